#!/usr/bin/python3
"""The withheld check in one command: make cases, diagnose them, score.

    run.py OUT --cases 40                      all parts, development seed
    run.py OUT --cases 200 --set test          the table in docs/
    run.py OUT --rig hydraulic_drive           another rig (the baselines know the servo actuator alone)
    run.py OUT --truth random --cases 40       truths drawn from classes (truth_classes.py)
    run.py OUT --truth random --cases 40 --case 7    one case of them, for Slurm or GNU parallel; then score.py OUT
    run.py OUT --part closed --cases 5 --no-faultline    baselines only
Stops cleanly on Ctrl-C and goes on where it stopped when the same command is given again.
"""
import argparse
import os
import subprocess
import sys
import time
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait

import baselines
import generate
import groups
import score
from datasheet import ROOT, Datasheet


def write_seconds(folder, name, seconds):
    with open(os.path.join(folder, name + ".seconds"), "w", encoding="ascii") as stream:
        stream.write(f"{seconds:.3f}\n")


class Diagnosis:
    """Runs the program on one case after the other, several at once; knows its processes so that it can end them."""

    def __init__(self, program, out, rig, threads):
        self.program, self.out, self.rig, self.threads = program, out, rig, threads
        self.processes = set()
        self.stopped = False

    def one(self, entry, method, extra):
        target = os.path.join(self.out, "answers", method, entry["case"] + ".json")
        command = [self.program, "gap"] + [os.path.join(self.out, r) for r in entry["runs"]] + extra
        for key in entry["without"]:
            command += ["--without", key]
        command += ["--rig", self.rig, "--jobs", str(self.threads), "--json", target + ".part"]
        if self.stopped:
            return entry["case"], None, "stopped"
        began = time.perf_counter()
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        self.processes.add(process)
        _, error = process.communicate()
        self.processes.discard(process)
        spent = time.perf_counter() - began
        if process.returncode != 0:
            return entry["case"], None, (error.strip().splitlines() or [f"exit {process.returncode}"])[-1]
        os.replace(target + ".part", target)
        return entry["case"], spent, ""

    def stop(self):
        self.stopped = True
        for process in list(self.processes):
            process.terminate()


def run_program(program, out, rig, manifest, method, jobs, threads, with_third):
    """Answers of the program for all cases that have none yet; returns the messages of those that failed."""
    folder = os.path.join(out, "answers", method)
    os.makedirs(folder, exist_ok=True)
    todo = [e for e in manifest if not os.path.exists(os.path.join(folder, e["case"] + ".json"))]
    work = Diagnosis(program, out, rig, threads)
    began, done, failed = time.perf_counter(), 0, []
    generate.bar(0, len(todo), began, f"{method:8s}")
    pool = ThreadPoolExecutor(jobs)
    waiting = set()
    try:
        for entry in todo:
            extra = ["--holdout", os.path.join(out, entry["third"])] if with_third else []
            waiting.add(pool.submit(work.one, entry, method, extra))
        while waiting:
            ready, waiting = wait(waiting, return_when=FIRST_COMPLETED)
            for future in ready:
                name, spent, error = future.result()
                done += 1
                if spent is None:
                    failed.append(f"{name}: {error}")
                else:
                    write_seconds(folder, name, spent)
                generate.bar(done, len(todo), began, f"{method:8s}")
    except BaseException:
        work.stop()
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
    return failed


def _baseline(task):
    out, entry = task
    sheet = Datasheet(baselines.RIG)
    began = time.perf_counter()
    found = baselines.answers([os.path.join(out, r) for r in entry["runs"]], sheet, entry["without"])
    return entry["case"], found, time.perf_counter() - began


def run_baselines(out, manifest, jobs):
    folders = {m: os.path.join(out, "answers", m) for m in baselines.METHODS}
    for folder in folders.values():
        os.makedirs(folder, exist_ok=True)
    last = folders[baselines.METHODS[-1]]
    todo = [(out, e) for e in manifest if not os.path.exists(os.path.join(last, e["case"] + ".json"))]
    began, done = time.perf_counter(), 0
    generate.bar(0, len(todo), began, "baseline")
    pool = generate.multiprocessing.Pool(jobs, generate.quiet_worker)
    try:
        for name, found, spent in pool.imap_unordered(_baseline, todo):
            for method, data in found.items():
                baselines.write(os.path.join(folders[method], name + ".json"), data)
                write_seconds(folders[method], name, spent)  # the four share one regression, and its time
            done += 1
            generate.bar(done, len(todo), began, "baseline")
        pool.close()
    except BaseException:
        pool.terminate()
        raise
    finally:
        pool.join()


def main():
    reader = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    generate.add_arguments(reader)
    reader.add_argument("--program", default=os.path.join(ROOT, "faultline"), help="what to run as `PROGRAM gap ...`")
    reader.add_argument(
        "--at-once", type=int, default=1, help="cases diagnosed at once; the cores are shared among them"
    )
    reader.add_argument(
        "--counted",
        action="store_true",
        help="ask only of cases that lines about verdicts count (identifiable, severity above 2; all without effect)",
    )
    reader.add_argument("--no-faultline", action="store_true", help="baselines only")
    reader.add_argument("--no-baselines", action="store_true", help="faultline only")
    reader.add_argument("--table", help="write the table here (default OUT/table.md)")
    given = reader.parse_args()
    if given.cases < 1 or given.jobs < 1 or given.at_once < 1:
        sys.exit("--cases, --jobs and --at-once must be at least 1")
    if not given.no_faultline and not os.access(given.program, os.X_OK):
        sys.exit(f"{given.program}: cannot be run; build first, or give --program or --no-faultline")
    seed = generate.seed_of(given)
    manifest = generate.from_arguments(given)
    if given.counted:
        label = lambda entry: generate.read(os.path.join(given.out, "sealed", entry["case"] + ".json"))
        manifest = [entry for entry in manifest if groups.counted(label(entry))]
    failed = []
    if not given.no_faultline:
        threads = max(1, given.jobs // given.at_once)
        failed = run_program(given.program, given.out, given.rig, manifest, "faultline", given.at_once, threads, False)
        if given.third:
            failed += run_program(given.program, given.out, given.rig, manifest, "third", given.at_once, threads, True)
    if not given.no_baselines and given.rig == baselines.RIG and given.truth == "plain":
        run_baselines(given.out, manifest, given.jobs)
    for line in failed:
        print(line, file=sys.stderr)
    if given.case is not None:  # one of many processes: the table is score.py's, once all are done
        return 1 if failed else 0
    command = (
        "test/withheld/run.py OUT"
        + (f" --rig {given.rig}" if given.rig != generate.RIGS[0] else "")
        + f" --cases {given.cases}"
        + "".join(f" --part {p}" for p in given.part or [])
        + (f" --set {given.set}" if given.seed is None else f" --seed {given.seed}")
        + (" --exact-inputs" if given.exact_inputs else "")
        + (" --partly-measured" if given.partly_measured else "")
        + (" --third" if given.third else "")
        + (f" --first {given.first}" if given.first else "")
        + (" --counted" if given.counted else "")
        + (" --truth random" if given.truth == "random" else "")
        + (f" --classes {','.join(given.classes) or 'none'}" if given.classes is not None else "")
        + (f" --without-classes {','.join(given.without_classes)}" if given.without_classes else "")
        + "".join(f" --{n} {v:g}" for n in ("runs", "length", "noise") for v in [getattr(given, n)] if v)
    )
    table = score.score([given.out], f"Made by `{command}` (seed {seed}).", given.counted or given.first is not None)
    with open(given.table or os.path.join(given.out, "table.md"), "w", encoding="utf-8") as stream:
        stream.write(table)
    print(table)
    return 1 if failed else 0


if __name__ == "__main__":
    generate.end_on_signals()
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit("\nstopped; give the same command again to go on")
