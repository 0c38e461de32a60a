#!/usr/bin/env python3
"""Table 12 of the rig's source cell by cell, on valves whose parameters are drawn within their tolerances: each learns
some hours of its own healthy run, then meets every fault of the datasheet, which grows and stays.

table_12.py [--valves 3] [--first 101] [--learn 7] [--growth 1] [--slower 1] [--size dn50] [--set single_bins=16]
            [--work FOLDER] [--keep FOLDER]

Per fault and variable: 1 high, -1 low, ±1 both in turn at the end of the run, valve by valve (. is none), and in
brackets what the source has. Per fault: modules named at the end, how often right (no other module at any time counts
as wrong before), and where the ramp stood when it was told and when control was degraded, in shares of the datasheet's
size (above 1: that part of the ramp's time after its end). Degraded: the flow lies 1.5 times as far from its set point
(RMS over 300 s, 15 s and more after each step) as in the same run without the fault, in two stretches one after the
other; position the same.

--growth K: grow on at the same rate to K times the size. --slower K: grow to it in K times the time. --size: a valve of
another size (valve_sizes.py) with the stages that ship. --set: the histograms with another setting. What is done stays
in FOLDER: stopped, it goes on where it was; a valve takes three minutes of processor time. The numbers in stages.yaml
were chosen on valve 1."""

import argparse
import re
import sys

import numpy as np

from valve_runs import CONTROL, PUBLISHED, RIG, Valves, control_error, course, pattern, rig_runs, told
from valve_sizes import SIZES, sized

FROM, TO, STAY = 600, 3600, 600  # s: every fault's ramp, and how long it stays
SHORT = {1: "1", -1: "-1", "+-1": "±1", None: ""}
EXPECTED = {  # modules of Table 13
    "fixed_restrictor_blockage": ["nozzle-flapper"],
    "nozzle_blockage": ["nozzle-flapper"],
    "prestage_leakage": ["nozzle-flapper"],
    "spool_valve_friction": ["spool valve"],
    "actuator_leakage": ["actuator"],
    "actuator_friction": ["actuator"],
    "mechanism_backlash": ["actuator"],
    "valve_friction": ["valve"],
    "actuator_leakage_and_valve_friction": ["actuator", "valve"],
    "prestage_leakage_and_valve_friction": ["nozzle-flapper", "valve"],
}
DEGRADED = 1.5


def grown(text, growth, slower):
    """An effect of the datasheet that grows on at the same rate, or more slowly."""
    head, _, rest = text.partition(":")
    words = []
    for word in rest.split(","):
        name, value = word.split("=")
        value = float(value)
        if name == "to":
            value = FROM + slower * growth * (TO - FROM)
        elif name != "from":
            value *= growth
        words.append(f"{name}={value:g}")
    return f"{head}:{','.join(words)}"


def widened(sheet, growth):
    """The datasheet with ranges that hold a fault grown so far."""
    ports = {}
    for name, port in sheet["ports"].items():
        effects = {}
        for effect, ranges in port["effects"].items():
            wide = {k: [v[0], v[1] * growth] for k, v in ranges.items()} if name.split(".")[0] != "sensor" else ranges
            if effect == "clogging":
                wide = {"fraction": [ranges["fraction"][0], max(0.9, ranges["fraction"][1])]}
            effects[effect] = wide
        ports[name] = {**port, "effects": effects}
    return {**sheet, "ports": ports}


def one_run(valves, valve, effects, growth, slower):
    seconds = round(FROM + slower * growth * (TO - FROM) + STAY)
    effects = [grown(effect, growth, slower) for effect in effects]
    with valves.recording(valve, 10 * valve + 2, seconds, *effects) as run:
        report, rows = course(valves, valve, run, CONTROL, seconds)
    ends, errors = control_error(rows, valves.demand_flow)
    named, signs, ever = set(), {}, set()
    for alarm in told(report):
        places, shifts = pattern(alarm["text"])
        ever |= places
        if alarm["active"]:
            named |= places
            signs.update(shifts)
    raised = min((alarm["raised"] for alarm in told(report)), default=None)
    return {"modules": sorted(named), "ever": sorted(ever), "signs": signs, "raised": raised,
            "ends": list(ends), "errors": errors.tolist()}  # fmt: skip


def share(time, slower=1):
    return None if time is None else max(0.0, (time - FROM) / (slower * (TO - FROM)))


def degraded(answer, healthy, which, slower):
    """Share of the size at which control was degraded, or None."""
    bad = np.array(answer["errors"])[:, which] > DEGRADED * np.array(healthy["errors"])[:, which]
    for i in range(2, len(bad)):
        if bad[i] and bad[i - 1]:
            return share(answer["ends"][i - 1], slower)
    return None


def several(values):
    return " ".join("-" if value is None else f"{value:.2f}" for value in values)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--valves", type=int, default=3)
    parser.add_argument("--first", type=int, default=101)
    parser.add_argument("--learn", type=float, default=7, help="hours; histograms and shares take six")
    parser.add_argument("--growth", type=float, default=1)
    parser.add_argument("--slower", type=float, default=1)
    parser.add_argument("--faults", help="of the datasheet, with commas between (default: all)")
    parser.add_argument("--size", choices=sorted(SIZES))
    parser.add_argument("--set", action="append", default=[], metavar="KEY=NUMBER", help="of the histograms")
    parser.add_argument("--keep", help="a folder: recordings stay there, to be judged by other stages")
    parser.add_argument("--work", default="catkin_ws/valve_runs")
    options = parser.parse_args()
    sheet = rig_runs.datasheet(RIG)
    changes = {key: float(value) for key, _, value in (text.partition("=") for text in options.set)}
    for stage in sheet["estimators"]:
        stage.update(changes if stage["type"] == "histogram" else {})
    if options.size:
        sheet = sized(sheet, options.size)
    if options.growth != 1:
        sheet = widened(sheet, options.growth)
    names = [fault["name"] for fault in sheet["faults"]]
    effects = {fault["name"]: fault["effects"] for fault in sheet["faults"]}
    faults = options.faults.split(",") if options.faults else names
    chain = [stage for stage in sheet["isolators"] if stage["type"] == "chain"][0]
    variables = re.split(r",\s*", chain["chain"])
    always = [] if options.growth > 1 else ["--substep", 0.001]
    valves = Valves(options.work, options.learn, sheet, always, options.keep)
    seeds = range(options.first, options.first + options.valves)
    growth, slower, results, healthy = options.growth, options.slower, {fault: [] for fault in faults}, []
    mark = f"{growth:g}" + (f"_{slower:g}" if slower != 1 else "")
    for valve in seeds:
        healthy.append(valves.once(f"{valve}_none_{mark}", lambda: one_run(valves, valve, [], growth, slower)))
        for fault in faults:
            name = f"{valve}_{fault}_{mark}"
            results[fault].append(
                valves.once(name, lambda: one_run(valves, valve, effects[fault], growth, slower))
            )
            answer = results[fault][-1]
            print(valve, fault, answer["modules"], answer["raised"], answer["signs"], file=sys.stderr, flush=True)

    heads = variables + ["modules named", "right", "told at", "flow degraded at", "position degraded at"]
    print(f"| fault | {' | '.join(heads)} |")
    print("|" + "---|" * (len(heads) + 1))
    for fault in faults:
        answers, number = results[fault], names.index(fault) + 1
        paper, cells = PUBLISHED["table_12"][str(number)], []
        for variable in variables:
            ours = [answer["signs"].get(variable) for answer in answers]
            text = "/".join(SHORT[sign] or "." for sign in ours) if any(ours) else ""
            printed = SHORT[paper.get(variable)]
            cells.append(f"{text} ({printed})" if printed else text)
        modules = "; ".join(sorted({", ".join(answer["modules"]) or "none" for answer in answers}))
        right = sum(a["modules"] == EXPECTED[fault] for a in answers)
        ever = sum(set(a["ever"]) <= set(EXPECTED[fault]) for a in answers)
        cells += [modules, f"{right} of {len(answers)}, at any time {ever}"]
        cells.append(several([share(answer["raised"], slower) for answer in answers]))
        for which in (1, 0):
            cells.append(several([degraded(answer, before, which, slower) for answer, before in zip(answers, healthy)]))
        print(f"| {number} {fault} | {' | '.join(cells)} |")
    flow = [np.median(np.array(answer["errors"])[:, 1]) for answer in healthy]
    parts = several(100 * f for f in flow)
    print(f"\nRMS of the settled flow from its set point without fault: {parts} % of its range")
    early = sum(a["raised"] is not None and a["raised"] < FROM for answers in results.values() for a in answers)
    print(f"told before the fault began: {early}; in the runs without fault: {sum(bool(a['raised']) for a in healthy)}")


if __name__ == "__main__":
    main()
