#!/usr/bin/python3
"""What the response isolator says of the paper's faults at several sizes, and of healthy rigs, as Markdown.

    scripts/studies/hydraulic_drive/responses.py [--rigs 3] [--healthy 6] [--minutes 10] [--seed 1000]

Rigs are off their datasheet by their tolerances and carry the small effects of every recording; profile paper. A fault
begins at 20 s of 45 s. Named: the first alarm of the isolator `fault` after that is the fault; among: it is that, or
stands in what cannot be told apart. The datasheet's stages other than the responses are left out.
"""

import argparse
import pathlib
import statistics
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))
from rig_runs import datasheet, diagnose, record, write_datasheet

RIG = "hydraulic_drive"
ONSET, END = 20, 45  # s
SIZES = [0.10, 0.05, 0.02]  # of the parameter
FAULTS = {  # effect, its size for a share of the parameter
    "eta_m": ("scale@transmission.motor:factor", lambda s: 1 + s),
    "eta_p": ("scale@transmission.pump:factor", lambda s: 1 / (1 + s)),
    "C_r": ("scale@transmission.displacement:factor", lambda s: 1 + s),
    "I": ("added_mass@force.shaft:mass", lambda s: s * 1.5606e-3),
    "D": ("viscous_friction@force.shaft:coefficient", lambda s: s * 1.3733e-2),
    "K_0": ("clogging@restriction.valve:fraction", lambda s: -s),
    "K_l": ("laminar_leakage@flow.motor_in_motor_out:coefficient", lambda s: s * 1.5e-12),
    "V_t": ("compliance_factor@compliance.motor_line:factor", lambda s: 1 / (1 + s)),
    "B": ("compliance_factor@compliance.motor_line:factor", lambda s: 1 + s),
}
PROFILES = ["paper", "wide", "multisine", "prbs", "speed_steps", "speed_cycle"]


def run(folder, config, seed, duration, *more):
    bag = record(
        RIG, folder / "run.bag", "--off-nominal", "--nuisance", "--seed", seed, "--duration", duration, *more
    )
    report = diagnose(bag, "--config", config)
    bag.unlink()
    return [alarm for alarm in report["alarms"] if alarm["effect"]]


def row(folder, config, name, share, seeds):
    setting, size = FAULTS[name]
    key, true = setting.split(":")[0], size(share)
    named = among = 0
    delays, sizes, others = [], [], []
    for seed in seeds:
        effect = f"{setting}={true:.9g},from={ONSET}"
        late = [a for a in run(folder, config, seed, END, "--effect", effect) if a["raised"] >= ONSET]
        if not late:
            continue
        first = min(late, key=lambda a: a["raised"])
        delays.append(first["raised"] - ONSET)
        said = f"{first['effect']}@{first['port']}"
        named += said == key
        among += key == said or key in first["equivalent"]
        if said == key:
            sizes.append(first["size"]["value"])
        elif said not in others:
            others.append(said)
    shown = f"{statistics.median(delays):.1f} s" if delays else "-"
    told = f"{statistics.median(sizes):.4g} for {true:.4g}" if sizes else "-"
    print(
        f"| {name} {100 * share:g} % | {len(delays)} | {named} | {among} | {shown} | {told} | {', '.join(others)} |",
        flush=True,
    )


def main():
    reader = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    reader.add_argument("--rigs", type=int, default=3)
    reader.add_argument("--healthy", type=int, default=6, help="runs without a fault")
    reader.add_argument("--minutes", type=float, default=10, help="of each")
    reader.add_argument("--seed", type=int, default=1000)
    given = reader.parse_args()
    sheet = datasheet(RIG)
    sheet["estimators"] = [s for s in sheet["estimators"] if s["type"] == "fault_response"]
    sheet["detectors"], sheet["isolators"] = [], [s for s in sheet["isolators"] if s["name"] == "fault"]
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        config = write_datasheet(sheet, folder / "config.yaml")
        print(f"| fault | alarms of {given.rigs} | named | among | delay | size | else named |")
        print("|---|---|---|---|---|---|---|")
        for fault in FAULTS:
            for share in SIZES:
                row(folder, config, fault, share, range(given.seed, given.seed + given.rigs))
        alarms = []
        for k in range(given.healthy):
            more = ["--profile", PROFILES[k % len(PROFILES)]]
            alarms += run(folder, config, given.seed + 500 + k, 60 * given.minutes, *more)
        minutes = given.healthy * given.minutes
        print(f"\nhealthy: {len(alarms)} alarms in {minutes:g} minutes", *[a["text"] for a in alarms], sep="\n")


if __name__ == "__main__":
    main()
