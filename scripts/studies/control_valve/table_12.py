#!/usr/bin/env python3
"""Table 12 of the rig's source cell by cell, on valves whose parameters are drawn within their tolerances: each learns
four hours and more of its own healthy run, then meets every fault of the datasheet.

table_12.py [--valves 3] [--first 101] [--hours 7] [--healthy HOURS] [--jobs 1] [--json FILE]

Per fault and variable: 1 high, -1 low, ±1 both in turn at the end of the run, valve by valve, and in brackets what the
source has. Per fault: the modules named at the end, and the share of its size at which it was told first. On stderr how
far position and flow are from their set points then, against the healthy part of the run.
--healthy: hours of a further healthy run per valve, and its false alarms. Seeds of the valves: --first and up; the
numbers in stages.yaml were chosen on valve 1, seeds 1, 2 and 11."""

import argparse
import concurrent.futures
import json
import pathlib
import re
import sys
import tempfile

import numpy as np
import yaml

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))
import rig_runs  # noqa: E402

RIG = "control_valve"
FROM, TO = 600, 3600  # s, of every fault's ramp
SIGNS = {"high": 1, "low": -1, "high and low in turn": "+-1"}
SHORT = {1: "1", -1: "-1", "+-1": "±1", None: ""}
EXPECTED = {  # modules of Table 13
    "fixed_restrictor_blockage": {"nozzle-flapper"},
    "nozzle_blockage": {"nozzle-flapper"},
    "prestage_leakage": {"nozzle-flapper"},
    "spool_valve_friction": {"spool valve"},
    "actuator_leakage": {"actuator"},
    "actuator_friction": {"actuator"},
    "mechanism_backlash": {"actuator"},
    "valve_friction": {"valve"},
    "actuator_leakage_and_valve_friction": {"actuator", "valve"},
    "prestage_leakage_and_valve_friction": {"nozzle-flapper", "valve"},
}


def pattern(text):
    """Variable -> sign, from an alarm's text; and the modules that it names."""
    places, _, shifts = text.partition(": shifted are ")
    signs = {}
    for part in shifts.split(", "):
        found = re.fullmatch(r"(\w+) (high and low in turn|high|low)", part)
        if found:
            signs[found.group(1)] = SIGNS[found.group(2)]
    named = set() if "names no place" in text else set(places.lower().split(" and "))
    return named, signs


def control_error(table, begin, end):
    """RMS of valve position and of flow from their set points, relative to the set point's range."""
    rows = (table["t"] >= begin) & (table["t"] < end)
    position = table["valve_position"][rows] - table["valve_setpoint"][rows]
    flow = (table["flow"][rows] - table["flow_setpoint"][rows]) / 0.028
    return float(np.sqrt(np.mean(position**2))), float(np.sqrt(np.mean(flow**2)))


def histograms_alone(folder):
    """The datasheet with these stages only: those that run the model cost hours on such runs."""
    sheet = rig_runs.datasheet(RIG)
    sheet["estimators"] = [stage for stage in sheet["estimators"] if stage["type"] == "histogram"]
    sheet["detectors"] = []
    sheet["isolators"] = [stage for stage in sheet["isolators"] if stage["type"] == "chain"]
    return rig_runs.write_datasheet(sheet, pathlib.Path(folder) / "sheet.yaml")


def run(folder, valve, seed, seconds, fault=None):
    file = pathlib.Path(folder) / "run.bag"
    more = ["--fault", fault] if fault else ["--profile", "paper"]
    base = ["--off-nominal", "--rig-seed", valve, "--nuisance", "--seed", seed, "--duration", seconds]
    return rig_runs.record(RIG, file, *base, *more)


def judge(folder, valve, seed, fault, sheet, learnt):
    file = run(folder, valve, seed, 4200, fault)
    report = rig_runs.diagnose(file, "--config", sheet, "--reference", learnt)
    alarms = [alarm for alarm in report["alarms"] if alarm["kind"] in ("fault", "unknown") and alarm["active"]]
    named, signs = set(), {}
    for alarm in alarms:
        places, shifts = pattern(alarm["text"])
        named |= places
        signs.update(shifts)
    raised = min((alarm["raised"] for alarm in report["alarms"] if alarm["kind"] in ("fault", "unknown")), default=None)
    table_file = file.with_suffix(".csv")
    rig_runs.faultline("export", file, "-o", table_file)
    table = rig_runs.read_table(table_file)
    table_file.unlink()
    healthy = control_error(table, 60, FROM)
    then = control_error(table, raised - 300, raised + 300) if raised else None
    end = control_error(table, 3600, 4200)
    return {
        "valve": valve,
        "modules": sorted(named),
        "signs": signs,
        "raised": raised,
        "share_of_size": None if raised is None else min(1.0, max(0.0, (raised - FROM) / (TO - FROM))),
        "error_before": healthy,
        "error_when_named": then,
        "error_at_the_end": end,
    }


def one_valve(valve, faults, arguments):
    """Its answer to every fault, and its false alarms."""
    with tempfile.TemporaryDirectory() as folder:
        sheet, learnt = histograms_alone(folder), pathlib.Path(folder) / "learnt.reference"
        file = run(folder, valve, 10 * valve, 3600 * arguments.hours)
        rig_runs.faultline("diagnose", file, "--config", sheet, "--keep-reference", learnt)
        alarms = []
        if arguments.healthy:
            file = run(folder, valve, 10 * valve + 1, 3600 * arguments.healthy)
            report = rig_runs.diagnose(file, "--config", sheet, "--reference", learnt)
            alarms = [(valve, alarm["raised"], alarm["text"]) for alarm in report["alarms"]]
            print(valve, "healthy", alarms, file=sys.stderr, flush=True)
        answers = {}
        for fault in faults:
            answers[fault] = judge(folder, valve, 10 * valve + 2, fault, sheet, learnt)
            answer = answers[fault]
            print(valve, fault, answer["modules"], answer["raised"], answer["signs"], file=sys.stderr, flush=True)
        return answers, alarms


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--valves", type=int, default=3)
    parser.add_argument("--first", type=int, default=101)
    parser.add_argument("--hours", type=float, default=7, help="of learning; histograms and shares take six")
    parser.add_argument("--healthy", type=float, default=0, help="hours per valve that nothing may be told in")
    parser.add_argument("--faults", help="of the datasheet, with commas between (default: all)")
    parser.add_argument("--jobs", type=int, default=1, help="valves at a time")
    parser.add_argument("--json")
    arguments = parser.parse_args()
    sheet = rig_runs.datasheet(RIG)
    faults = arguments.faults.split(",") if arguments.faults else [fault["name"] for fault in sheet["faults"]]
    chain = [stage for stage in sheet["isolators"] if stage["type"] == "chain"][0]
    variables = [name.strip() for name in chain["chain"].split(",")]
    published = yaml.safe_load((pathlib.Path(__file__).parent / "published.yaml").read_text())["table_12"]
    results, false_alarms = {fault: [] for fault in faults}, []
    valves = range(arguments.first, arguments.first + arguments.valves)
    with concurrent.futures.ThreadPoolExecutor(arguments.jobs) as pool:
        for answers, alarms in pool.map(lambda valve: one_valve(valve, faults, arguments), valves):
            false_alarms += alarms
            for fault, answer in answers.items():
                results[fault].append(answer)
    healthy_hours = arguments.healthy * arguments.valves

    print(f"| fault | {' | '.join(variables)} | modules named | right | named at, share of its size |")
    print("|" + "---|" * (len(variables) + 4))
    for number, fault in enumerate(faults if not arguments.faults else [], 1):
        paper = published[str(number)]
        cells = []
        for variable in variables:
            ours = [answer["signs"].get(variable) for answer in results[fault]]
            text = "/".join(SHORT[sign] or "." for sign in ours) if any(ours) else ""
            printed = SHORT[paper.get(variable)]
            cells.append(f"{text} ({printed})" if printed else text)
        right = sum(set(answer["modules"]) == EXPECTED[fault] for answer in results[fault])
        shares = [answer["share_of_size"] for answer in results[fault] if answer["share_of_size"] is not None]
        modules = "; ".join(sorted({", ".join(answer["modules"]) or "none" for answer in results[fault]}))
        size = f"{np.median(shares):.2f}" if shares else "-"
        print(f"| {number} {fault} | {' | '.join(cells)} | {modules} | {right} of {len(results[fault])} | {size} |")
    for fault in faults:
        for answer in results[fault]:
            if answer["error_when_named"]:
                before, then, end = (answer[key] for key in ("error_before", "error_when_named", "error_at_the_end"))
                print(
                    f"{fault}, valve {answer['valve']}: RMS of position and flow from their set points before "
                    f"{before[0]:.4f}, {before[1]:.4f}; when named {then[0]:.4f}, {then[1]:.4f}; "
                    f"at full size {end[0]:.4f}, {end[1]:.4f}",
                    file=sys.stderr,
                )
    if healthy_hours:
        print(f"\n{len(false_alarms)} false alarms in {healthy_hours:g} healthy hours")
        for valve, raised, text in false_alarms:
            print(f"valve {valve}, {raised:.0f} s: {text}")
    if arguments.json:
        pathlib.Path(arguments.json).write_text(json.dumps({"faults": results, "false": false_alarms}, indent=1))


if __name__ == "__main__":
    main()
