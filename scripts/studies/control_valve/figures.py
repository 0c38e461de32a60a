#!/usr/bin/python3
"""Figures 30, 31, 33, 34, 35 and 42 of Manninen (2012) on the control valve's simulator, and their numbers as JSON on
standard output. Figures 31 and 34: how far the mean of each variable in the chain moves by a fault of growing size, over
its standard deviation without fault.

The valve is off its datasheet by its tolerances, but for figure 31: without loops it would drift to a stop. It carries
the small effects of every recording.

    scripts/studies/control_valve/figures.py [--seed 1] [-o docs/pictures]
"""

import argparse
import json
import pathlib
import sys
import tempfile

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))
from rig_runs import simulate

RIG = "control_valve"
COLOURS = ["#8a9199", "#7fb2d9", "#1f5f99", "#d1741b"]
CHAIN = [
    "valve_setpoint",
    "spool_setpoint",
    "coil_voltage",
    "flapper_position",
    "prestage_net_mass_flow",
    "prestage_pressure",
    "spool_position",
    "cylinder_net_mass_flow",
    "cylinder_pressure",
    "load_torque",
    "valve_position",
    "flow",
]
PRESTAGE = "orifice_leakage@flow.prestage_ambient:coefficient={:g}"
CYLINDER = "orifice_leakage@flow.cylinder_ambient:coefficient={:g}"
PRESTAGE_SIZES = [0, 2.5e-9, 5e-9, 1e-8]  # m^3/(s sqrt(Pa)); holes of 0.05, 0.07 and 0.1 mm
CYLINDER_SIZES = [0, 2e-7, 4e-7, 8e-7]  # 0.44, 0.63 and 0.89 mm


class Bench:
    def __init__(self, folder, seed):
        self.folder, self.seed = pathlib.Path(folder), seed

    def run(self, profile, duration, effect=None, rig="--off-nominal"):
        arguments = ["--profile", profile, "--duration", duration, "--seed", self.seed, "--internals", "--nuisance"]
        arguments += ([rig] if rig else []) + (["--effect", effect] if effect else [])
        return simulate(RIG, self.folder, *arguments)

    def sizes(self, profile, duration, effect, sizes, **rig):
        return [self.run(profile, duration, effect.format(size) if size else None, **rig) for size in sizes]


def shifts(runs, start=20):
    """Per size and variable of the chain: shift of the mean, in standard deviations of the first run."""
    kept = [{name: run[name][run["t"] >= start] for name in CHAIN} for run in runs]
    spread = {name: max(np.std(kept[0][name]), 1e-12) for name in CHAIN}
    return [{n: float((np.mean(run[n]) - np.mean(kept[0][n])) / spread[n]) for n in CHAIN} for run in kept[1:]]


def bars(moved, names, labels, title, file):
    figure, axes = plt.subplots(figsize=(8, 3.2))
    for i, (one, label) in enumerate(zip(moved, labels)):
        axes.bar(np.arange(len(names)) + 0.25 * (i - 1), [one[n] for n in names], 0.25, label=label, color=COLOURS[1 + i])
    axes.axhline(0, color="black", linewidth=0.6)
    axes.set_xticks(np.arange(len(names)), [n.replace("_", "\n") for n in names], fontsize=7)
    axes.set_ylabel("shift of the mean,\nstandard deviations")
    axes.set_title(title, fontsize=9)
    axes.legend(frameon=False, fontsize=8)
    figure.savefig(file, dpi=110, bbox_inches="tight")
    plt.close(figure)


def flapper(runs, sizes, title, file, window):
    figure, axes = plt.subplots(1, 2, figsize=(9, 3))
    for run, size, colour in zip(runs, sizes, COLOURS):
        part = (run["t"] >= window[0]) & (run["t"] <= window[1])
        x = 1e6 * run["flapper_position"]
        axes[0].plot(run["t"][part], x[part], color=colour, linewidth=0.8, label=f"{size:g}" if size else "no leak")
        axes[1].plot(x[::20], 1e-5 * run["prestage_pressure"][::20], ".", color=colour, markersize=2)
    axes[0].set_xlabel("time [s]"), axes[0].set_ylabel("flapper [um]")
    axes[1].set_xlabel("flapper [um]"), axes[1].set_ylabel("prestage pressure [bar]")
    axes[0].legend(frameon=False, fontsize=7, ncol=2)
    figure.suptitle(title, fontsize=9)
    figure.savefig(file, dpi=110, bbox_inches="tight")
    plt.close(figure)


def excitation(bench, file):
    fast, slow = bench.run("duty", 60), bench.run("paper", 4200)
    figure, axes = plt.subplots(2, 2, figsize=(10, 4.5))
    for axis, run, title in ((axes[0, 0], fast, "fast switching"), (axes[0, 1], slow, "flow control")):
        axis.plot(run["t"], 1e3 * run["flow_setpoint"], color=COLOURS[3], linewidth=0.8, label="set point")
        axis.plot(run["t"], 1e3 * run["flow"], color=COLOURS[2], linewidth=0.8, label="flow")
        axis.set_ylim(0, 32), axis.set_ylabel("flow [l/s]"), axis.set_title(title, fontsize=9), axis.legend(frameon=False, fontsize=7, loc="upper right")
    axes[1, 0].plot(slow["t"], 1e-5 * slow["supply_pressure"], color=COLOURS[2], linewidth=0.8)
    axes[1, 0].set_ylabel("supply [bar]"), axes[1, 0].set_xlabel("time [s]")
    axes[1, 1].plot(slow["t"], slow["ambient_temperature"], color=COLOURS[2], linewidth=0.8)
    axes[1, 1].set_ylabel("temperature [K]"), axes[1, 1].set_xlabel("time [s]")
    figure.savefig(file, dpi=110, bbox_inches="tight")
    plt.close(figure)
    error = slow["flow"] - slow["flow_setpoint"]
    settled = np.abs(error) < 2e-3
    return {
        "supply_bar": [float(1e-5 * slow["supply_pressure"].min()), float(1e-5 * slow["supply_pressure"].max())],
        "temperature_K": [float(slow["ambient_temperature"].min()), float(slow["ambient_temperature"].max())],
        "flow_error_rms_l_s": float(1e3 * np.sqrt(np.mean(error[settled] ** 2))),
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("-o", "--output", type=pathlib.Path, default=pathlib.Path("docs/pictures"))
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    picture = lambda number: options.output / f"valve_figure_{number}.png"
    with tempfile.TemporaryDirectory(prefix="faultline_") as folder:
        bench = Bench(folder, options.seed)
        answer = {"figures_35_42": excitation(bench, picture("35_42"))}

        open_prestage = bench.sizes("open_ramps", 120, PRESTAGE, PRESTAGE_SIZES)
        flapper(open_prestage, PRESTAGE_SIZES, "open loop, prestage leak", picture(30), (0, 120))
        open_cylinder = bench.sizes("open_steps", 300, CYLINDER, CYLINDER_SIZES, rig=None)
        answer["figure_31"] = shifts(open_cylinder)
        labels = [f"{size:g} m$^3$/(s Pa$^{{1/2}}$)" for size in CYLINDER_SIZES[1:]]
        bars(answer["figure_31"], CHAIN[2:], labels, "open loop, cylinder leak", picture(31))

        closed = bench.sizes("valve_ramps", 120, PRESTAGE, PRESTAGE_SIZES)
        flapper(closed, PRESTAGE_SIZES, "control valve, prestage leak", picture(33), (0, 120))
        flow = bench.sizes("paper", 1200, PRESTAGE, PRESTAGE_SIZES)
        answer["figure_34"] = shifts(flow)
        labels = [f"{size:g} m$^3$/(s Pa$^{{1/2}}$)" for size in PRESTAGE_SIZES[1:]]
        bars(answer["figure_34"], CHAIN, labels, "flow loop, prestage leak", picture(34))
        for name, runs in (("figure_30", open_prestage), ("figure_33", closed)):
            answer[name] = [
                {
                    "flapper_mean_um": float(1e6 * np.mean(run["flapper_position"])),
                    "prestage_mean_bar": float(1e-5 * np.mean(run["prestage_pressure"])),
                }
                for run in runs
            ]
    print(json.dumps(answer, indent=1))


if __name__ == "__main__":
    main()
