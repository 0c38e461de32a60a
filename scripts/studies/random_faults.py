#!/usr/bin/python3
"""Faults drawn at random over all rigs, and what `faultline diagnose` makes of them.

    scripts/studies/random_faults.py [--rigs RIG ...] [--faults 20] [--first 1001] [--work FOLDER] [--print] [--list]
        [--oracle] [--from-start | --lost S] [--noise FACTOR]

A seed fixes rig parameters (off nominal, with the small effects of every recording), the profile, the effect (any that
the datasheet lists at any of its ports), its size (over the datasheet's whole range, evenly in the logarithm where that
is wide) and when it comes, at once, between 30 and 60 % of the run. Seeds below 1000 are for tuning, those from 1001 on
for reporting. --from-start: the fault is there from the first sample. --lost: so many seconds of samples are lost, from
1 s after the fault came. --noise: the noise of each transducer is 1/FACTOR to FACTOR times its datasheet's. What is
done stays in FOLDER: stopped, it goes on where it was.

right: the alarm to read first has the effect and its port. alike: it says that it cannot tell another from that. place:
another effect at that port. wrong: another port. unnamed: it names none. missed: no alarm. before: there was an alarm
before the fault, whatever came then.

--oracle tells which of the faults cannot be seen in their run, whatever one knows: the run is simulated again without
the fault, with the same noise and set points, and what is different is taken over each channel's noise (of a command,
that is recorded as it is: over a thousandth of its range). A difference whose root of the sum of squares over all
channels and samples is below SEEN could not be told from noise by one who knew rig, parameters and fault exactly. With
it, `missed` is split: `hidden` are those that cannot be seen."""

import argparse
import collections
import json
import math
import pathlib
import random
import tempfile

import numpy as np
from rig_runs import (
    RIGS,
    ROOT,
    Results,
    datasheet,
    diagnose,
    faultline,
    named_alarms,
    on_all_cores,
    other_noise,
    record,
    simulate,
)

GRADES = ("right", "alike", "place", "wrong", "unnamed", "missed", "before")
RUN = 90  # s, at most; a table in time has its own length
WIDE = 5  # of a range's ends
SEEN = 5  # sigma


def drawn_size(parameter, generator):
    low, high = float(parameter["minimum"]), float(parameter["maximum"])
    if parameter["none"] is None:  # a shape
        return math.sqrt(low * high) if low > 0 and high > WIDE * low else 0.5 * (low + high)
    none = float(parameter["none"])
    if low < none < high:
        end = generator.choice((low, high))
        return none + (end - none) * generator.uniform(0.1, 1)
    if low > 0 and high > WIDE * low:
        return low * (high / low if math.isfinite(high) else 10) ** generator.uniform(0, 1)
    return generator.uniform(low, high)


def share_of_range(parameter, size):
    """How much of the way from no effect to the datasheet's limit; None for a shape."""
    if parameter["none"] is None:
        return None
    none = float(parameter["none"])
    end = float(parameter["maximum"] if size > none else parameter["minimum"])
    return (size - none) / (end - none) if math.isfinite(end) and math.isfinite(none) else None


def draw(ports, profiles, seed, from_start=False):
    """(profile, seconds, onset, effect@port, as simulate takes it, size as a share of its range or None)"""
    generator = random.Random(seed)
    profile = generator.choice(profiles)
    seconds = profile["duration"] if profile.get("shape") == "table" else min(profile["duration"], RUN)
    onset = round(generator.uniform(0.3, 0.6) * seconds, 1)
    if from_start:
        onset = 0
    port = generator.choice([p for p in ports if p["effects"]])
    effect = generator.choice(port["effects"])
    name = f"{effect['effect']}@{port['name']}"
    if effect["effect"] == "stuck":
        return profile["name"], seconds, onset, name, f"{name}:from={onset}", None
    sizes = {p["name"]: drawn_size(p, generator) for p in effect["parameters"]}
    words = ",".join(f"{key}={value:.4g}" for key, value in sizes.items())
    shares = [share_of_range(p, sizes[p["name"]]) for p in effect["parameters"]]
    share = next((s for s in shares if s is not None), None)
    return profile["name"], seconds, onset, name, f"{name}:{words},from={onset}", share


def without(table, begin, end):
    """The lines of a recording (CSV) without those of its samples from `begin` to `end`, s."""
    names, *rows = table.splitlines(keepends=True)
    return names + "".join(row for row in rows if not begin <= float(row.split(",", 1)[0]) < end)


def run(rig, ports, profiles, seed, from_start=False, lost=0, noise=1):
    profile, seconds, onset, name, effect, share = draw(ports, profiles, seed, from_start)
    with tempfile.TemporaryDirectory() as folder:
        more = ["--profile", profile, "--duration", seconds, "--off-nominal", "--nuisance", "--seed", seed]
        more += ["--effect", effect, *other_noise(rig, seed, noise, folder)]
        file = record(rig, pathlib.Path(folder) / ("run.csv" if lost else "run.bag"), *more)
        if lost:
            file.write_text(without(file.read_text(), onset + 1, onset + 1 + lost))
        report = diagnose(file, *(["--rig", rig] if lost else []))
    entry = {"profile": profile, "onset": onset, "effect": effect, "share": share, **named_alarms(report)}
    return {**entry, "grade": grade(name, onset, entry)}


def oracle(described, profiles, seed):
    """The fault's difference in sigma, and the channel that shows the most of it."""
    rig = described["rig"]
    profile, seconds, _, _, effect, _ = draw(described["ports"], profiles, seed)
    with tempfile.TemporaryDirectory() as folder:
        more = ["--profile", profile, "--duration", seconds, "--off-nominal", "--nuisance", "--seed", seed]
        well = simulate(rig, folder, *more, name="well")
        ill = simulate(rig, folder, *more, "--effect", effect, name="ill")
    shown = {}
    for channel in described["channels"]:
        if channel["role"] not in ("output", "input", "command"):
            continue
        scale = math.hypot(channel["noise_std"], channel["resolution"] / math.sqrt(12))
        if channel["role"] == "command" or scale == 0:
            scale = max(scale, 1e-3 * (channel["maximum"] - channel["minimum"]))
        rows = min(len(well[channel["name"]]), len(ill[channel["name"]]))
        step = (ill[channel["name"]][:rows] - well[channel["name"]][:rows]) / scale
        shown[channel["name"]] = float(np.sqrt(np.nansum(step**2)))
    most = max(shown, key=shown.get)
    return {"effect": effect, "sigma": math.sqrt(sum(s * s for s in shown.values())), "channel": most}


def grade(name, onset, entry):
    alarms = [a for a in entry["alarms"] if not a["text"].startswith("no sample for more than")]
    if any(a["raised"] < onset for a in alarms):
        return "before"
    if not alarms:
        return "missed"
    sentence = entry["sentence"].lower()
    first = next((a for a in alarms if sentence.startswith(a["text"].lower().rstrip("."))), alarms[0])
    told = f"{first['effect']}@{first['port']}"
    if told == name:
        return "right"
    if name in first["equivalent"] and first["effect"]:
        return "alike"
    port = name.split("@")[1]
    if first["port"] == port:
        return "place"
    return "wrong" if first["effect"] else "unnamed"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rigs", nargs="+", default=RIGS)
    parser.add_argument("--faults", type=int, default=20, help="of each rig")
    parser.add_argument("--first", type=int, default=1001, help="the first seed")
    parser.add_argument("--work", default=str(ROOT / "catkin_ws/reliability/random_faults"))
    parser.add_argument("--print", action="store_true", help="run nothing")
    parser.add_argument("--list", action="store_true", help="every fault, too")
    parser.add_argument("--oracle", action="store_true", help="which faults cannot be seen at all")
    parser.add_argument("--from-start", action="store_true", help="the fault is there from the first sample")
    parser.add_argument("--lost", type=float, default=0, help="s of samples that are lost after the fault came")
    parser.add_argument("--noise", type=float, default=1, help="times the datasheet's, up or down")
    options = parser.parse_args()
    grades_told = (*GRADES, "hidden") if options.oracle else GRADES
    print("| rig | faults | " + " | ".join(grades_told) + " |\n|" + "---|" * (len(grades_told) + 2))
    listed, total = [], collections.Counter()
    for rig in options.rigs:
        described = json.loads(faultline("rigs", rig, "--json", "-"))["rigs"][0]
        profiles = datasheet(rig)["profiles"]
        results = Results(pathlib.Path(options.work) / f"{rig}.jsonl")
        grades = collections.Counter()
        seeds = range(options.first, options.first + options.faults)
        if options.print:
            seeds = [seed for seed in seeds if str(seed) in results.all]

        def once(seed):
            more = options.from_start, options.lost, options.noise
            return results.once(str(seed), lambda: run(rig, described["ports"], profiles, seed, *more))

        known = Results(pathlib.Path(options.work) / f"{rig}_oracle.jsonl") if options.oracle else None

        def judged(seed):
            entry = once(seed)
            if not known or entry["grade"] != "missed":
                return entry, None
            return entry, known.once(str(seed), lambda: oracle(described, profiles, seed))

        for seed, (entry, seen) in zip(seeds, on_all_cores(judged, [(seed,) for seed in seeds])):
            if seen:
                entry = {**entry, "grade": "missed" if seen["sigma"] >= SEEN else "hidden"}
                entry["sentence"] += f" ({seen['sigma']:.3g} sigma, most in {seen['channel']})"
            grades[entry["grade"]] += 1
            listed.append((rig, seed, entry))
        total += grades
        told = " | ".join(str(grades[g]) for g in grades_told)
        print(f"| `{rig}` | {sum(grades.values())} | {told} |", flush=True)
    print(f"| all | {sum(total.values())} | " + " | ".join(str(total[g]) for g in grades_told) + " |")
    if options.list:
        for rig, seed, entry in listed:
            print(f"- {rig} {seed} {entry['profile']}: {entry['effect']}: {entry['grade']}: {entry['sentence']}")


if __name__ == "__main__":
    main()
