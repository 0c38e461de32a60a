#!/usr/bin/python3
"""What `faultline diagnose` says of one run per fault, and of healthy runs: the last table of docs/pump_cylinder.md.

Rigs off their datasheet with the small effects of every recording, 20 s, the fault from 8 s on.

    scripts/studies/pump_cylinder/diagnosis.py [--seed 12] [--profile steps]
"""

import argparse
import pathlib
import tempfile

from paper_runs import RIG
from rig_runs import diagnose, record

FAULTS = [
    "laminar_leakage@flow.pump2_a_b:coefficient=4e-13",
    "laminar_leakage@flow.pump2_b_tank:coefficient=2e-13",
    "laminar_leakage@flow.pump1_a_tank:coefficient=4e-13",
    "viscosity_drift@source.oil:factor=0.85",
    "offset@sensor.chamber_b_pressure:value=3e5",
    "scale@sensor.chamber_a_pressure:factor=0",
    "stuck@sensor.chamber_a_pressure",
    "drift@sensor.chamber_a_pressure:rate=5e4",
    "offset@sensor.pump2_speed:value=0.3",
    "scale@command.pump2_speed:factor=0.94",
    "lag@command.pump2_speed:time_constant=0.008",
    "coulomb_friction@force.piston:force=300",
    "added_mass@force.piston:mass=100",
    "entrained_air@compliance.chamber_a:fraction=0.03",
    "compliance_factor@compliance.chamber_b:factor=0.3",
]
HEALTHY = [("steps", 12), ("multisine", 12), ("cycle", 12), ("chirp", 13), ("validation", 13), ("triangle", 14)]


def with_start(fault):
    return f"{fault}:from=8" if ":" not in fault else f"{fault},from=8"


def told(alarm):
    name = f"{alarm['effect']}@{alarm['port']}" if alarm["effect"] else alarm["text"]
    size = alarm.get("size")
    numbers = f" {size['value']:.3g} ({size['low']:.3g} to {size['high']:.3g})" if size and alarm["effect"] else ""
    others = alarm.get("equivalent") or []
    names = ", ".join(f"{o['effect']}@{o['port']}" if isinstance(o, dict) else str(o) for o in others)
    return f"{alarm['kind']} {name}{numbers} at {alarm['raised']:.1f} s" + (f" [like {names}]" if names else "")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=12)
    parser.add_argument("--profile", default="steps")
    options = parser.parse_args()
    runs = [(options.profile, options.seed, fault) for fault in FAULTS]
    runs += [(profile, seed, "") for profile, seed in HEALTHY]
    with tempfile.TemporaryDirectory() as folder:
        bag = pathlib.Path(folder) / "run.bag"
        for profile, seed, fault in runs:
            effect = ["--effect", with_start(fault)] if fault else []
            common = ["--off-nominal", "--nuisance", "--duration", 20]
            record(RIG, bag, "--profile", profile, "--seed", seed, *common, *effect)
            report = diagnose(bag)
            print(f"{fault or f'healthy {profile} {seed}'}: {report['verdict']}", flush=True)
            for alarm in report["alarms"]:
                print("    " + told(alarm), flush=True)


if __name__ == "__main__":
    main()
