#!/usr/bin/env python3
"""How much the answers of each engine change when one of its options is halved and doubled: writes docs/options.md.

    ./faultline shell scripts/studies/option_sensitivity.py [--engines NAME...] [--jobs N]

Asks the program option_sensitivity (test/studies/), which simulates a fixed set of small recordings and answers for
every option. What was measured is kept in catkin_ws/option_sensitivity.json, so that a run that was interrupted goes on
where it was; answers of other sources (the unchanged options no longer give the same) are thrown away. The table is
written at the end, on interruption, and with --table alone; rows that were not measured say so. Builds the program
first; it runs at the lowest priority.
"""
import argparse
import json
import math
import os
import pathlib
import queue
import signal
import subprocess
import sys
import threading
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROGRAM = ROOT / "catkin_ws/devel/lib/faultline/test/option_sensitivity"
STATE = ROOT / "catkin_ws/option_sensitivity.json"
TABLE = ROOT / "docs/options.md"
ENGINES = {
    "signatures": ("Signature isolator", "src/faultline/isolation/signature_options.h"),
    "responses": ("Fault responses", "src/faultline/estimators/response_settings.h"),
    "fit": ("Parameter fit", "src/faultline/fit/fit_options.h"),
    "live_gap": ("Live gap", "src/faultline/gap/live_gap.h"),
    "gap": ("Gap", "src/faultline/gap/gap_options.h"),
}
FACTORS = {"halved": 0.5, "doubled": 2.0}
UNCHANGED = "unchanged"
LIMIT_S = 3600.0  # of one answer: a machine that others use too


class Asked:
    """One running option_sensitivity."""

    def __init__(self, engine):
        self.engine = engine
        self.start()

    def start(self):
        self.process = subprocess.Popen([str(PROGRAM), self.engine], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                        text=True, cwd=ROOT, preexec_fn=lambda: os.nice(19))
        line = self.process.stdout.readline()
        if not line:
            raise SystemExit(f"option_sensitivity {self.engine} ended with {self.process.wait()}")
        self.options = json.loads(line)

    def answer(self, option, factor):
        timer = threading.Timer(LIMIT_S, self.process.kill)
        timer.start()
        try:
            self.process.stdin.write(f"{option} {factor}\n")
            self.process.stdin.flush()
            line = self.process.stdout.readline()
        finally:
            timer.cancel()
        if line:
            return json.loads(line)
        self.process.wait()
        code = self.process.returncode
        self.start()
        return {"error": f"the program ended with {code}"}

    def stop(self):
        self.process.kill()
        self.process.wait()


def relative(before, now):
    """Largest relative change among the values that both have; a value that was 0 counts by its own size."""
    changes = []
    for name, value in before.items():
        if name not in now:
            continue
        a, b = value, now[name]
        if a is None or b is None:  # not a number, in JSON
            changes.append(0.0 if a == b else math.inf)
        elif a != b:
            changes.append(abs(b - a) / max(abs(a), abs(b) if a == 0 else 0.0))
        else:
            changes.append(0.0)
    return max(changes, default=0.0)


def compare(before, now):
    """What changed against the answers `before`, over all cases."""
    if "error" in now:
        return {"error": now["error"]}
    change = {"cases": len(now), "words": 0, "details": 0, "sizes": 0.0, "numbers": 0.0}
    for case, after in now.items():
        change["words"] += before[case]["words"] != after["words"]
        change["details"] += before[case]["details"] != after["details"]
        change["sizes"] = max(change["sizes"], relative(before[case]["sizes"], after["sizes"]))
        if before[case]["words"] == after["words"]:  # else they are numbers of another thing
            change["numbers"] = max(change["numbers"], relative(before[case]["numbers"], after["numbers"]))
    return change


def percent(value):
    if value == 0:
        return "0"
    if value < 0.001:
        return "< 0.1 %"
    if value < 0.1:
        return f"{100 * value:.2g} %"
    return f"{100 * value:.0f} %" if value < 1 else f"x {1 + value:.2g}" if math.isfinite(value) else "lost"


def cells(change):
    if change is None:
        return "not measured | | |"
    if "error" in change:
        text = change["error"].replace("|", "/")
        return f"refused: {text} | | |"
    return " | ".join([f'{change["words"]} of {change["cases"]}', percent(change["sizes"]), percent(change["numbers"]),
                       f'{change["details"]} of {change["cases"]}'])


def number(value):
    if isinstance(value, list):
        distinct = list(dict.fromkeys(f"{v:g}" for v in value))
        return ", ".join(distinct if len(distinct) < len(value) else [f"{v:g}" for v in value])
    return f"{value:g}"


def write_table(state):
    lines = [
        "# Options of the engines",
        "",
        "Made by `./faultline shell scripts/studies/option_sensitivity.py`; not written by hand.",
        "",
        "Every number on which an answer of an engine depends stands in one struct per engine, with its meaning, its",
        "unit and why it has its value: the headers named below. This table has how much the answers change when one",
        "is halved and when it is doubled (counts are rounded and at least 1), on few small simulated recordings",
        "(`test/studies/option_sensitivity.cpp`): it says which options matter, not which value is best.",
        "",
        "- **named**: in how many of the cases that reach it what was decided changes (verdict, effects, places)",
        "- **sizes**: largest relative change of a size among what both name",
        "- **numbers**: largest relative change of the other numbers where the decision is the same (shrink, widths of",
        "  intervals, probabilities, evidence, times)",
        "- **beside**: in how many of the cases what is told beside changes (rivals, regions, reasons, next runs)",
        "",
        "`x 3` is three times as much. `0` everywhere: these recordings do not reach the option.",
        "",
    ]
    measured = whole = 0
    for engine, (title, header) in ENGINES.items():
        known = state.get(engine)
        lines += [f"## {title}", "", f"[`{header}`](../{header})", ""]
        if not known or UNCHANGED not in known["answers"]:
            lines += ["Not measured.", ""]
            continue
        before = known["answers"][UNCHANGED]
        lines += [f"{len(before)} cases: {', '.join(before)}.", "",
                  "| option | value | halved: named | sizes | numbers | beside "
                  "| doubled: named | sizes | numbers | beside |",
                  "|---|---|---|---|---|---|---|---|---|---|"]
        for option, value in known["options"]:
            row = f"| `{option}` | {number(value)} "
            for word in FACTORS:
                answer = known["answers"].get(f"{option} {word}")
                measured += answer is not None
                whole += 1
                row += "| " + cells(compare(before, answer) if answer is not None else None) + " "
            lines.append(row + "|")
        lines.append("")
    lines.insert(4, f"Measured: {measured} of {whole} options halved or doubled; the others took too long so far.\n"
                 if measured < whole else f"Measured: all {whole} options halved or doubled.\n")
    TABLE.write_text("\n".join(lines))


def save(state):
    part = STATE.with_suffix(f".{os.getpid()}.part")
    part.write_text(json.dumps(state))
    part.replace(STATE)


def study(state, engines, jobs):
    tasks, guard, stop = queue.Queue(), threading.Lock(), threading.Event()
    for engine in engines:
        asked = Asked(engine)
        try:
            print(f"{engine}: unchanged ...", flush=True)
            begin = time.monotonic()
            base = asked.answer(asked.options[0][0], 1)
        finally:
            asked.stop()
        seconds = time.monotonic() - begin
        known = state.get(engine, {})
        if known.get("options") != asked.options or known.get("answers", {}).get(UNCHANGED) != base:
            known = {"options": asked.options, "answers": {UNCHANGED: base}}
            state[engine] = known
            save(state)
        wanted = [(option, word) for option, _ in asked.options for word in FACTORS
                  if f"{option} {word}" not in known["answers"]]
        print(f"{engine}: {len(wanted)} of {2 * len(asked.options)} to do, about {seconds:.0f} s each", flush=True)
        for option, word in wanted:
            tasks.put((engine, option, word))
    total, done = tasks.qsize(), 0

    def work():
        nonlocal done
        asked = None
        try:
            while not stop.is_set():
                try:
                    engine, option, word = tasks.get_nowait()
                except queue.Empty:
                    return
                if asked is None or asked.engine != engine:
                    if asked:
                        asked.stop()
                    asked = Asked(engine)
                running.append(asked)
                answer = asked.answer(option, FACTORS[word])
                if stop.is_set():
                    return
                with guard:
                    done += 1
                    state[engine]["answers"][f"{option} {word}"] = answer
                    save(state)
                    change = compare(state[engine]["answers"][UNCHANGED], answer)
                    print(f"{done}/{total} {engine} {option} {word}: {change}", flush=True)
        finally:
            if asked:
                asked.stop()

    running = []
    workers = [threading.Thread(target=work) for _ in range(jobs)]
    for worker in workers:
        worker.start()
    try:
        for worker in workers:
            while worker.is_alive():
                worker.join(0.5)
    except KeyboardInterrupt:
        for name in (signal.SIGINT, signal.SIGTERM):  # once is enough
            signal.signal(name, signal.SIG_IGN)
        stop.set()
        for asked in running:
            if asked.process.poll() is None:
                asked.process.kill()
        for worker in workers:
            worker.join()
        return False
    return True


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--engines", nargs="+", choices=list(ENGINES), default=list(ENGINES))
    parser.add_argument("--jobs", type=int, default=1, help="programs that run at once")
    parser.add_argument("--table", action="store_true", help="only write the table from what was measured")
    arguments = parser.parse_args()
    for name in (signal.SIGINT, signal.SIGTERM):  # a shell's background jobs ignore the first unless told otherwise
        signal.signal(name, signal.default_int_handler)
    state = json.loads(STATE.read_text()) if STATE.exists() else {}
    complete = True
    if not arguments.table:
        build = ROOT / "catkin_ws/build"
        if (build / "build.ninja").exists():
            subprocess.run(["cmake", "--build", str(build), "--target", "option_sensitivity"], check=True)
        if not PROGRAM.exists():
            sys.exit(f"option_sensitivity: {PROGRAM.relative_to(ROOT)} is missing; run ./faultline build first")
        try:
            complete = study(state, arguments.engines, max(1, arguments.jobs))
        except KeyboardInterrupt:  # before anything was measured
            complete = False
    write_table(state)
    print(f"wrote {TABLE.relative_to(ROOT)}")
    return 0 if complete else 130


if __name__ == "__main__":
    sys.exit(main())
