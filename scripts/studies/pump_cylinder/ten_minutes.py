#!/usr/bin/python3
"""Error of the pressure that stands in for each transmitter over ten minutes: no drift.

A rig off its datasheet with the small effects of every recording, machine cycle, oil that warms (viscosity down to
0.8). RMS in MPa, minute by minute, of the estimate without the transmitter against its reading, whose own noise is
taken off; and the same of the open-loop model under the measured speeds.

    scripts/studies/pump_cylinder/ten_minutes.py [--seconds 600]
"""

import argparse
import pathlib
import tempfile

import numpy as np

from paper_runs import PRESSURES, RIG
from rig_runs import datasheet, faultline, read_table, record, write_datasheet


def columns(file, names):
    """Of a long table, as a mapping."""
    with open(file) as text:
        head = text.readline().strip().split(",")
    table = np.loadtxt(file, delimiter=",", skiprows=1, usecols=[head.index(name) for name in names])
    return dict(zip(names, table.T))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=int, default=600)
    options = parser.parse_args()
    sheet = datasheet(RIG)
    noise = {c["name"]: c["noise_std"] for c in sheet["channels"]}
    alone = {**sheet, "estimators": sheet["estimators"][:1], "detectors": [], "isolators": []}
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        bag = folder / "run.bag"
        warm = f"viscosity_drift@source.oil:factor=0.8,from=0,to={options.seconds}"
        common = ["--profile", "cycle", "--seed", 5, "--off-nominal", "--nuisance", "--duration", options.seconds]
        record(RIG, bag, *common, "--effect", warm)
        config = write_datasheet(alone, folder / "one.yaml")
        # Every row: of stretches a series keeps the extremes, which are no samples of an error.
        series = folder / "series.csv"
        rows = ["--series", series, "--series-rows", 2000 * options.seconds]
        faultline("diagnose", bag, "--config", config, "--json", folder / "report.json", *rows)
        kinds = ("{}", "q.{}_virtual", "q.{}_virtual.std")
        course = columns(series, ["t", *(kind.format(c) for c in PRESSURES.values() for kind in kinds)])
        table = folder / "open.csv"
        faultline("simulate", RIG, "--drive", bag, "--no-noise", "--quiet", "-o", table)
        model = read_table(table)
        for channel in PRESSURES.values():
            model[channel] = np.interp(course["t"], model["t"], model[channel])
    for minute in range(options.seconds // 60):
        inside = (course["t"] >= max(60 * minute, 1)) & (course["t"] < 60 * (minute + 1))
        cells = []
        for symbol, channel in PRESSURES.items():
            for estimate in (course[f"q.{channel}_virtual"], model[channel]):
                off = np.mean((course[channel] - estimate)[inside] ** 2) - noise[channel] ** 2
                cells.append(f"{np.sqrt(max(off, 0)) / 1e6:.3f}")
        told = np.mean(course["q.chamber_a_pressure_virtual.std"][inside]) / 1e6
        told_b = np.mean(course["q.chamber_b_pressure_virtual.std"][inside]) / 1e6
        print(
            f"minute {minute + 1}: P_A {cells[0]} (open loop {cells[1]}), P_B {cells[2]} (open loop {cells[3]});"
            f" told {told:.3f}, {told_b:.3f}"
        )


if __name__ == "__main__":
    main()
