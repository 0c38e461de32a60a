#!/usr/bin/env python3
"""Figures 41 and 43 of Manninen (2012): a prestage leak that grows from 600 s to 3600 s, seen by histograms and chain.

fault_course.py [--valve 101] [--learn 7] [--work FOLDER] [--keep FOLDER] [-o docs/pictures]

Figure 41: moving average of the flapper position, scaled by the limits of the bin it is in (0 and 1), and the diameter
of the leak. Figure 43: the same of all variables, averaged over a minute; what shifted, with alarms; the leak. Numbers
as JSON on standard output."""

import argparse
import json
import pathlib

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from valve_runs import RIG, Valves, course, rig_runs, told

COEFFICIENT, BEGIN, END, SECONDS = 1e-8, 600, 3600, 4200  # m^3/(s sqrt(Pa)), s
VARIABLES = ["spool_setpoint", "coil_voltage", "flapper_position", "prestage_pressure", "spool_position"]
VARIABLES += ["cylinder_pressure", "load_torque", "valve_position", "flow"]
MOVING = {"coil_voltage": "#d1741b", "flapper_position": "#1f5f99"}


def diameter(coefficient):
    """mm, of a hole with discharge coefficient 1: coefficient sqrt(leakage_density/2) = A."""
    return 1e3 * np.sqrt(4 / np.pi * coefficient * np.sqrt(1.2 / 2))


def minute(t, values):
    """Mean over the minute before."""
    total = np.concatenate([[0], np.cumsum(values)])
    first = np.searchsorted(t, t - 60)
    last = np.arange(len(t)) + 1
    return (total[last] - total[first]) / (last - first)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--valve", type=int, default=101)
    parser.add_argument("--learn", type=float, default=7)
    parser.add_argument("--work", default="catkin_ws/valve_runs")
    parser.add_argument("--keep", help="a folder: recordings stay there, to be judged by other stages")
    parser.add_argument("-o", "--output", type=pathlib.Path, default=pathlib.Path("docs/pictures"))
    options = parser.parse_args()
    valves = Valves(options.work, options.learn, rig_runs.datasheet(RIG), ["--substep", 0.001], options.keep)
    effect = f"orifice_leakage@flow.prestage_ambient:coefficient={COEFFICIENT:g},from={BEGIN},to={END}"
    columns = ["t"] + [f"q.{name}.{what}" for name in VARIABLES for what in ("average", "above", "below", "level")]
    with valves.recording(options.valve, 10 * options.valve + 2, SECONDS, effect) as run:
        report, rows = course(valves, options.valve, run, columns, SECONDS)
    t = rows["t"]
    hole = diameter(COEFFICIENT * np.clip((t - BEGIN) / (END - BEGIN), 0, 1))

    figure, axes = plt.subplots(2, 1, figsize=(9, 4.5), sharex=True)
    axes[0].plot(t, rows["q.flapper_position.average"], color="#7fb2d9", linewidth=0.4)
    axes[0].plot(t, minute(t, rows["q.flapper_position.average"]), color="#1f5f99", linewidth=1, label="over a minute")
    axes[0].hlines([0, 1], 0, SECONDS, color="#b02318", linewidth=1, label="alarm limits")
    axes[0].set_ylabel("flapper position, scaled")
    axes[0].legend(frameon=False, fontsize=8, loc="lower left")
    axes[1].plot(t, hole, color="#d1741b")
    axes[1].set_ylabel("leak, diameter [mm]")
    axes[1].set_xlabel("time [s]")
    figure.savefig(options.output / "valve_figure_41.png", dpi=110, bbox_inches="tight")
    plt.close(figure)

    figure, axes = plt.subplots(3, 1, figsize=(9, 6.5), sharex=True)
    for name in VARIABLES:
        style = {"color": MOVING.get(name, "#8a9199"), "linewidth": 1.2 if name in MOVING else 0.7}
        axes[0].plot(t, minute(t, rows[f"q.{name}.average"]), label=name if name in MOVING else None, **style)
    axes[0].hlines([0, 1], 0, SECONDS, color="#b02318", linewidth=0.8)
    axes[0].set_ylabel("averages, scaled")
    axes[0].legend(frameon=False, fontsize=8, loc="lower left")
    for name, colour in MOVING.items():
        for side, style in (("above", "-"), ("below", "--"), ("level", ":")):
            axes[1].plot(t, rows[f"q.{name}.{side}"], style, color=colour, linewidth=1, label=f"{name} {side}")
    for alarm in told(report):
        axes[1].axvline(alarm["raised"], color="black", linewidth=0.8)
        axes[1].text(alarm["raised"] + 20, 0.9, alarm["text"].partition(":")[0], fontsize=8)
    axes[1].set_ylabel("shares of time\nbeyond, levels")
    axes[1].legend(frameon=False, fontsize=8, loc="center left", bbox_to_anchor=(1, 0.5))
    axes[2].plot(t, hole, color="#d1741b")
    axes[2].set_ylabel("leak, diameter [mm]")
    axes[2].set_xlabel("time [s]")
    figure.savefig(options.output / "valve_figure_43.png", dpi=110, bbox_inches="tight")

    ends = {n: float(np.mean(rows[f"q.{n}.average"][t > END])) for n in VARIABLES}
    starts = {n: float(np.mean(rows[f"q.{n}.average"][t < BEGIN])) for n in VARIABLES}
    alarms = [[alarm["raised"], alarm["text"]] for alarm in told(report)]
    print(json.dumps({"alarms": alarms, "average_before": starts, "average_at_the_end": ends}, indent=1))


if __name__ == "__main__":
    main()
