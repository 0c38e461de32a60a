#!/usr/bin/python3
"""Causes that begin during a run, and whether `faultline gap` names and dates them.

    scripts/studies/gap_since.py [--rigs RIG ...] [--runs 12] [--first 1001] [--together 1] [--always] [--list]

Rig, profile, effect and size are drawn as by random_faults.py, the onset between 30 and 70 % of one run; `stuck`, which
has a time of its own, is drawn again. With --together N it begins in each of N runs of that rig, at times of their own.
With --always the effect is there from the beginning, and every date is false.
What is done stays in FOLDER: stopped, it goes on where it was.

dated: named (or in its equivalence set) and dated to two segments, in each run. undated: named without a date.
misdated: named with another date. other: something else is named, whatever its date. unknown; none: no cause, or
parameters only."""

import argparse
import collections
import json
import pathlib
import random
import tempfile

from random_faults import draw
from rig_runs import ROOT, Results, datasheet, faultline, on_all_cores, record

SECONDS = {"control_valve": 60, "cooling_circuit": 20, "hydraulic_drive": 60, "pump_cylinder": 24, "servo_actuator": 20}
GRADES = ("dated", "undated", "misdated", "other", "unknown", "none")


def draw_one(ports, profiles, seed):
    """(profile, effect@port, as simulate takes it without its onset)"""
    for again in range(1000):
        profile, _, _, name, effect, _ = draw(ports, profiles, seed + 100000 * again)
        if not name.startswith("stuck@"):
            return profile, name, effect.rsplit(",from=", 1)[0]
    raise SystemExit("this rig has no effect that can begin")


def run(rig, ports, profiles, seed, together, always):
    profile, name, effect = draw_one(ports, profiles, seed)
    moment = random.Random(f"onset {seed}")
    onsets = [round(moment.uniform(0.3, 0.7) * SECONDS[rig], 2) for _ in range(together)]
    with tempfile.TemporaryDirectory() as folder:
        bags = []
        for k, onset in enumerate(onsets):
            more = ["--profile", profile, "--duration", SECONDS[rig], "--off-nominal", "--nuisance"]
            more += ["--rig-seed", seed, "--seed", seed + 50000 * k]
            given = effect if always else f"{effect},from={onset}"
            bags.append(record(rig, pathlib.Path(folder) / f"run_{k}.bag", *more, "--effect", given))
        cause = json.loads(faultline("gap", *bags, "--json", "-"))["cause"]
    entry = {"effect": effect, "onsets": onsets, "verdict": cause["verdict"], "since": cause.get("since")}
    entry["sentence"] = cause["sentence"]
    entry["named"] = [f"{e['effect']}@{e['port']}" for e in cause["effects"]]
    entry["equivalent"] = [f"{e['effect']}@{e['port']}" for e in cause["equivalent"]]
    return {**entry, "grade": grade(name, onsets, entry)}


def grade(name, onsets, entry):
    if entry["verdict"] != "named":
        return "unknown" if entry["verdict"] == "unknown" else "none"
    if name not in entry["named"] + entry["equivalent"]:
        return "other"
    since = entry["since"]
    if since is None:
        return "undated"
    moments = {int(m["run"].split("_")[-1].split(".")[0]): m["time"] for m in since["moments"]}
    near = [k in moments and abs(moments[k] - onset) <= 2 * since["within"] for k, onset in enumerate(onsets)]
    return "dated" if all(near) else "misdated"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rigs", nargs="+", default=sorted(SECONDS))
    parser.add_argument("--runs", type=int, default=12, help="of each rig")
    parser.add_argument("--first", type=int, default=1001, help="the first seed")
    parser.add_argument("--work", default=str(ROOT / "catkin_ws/gap_since"))
    parser.add_argument("--together", type=int, default=1, help="runs in one question")
    parser.add_argument("--always", action="store_true", help="from the beginning")
    parser.add_argument("--list", action="store_true", help="every run, too")
    options = parser.parse_args()
    print("| rig | runs | " + " | ".join(GRADES) + " | dates |\n|" + "---|" * (len(GRADES) + 3))
    listed = []
    for rig in options.rigs:
        ports = json.loads(faultline("rigs", rig, "--json", "-"))["rigs"][0]["ports"]
        profiles = datasheet(rig)["profiles"]
        name = f"{rig}_{options.together}{'_always' if options.always else ''}.jsonl"
        results = Results(pathlib.Path(options.work) / name)

        def once(seed):
            return results.once(str(seed), lambda: run(rig, ports, profiles, seed, options.together, options.always))

        seeds = range(options.first, options.first + options.runs)
        entries = list(on_all_cores(once, [(seed,) for seed in seeds]))
        grades = collections.Counter(entry["grade"] for entry in entries)
        dates = sum(entry["since"] is not None for entry in entries)
        told = " | ".join(str(grades[g]) for g in GRADES)
        print(f"| `{rig}` | {len(entries)} | {told} | {dates} |", flush=True)
        listed += [(rig, seed, entry) for seed, entry in zip(seeds, entries)]
    if options.list:
        for rig, seed, entry in listed:
            print(f"- {rig} {seed}: {entry['effect']}: {entry['grade']}: {entry['sentence']}")


if __name__ == "__main__":
    main()
