#!/usr/bin/python3
"""The paper's recording conditions (its Fig 2) on our simulator: ranges of every channel over several rigs, a picture.

    scripts/studies/hydraulic_drive/recording.py [--rigs 6] [--picture FILE]

Rigs are off their datasheet by their tolerances, seeds 1 and up; the picture is of the first. Voltage with the paper's
sign would be below 0; speed in rpm and pressure in bar, as the paper plots them.
"""

import argparse
import math
import pathlib
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))
from rig_runs import simulate

RIG = "hydraulic_drive"
PANELS = [  # channel, title, unit and its size, what the paper shows
    ("supply_pressure", "supply pressure P_s", "bar", 1e5, "140 to 145"),
    ("valve_voltage", "voltage v (paper: -v)", "V", 1, "0 to 2 in steps"),
    ("pump_pressure", "load P_p", "bar", 1e5, "30 to 40 in steps"),
    ("motor_pressure", "motor pressure P_m", "bar", 1e5, "40 to 70"),
    ("shaft_speed", "speed S_s", "rpm", math.pi / 30, "up to about 1000"),
]


def picture(run, file):
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(len(PANELS), 1, figsize=(8, 9), sharex=True)
    for axis, (channel, title, unit, size, _) in zip(axes, PANELS):
        axis.plot(run[channel] / size, linewidth=0.7)
        axis.set_ylabel(unit)
        axis.set_title(title, fontsize=9, loc="left")
        axis.grid(alpha=0.3)
    axes[-1].set_xlabel("sample (10 ms)")
    figure.tight_layout()
    figure.savefig(file, dpi=90)


def main():
    reader = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    reader.add_argument("--rigs", type=int, default=6)
    reader.add_argument("--picture")
    given = reader.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        more = ["--profile", "paper", "--off-nominal", "--nuisance"]
        runs = [simulate(RIG, folder, *more, "--seed", 1 + k) for k in range(given.rigs)]
    print("| channel | paper | here: 1 %, median, 99 % |\n|---|---|---|")
    for channel, title, unit, size, paper in PANELS:
        values = sorted(value / size for run in runs for value in run[channel])
        low, middle, high = (values[int(share * (len(values) - 1))] for share in (0.01, 0.5, 0.99))
        print(f"| {title}, {unit} | {paper} | {low:.4g}, {middle:.4g}, {high:.4g} |")
    if given.picture:
        picture(runs[0], given.picture)


if __name__ == "__main__":
    main()
