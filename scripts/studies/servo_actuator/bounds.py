#!/usr/bin/python3
"""Do the 90 % bounds of an internal leak hold it? Leaks of random size from 15 s on, on rigs off their datasheet.

Every run: other parameters within tolerance, the small effects of every recording, one of three profiles in turn, a
leak coefficient drawn between 5e-9 and 4e-8 m^3/(s sqrt(Pa)) on a logarithmic scale; 40 s. Printed: how often the alarm
at the end names the leak, how often its bounds hold the true size, and the errors in half widths of the bounds.

    scripts/studies/servo_actuator/bounds.py [--runs 36] [--seed 7]
"""

import argparse
import concurrent.futures
import math
import os
import pathlib
import sys
import random
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))
from rig_runs import diagnose, record

RIG = "servo_actuator"
PROFILES = ["random", "square", "multisine"]
FRICTION_PRESSURE = 0.67e6  # Pa, at which the alarm states the flow


def one(folder, number, seed, coefficient):
    profile = PROFILES[number % len(PROFILES)]
    bag = record(
        RIG,
        folder / f"{number}.bag",
        "--profile",
        profile,
        "--duration",
        40,
        "--seed",
        seed,
        "--off-nominal",
        "--nuisance",
        "--effect",
        f"orifice_leakage@flow.chamber_a_chamber_b:coefficient={coefficient:.4g},from=15",
    )
    report = diagnose(bag)
    bag.unlink()
    sizes = [
        a["size"] for a in report["alarms"] if a["active"] and a["port"] == "flow.chamber_a_chamber_b" and a["size"]
    ]
    return profile, coefficient * math.sqrt(FRICTION_PRESSURE) * 1e3, sizes[0] if sizes else None


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=36)
    parser.add_argument("--seed", type=int, default=7)
    options = parser.parse_args()
    generator = random.Random(options.seed)
    drawn = [(k, generator.randint(100, 99999), 10 ** generator.uniform(-8.3, -7.4)) for k in range(options.runs)]
    with tempfile.TemporaryDirectory() as folder, concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        results = list(pool.map(lambda work: one(pathlib.Path(folder), *work), drawn))
    for chosen in [*PROFILES, "all"]:
        rows = [(true, size) for profile, true, size in results if chosen in (profile, "all")]
        found = [(true, size) for true, size in rows if size]
        errors = sorted(abs(size["value"] - true) / (0.5 * (size["high"] - size["low"])) for true, size in found)
        inside = sum(size["low"] <= true <= size["high"] for true, size in found)
        middle = f"{errors[len(errors) // 2]:.2f}, {errors[9 * len(errors) // 10]:.2f}" if errors else "-"
        print(
            f"{chosen:<10} named {len(found):>2}/{len(rows):<3} inside {inside:>2}/{len(found):<3} error in half"
            f" widths, median and 90 %: {middle}"
        )


if __name__ == "__main__":
    main()
