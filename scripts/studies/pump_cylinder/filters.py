#!/usr/bin/python3
"""The Kalman filters' columns of Table 6 of Kilic et al. (2014): RMS of P_A and P_B on three runs of paper_rig.

Each filter runs by itself over the recording (`faultline diagnose --series`): the linear one of (17), the extended one
of (23)-(28) with its Coulomb term as the paper's results ask for (none), as printed (unsigned) and with its sign; with
the inputs as printed (p_sum taken for 12 MPa, while the rig stands near 9) and with the measured pump speeds; given the
position, and one pressure or none.

    scripts/studies/pump_cylinder/filters.py
"""

import argparse
import json
import pathlib
import tempfile

from paper_runs import PRESSURES, RIG, RUNS, paper_run, published, rms
from rig_runs import datasheet, diagnose, write_datasheet

FILTERS = {
    "KF": {"model": "pump_cylinder_linear", "bulk_modulus": 1.3e9},
    "EKF, no Coulomb term": {"model": "pump_cylinder_nonlinear", "friction": "none"},
    "EKF, Coulomb term as printed": {"model": "pump_cylinder_nonlinear", "friction": "unsigned"},
    "EKF, Coulomb term with sign": {"model": "pump_cylinder_nonlinear", "friction": "signed", "friction_width": 0.01},
}
INPUTS = {"p_sum = 12 MPa": {"pressure_sum": 12e6}, "measured speeds": {}}
SETS = {"none": ["both_A", "both_B"], "b": ["P_A"], "a": ["P_B"]}  # pressures given: columns of Table 6
START = 1000  # samples that are left out


def estimator(sheet, pressures, settings):
    """The datasheet with this filter alone."""
    kept = ("name", "process_noise", "measurement_noise", "initial_variance", "gap", "jump")
    stage = {"type": "extended_kalman", **{k: sheet["estimators"][0][k] for k in kept}}
    stage.update(settings, pressures=pressures)
    return {**sheet, "estimators": [stage], "detectors": [], "isolators": []}


def columns(run, course, pressures):
    """RMS in MPa by the names of Table 6."""
    found = {}
    for name in SETS[pressures]:
        channel = PRESSURES["P_" + name[-1]]
        found[name] = rms(run[channel][START:], course[f"x.{channel}"][START:])
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.parse_args()
    sheet = datasheet(RIG)
    table = {}
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        for name in RUNS:
            bag, run = paper_run(folder, name)
            table[name] = {"paper, KF": {}, "paper, EKF": {}}
            for column, (_, linear, extended) in published()["table6"][name].items():
                table[name]["paper, KF"][column] = linear
                table[name]["paper, EKF"][column] = extended
            for inputs, given in INPUTS.items():
                for kind, settings in FILTERS.items():
                    row = {}
                    for pressures in SETS:
                        one = estimator(sheet, pressures, {**settings, **given})
                        config = write_datasheet(one, folder / "one.yaml")
                        _, course = diagnose(bag, "--config", config, "--series-rows", 100000, series=True)
                        row.update(columns(run, course, pressures))
                    table[name][f"{kind}; {inputs}"] = row
    print(json.dumps(table, indent=1))
    heads = ["P_A", "P_B", "both_A", "both_B"]
    for name, rows in table.items():
        print(f"\n| {name} | P_A from x, P_B | P_B from x, P_A | P_A from x | P_B from x |\n|---|---|---|---|---|")
        for label, row in rows.items():
            print(f"| {label} | " + " | ".join(f"{row[head]:.3f}" for head in heads) + " |")


if __name__ == "__main__":
    main()
