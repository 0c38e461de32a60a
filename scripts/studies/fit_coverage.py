#!/usr/bin/python3
"""How often do the 90 % intervals of `faultline fit` hold the truth?

Every run is simulated on a datasheet of its own, whose parameters are drawn within the tolerances of the rig's, with
the small effects that every recording carries; `faultline fit` knows the rig's datasheet only.

    scripts/studies/fit_coverage.py servo_actuator --profile prbs --duration 20 --runs 30
"""

import argparse
import json
import pathlib
import tempfile

from rig_runs import datasheet, drawn, faultline, values, write_datasheet


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rig")
    parser.add_argument("--profile", default="")
    parser.add_argument("--duration", type=float, default=20)
    parser.add_argument("--runs", type=int, default=30)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", help="write every estimate to this file")
    options = parser.parse_args()
    sheet = datasheet(options.rig)
    profile = ["--profile", options.profile] if options.profile else []
    rows = {}
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        for k in range(options.runs):
            truth = drawn(sheet, options.seed + k)
            config = write_datasheet(truth, folder / f"{options.rig}.yaml")
            faultline(
                "simulate",
                options.rig,
                "--config",
                config,
                *profile,
                "--duration",
                options.duration,
                "--seed",
                options.seed + k,
                "--nuisance",
                "--compression",
                "none",
                "--quiet",
                "-o",
                folder / "run.bag",
            )
            faultline("fit", options.rig, folder / "run.bag", "--json", folder / "fit.json")
            fit = json.loads((folder / "fit.json").read_text())
            for p in fit["parameters"]:
                rows.setdefault(p["name"], []).append({**p, "truth": values(truth)[p["name"]]})
    print(f"{'parameter':<26} {'determined':>10} {'inside':>8} {'half width':>11} {'rms error':>10} {'tolerance':>10}")
    inside_all = count_all = 0
    for name, fits in rows.items():
        known = [f for f in fits if f["determined"]]
        inside = sum(f["low"] <= f["truth"] <= f["high"] for f in known)
        inside_all += inside
        count_all += len(known)
        if not known:
            print(f"{name:<26} {0:>10} {'':>8} {'':>11} {'':>10} {fits[0]['tolerance']:>9.2%}")
            continue
        width = sum((f["high"] - f["low"]) / 2 / abs(f["estimate"]) for f in known) / len(known)
        error = (sum((f["estimate"] / f["truth"] - 1) ** 2 for f in known) / len(known)) ** 0.5
        print(
            f"{name:<26} {len(known):>10} {inside / len(known):>8.0%} {width:>11.2%} {error:>10.2%} "
            f"{fits[0]['tolerance']:>10.2%}"
        )
    print(f"all: {inside_all} of {count_all} intervals hold the truth, {inside_all / max(1, count_all):.0%}")
    if options.json:
        pathlib.Path(options.json).write_text(json.dumps(rows, indent=1) + "\n")


if __name__ == "__main__":
    main()
