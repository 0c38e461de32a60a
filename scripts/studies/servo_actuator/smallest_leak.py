#!/usr/bin/python3
"""The smallest internal leak that is found at one false alarm per 100 h, against the motion.

For each profile: healthy runs of several rigs (off their datasheet, with the small effects of every recording) give the
threshold of the leak detector for 0.01 false alarms per hour by `faultline tune`; then leaks of rising size open at 20
s, and the smallest of which every rig is found within 30 s counts. With the noise settings as printed, or with those
that tune chooses. What a threshold for 100 h rests on is told: the hours of healthy runs, and the 90 % upper bound of
the threshold from a bootstrap over their blocks.

    scripts/studies/servo_actuator/smallest_leak.py [--rigs 4] [--healthy 200] [--profiles square ...]
        [--noise printed tuned] [--json FILE] [--picture FILE]
"""

import argparse
import concurrent.futures
import json
import os
import pathlib
import sys
import re
import tempfile

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))
from rig_runs import datasheet, diagnose, drawn, faultline, record, simulate, write_datasheet

RIG = "servo_actuator"
PROFILES = ["square", "random", "steps", "triangle", "cycle", "multisine"]
COEFFICIENTS = [
    2e-10,
    4e-10,
    7e-10,
    1e-9,
    1.5e-9,
    2e-9,
    3e-9,
    4e-9,
    6e-9,
    8e-9,
    1.2e-8,
    1.6e-8,
    2.4e-8,
]  # m^3/(s sqrt(Pa))
ONSET, DURATION, RATE = 20, 50, 0.01
RATED_DROP = 0.67e6  # Pa, of Coulomb friction: what a coefficient is told in l/s at


def study(folder, sheet, profile, rigs, healthy, keep_noise):
    name = f"{profile}_{'printed' if keep_noise else 'tuned'}"
    configs = [write_datasheet(drawn(sheet, 80 + k), folder / f"{name}_{k}.yaml") for k in range(rigs)]
    run = lambda k, file, *more: record(
        RIG,
        folder / file,
        "--config",
        configs[k],
        "--profile",
        profile,
        "--seed",
        80 + k,  # noqa: E731
        "--nuisance",
        *more,
    )
    files = [run(k, f"{name}_{k}.bag", "--duration", healthy) for k in range(rigs)]
    keep = ["--keep-noise"] if keep_noise else []
    patch = folder / f"{name}_tuned.yaml"
    answer = json.loads(
        faultline(
            "tune",
            RIG,
            *files,
            "--config",
            folder / "filter.yaml",
            "--rate",
            RATE,
            *keep,
            "--patch",
            patch,
            "--json",
            "-",
        )
    )
    threshold = next(t for t in answer["thresholds"] if t["detector"] == "internal_leak")
    motion = simulate(
        RIG, folder, "--config", configs[0], "--profile", profile, "--seed", 80, "--duration", 20, name=f"{name}_motion"
    )
    speed = np.sqrt(np.mean(motion["velocity"] ** 2))
    # Where the filter reads low in all healthy motion, the threshold comes out below zero, which no detector takes.
    text = re.sub(r"\bthreshold: -\S+", "threshold: 0", patch.read_text())
    # The release level must lie below the new threshold.
    patch.write_text(
        text.replace("release_threshold: 1.5e-09", f"release_threshold: {max(0, 0.5 * threshold['chosen']):.3e}")
    )
    smallest, delays = None, []
    for coefficient in COEFFICIENTS:
        delays = []
        for k in range(rigs):
            file = run(
                k,
                f"{name}_leak.bag",
                "--duration",
                DURATION,
                "--effect",
                f"orifice_leakage@flow.chamber_a_chamber_b:coefficient={coefficient},from={ONSET}",
            )
            alarms = [a for a in diagnose(file, "--config", patch)["alarms"] if a["effect"] == "orifice_leakage"]
            found = [a["raised"] - ONSET for a in alarms if a["raised"] > ONSET]
            delays.append(min(found) if found else None)
        if all(d is not None for d in delays):
            smallest = coefficient
            break
    for file in files:
        file.unlink()
    return {
        "speed": float(speed),
        "hours": rigs * healthy / 3600,
        "blocks": threshold["blocks"],
        "profile": profile,
        "noise": "printed" if keep_noise else "tuned",
        "threshold": threshold["chosen"],
        "upper": threshold["upper"],
        "coefficient": smallest,
        "lps": smallest and 1e3 * smallest * float(np.sqrt(RATED_DROP)),
        "delays": delays,
    }


def draw(file, rows):
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(7, 4.2))
    for noise, colour in (("printed", "#d1741b"), ("tuned", "#1f5f99")):
        mine = [r for r in rows if r["noise"] == noise]
        found = [r for r in mine if r["lps"]]
        if not mine:
            continue
        axes.plot(
            [r["speed"] for r in found],
            [r["lps"] for r in found],
            "o",
            color=colour,
            label=f"found in every run, Q and R {noise}",
        )
        axes.plot(
            [r["speed"] for r in mine],
            [1e3 * r["threshold"] * np.sqrt(RATED_DROP) for r in mine],
            "_",
            ms=14,
            color=colour,
            label="threshold for one false alarm per 100 h",
        )
        axes.plot(
            [r["speed"] for r in mine],
            [1e3 * r["upper"] * np.sqrt(RATED_DROP) for r in mine],
            "2",
            ms=9,
            color=colour,
            label="its 90 % upper bound",
        )
        for r in mine:
            height = r["lps"] or 1e3 * r["threshold"] * np.sqrt(RATED_DROP)
            axes.annotate(r["profile"], (r["speed"], height), xytext=(6, 3), textcoords="offset points", fontsize=8)
    axes.axhline(0.003, color="#8a9199", lw=1, ls="--")
    axes.text(axes.get_xlim()[1], 0.003, "aim ", ha="right", va="bottom", color="#8a9199", fontsize=8)
    axes.set_yscale("log")
    axes.set_xlabel("rms speed of the piston, m/s")
    axes.set_ylabel("leak at 0.67 MPa, l/s")
    axes.legend(fontsize=7)
    figure.tight_layout()
    figure.savefig(file, dpi=110)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rigs", type=int, default=4)
    parser.add_argument("--healthy", type=float, default=200, help="s of each rig")
    parser.add_argument("--profiles", nargs="*", choices=PROFILES, default=PROFILES)
    parser.add_argument("--noise", nargs="*", choices=["printed", "tuned"], default=["printed", "tuned"])
    parser.add_argument("--json")
    parser.add_argument("--picture")
    options = parser.parse_args()
    sheet = datasheet(RIG)
    alone = json.loads(json.dumps(sheet))
    alone["estimators"] = alone["estimators"][:1]
    alone.pop("isolators", None)
    # The detectors that withhold faults are made for the printed noise; here only the leak counts.
    alone["detectors"] = [d for d in alone["detectors"] if d["name"] == "internal_leak"]
    with tempfile.TemporaryDirectory() as folder, concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        folder = pathlib.Path(folder)
        # By hand, so that tune finds the settings it rewrites on lines of their own.
        import yaml

        text = yaml.safe_dump(
            {k: v for k, v in alone.items() if k not in ("estimators", "detectors", "parameters")},
            sort_keys=False,
            allow_unicode=True,
            width=10000,
        )
        text += "parameters:\n" + "".join("  - " + json.dumps(p) + "\n" for p in alone["parameters"])
        for key in ("estimators", "detectors"):
            text += f"{key}:\n"
            for stage in alone[key]:
                text += f"  - name: {stage['name']}\n" + "".join(
                    f"    {k}: {v if not isinstance(v, float) else format(v, '.6e')}\n"
                    for k, v in stage.items()
                    if k != "name"
                )
        (folder / "filter.yaml").write_text(
            text.replace("release_threshold: 1.500000e-09", "release_threshold: 1.5e-09")
        )
        jobs = [
            pool.submit(study, folder, sheet, profile, options.rigs, options.healthy, keep)
            for profile in options.profiles
            for keep in [noise == "printed" for noise in options.noise]
        ]
        rows = [j.result() for j in jobs]
    print(
        f"{'profile':<10} {'noise':<8} {'rms m/s':>8} {'hours':>6} {'blocks':>7} {'threshold':>10} {'upper':>10} "
        f"{'smallest':>10} {'l/s':>8} "
        " delays, s"
    )
    for r in rows:
        lps = f"{r['lps']:.4f}" if r["lps"] else "none"
        delays = " ".join("-" if d is None else f"{d:.1f}" for d in r["delays"])
        print(
            f"{r['profile']:<10} {r['noise']:<8} {r['speed']:>8.3f} {r['hours']:>6.2f} {r['blocks']:>7} "
            f"{r['threshold']:>10.2e} {r['upper']:>10.2e} {r['coefficient'] or float('nan'):>10.2e} {lps:>8} "
            f" {delays}"
        )
    if options.picture:
        draw(options.picture, rows)
    if options.json:
        pathlib.Path(options.json).write_text(json.dumps(rows, indent=1) + "\n")


if __name__ == "__main__":
    main()
