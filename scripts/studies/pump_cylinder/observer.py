#!/usr/bin/python3
"""The open-loop observer of Kilic et al. (2014): figures 5, 6 and 7.

The nominal model, driven by the measured pump speeds for 50 s (`faultline simulate --drive`), beside the recorded
pressures of the preset paper_rig. Seven parameters are then retuned on the chirp in three ways: as printed in the
paper, by the paper's random search (Fig 5: theta (1 + range E delta), kept where the error E falls), and by
`faultline fit`. All are judged on the chirp and on another run.

    scripts/studies/pump_cylinder/observer.py [--iterations 200] [--seed 1] [-o docs/pictures]
"""

import argparse
import json
import pathlib
import random
import tempfile

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from paper_runs import BLUE, GREEN, GREY, ORANGE, PRESSURES, RIG, errors, paper_run, published
from rig_runs import datasheet, faultline, simulate, values, write_datasheet

SEARCHED = [
    "internal_leakage",
    "external_leakage_a",
    "external_leakage_b",
    "viscous_friction",
    "coulomb_friction",
    "bulk_c1",
    "bulk_c2",
]
PRINTED = [1.013e-12, 1.708e-13, 1.196e-13, 1980.0, 287.0, 57.88e6, 0.1587]  # section 3.1
RANGE = 0.5  # of the perturbation, per MPa of error


def with_values(sheet, numbers):
    changed = dict(zip(SEARCHED, numbers))
    return {
        **sheet,
        "parameters": [{**p, "nominal": changed.get(p["name"], p["nominal"])} for p in sheet["parameters"]],
    }


def observed(bag, folder, config=None):
    more = ["--config", config] if config else []
    return simulate(RIG, folder, "--drive", bag, "--no-noise", *more, name="observed")


def level(found):
    return float(np.hypot(found["P_A"], found["P_B"]))


def search(sheet, bag, run, folder, iterations, seed):
    """The paper's random search; the course of E and the best parameters."""
    generator = random.Random(seed)
    file = pathlib.Path(folder) / "searched.yaml"

    def error(numbers):
        return level(errors(run, observed(bag, folder, write_datasheet(with_values(sheet, numbers), file))))

    best = [values(sheet)[name] for name in SEARCHED]
    least = error(best)
    course = [least]
    for _ in range(iterations):
        trial = [value * (1 + RANGE * least * generator.uniform(-1, 1)) for value in best]
        found = error(trial)
        if found < least:
            best, least = trial, found
        course.append(least)
    return course, best


def picture(runs, title, file):
    """Speeds above, then measured and estimated pressures, one panel per observer."""
    run, estimates = runs
    figure, axes = plt.subplots(1 + len(estimates), 1, figsize=(8, 2 + 2.4 * len(estimates)), sharex=True)
    t = np.arange(len(run["position"])) * 1e-3
    for name, colour in (("pump1_speed", ORANGE), ("pump2_speed", BLUE)):
        axes[0].plot(t[::5], run[name][::5] / (2 * np.pi), color=colour, linewidth=0.5, label=name.replace("_", " "))
    axes[0].set(ylabel="rev/s", title=title)
    for axis, (label, estimate) in zip(axes[1:], estimates.items()):
        for (symbol, channel), colour in zip(PRESSURES.items(), (ORANGE, BLUE)):
            axis.plot(t[::5], run[channel][::5] / 1e6, color=GREY, linewidth=0.4, alpha=0.6)
            error = errors(run, estimate)[symbol]
            label_of = f"{symbol}, {error:.2f} MPa off"
            axis.plot(t[::5], estimate[channel][::5] / 1e6, color=colour, linewidth=0.6, label=label_of)
        axis.set(ylabel="MPa", title=label)
    for axis in axes:
        axis.legend(loc="upper right", fontsize=7, ncol=2, framealpha=0.8)
        axis.title.set_fontsize(9)
    axes[-1].set(xlabel="time, s (grey: measured)")
    figure.savefig(file, dpi=100, bbox_inches="tight")
    plt.close(figure)


def search_picture(course, refit, printed, file):
    figure, axis = plt.subplots(figsize=(7, 3))
    axis.plot(course, color=BLUE, label="random search (Fig 5)")
    axis.axhline(refit, color=GREEN, linestyle="--", label="faultline fit")
    axis.axhline(printed, color=GREY, linestyle=":", label="the paper's retuned parameters")
    axis.set(xlabel="models tried", ylabel="error of P_A and P_B together, MPa", ylim=(0, None))
    axis.legend(fontsize=8)
    figure.savefig(file, dpi=110, bbox_inches="tight")
    plt.close(figure)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--iterations", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1, help="of the random search")
    parser.add_argument("-o", "--output", default="docs/pictures")
    options = parser.parse_args()
    output = pathlib.Path(options.output)
    sheet = datasheet(RIG)
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        chirp, other = paper_run(folder, "training"), paper_run(folder, "validation1")
        course, best = search(sheet, *chirp, folder, options.iterations, options.seed)
        faultline("fit", RIG, chirp[0], "--patch", folder / "refit.yaml", "--json", folder / "fit.json")
        fitted = json.loads((folder / "fit.json").read_text())
        configs = {
            "Table 2": None,
            "the paper's retuned parameters": write_datasheet(with_values(sheet, PRINTED), folder / "printed.yaml"),
            "random search": write_datasheet(with_values(sheet, best), folder / "best.yaml"),
            "faultline fit": folder / "refit.yaml",
        }
        on_chirp = {name: observed(chirp[0], folder, config) for name, config in configs.items()}
        on_other = {name: observed(other[0], folder, config) for name, config in configs.items()}
    found = {
        name: {"chirp": errors(chirp[1], on_chirp[name]), "other run": errors(other[1], on_other[name])}
        for name in configs
    }
    search_picture(
        course,
        level(found["faultline fit"]["chirp"]),
        level(found["the paper's retuned parameters"]["chirp"]),
        output / "cylinder_figure_5.png",
    )
    shown = ["Table 2", "random search", "faultline fit"]
    picture((chirp[1], {n: on_chirp[n] for n in shown}), "Fig 6: the chirp", output / "cylinder_figure_6.png")
    picture((other[1], {n: on_other[n] for n in shown[1:]}), "Fig 7: another run", output / "cylinder_figure_7.png")
    nominal = values(sheet)
    print(
        json.dumps(
            {
                "errors, MPa": found,
                "paper, MPa": {
                    "Table 2": published()["observer_nominal"],
                    "the paper's retuned parameters": published()["observer_retuned"],
                },
                "random search": {n: [value, value / nominal[n]] for n, value in zip(SEARCHED, best)},
                "models tried": options.iterations,
                "models until within 1 % of the end": int(np.argmax(np.array(course) < 1.01 * course[-1])),
                "faultline fit": fitted["parameters"],
            },
            indent=1,
        )
    )


if __name__ == "__main__":
    main()
