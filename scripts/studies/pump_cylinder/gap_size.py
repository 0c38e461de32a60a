#!/usr/bin/python3
"""Which estimator of the chamber pressures to trust when the gap between rig and model grows; and what dry friction
does to the filters without a Coulomb term.

The preset paper_rig with its warming oil, stiction and ripple 0 to 2 times as large (50 s): RMS of P_A and P_B
against the measured pressures, from 1 s on. The network is the one that the datasheet names, trained on runs with the
gap once as large; profile validation with a seed that trained nothing is a motion like that of its training, chirp of
seed 1 is its training run, steps it never saw. Then the preset with other levels of Coulomb friction, in the chirp.

    scripts/studies/pump_cylinder/gap_size.py [--picture docs/pictures/cylinder_gap_size.png]
        [--profile validation] [--seed 21] [--friction]
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
    "network, x and the other": "network",
}
STYLES = {
    "open loop": (GREY, "-"),
    "KF, x": (ORANGE, "--"),
    "EKF, x": (BLUE, "--"),
    "KF, x and the other": (ORANGE, "-"),
    "EKF, x and the other": (GREEN, "-"),
    "network, x and the other": (BLUE, "-"),
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


def recording(folder, size, profile, seed, *more):
    bag = folder / "run.bag"
    given = [part for effect in effects(size) for part in ("--effect", effect)]
    record(RIG, bag, "--nuisance", "--profile", profile, "--seed", seed, *given, *more)
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


def network(folder, sheet, bag, run):
    stage = next(stage for stage in sheet["estimators"] if stage["type"] == "network")
    config = write_datasheet({**sheet, "estimators": [stage], "detectors": [], "isolators": []}, folder / "one.yaml")
    _, course = diagnose(bag, "--config", config, "--series-rows", 100000, series=True)
    return {s: rms(run[channel][START:], course[f"q.{channel}_network"][START:]) for s, channel in PRESSURES.items()}


def row_of(which, folder, sheet, bag, run):
    if which is None:
        return open_loop(folder, bag, run)
    if which == "network":
        return network(folder, sheet, bag, run)
    return estimated(folder, sheet, bag, run, *which)


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
    parser.add_argument("--profile", default="validation")
    parser.add_argument("--seed", type=int, default=21)
    parser.add_argument("--friction", action="store_true", help="only the levels of Coulomb friction")
    options = parser.parse_args()
    sheet, table = datasheet(RIG), {}
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        for size in [] if options.friction else SIZES:
            bag, run = recording(folder, size, options.profile, options.seed)
            table[size] = {row: row_of(which, folder, sheet, bag, run) for row, which in ROWS.items()}
            cells = [f"{row} {found['P_A']:.3f} {found['P_B']:.3f}" for row, found in table[size].items()]
            print(f"gap {size:g}: " + "; ".join(cells), flush=True)
        for force in FRICTION if options.friction else []:
            other = dict(sheet)
            other["parameters"] = [
                {**p, "nominal": float(force)} if p["name"] == "coulomb_friction" else p for p in sheet["parameters"]
            ]
            config = write_datasheet(other, folder / "rig.yaml")
            bag, run = recording(folder, 1.0, "chirp", 1, "--config", config)
            found = estimated(folder, sheet, bag, run, KF, "one")
            print(f"friction {force} N: KF, x and the other {found['P_A']:.3f} {found['P_B']:.3f}", flush=True)
    if options.picture and table:
        draw(table, options.picture)


if __name__ == "__main__":
    main()
