#!/usr/bin/env python3
"""What becomes of faults while the supply or the temperature is not as it was learnt, and of faults that grow slowly:
the histograms go on learning, so both are forgotten in time.

common_causes.py [--valve 101] [--learn 7] [--work FOLDER]

A valve that learnt at 5 bar and 20 degrees runs two hours at another supply or temperature (which wander as before),
without a fault and with the datasheet's prestage leak, growing from 600 s to 3600 s.
Then the prestage leak growing over 8 hours instead, at the supply and temperature that were learnt. Printed: the
alarms, and the highest share of a window in which a common cause lay on one side outside of what was learnt, in the
first and in the last hour."""

import argparse

import numpy as np

from valve_runs import RIG, Valves, course, rig_runs, told

HOURS = 2
LEARNT = (5.0e5, 293.15)
CASES = {  # mean of supply, Pa, and of temperature, K
    "supply 4.2 bar": (4.2e5, 293.15),
    "supply 5.8 bar": (5.8e5, 293.15),
    "temperature 0 C": (5.0e5, 273.15),
    "temperature 40 C": (5.0e5, 313.15),
}
FAULTS = {
    "none": [],
    "prestage leak": ["orifice_leakage@flow.prestage_ambient:coefficient=1e-8,from=600,to={:g}"],
}
COMMON = ["supply_pressure", "ambient_temperature"]


def one(valves, valve, means, fault, to, seconds):
    sheet = rig_runs.datasheet(RIG)
    for name, mean in zip(COMMON, means):
        sheet["inputs"][name]["value"] = mean
    file = rig_runs.write_datasheet(sheet, valves.folder / "elsewhere.yaml")
    words = [word for effect in FAULTS[fault] for word in ("--effect", effect.format(to))]
    run = valves.record(valve, 10 * valve + 3, seconds, "--profile", "paper", *words, sheet=file)
    columns = [f"q.{name}.{side}" for name in COMMON for side in ("above", "below")]
    report, rows = course(valves, valve, run, ["t"] + columns, seconds)
    run.unlink()
    far = np.max([rows[name] for name in columns], axis=0)
    first, last = far[rows["t"] < 3600].max(), far[rows["t"] > seconds - 3600].max()
    alarms = [[alarm["raised"], alarm["active"], alarm["text"]] for alarm in told(report)]
    return {"alarms": alarms, "far_first": float(first), "far_last": float(last)}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--valve", type=int, default=101)
    parser.add_argument("--learn", type=float, default=7)
    parser.add_argument("--work", default="catkin_ws/valve_runs")
    options = parser.parse_args()
    valves = Valves(options.work, options.learn, rig_runs.datasheet(RIG), ["--substep", 0.001])
    rows = [(case, fault, 3600, 3600 * HOURS) for case in CASES for fault in FAULTS]
    rows.append(("as learnt", "prestage leak", 600 + 3600 * 8, 3600 * 9))
    for case, fault, to, seconds in rows:
        name = f"{options.valve}_{case}_{fault}_{to}".replace(" ", "_")
        found = valves.once(name, lambda: one(valves, options.valve, CASES.get(case, LEARNT), fault, to, seconds))
        outside = f"{found['far_first']:.2f}, {found['far_last']:.2f}"
        print(f"{case}, {fault} growing to {to} s; outside {outside}", flush=True)
        for raised, active, text in found["alarms"]:
            print(f"    {raised:.0f} s{'' if active else ', over'}: {text}", flush=True)


if __name__ == "__main__":
    main()
