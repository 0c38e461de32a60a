#!/usr/bin/env python3
"""The response isolator on the recordings of Table 12, beside histograms and chain.

responses.py --keep FOLDER [--valve 101] [--every 300] [--faults A,B] [--work FOLDER]

FOLDER holds the recordings of table_12.py --keep (missing ones are made). Of the rig's stages only the fault responses
and their isolators run, a stretch every --every s instead of the datasheet's, which bounds the processor time: a fault
lasts an hour and most of the time goes to it. Per fault: what was named by the end and by its first alarm, and where
the ramp stood then, in shares of the datasheet's size. Right is a name at a port of the fault, for itself or among
those it cannot be told from."""

import argparse
import resource

from table_12 import FROM, STAY, TO, share
from valve_runs import RIG, Valves, rig_runs


def responses_alone(sheet, every):
    chosen = {**sheet, "detectors": []}
    chosen["estimators"] = [{**s, "every": every} for s in sheet["estimators"] if s["type"] == "fault_response"]
    chosen["isolators"] = [s for s in sheet["isolators"] if s["type"] == "response"]
    return chosen


def one(valves, valve, effects, file):
    seconds = FROM + (TO - FROM) + STAY
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    with valves.recording(valve, 10 * valve + 2, seconds, *effects) as run:
        report = rig_runs.diagnose(run, "--rig", RIG, "--config", file)
    cost = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
    keys = ("raised", "until", "active", "kind", "effect", "port", "equivalent", "size", "text")
    return {"alarms": [{key: alarm[key] for key in keys} for alarm in report["alarms"]], "cost": cost}


def ports(alarm):
    return [name.split("@")[-1] for name in (f"{alarm['effect']}@{alarm['port']}", *alarm["equivalent"])]


def words(alarm):
    name = f"{alarm['effect']}@{alarm['port']}" if alarm["port"] else alarm["text"]
    others = len(alarm["equivalent"])
    return name + (f" (or {others} more)" if others else "")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--valve", type=int, default=101)
    parser.add_argument("--every", type=float, default=300)
    parser.add_argument("--faults", help="of the datasheet, with commas between (default: all)")
    parser.add_argument("--keep", required=True, help="a folder with the recordings of table_12.py")
    parser.add_argument("--work", default="catkin_ws/valve_runs")
    options = parser.parse_args()
    sheet = rig_runs.datasheet(RIG)
    valves = Valves(options.work, 7, sheet, ["--substep", 0.001], options.keep)
    file = rig_runs.write_datasheet(responses_alone(sheet, options.every), valves.folder / "responses.yaml")
    faults = {"none": [], **{fault["name"]: fault["effects"] for fault in sheet["faults"]}}
    names = options.faults.split(",") if options.faults else list(faults)
    print("| fault | told at | first alarm | alarms at the end | at the right port | processor time, s |")
    print("|---|---|---|---|---|---|")
    for name in names:
        effects = faults[name]
        key = f"{options.valve}_responses_{options.every:g}_{name}"
        found = valves.once(key, lambda: one(valves, options.valve, effects, file))
        alarms = sorted(found["alarms"], key=lambda alarm: alarm["raised"])
        at = "-"
        if alarms:
            at = f"{share(alarms[0]['raised']):.2f}" if alarms[0]["raised"] >= FROM else "before it began"
        meant = {effect.partition(":")[0].partition("@")[2] for effect in effects}
        last = [alarm for alarm in alarms if alarm["active"]]
        right = sorted({port for alarm in last for port in ports(alarm)} & meant)
        cells = [at, words(alarms[0]) if alarms else "-", "; ".join(map(words, last)) or "-"]
        cells += [f"{len(right)} of {len(meant)}", f"{found['cost']:.0f}"]
        print(f"| {name} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
