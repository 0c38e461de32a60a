#!/usr/bin/env python3
"""False alarms of histograms and chain on healthy valves whose supply and temperature vary (profile paper).

false_alarms.py [--valves 25] [--first 201] [--hours 40] [--learn 7] [--work FOLDER] [--keep FOLDER]

Each valve, drawn within its tolerances, learns --learn h and is judged for --hours more, ten at a time. What is done
stays in FOLDER: stopped, it goes on where it was, and --print tells what is there. An hour takes 5 s of processor time,
in steps of 1 ms. The bound is on the rate of false alarms, Poisson, one-sided, 95 %."""

import argparse

from scipy.stats import chi2

from valve_runs import RIG, Valves, rig_runs

PART = 10  # h


def part_of(valves, valve, part):
    with valves.recording(valve, 1000 * valve + part, 3600 * PART) as run:
        report = valves.judge(valve, run)
    return [[alarm["raised"], alarm["kind"], alarm["text"]] for alarm in report["alarms"]]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--valves", type=int, default=25)
    parser.add_argument("--first", type=int, default=201)
    parser.add_argument("--hours", type=int, default=40, help="judged, per valve")
    parser.add_argument("--learn", type=float, default=7)
    parser.add_argument("--work", default="catkin_ws/valve_runs")
    parser.add_argument("--keep", help="a folder: recordings stay there (25 MB an hour), to be judged by other stages")
    parser.add_argument("--print", action="store_true", help="run nothing")
    options = parser.parse_args()
    valves = Valves(options.work, options.learn, rig_runs.datasheet(RIG), ["--substep", 0.001], options.keep)
    hours, alarms, seen = 0, [], set()
    for valve in range(options.first, options.first + options.valves):
        for part in range(options.hours // PART):
            name = f"{valve}_healthy_{part}"
            if options.print and not (valves.folder / f"{name}.json").exists():
                continue
            found = valves.once(name, lambda: part_of(valves, valve, part))
            hours += PART
            seen.add(valve)
            alarms += [(valve, part, *alarm) for alarm in found]
            for alarm in found:
                print(f"valve {valve}, part {part}, {alarm[0]:.0f} s, {alarm[1]}: {alarm[2]}", flush=True)
    if hours:
        most = chi2.ppf(0.95, 2 * len(alarms) + 2) / 2 / hours
        print(f"{len(alarms)} false alarms in {hours} h judged, of {len(seen)} valves")
        print(f"at most {1000 * most:.2g} in 1000 h, {8766 * most:.2g} per valve-year (95 %)")


if __name__ == "__main__":
    main()
