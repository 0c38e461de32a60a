#!/usr/bin/python3
"""The four filters on the same recordings of the servo actuator: error, delay, false alarms; and how the bounds hold.

Rigs are off their datasheet by their tolerances, with the small effects of every recording. Each filter runs with the
datasheet's Q, R and P0; only its type changes. Time per step: ./faultline bench --benchmark_filter=filter_step

    scripts/studies/servo_actuator/comparison.py [--rigs 8] [--filters divided_difference_2 ...] [--json FILE]
"""

import argparse
import concurrent.futures
import json
import os
import pathlib
import sys
import tempfile

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))
from rig_runs import datasheet, diagnose, drawn, record, values, write_datasheet

RIG = "servo_actuator"
FILTERS = {
    "divided_difference_1": "DD1",
    "divided_difference_2": "DD2",
    "unscented_kalman": "UKF",
    "extended_kalman": "EKF",
}
VOLTS = [1, 3, 5]
PROFILES = ["square", "random"]
ONSET, DURATION, SETTLED = 20, 60, 15  # s
NINETY = 1.6449


def job(folder, sheet, seed, profile, volts, configs):
    rig = drawn(sheet, seed)
    name = f"{profile}_{seed}_{volts}"
    config = write_datasheet(rig, folder / f"{name}.yaml")
    leak = ["--command", f"leak_valve_command:{ONSET}=0,{ONSET + 0.001}={volts}"] if volts else []
    bag = record(
        RIG,
        folder / f"{name}.bag",
        "--config",
        config,
        "--profile",
        profile,
        "--seed",
        seed,
        "--nuisance",
        "--duration",
        DURATION,
        *leak,
    )
    true = volts * values(rig)["leak_valve_gain"]
    rows = []
    for kind, variant in configs.items():
        report, series = diagnose(bag, "--config", variant, series=True)
        late = series["t"] > ONSET + SETTLED
        estimate = series["q.leak_coefficient"][late]
        bound = NINETY * series["q.leak_coefficient.std"][late]
        alarms = [
            a for a in report["alarms"] if a["effect"] == "orifice_leakage" and a["port"] == "flow.chamber_a_chamber_b"
        ]
        early = [a for a in report["alarms"] if a["raised"] < ONSET or not volts]
        found = next((a for a in alarms if a["raised"] >= ONSET), None) if volts else None
        size = found and found["size"]
        flow = (np.sqrt(np.abs(series["load_pressure"])) * true * 1e3)[series["t"] > DURATION - 20].mean()
        rows.append(
            {
                "filter": kind,
                "profile": profile,
                "volts": volts,
                "seed": seed,
                "bias": float(np.mean(estimate - true)),
                "rms": float(np.sqrt(np.mean((estimate - true) ** 2))),
                "inside": float(np.mean(np.abs(estimate - true) <= bound)),
                "delay": found and found["raised"] - ONSET,
                "false_alarms": len(early),
                "alarm_inside": (
                    bool(size["low"] <= flow <= size["high"]) if size and size["name"] == "leak_flow" else None
                ),
            }
        )
    bag.unlink()
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rigs", type=int, default=8)
    parser.add_argument("--filters", nargs="*", choices=FILTERS, default=list(FILTERS))
    parser.add_argument("--json")
    options = parser.parse_args()
    sheet = datasheet(RIG)
    with tempfile.TemporaryDirectory() as folder, concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        folder = pathlib.Path(folder)
        configs = {}
        for kind in options.filters:
            copy = json.loads(json.dumps(sheet))
            copy["estimators"][0]["type"] = kind
            # The filter alone: its alarms without the isolation that other stages add.
            copy["estimators"] = copy["estimators"][:1]
            copy.pop("isolators", None)
            configs[kind] = write_datasheet(copy, folder / f"{kind}.yaml")
        jobs = [
            pool.submit(job, folder, sheet, 40 + k, profile, volts, configs)
            for k in range(options.rigs)
            for profile in PROFILES
            for volts in [0, *VOLTS]
        ]
        rows = [row for done in jobs for row in done.result()]
    unit = 1e-9
    print(
        f"{'profile':<8} {'filter':<6} {'bias':>8} {'rms':>8} {'inside 90 %':>12} {'found':>7} {'delay, s':>9} "
        f"{'longest':>8} {'false alarms':>13} {'alarm size inside':>18} "
        "  (bias, rms: 1e-9 m^3/(s sqrt(Pa)))"
    )
    for profile in PROFILES:
        for kind in options.filters:
            name = FILTERS[kind]
            mine = [r for r in rows if r["filter"] == kind and r["profile"] == profile]
            leaks, healthy = [r for r in mine if r["volts"]], [r for r in mine if not r["volts"]]
            delays = [r["delay"] for r in leaks if r["delay"] is not None]
            sizes = [r["alarm_inside"] for r in leaks if r["alarm_inside"] is not None]
            print(
                f"{profile:<8} {name:<6} {np.mean([r['bias'] for r in leaks]) / unit:>8.2f} "
                f"{np.sqrt(np.mean([r['rms'] ** 2 for r in leaks])) / unit:>8.2f} "
                f"{np.mean([r['inside'] for r in mine]):>12.0%} {len(delays):>3}/{len(leaks):<3} "
                f"{np.median(delays) if delays else float('nan'):>9.2f} "
                f"{max(delays) if delays else float('nan'):>8.2f} {sum(r['false_alarms'] for r in healthy):>4} in"
                f" {len(healthy):>2} min {sum(sizes):>10}/{len(sizes):<3}"
            )
    if options.json:
        pathlib.Path(options.json).write_text(json.dumps(rows, indent=1) + "\n")


if __name__ == "__main__":
    main()
