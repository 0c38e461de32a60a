#!/usr/bin/python3
"""What `faultline gap` costs, against samples, output channels, effects tried, and the ports of rigs.

    scripts/studies/gap_cost.py [--rigs RIG ...] [--work FOLDER] [--picture FILE]

Two runs of one rig (multisine or the rig's first profile, steps or its second), off nominal with nuisance, with a leak
in the middle of its range at the first port that can have one. Then the same with longer runs; with half and a
quarter of the output channels (the rest is empty in the recording); with half and a quarter of the effects, the leak
among them. Processor time with --jobs 1, and the most memory. What is done stays in FOLDER: stopped, it goes on."""

import argparse
import json
import os
import pathlib
import random
import subprocess
import tempfile

from rig_runs import PROGRAM, RIGS, ROOT, Results, datasheet, faultline

LENGTHS = (0.5, 1, 2, 4)  # of the rig's usual run
PARTS = (1, 0.5, 0.25)
SECONDS = {"control_valve": 30, "cooling_circuit": 5, "hydraulic_drive": 30, "pump_cylinder": 12, "servo_actuator": 8}
PREFERRED = ("multisine", "steps")
LEAKS = ("laminar_leakage", "orifice_leakage")
COLOURS = dict(zip(RIGS, ("#d95f02", "#1b6ca8", "#4d9221", "#7b3294", "#666666")))
SHAPES = dict(zip(RIGS, "osD^v"))


def facts(rig):
    return json.loads(faultline("rigs", rig, "--json", "-"))["rigs"][0]


def leak(ports):
    """(effect@port, as simulate takes it): the middle of the range, on a scale of logarithms where it has one"""
    for port in ports:
        for effect in port["effects"]:
            if effect["effect"] in LEAKS:
                name = f"{effect['effect']}@{port['name']}"
                sizes = [(p["name"], p["minimum"], p["maximum"]) for p in effect["parameters"]]
                middle = [f"{n}={(a * b) ** 0.5 if a > 0 else b / 10:.4g}" for n, a, b in sizes]
                return name, f"{name}:" + ",".join(middle)
    raise SystemExit("no port of this rig can leak")


def profiles(sheet):
    names = [p["name"] for p in sheet["profiles"]]
    return ([n for n in PREFERRED if n in names] + [n for n in names if n not in PREFERRED])[:2]


def emptied(file, kept):
    """The recording with output channels that are not `kept` empty."""
    lines = file.read_text().splitlines()
    names = [name.split("[")[0] for name in lines[0].split(",")]
    rows = [lines[0]]
    for line in lines[1:]:
        rows.append(",".join(v if n in kept else "" for n, v in zip(names, line.split(","))))
    file.write_text("\n".join(rows) + "\n")


def measure(rig, length, channels, effects):
    """One answer: {"seconds", "megabytes", "samples", "outputs", "effects", "ports", "sentence"}"""
    sheet, known = datasheet(rig), facts(rig)
    ports, channels_of = known["ports"], known["channels"]
    name, given = leak(ports)
    outputs = [c["name"] for c in channels_of if c["role"] == "output" and not c["ground_truth"]]
    chosen = random.Random(1)
    count = max(1, round(channels * len(outputs)))
    others = {"t"} | {c["name"] for c in channels_of} - set(outputs)
    kept = others | set(outputs if channels == 1 else chosen.sample(outputs, count))
    tried = [f"{effect['effect']}@{port['name']}" for port in ports for effect in port["effects"]]
    without = [] if effects == 1 else chosen.sample([t for t in tried if t != name], round((1 - effects) * len(tried)))
    seconds = length * SECONDS[rig]
    with tempfile.TemporaryDirectory() as folder:
        runs = []
        for seed, profile in enumerate(profiles(sheet), 1):
            run = pathlib.Path(folder) / f"{profile}.csv"
            more = ["--off-nominal", "--nuisance", "--rig-seed", 5, "--effect", given, "--quiet", "-o", run]
            faultline("simulate", rig, "--profile", profile, "--duration", seconds, "--seed", seed, *more)
            if channels < 1:
                emptied(run, kept)
            runs.append(run)
        command = [PROGRAM, "gap", *runs, "--rig", rig, "--jobs", "1"]
        command += [part for w in without for part in ("--without", w)]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        said, errors = process.stdout.read(), process.stderr.read()
        _, status, used = os.wait4(process.pid, 0)
        if status:
            raise SystemExit(f"{rig}: {errors.strip() or 'gap was stopped'}")
    return {
        "seconds": round(used.ru_utime + used.ru_stime, 1),
        "megabytes": round(used.ru_maxrss / 1024),
        "samples": 2 * round(seconds / sheet["sample_period"]),
        "outputs": count,
        "effects": len(tried) - len(without),
        "ports": len(ports),
        "sentence": next((line for line in said.splitlines() if line.strip()), ""),
    }


def draw(file, table):
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from matplotlib.ticker import NullLocator

    figure, axes = plt.subplots(1, 4, figsize=(14, 3.8), sharey=True, constrained_layout=True)
    for rig, entries in table.items():
        style = {"color": COLOURS[rig], "marker": SHAPES[rig]}
        for axis, (series, key) in zip(axes, (("length", "samples"), ("channels", "outputs"), ("effects", "effects"))):
            line = sorted((e[key], e["seconds"]) for e in entries[series])
            axis.plot(*zip(*line), label=rig.replace("_", " "), **style)
        usual = next(e for e in entries["effects"] if e["effects"] == max(f["effects"] for f in entries["effects"]))
        axes[3].plot(usual["ports"], usual["seconds"], **style)
    labels = ("samples of two runs", "output channels measured", "effects tried", "ports of the rig")
    seconds = (2, 5, 10, 20, 50, 100, 200, 500)
    for axis, label in zip(axes, labels):
        axis.set(xscale="log", yscale="log", xlabel=label)
        axis.set_yticks(seconds, [str(s) for s in seconds], minor=False)
        axis.yaxis.set_minor_locator(NullLocator())
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("processor time [s]")
    for axis, key in zip(axes[1:], ("outputs", "effects", "ports")):
        series = "channels" if key == "outputs" else "effects"
        values = sorted({e[key] for entries in table.values() for e in entries[series]})
        values = [v for v, after in zip(values, values[1:] + [10 * values[-1]]) if after > 1.12 * v]
        axis.set_xticks(values, [str(v) for v in values])
        axis.xaxis.set_minor_locator(NullLocator())
    least = min(e["seconds"] for entries in table.values() for line in entries.values() for e in line)
    most = max(e["seconds"] for entries in table.values() for line in entries.values() for e in line)
    axes[0].set_ylim(least / 1.3, most * 1.3)
    axes[0].legend(fontsize=8)
    figure.savefig(file, dpi=110)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rigs", nargs="+", default=RIGS, choices=RIGS)
    parser.add_argument("--work", default=str(ROOT / "catkin_ws/gap_cost"))
    parser.add_argument("--picture")
    options = parser.parse_args()
    table = {}
    print("| rig | samples | outputs | effects | processor time [s] | memory [MiB] |\n|" + "---|" * 6)
    for rig in options.rigs:
        results = Results(pathlib.Path(options.work) / f"{rig}.jsonl")
        usual = (1, 1, 1)
        series = {
            "length": [(length, 1, 1) for length in LENGTHS],
            "channels": [(1, part, 1) for part in PARTS],
            "effects": [(1, 1, part) for part in PARTS],
        }
        table[rig] = {}
        for what, cases in series.items():
            table[rig][what] = []
            for case in cases:
                entry = results.once("_".join(map(str, case)), lambda case=case: measure(rig, *case))
                table[rig][what].append(entry)
                if case != usual or what == "length":
                    told = (entry[k] for k in ("samples", "outputs", "effects", "seconds", "megabytes"))
                    print(f"| `{rig}` | " + " | ".join(map(str, told)) + " |", flush=True)
    if options.picture:
        draw(options.picture, table)


if __name__ == "__main__":
    main()
