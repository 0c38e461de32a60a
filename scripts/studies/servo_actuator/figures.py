#!/usr/bin/python3
"""Figures 5 to 12 of Mahulkar et al. (2011) on the servo actuator, and their numbers as JSON on standard output.

The rig is off its datasheet by its tolerances and carries the small effects of every recording; the filter is the
datasheet's.

    scripts/studies/servo_actuator/figures.py [--seed 4] [-o docs/pictures]
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
from rig_runs import datasheet, diagnose, drawn, record, simulate, values, write_datasheet

RIG = "servo_actuator"
BLUE, ORANGE, GREY, GREEN = "#1f5f99", "#d1741b", "#8a9199", "#2f8f5b"
LITRES = 1e3
STEPS = [
    (20, 50, 1),
    (50, 80, 2),
    (80, 110, 3),
    (110, 140, 4),
    (140, 170, 5),
    (200, 230, 5),
]  # s, s, V: internal_leak_steps
Q55 = [8e-4, 1e-4, 4e-5, 8e-6, 8e-7]


class Bench:
    def __init__(self, folder, seed):
        self.folder = pathlib.Path(folder)
        self.seed = seed
        self.sheet = datasheet(RIG)
        self.rig = drawn(self.sheet, seed)
        self.config = write_datasheet(self.rig, self.folder / "rig.yaml")
        self.truth, self.nominal = values(self.rig), values(self.sheet)

    def record(self, name, *arguments):
        return record(
            RIG, self.folder / f"{name}.bag", "--config", self.config, "--seed", self.seed, "--nuisance", *arguments
        )

    def variant(self, name, change):
        """The rig's own datasheet with something changed."""
        sheet = json.loads(json.dumps(self.sheet))
        change(sheet)
        return write_datasheet(sheet, self.folder / f"{name}.yaml")

    def true_leak(self, volts):
        return volts * self.truth["leak_valve_gain"] / self.nominal["flow_coefficient"]


def panel(rows, height):
    figure, axes = plt.subplots(rows, 1, figsize=(8, height), sharex=True, squeeze=False)
    return figure, axes[:, 0]


def save(figure, output, number):
    for axes in figure.axes:
        axes.legend(loc="upper right", frameon=False, fontsize=8, ncol=3)
    figure.savefig(output / f"servo_figure_{number}.png", dpi=110, bbox_inches="tight")
    plt.close(figure)


def tracking(bench, output):
    """Figs 5 to 7: simulated (nominal model, k_f = 80 1/s as in the paper) against the rig (k_f = 30 1/s)."""
    stiff = bench.variant("stiff", lambda sheet: sheet["controllers"]["position_control"].update(force_gain=80))
    runs = {
        "simulated": simulate(
            RIG, bench.folder, "--config", stiff, "--profile", "random", "--duration", 60, "--seed", bench.seed
        ),
        "rig": simulate(
            RIG,
            bench.folder,
            "--config",
            bench.config,
            "--nuisance",
            "--profile",
            "random",
            "--duration",
            60,
            "--seed",
            bench.seed,
        ),
    }
    figure, axes = panel(3, 7)
    numbers = {}
    for (name, run), colour in zip(runs.items(), (ORANGE, BLUE)):
        error = 1e3 * (run["position"] - run["position_reference"])
        settled, shown = run["t"] > 6, (run["t"] >= 15) & (run["t"] <= 25)
        t = run["t"][shown]
        axes[0].plot(t, 1e3 * run["position"][shown], color=colour, linewidth=1, label=name)
        axes[1].plot(t, error[shown], color=colour, linewidth=0.8, label=name)
        axes[2].plot(t, run["valve_command"][shown], color=colour, linewidth=0.8, label=name)
        numbers[name] = {
            "error_mm": [float(error[settled].min()), float(error[settled].max())],
            "error_rms_mm": float(np.sqrt(np.mean(error[settled] ** 2))),
            "valve_V": [float(run["valve_command"][settled].min()), float(run["valve_command"][settled].max())],
            "position_mm": [float(1e3 * run["position"][settled].min()), float(1e3 * run["position"][settled].max())],
        }
    axes[0].plot(
        t, 1e3 * runs["rig"]["position_reference"][shown], color=GREY, linewidth=1, linestyle="--", label="set point"
    )
    axes[0].set_ylabel("Fig 5: position, mm")
    axes[1].set_ylabel("Fig 6: error, mm")
    axes[2].set(ylabel="Fig 7: valve input, V", xlabel="time, s")
    save(figure, output, "5_6_7")
    return numbers


def course(series):
    return (
        series["t"],
        series["q.leak_coefficient"],
        series["q.leak_flow"] * LITRES,
        series["leak_flow"] * LITRES,
        series["leak_valve_command"],
    )


def leak_steps(bench, output):
    report, series = diagnose(bench.record("steps", "--fault", "internal_leak_steps", "--duration", 240), series=True)
    t, coefficient, flow, metered, volts = course(series)
    scaled = coefficient / bench.nominal["flow_coefficient"]
    figure, axes = panel(2, 5.5)
    axes[0].plot(t, scaled, color=BLUE, linewidth=0.7, label="estimated")
    axes[0].plot(t, bench.true_leak(volts), color=ORANGE, linewidth=1, label="this rig's valve")
    axes[0].set(ylabel="Fig 8: scaled leak coefficient", ylim=(-1, 4))
    axes[1].plot(t, metered, color=ORANGE, linewidth=0.7, label="flow meter")
    axes[1].plot(t, np.abs(flow), color=BLUE, linewidth=0.7, label="estimated")
    axes[1].set(ylabel="Fig 9: leak flow, l/s", xlabel="time, s", ylim=(0, 0.06))
    save(figure, output, "8_9")
    rows = []
    for begin, end, v in STEPS:
        inside = (t > begin + 10) & (t < end)
        rows.append(
            {
                "volts": v,
                "coefficient": float(scaled[inside].mean()),
                "true_coefficient": float(bench.true_leak(v)),
                "flow_lps": float(np.abs(flow[inside]).mean()),
                "metered_lps": float(metered[inside].mean()),
            }
        )
    return {"steps": rows, "sentence": report["sentence"]}


def leak_ramp(bench, output):
    report, series = diagnose(bench.record("ramp", "--fault", "internal_leak_ramp", "--duration", 240), series=True)
    t, coefficient, flow, metered, volts = course(series)
    scaled, true = coefficient / bench.nominal["flow_coefficient"], bench.true_leak(volts)
    figure, axes = panel(1, 3)
    axes[0].plot(t, scaled, color=BLUE, linewidth=0.7, label="estimated")
    axes[0].plot(t, true, color=ORANGE, linewidth=1, label="this rig's valve")
    axes[0].set(ylabel="Fig 10: scaled leak coefficient", xlabel="time, s", ylim=(-1, 4))
    save(figure, output, "10")
    late = t > 25
    alarm = next((a for a in report["alarms"] if a["effect"] == "orifice_leakage"), None)
    at = float(np.interp(alarm["raised"], [20, 220], [0, 5])) if alarm else None
    return {
        "error_rms": float(np.sqrt(np.mean((scaled - true)[late] ** 2))),
        "error_mean": float((scaled - true)[late].mean()),
        "alarm_raised_s": alarm and alarm["raised"],
        "volts_then": at,
        "lps_then": at and at * 0.0064,
    }


def small_leaks(bench, output):
    """One step each, read 15 to 40 s after it opened."""
    rows = []
    for volts in (0.25, 0.5, 1, 1.5, 2, 3, 4, 5):
        file = bench.record(
            "small", "--profile", "square", "--duration", 60, "--command", f"leak_valve_command:20=0,20.001={volts}"
        )
        report, series = diagnose(file, series=True)
        t, coefficient, flow, metered, _ = course(series)
        inside = (t > 35) & (t < 60)
        alarm = next((a for a in report["alarms"] if a["effect"] == "orifice_leakage"), None)
        rows.append(
            {
                "volts": volts,
                "metered_lps": float(metered[inside].mean()),
                "estimated_lps": float(np.abs(flow[inside]).mean()),
                "delay_s": alarm and alarm["raised"] - 20,
                "alarm_lps": alarm and [alarm["size"]["low"], alarm["size"]["value"], alarm["size"]["high"]],
            }
        )
    figure, axes = plt.subplots(figsize=(5, 3.6))
    metered, estimated = [r["metered_lps"] for r in rows], [r["estimated_lps"] for r in rows]
    axes.plot([0, 0.036], [0, 0.036], color=GREY, linewidth=1, linestyle=":", label="equal")
    axes.plot(metered, estimated, "o-", color=BLUE, markersize=4, linewidth=0.8, label="filter, mean over 25 s")
    found = [r for r in rows if r["alarm_lps"]]
    low, value, high = np.array([r["alarm_lps"] for r in found]).T
    axes.errorbar(
        [r["metered_lps"] for r in found],
        value,
        [value - low, high - value],
        fmt="s",
        color=ORANGE,
        markersize=3,
        linewidth=0.8,
        label="alarm with 90 % bounds",
    )
    axes.set(xlabel="flow meter, l/s", ylabel="leak, l/s")
    axes.legend(frameon=False, fontsize=8)
    figure.savefig(output / "servo_small_leaks.png", dpi=110, bbox_inches="tight")
    plt.close(figure)
    return rows


def sensitivity(bench, output):
    """Figs 11 and 12: the step to 5 V at 25 s for five values of Q55."""
    file = bench.record("q55", "--profile", "square", "--duration", 90, "--command", "leak_valve_command:25=0,25.001=5")
    figure, axes = panel(1, 3.4)
    rows = []
    for q, colour in zip(Q55, ("#0b3c5d", BLUE, GREEN, ORANGE, "#a23b3b")):
        config = bench.variant("q55", lambda sheet: sheet["estimators"][0]["process_noise"].__setitem__(4, q))
        series = diagnose(file, "--config", config, series=True)[1]
        t, scaled = series["t"], series["q.leak_coefficient"] / bench.nominal["flow_coefficient"]
        axes[0].plot(t, scaled, color=colour, linewidth=0.8, label=f"{q:g}")
        smooth = np.convolve(scaled, np.ones(9) / 9, "same")
        final = scaled[t > 70].mean()
        rise = t[(t > 25) & (smooth >= 0.9 * final)][0] - 25
        rows.append({"Q55": q, "rise_90_s": float(rise), "final": float(final), "scatter": float(scaled[t > 70].std())})
    axes[0].axhline(bench.true_leak(5), color=GREY, linestyle="--", linewidth=1)
    axes[0].set(xlabel="time, s", ylabel="Fig 11: scaled leak coefficient", xlim=(15, 60), ylim=(-0.5, 4))
    save(figure, output, "11")
    figure, axes = plt.subplots(figsize=(5, 3))
    axes.semilogx([r["Q55"] for r in rows], [r["rise_90_s"] for r in rows], "o-", color=BLUE)
    axes.set(xlabel="Q55", ylabel="Fig 12: time to 90 %, s", ylim=(0, None))
    figure.savefig(output / "servo_figure_12.png", dpi=110, bbox_inches="tight")
    plt.close(figure)
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=4, help="of the rig and of its runs")
    parser.add_argument("-o", "--output", default="docs/pictures")
    options = parser.parse_args()
    output = pathlib.Path(options.output)
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(folder, options.seed)
        answer = {
            name: work(bench, output)
            for name, work in {
                "tracking": tracking,
                "leak_steps": leak_steps,
                "leak_ramp": leak_ramp,
                "small_leaks": small_leaks,
                "sensitivity": sensitivity,
            }.items()
        }
    print(json.dumps(answer, indent=1))


if __name__ == "__main__":
    main()
