#!/usr/bin/env python3
"""What histograms and chain say of a transducer that is off: steps at 600 s, at a third to a half of what the
datasheet's bounds allow, on a valve that learnt its healthy self.

transducers.py [--valve 101] [--learn 7] [--work FOLDER] [--keep FOLDER]

Per transducer every alarm: what it names, when it was raised after the step, whether it was active at the end."""

import argparse

from valve_runs import RIG, Valves, rig_runs, told

BEGIN, SECONDS = 600, 2400
STEPS = [
    "offset@sensor.flapper_position:value=3e-6",
    "offset@sensor.prestage_pressure:value=1e4",
    "offset@sensor.cylinder_pressure:value=1e4",
    "scale@sensor.cylinder_pressure:factor=0.95",
    "offset@sensor.load_torque:value=5",
    "scale@sensor.load_torque:factor=1.25",
    "offset@sensor.spool_position:value=0.02",
    "offset@sensor.valve_position:value=0.01",
    "scale@sensor.flow:factor=1.05",
]


def one(valves, valve, effect):
    with valves.recording(valve, 10 * valve + 4, SECONDS, f"{effect},from={BEGIN}") as run:
        report = valves.judge(valve, run)
    names = [f"{alarm['kind']}, {alarm['effect']}@{alarm['port']}, {alarm['text']}" for alarm in told(report)]
    return [[n, alarm["raised"], alarm["active"]] for n, alarm in zip(names, told(report))]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--valve", type=int, default=101)
    parser.add_argument("--learn", type=float, default=7)
    parser.add_argument("--work", default="catkin_ws/valve_runs")
    parser.add_argument("--keep", help="a folder: recordings stay there, to be judged by other stages")
    options = parser.parse_args()
    valves = Valves(options.work, options.learn, rig_runs.datasheet(RIG), ["--substep", 0.001], options.keep)
    for effect in STEPS:
        name = f"{options.valve}_{effect.partition(':')[0]}"
        found = valves.once(name, lambda: one(valves, options.valve, effect))
        print(effect, flush=True)
        for text, raised, active in found:
            print(f"    after {raised - BEGIN:.0f} s{'' if active else ', over'}: {text}", flush=True)


if __name__ == "__main__":
    main()
