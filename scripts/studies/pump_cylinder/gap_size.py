#!/usr/bin/python3
"""Which estimator of the chamber pressures to trust when the gap between rig and model grows; and what dry friction
does to the filters without a Coulomb term.

The preset paper_rig with its warming oil, stiction and ripple 0 to 2 times as large (chirp, 50 s): RMS of P_A and P_B
against the measured pressures, from 1 s on. Then the preset with other levels of Coulomb friction.

    scripts/studies/pump_cylinder/gap_size.py [--picture docs/pictures/cylinder_gap_size.png]
"""

import argparse
import pathlib
import tempfile

from filters import FILTERS, START, estimator
from paper_runs import BLUE, GREEN, GREY, ORANGE, PRESSURES, RIG, rms
from rig_runs import datasheet, diagnose, faultline, read_table, record, write_datasheet

SIZES = [0.0, 0.5, 1.0, 1.5, 2.0]
KF, EKF = "KF", "EKF, Coulomb term with sign"
ROWS = {
    "open loop": None,
    "KF, x": (KF, "none"),
    "EKF, x": (EKF, "none"),
    "KF, x and the other": (KF, "one"),
    "EKF, x and the other": (EKF, "one"),
}
STYLES = {
    "open loop": (GREY, "-"),
    "KF, x": (ORANGE, "--"),
    "EKF, x": (BLUE, "--"),
    "KF, x and the other": (ORANGE, "-"),
    "EKF, x and the other": (GREEN, "-"),
}
FRICTION = [200, 250, 330]  # N


def effects(size):
    if size == 0:
        return []
    return [
        f"viscosity_drift@source.oil:factor={1 - 0.16 * size:g},from=0,to=50",
        f"stribeck_friction@force.piston:static_excess={60 * size:g},velocity=0.01",
        f"displacement_ripple@source.pump2:amplitude={0.01 * size:g},order=9",
    ]


def recording(folder, size, *more):
    bag = folder / "run.bag"
    given = [part for effect in effects(size) for part in ("--effect", effect)]
    record(RIG, bag, "--nuisance", "--profile", "chirp", "--seed", 1, *given, *more)
    table = folder / "run.csv"
    faultline("export", bag, "-o", table)
    return bag, read_table(table)


def estimated(folder, sheet, bag, run, name, pressures):
    """RMS of P_A and P_B in MPa by one filter."""
    found = {}
    for symbol, channel in PRESSURES.items():
        given = pressures if pressures == "none" else {"P_A": "b", "P_B": "a"}[symbol]
        config = write_datasheet(estimator(sheet, given, FILTERS[name]), folder / "one.yaml")
        _, course = diagnose(bag, "--config", config, "--series-rows", 100000, series=True)
        found[symbol] = rms(run[channel][START:], course[f"x.{channel}"][START:])
    return found


def open_loop(folder, bag, run):
    table = folder / "open.csv"
    faultline("simulate", RIG, "--drive", bag, "--no-noise", "--quiet", "-o", table)
    course = read_table(table)
    return {symbol: rms(run[channel][START:], course[channel][START:]) for symbol, channel in PRESSURES.items()}


def draw(table, file):
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(9, 3.6), sharey=True)
    for axis, symbol in zip(axes, PRESSURES):
        for row, (colour, line) in STYLES.items():
            axis.plot(SIZES, [table[size][row][symbol] for size in SIZES], line, color=colour, marker="o", label=row)
        axis.set_xlabel("size of the gap, times paper_rig's")
        axis.set_title(symbol.replace("_", " "))
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("RMS error in MPa")
    axes[0].legend(frameon=False, fontsize=8)
    figure.tight_layout()
    figure.savefig(file, dpi=110)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--picture", type=pathlib.Path)
    options = parser.parse_args()
    sheet, table = datasheet(RIG), {}
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        for size in SIZES:
            bag, run = recording(folder, size)
            table[size] = {
                row: open_loop(folder, bag, run) if which is None else estimated(folder, sheet, bag, run, *which)
                for row, which in ROWS.items()
            }
            cells = [f"{row} {found['P_A']:.3f} {found['P_B']:.3f}" for row, found in table[size].items()]
            print(f"gap {size:g}: " + "; ".join(cells), flush=True)
        for force in FRICTION:
            other = dict(sheet)
            other["parameters"] = [
                {**p, "nominal": float(force)} if p["name"] == "coulomb_friction" else p for p in sheet["parameters"]
            ]
            config = write_datasheet(other, folder / "rig.yaml")
            bag, run = recording(folder, 1.0, "--config", config)
            found = estimated(folder, sheet, bag, run, KF, "one")
            print(f"friction {force} N: KF, x and the other {found['P_A']:.3f} {found['P_B']:.3f}", flush=True)
    if options.picture:
        draw(table, options.picture)


if __name__ == "__main__":
    main()
