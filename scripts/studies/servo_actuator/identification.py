#!/usr/bin/python3
"""The identification of Mahulkar et al. (2011) on the servo actuator: figures 2, 3 and 4.

One rig, off its datasheet by its tolerances and with the small effects of every recording, is run 30 times with a PRBS
on the valve. Each run gives compliance = V_t/4beta_e and K = C_d w/sqrt(rho) by linear least squares on (2) over
windows of 20 ms,

    A (x_2 - x_1) = K integral of x_v sqrt(P_s - sgn(x_v) P_L) dt - compliance (P_L2 - P_L1),

and further runs, with the whole valve and in a closed loop, give the friction map: A P_L - F_load - m v' over v, fitted
with Stribeck, Coulomb and viscous parts.

    scripts/studies/servo_actuator/identification.py [--runs 30] [--seed 1] [-o docs/pictures]
"""

import argparse
import concurrent.futures
import json
import os
import pathlib
import sys
import tempfile

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import scipy.optimize

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))
from rig_runs import datasheet, drawn, simulate, values, write_datasheet

RIG = "servo_actuator"
WINDOW = 20  # samples
AVERAGE = 5  # samples that a window's ends are averaged over
PERIOD = 1e-3  # s
BLUE, ORANGE, GREY = "#1f5f99", "#d1741b", "#8a9199"


def flow_parameters(run, area):
    """compliance [m^3/Pa] and K [m^3/(s V sqrt(Pa))] of one run."""
    smooth = {
        name: np.convolve(run[name], np.ones(AVERAGE) / AVERAGE, "same") for name in ("position", "load_pressure")
    }
    drop = run["supply_pressure"] - np.sign(run["spool_position"]) * run["load_pressure"]
    passed = np.cumsum(run["spool_position"] * np.sqrt(np.maximum(drop, 0))) * PERIOD
    ends = np.arange(AVERAGE, len(passed) - AVERAGE, WINDOW)
    # Flow between two samples is the mean of both: the sum up to a sample holds half of it too much at each end, which
    # cancels but for the change of flow over the window.
    half = 0.5 * PERIOD * run["spool_position"] * np.sqrt(np.maximum(drop, 0))
    moved = area * np.diff(smooth["position"][ends])
    through = np.diff((passed - half)[ends])
    stored = np.diff(smooth["load_pressure"][ends])
    (k, compliance), *_ = np.linalg.lstsq(np.column_stack([through, -stored]), moved, rcond=None)
    return compliance, k


def friction(v, coulomb, excess, width, viscous):
    return np.sign(v) * (coulomb + excess * np.exp(-((v / width) ** 2))) + viscous * v


def friction_samples(run, area, mass):
    """Velocity and friction force where the piston moves freely and steadily enough."""
    half = 10
    kernel = np.ones(2 * half + 1) / (2 * half + 1)
    mean = {name: np.convolve(run[name], kernel, "same") for name in ("velocity", "load_pressure", "load_force")}
    acceleration = np.gradient(mean["velocity"], PERIOD)
    force = area * mean["load_pressure"] - mean["load_force"] - mass * acceleration
    keep = (np.abs(run["position"]) < 0.12) & (np.abs(acceleration) < 8)
    # Where the mean straddles a reversal or a stop it is no friction at that velocity.
    slow = np.abs(mean["velocity"]) < 4e-3
    keep &= np.convolve(slow, np.ones(4 * half + 1), "same") < 0.5
    keep[:100] = keep[-50:] = False
    return mean["velocity"][keep][::half], force[keep][::half]


def binned(v, f):
    edges = np.concatenate(
        [np.linspace(-0.55, -0.1, 19)[:-1], np.linspace(-0.1, 0.1, 41), np.linspace(0.1, 0.55, 19)[1:]]
    )
    centre, median, count = [], [], []
    for low, high in zip(edges[:-1], edges[1:]):
        inside = (v >= low) & (v < high) & (np.abs(v) > 2e-3)
        if inside.sum() >= 20:
            centre.append(np.median(v[inside]))
            median.append(np.median(f[inside]))
            count.append(inside.sum())
    return np.array(centre), np.array(median), np.array(count)


def fit_friction(v, f):
    start = [300, 20, 0.03, 700]
    result = scipy.optimize.least_squares(
        lambda p: friction(v, *p) - f,
        start,
        loss="soft_l1",
        f_scale=20,
        bounds=([0, 0, 0.005, 0], [2000, 1000, 0.2, 5000]),
        x_scale=start,
    )
    return result.x


def spread(numbers):
    return {
        "median": float(np.median(numbers)),
        "lowest": float(np.min(numbers)),
        "highest": float(np.max(numbers)),
        "std": float(np.std(numbers, ddof=1)),
    }


def scatter_picture(numbers, truth, nominal, label, paper, file):
    figure, axes = plt.subplots(figsize=(7, 3))
    axes.plot(np.arange(1, len(numbers) + 1), numbers, "o", color=BLUE, markersize=4, label="one run")
    axes.axhline(np.median(numbers), color=BLUE, linewidth=1.2, label="median")
    axes.axhline(truth, color=ORANGE, linewidth=1.2, linestyle="--", label="this rig")
    axes.axhspan(*paper, color=GREY, alpha=0.18, linewidth=0, label="spread in the paper")
    axes.axhline(nominal, color=GREY, linewidth=1, linestyle=":", label="datasheet")
    axes.set(xlabel="run", ylabel=label)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, 1.22), ncol=5, frameon=False, fontsize=8)
    figure.savefig(file, dpi=110, bbox_inches="tight")
    plt.close(figure)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=30)
    parser.add_argument("--seed", type=int, default=1, help="of the rig and of the first run")
    parser.add_argument("-o", "--output", default="docs/pictures")
    options = parser.parse_args()
    sheet = datasheet(RIG)
    rig = drawn(sheet, options.seed)
    truth, nominal = values(rig), values(sheet)
    output = pathlib.Path(options.output)
    with tempfile.TemporaryDirectory() as folder, concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        config = write_datasheet(rig, pathlib.Path(folder) / f"{RIG}.yaml")

        def run(profile, seed, duration):
            return simulate(
                RIG,
                folder,
                "--config",
                config,
                "--profile",
                profile,
                "--duration",
                duration,
                "--seed",
                seed,
                "--nuisance",
                name=f"{profile}_{seed}",
            )

        seeds = range(options.seed, options.seed + options.runs)
        pairs = np.array(
            list(pool.map(lambda seed: flow_parameters(run("prbs", seed, 20), nominal["ram_area"]), seeds))
        )
        # The whole valve for the fast part, a closed loop for the slow one.
        wanted = [(profile, seed) for seed in seeds for profile in ("full_valve", "random")]
        maps = list(
            pool.map(lambda pair: friction_samples(run(*pair, 20), nominal["ram_area"], nominal["moving_mass"]), wanted)
        )
    compliance, k = pairs[:, 0], pairs[:, 1]
    scatter_picture(
        k,
        truth["flow_coefficient"],
        nominal["flow_coefficient"],
        "C_d w/√ρ, m³/(s V √Pa)",
        (1.41e-8, 1.49e-8),
        output / "servo_figure_2.png",
    )
    scatter_picture(
        compliance,
        truth["compliance"],
        nominal["compliance"],
        "V_t/4β_e, m³/Pa",
        (0.5e-12, 1.5e-12),
        output / "servo_figure_3.png",
    )

    v, f = np.concatenate([m[0] for m in maps]), np.concatenate([m[1] for m in maps])
    centre, median, count = binned(v, f)
    found = fit_friction(centre, median)
    figure, axes = plt.subplots(figsize=(7, 3.6))
    axes.plot(v[::5], f[::5], ".", color=GREY, markersize=1.5, alpha=0.4, label="samples")
    axes.plot(centre, median, "o", color=BLUE, markersize=4, label="median per bin")
    fine = np.concatenate([np.linspace(-0.52, -1e-4, 400), np.linspace(1e-4, 0.52, 400)])
    axes.plot(fine, friction(fine, *found), color=BLUE, linewidth=1.4, label="fitted")
    true = [truth[n] for n in ("coulomb_friction", "static_excess", "stribeck_velocity", "viscous_damping")]
    axes.plot(fine, friction(fine, *true), color=ORANGE, linewidth=1.2, linestyle="--", label="this rig")
    axes.set(xlabel="velocity, m/s", ylabel="friction force, N", ylim=(-1100, 1100))
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, 1.14), ncol=4, frameon=False, fontsize=8, markerscale=2)
    figure.savefig(output / "servo_figure_4.png", dpi=110, bbox_inches="tight")
    print(
        json.dumps(
            {
                "flow_coefficient": {**spread(k), "rig": truth["flow_coefficient"]},
                "compliance": {**spread(compliance), "rig": truth["compliance"]},
                "friction": {
                    name: {"fitted": float(x), "rig": t}
                    for name, x, t in zip(
                        ("coulomb_friction", "static_excess", "stribeck_velocity", "viscous_damping"), found, true
                    )
                },
                "friction_at_half_mps": float(friction(0.5, *found)),
                "bins": len(centre),
            },
            indent=1,
        )
    )


if __name__ == "__main__":
    main()
