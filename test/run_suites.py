#!/usr/bin/python3
"""Runs every test suite and counts tests: `./faultline test` ends here.

A suite is one gtest program, one fuzz corpus, one python file test/**/test_*.py or one rostest. The first three kinds
run side by side, rostests one by one, each suite with a ROS master port, ROS_HOME and log folder of its own, on
127.0.0.1. The last line is "N passed, N failed"; the exit code is 1 if anything failed. A skipped test, an empty suite,
a crash and a suite that runs too long each count as failed. What a suite says is in BUILD/suite_results/<suite>.log.
"""

import argparse
import concurrent.futures
import json
import os
import pathlib
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import unittest
import xml.etree.ElementTree as ElementTree

ROOT = pathlib.Path(__file__).resolve().parent.parent
TIME_LIMIT = 2700  # s, per suite; house_build_ways compiles all once more, on one core, where ccache knows nothing
# Suites that take minutes start first, so that the others fill the second core beside them.
SLOW_FIRST = ("build_ways", "withheld", "gap", "demo", "cli")


class Suite:
    def __init__(self, kind, name, path, extra=()):
        self.kind, self.name, self.path, self.extra = kind, name, path, list(extra)
        self.passed, self.failed, self.seconds, self.notes = 0, 0, 0.0, []


def find_suites(build):
    suites = []
    for line in (build / "suites.txt").read_text().splitlines():
        kind, name, *paths = line.split()
        suites.append(Suite(kind, name, paths[0], paths[1:]))
    for path in sorted((ROOT / "test").rglob("test_*.py")):
        folder = path.relative_to(ROOT / "test").parent
        name = "_".join([*folder.parts, path.stem[len("test_") :]])
        suites.append(Suite("python", name, str(path)))
    return suites


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def environment(suite, scratch, build):
    chosen = dict(os.environ)
    chosen.update(
        {
            "FAULTLINE_SUITE": f"{os.getpid()}:{suite.name}",  # also marks every process that the suite starts
            "FAULTLINE_BUILD": str(build),
            "LCM_DEFAULT_URL": "memq://",
            "LC_ALL": "C.UTF-8",
            "MPLBACKEND": "Agg",
            "MPLCONFIGDIR": str(scratch),
            "PYTHONDONTWRITEBYTECODE": "1",
            "ROS_HOME": str(scratch),
            "ROS_LOG_DIR": str(scratch / "log"),
            "ROS_TEST_RESULTS_DIR": str(scratch / "results"),
            "ROS_IP": "127.0.0.1",
            "ROS_MASTER_URI": f"http://127.0.0.1:{free_port()}",
            "UBSAN_OPTIONS": "print_stacktrace=1",
        }
    )
    chosen.pop("ROS_HOSTNAME", None)
    return chosen


def command(suite, result):
    python = sys.executable
    return {
        "gtest": [suite.path, f"--gtest_output=xml:{result}"],
        "corpus": [suite.path, *suite.extra],
        "python": [python, __file__, "--run-python", suite.path, "--result", str(result)],
        "rostest": ["rostest", suite.path],
    }[suite.kind]


def marked_processes(suite):
    """Processes that the suite left: they carry its mark in their environment."""
    mark = f"FAULTLINE_SUITE={os.getpid()}:{suite.name}".encode()
    found = []
    for entry in pathlib.Path("/proc").iterdir():
        if entry.name.isdigit() and int(entry.name) != os.getpid():
            try:
                if mark in (entry / "environ").read_bytes().split(b"\0"):
                    found.append(int(entry.name))
            except OSError:
                pass
    return found


def send(pids, number):
    for pid in pids:
        try:
            os.kill(pid, number)
        except OSError:
            pass


def gone(suite, patience):
    limit = time.monotonic() + patience
    while time.monotonic() < limit:
        if not marked_processes(suite):
            return True
        time.sleep(0.1)
    return not marked_processes(suite)


def end_processes(suite, grace=0.0):
    """Waits, asks twice, insists. Returns how many had to be asked."""
    if gone(suite, grace):
        return 0
    first = marked_processes(suite)
    for number, patience in ((signal.SIGINT, 6.0), (signal.SIGTERM, 3.0), (signal.SIGKILL, 3.0)):
        send(marked_processes(suite), number)
        if gone(suite, patience):
            break
    return len(first)


def read_junit(suite, tree):
    for case in tree.iter("testcase"):
        bad = [child for child in case if child.tag in ("failure", "error", "skipped")]
        if bad or case.get("status") == "notrun" or case.get("result") == "skipped":
            suite.failed += 1
            text = (bad[0].get("message") or bad[0].text or bad[0].tag) if bad else "not run"
            first = text.strip().splitlines()[0] if text.strip() else "failed"
            suite.notes.append(f"{case.get('classname', '')}.{case.get('name', '')}: {first}")
        else:
            suite.passed += 1


def count(suite, result, scratch, log, code):
    """Reads what the suite reported. Each way of not reporting is a failure."""
    try:
        if suite.kind == "corpus":
            suite.passed, suite.failed = (1, 0) if code == 0 else (0, 1)
        elif suite.kind == "python":
            answer = json.loads(result.read_text())
            suite.passed, suite.failed, suite.notes = answer["passed"], answer["failed"], answer["notes"]
        elif suite.kind == "gtest":
            read_junit(suite, ElementTree.parse(result))
        else:
            # Each test node writes rosunit-*.xml, which counts; rostest-*.xml says in addition which nodes wrote
            # nothing.
            for file in (scratch / "results").rglob("rosunit-*.xml"):
                read_junit(suite, ElementTree.parse(file))
            nodes = Suite("rostest", suite.name, suite.path)
            for file in (scratch / "results").rglob("rostest-*.xml"):
                read_junit(nodes, ElementTree.parse(file))
            suite.failed += nodes.failed
            suite.notes += nodes.notes
    except (OSError, ValueError, KeyError, ElementTree.ParseError):
        said = log.read_text(errors="replace")
        suite.passed = len(re.findall(r"^\[       OK \]", said, re.M))
        suite.failed = len(re.findall(r"^\[  FAILED  \] \S+ \(\d+ ms\)", said, re.M)) + 1
        suite.notes.append(f"ended with {code} and without a result")
        return
    if suite.passed + suite.failed == 0:
        suite.failed = 1
        suite.notes.append("ran no test")
    elif code != 0 and suite.failed == 0:
        suite.failed = 1
        suite.notes.append(f"ended with {code} though no test failed")


class Runner:
    def __init__(self, build):
        self.build = build
        self.results = build / "suite_results"
        self.results.mkdir(exist_ok=True)
        self.lock = threading.Lock()
        self.running = {}
        self.stopped = False
        self.done = 0
        self.total = 0

    def run(self, suite):
        if self.stopped:
            return
        start = time.monotonic()
        scratch = pathlib.Path(tempfile.mkdtemp(prefix="faultline_test_"))
        log = self.results / f"{suite.name}.log"
        result = self.results / f"{suite.name}.xml"
        result.unlink(missing_ok=True)
        try:
            with open(log, "w") as output:
                process = subprocess.Popen(
                    command(suite, result),
                    cwd=ROOT,
                    env=environment(suite, scratch, self.build),
                    stdin=subprocess.DEVNULL,
                    stdout=output,
                    stderr=subprocess.STDOUT,
                    start_new_session=True,
                )
                with self.lock:
                    self.running[suite.name] = suite
                try:
                    code = process.wait(TIME_LIMIT)
                except subprocess.TimeoutExpired:
                    suite.notes.append(f"stopped after {TIME_LIMIT} s")
                    end_processes(suite)
                    code = process.wait()
            count(suite, result, scratch, log, code)
        except OSError as problem:
            suite.failed += 1
            suite.notes.append(f"did not start: {problem}")
        finally:
            left = end_processes(suite, grace=2.0)
            if left and not self.stopped:
                suite.failed += 1
                suite.notes.append(f"left {left} processes running; they were ended")
            shutil.rmtree(scratch, ignore_errors=True)
        suite.seconds = time.monotonic() - start
        with self.lock:
            self.running.pop(suite.name, None)
            self.done += 1
            if not self.stopped:
                self.report(suite, log)

    def report(self, suite, log):
        outcome = f"{suite.passed:4d} passed" + (f", {suite.failed} FAILED" if suite.failed else "")
        print(f"[{self.done:3d}/{self.total}] {suite.name:36s} {outcome:24s} {suite.seconds:7.1f} s", flush=True)
        if suite.failed:
            for note in suite.notes[:20]:
                print(f"          {note}")
            print(f"          all it said: {os.path.relpath(log, ROOT)}")
            if os.environ.get("CI"):  # nobody can open the log afterwards
                print("\n".join("          | " + line for line in log.read_text(errors="replace").splitlines()[-60:]))
            sys.stdout.flush()

    def stop(self):
        self.stopped = True
        with self.lock:
            running = list(self.running.values())
        for suite in running:
            end_processes(suite)

    def run_all(self, suites, jobs):
        self.total = len(suites)
        alone = [suite for suite in suites if suite.kind == "rostest"]
        beside = [suite for suite in suites if suite.kind != "rostest"]
        beside.sort(key=lambda suite: next((i for i, word in enumerate(SLOW_FIRST) if word in suite.name), 99))
        for group, workers in ((beside, jobs), (alone, 1)):
            with concurrent.futures.ThreadPoolExecutor(workers) as pool:
                futures = [pool.submit(self.run, suite) for suite in group]
                try:
                    for future in futures:
                        future.result()
                except KeyboardInterrupt:
                    for future in futures:
                        future.cancel()
                    self.stop()
                    raise


class Counter(unittest.TextTestResult):
    def __init__(self, *arguments, **options):
        super().__init__(*arguments, **options)
        self.succeeded = 0

    def addSuccess(self, test):
        super().addSuccess(test)
        self.succeeded += 1


def run_python(path, result):
    """In the child: runs the unittests of one file and writes their count."""
    path = pathlib.Path(path)
    sys.path[0] = str(path.parent)
    found = unittest.TestLoader().discover(str(path.parent), pattern=path.name, top_level_dir=str(path.parent))
    outcome = unittest.TextTestRunner(stream=sys.stdout, verbosity=2, resultclass=Counter).run(found)
    bad = (
        outcome.failures
        + outcome.errors
        + outcome.skipped
        + [(test, "succeeded") for test in outcome.unexpectedSuccesses]
    )
    notes = [f"{test.id()}: {(text.strip().splitlines() or ['failed'])[-1]}" for test, text in bad]
    answer = {"passed": outcome.succeeded, "failed": len(bad), "notes": notes}
    pathlib.Path(result).write_text(json.dumps(answer))
    return 1 if bad else 0


def interrupted(number, frame):
    raise KeyboardInterrupt


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help="a suite's name, or the first part of it")
    parser.add_argument("--build", type=pathlib.Path, default=ROOT / "catkin_ws/build", help="build folder")
    parser.add_argument("--kinds", default="gtest,corpus,python,rostest")
    parser.add_argument("--jobs", type=int, default=int(os.environ.get("FAULTLINE_JOBS", 0)) or os.cpu_count() or 1)
    parser.add_argument("--list", action="store_true", help="name the suites and stop")
    parser.add_argument("--run-python", help=argparse.SUPPRESS)
    parser.add_argument("--result", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.run_python:
        return run_python(options.run_python, options.result)

    suites = [suite for suite in find_suites(options.build.resolve()) if suite.kind in options.kinds.split(",")]
    if options.names:
        known = {suite.name for suite in suites}
        for name in options.names:
            if not any(other.startswith(name) for other in known):
                print(f"{name}: no such suite; ./faultline test --list names them", file=sys.stderr)
                return 2
        # An exact name means that suite alone; else every suite that starts so.
        suites = [
            suite
            for suite in suites
            if any(suite.name == name or (name not in known and suite.name.startswith(name)) for name in options.names)
        ]
    if options.list:
        for suite in suites:
            print(f"{suite.kind:8s} {suite.name}")
        return 0

    signal.signal(signal.SIGTERM, interrupted)
    signal.signal(signal.SIGHUP, interrupted)
    runner = Runner(options.build.resolve())
    start, broken_off = time.monotonic(), False
    print(f"{len(suites)} suites, {max(1, options.jobs)} at a time", flush=True)
    try:
        runner.run_all(suites, max(1, options.jobs))
    except KeyboardInterrupt:
        broken_off = True
        print("stopped; nothing is left running", flush=True)
    failing = [suite.name for suite in suites if suite.failed]
    print(
        f"{runner.done} of {len(suites)} suites in {time.monotonic() - start:.0f} s"
        + (f"; failing: {' '.join(failing)}" if failing else "")
    )
    failed = sum(suite.failed for suite in suites)
    print(f"{sum(suite.passed for suite in suites)} passed, {failed} failed", flush=True)
    return 130 if broken_off else 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
