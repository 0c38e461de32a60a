#!/usr/bin/python3
"""False alarms of all rigs on healthy runs, off nominal within the tolerances, with the small effects of every one.

    scripts/studies/false_alarms.py [--rigs RIG ...] [--hours 20] [--first 1] [--noise FACTOR] [--work FOLDER] [--print]
        [--faults FOLDER] [--picture FILE]

Each run has a rig and a seed of its own and takes the next of the rig's profiles; it lasts ten minutes, or as long as
its profile says where that is a table in time. What is done stays in FOLDER: stopped, it goes on where it was, and
--print tells what is there, whatever its seeds. --noise: the noise of each transducer is 1/FACTOR to FACTOR times its
datasheet's. The bound on the rate is Poisson's, one-sided, 95 %.

The picture shows what fewer false alarms cost: over the threshold of the stage that ranks causes, as a multiple of
its own, the false alarms in 100 h, and, from the runs that random_faults.py left in --faults, the share of faults
found, the median delay, and the median size that would just reach the threshold, as a share of the datasheet's range
(evidence grows with the square of the size). It changes nothing else, so the other alarms of a rig are not in it.
"""

import argparse
import collections
import itertools
import pathlib
import tempfile

import numpy as np
from rig_runs import RIGS, ROOT, Results, datasheet, diagnose, named_alarms, on_all_cores, other_noise, record
from scipy.stats import chi2

RUN = 600  # s
MULTIPLES = np.geomspace(1, 30, 40)


def run(rig, profile, seconds, seed, noise):
    with tempfile.TemporaryDirectory() as folder:
        more = ["--profile", profile, "--duration", seconds, "--off-nominal", "--nuisance", "--seed", seed]
        more += other_noise(rig, seed, noise, folder)
        return named_alarms(diagnose(record(rig, pathlib.Path(folder) / "run.bag", *more)))


def runs_of(rig, hours, first, results, only_print, noise):
    if only_print:
        return list(results.all.values())
    profiles = datasheet(rig)["profiles"]
    tasks, planned = [], 0.0
    for seed in itertools.count(first):
        if planned >= 3600 * hours:
            break
        profile = profiles[seed % len(profiles)]
        seconds = profile["duration"] if profile.get("shape") == "table" else RUN
        planned += seconds
        tasks.append((f"{seed}_{profile['name']}", profile["name"], seconds, seed, noise))
    return list(on_all_cores(lambda name, *task: results.once(name, lambda: run(rig, *task)), tasks))


def told(alarm):
    place = f"{alarm['effect']}@{alarm['port']}" if alarm["effect"] else alarm["text"].split(";")[0]
    return f"{alarm['kind']}: {place}"


def just_seen(fault):
    """The size, as a share of its range, at which its evidence would be the threshold."""
    most = max((e / t for _, time, e, t in fault["evidence"] if time > fault["onset"]), default=0)
    return fault["share"] / np.sqrt(most) if fault["share"] and most > 0 else None


def draw(file, healthy, faults):
    """Per rig: healthy runs and, per fault, the onset and the course of evidence."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 4, figsize=(14, 3.6), constrained_layout=True)
    for rig, runs in healthy.items():
        evidence = [max((e / t for _, _, e, t in r["evidence"]), default=0) for r in runs]
        hours = sum(r["duration"] for r in runs) / 3600
        if not any(evidence):
            continue
        line = axes[0].step(MULTIPLES, [100 / hours * sum(e > m for e in evidence) for m in MULTIPLES], label=rig)
        colour = line[0].get_color()
        found, delay = [], []
        just = [s for s in map(just_seen, faults.get(rig, [])) if s is not None]
        for m in MULTIPLES:
            first = [
                next((time - r["onset"] for _, time, e, t in r["evidence"] if time > r["onset"] and e > m * t), None)
                for r in faults.get(rig, [])
            ]
            there = [f for f in first if f is not None]
            found.append(100 * len(there) / max(len(first), 1))
            delay.append(np.median(there) if there else np.nan)
        if faults.get(rig):
            axes[1].plot(MULTIPLES, found, color=colour)
            axes[2].plot(MULTIPLES, delay, color=colour)
        if just:
            axes[3].plot(MULTIPLES, 100 * np.median(just) * np.sqrt(MULTIPLES), color=colour)
    titles = ("false alarms in 100 h", "faults found [%]", "median delay [s]", "smallest size [% of range]")
    for axis, title in zip(axes, titles):
        axis.set(xscale="log", xlabel="threshold, in multiples of the rig's", title=title, ylim=(0, None))
        axis.grid(alpha=0.3)
    axes[0].legend(fontsize=8)
    figure.savefig(file, dpi=110)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rigs", nargs="+", default=RIGS)
    parser.add_argument("--hours", type=float, default=20, help="of each rig")
    parser.add_argument("--first", type=int, default=1, help="the first seed")
    parser.add_argument("--noise", type=float, default=1, help="times the datasheet's, up or down")
    parser.add_argument("--work", default=str(ROOT / "catkin_ws/reliability/false_alarms"))
    parser.add_argument("--print", action="store_true", help="run nothing")
    parser.add_argument("--faults", help="FOLDER of random_faults.py")
    parser.add_argument("--picture")
    options = parser.parse_args()
    healthy = {}
    print("| rig | runs | hours | false alarms | what they said |\n|---|---|---|---|---|")
    for rig in options.rigs:
        results = Results(pathlib.Path(options.work) / f"{rig}.jsonl")
        healthy[rig] = runs_of(rig, options.hours, options.first, results, options.print, options.noise)
        hours = sum(r["duration"] for r in healthy[rig]) / 3600
        alarms = collections.Counter(told(a) for r in healthy[rig] for a in r["alarms"])
        words = "; ".join(f"{n} x {what}" if n > 1 else what for what, n in alarms.most_common())
        print(f"| `{rig}` | {len(healthy[rig])} | {hours:.1f} | {sum(alarms.values())} | {words} |", flush=True)
    hours = sum(r["duration"] for runs in healthy.values() for r in runs) / 3600
    alarms = sum(len(r["alarms"]) for runs in healthy.values() for r in runs)
    if hours:
        most = chi2.ppf(0.95, 2 * alarms + 2) / 2 / hours
        print(f"\n{alarms} false alarms in {hours:.1f} h; at most {100 * most:.2g} in 100 h (95 %)")
    if options.picture:
        folder = pathlib.Path(options.faults or "")
        faults = {rig: list(Results(folder / f"{rig}.jsonl").all.values()) for rig in healthy} if options.faults else {}
        draw(options.picture, healthy, faults)


if __name__ == "__main__":
    main()
