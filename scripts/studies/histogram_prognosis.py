#!/usr/bin/env python3
"""When will a variable reach the end of its range? Prognoses of histograms on ramps, against when it did.

histogram_prognosis.py STUDY.yaml [--rows] [--picture FILE.png] [--json FILE] [--keep FOLDER]

STUDY.yaml as of histograms.py, with `settings` for its histograms (a horizon, ends), `profiles` beside those of the
rig's datasheet, and per entry of `judge` the variable that drifts, which `end` it reaches, the `run` with {seed} in it
and its `seeds`, and `held`: the same drift at the operating point that lies nearest to the end. The truth is when the
variable spends `share` of the time beyond the end there, for `stay` s: what a histogram's limit means. From the onset
on the prognosis is asked at tenths of the time that is left; told are the error and whether the interval held.

With `rigs`, a list, everything is done for each rig in turn, whose number stands for {rig} in `learn`, `run` and
`held`. `ranges` widens effects of the datasheet: {port: {effect: {parameter: [low, high]}}}. Printed are, per entry of
`judge`, how often a time was told (also in the second half of what was left), how often the interval held, where not,
and the median error; with --rows also each time that was asked."""

import argparse
import json
import pathlib
import sys
import tempfile

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import histograms
import rig_runs

NEVER = 1e9  # s, as the quantities have it
TENTHS = np.arange(1, 10) / 10


def reached(time, values, end, upwards, share, stay):
    """When the variable began to be beyond its end for that share of every `stay` s to come."""
    beyond = np.concatenate([[0], np.cumsum(values >= end if upwards else values <= end)])
    last = np.minimum(np.searchsorted(time, time + stay), len(time))
    first = np.arange(len(time))
    enough = (beyond[last] - beyond[first] >= share * (last - first)) & (time + stay <= time[-1])
    return float(time[np.argmax(enough)]) if enough.any() else None


def columns(file, names):
    with open(file) as text:
        head = text.readline().strip().split(",")
        rows = np.loadtxt(text, delimiter=",", usecols=[head.index(name) for name in names], ndmin=2)
    return dict(zip(names, rows.T))


def truth(study, entry, rig):
    """When the end is reached in the run of `held`, which nothing needs to judge; None: not in that time."""
    file = study.folder / "held.csv"
    how = ["--config", study.made_by, *entry["held"].format(rig=rig).split()[1:]]
    rig_runs.faultline("simulate", study.rig, *how, "--quiet", "-o", file)
    series = columns(file, ["t", entry["variable"]])
    time, values = series["t"], series[entry["variable"]]
    upwards = entry["end"] >= np.median(values[: len(values) // 10])
    return reached(time, values, entry["end"], upwards, study.study["share"], study.study["stay"])


def score(series, entry, at):
    time, variable, rows = series["t"], entry["variable"], []
    for tenth in TENTHS:
        now = entry["onset"] + tenth * (at - entry["onset"])
        k = int(np.searchsorted(time, now))
        value, low, high = (float(series[f"q.{variable}.saturation{part}"][k]) for part in ("", "_low", "_high"))
        rows.append({"tenth": float(tenth), "left": at - time[k], "value": value, "low": low, "high": high})
    return rows


def words(seconds):
    return "-" if seconds >= NEVER else f"{seconds:.0f}"


def holds(row):
    return row["low"] <= row["left"] <= row["high"]


def summary(rows):
    told = [r for r in rows if r["value"] < NEVER]
    late = [r for r in rows if r["tenth"] > 0.5]
    errors = sorted(abs(r["value"] / r["left"] - 1) for r in told)
    return [
        f"{len(told)} of {len(rows)}",
        f"{sum(r['value'] < NEVER for r in late)} of {len(late)}",
        f"{sum(map(holds, told))} ({sum(map(holds, told)) / max(1, len(told)):.0%})",
        str(sum(r["left"] < r["low"] for r in told)),
        str(sum(r["left"] > r["high"] for r in told)),
        f"{errors[len(errors) // 2]:.0%}" if errors else "-",
    ]


def measure(study, rig, show):
    """{(entry of judge, rig, seed): when the end was reached, and what was told before}"""
    result = {}
    sheet, learnt = study.learn(rig, **study.study["settings"])
    for name, entry in study.study["judge"].items():
        at = truth(study, entry, rig)
        if at is None:
            print(f"{name}, rig {rig}: left out, the end is not reached; simulate longer", file=sys.stderr)
            continue
        for seed in entry["seeds"]:
            run = study.recording(entry["run"].format(rig=rig, seed=seed))
            file = study.folder / "judged.csv"
            rig_runs.diagnose(run, "--config", sheet, "--reference", learnt, "--series", file)
            told = [f"q.{entry['variable']}.saturation{part}" for part in ("", "_low", "_high")]
            rows = score(columns(file, ["t", *told]), entry, at)
            result[name, rig, seed] = {"reached": at, "rows": rows}
            if show:
                told = [f"{r['left']:.0f}: {words(r['value'])} ({words(r['low'])} to {words(r['high'])})" for r in rows]
                print(f"| {name}, {seed} | {at:.0f} | {'; '.join(told)} |", flush=True)
    return result


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("study")
    parser.add_argument("--picture")
    parser.add_argument("--json")
    parser.add_argument("--rows", action="store_true")
    parser.add_argument("--keep", metavar="FOLDER", help="where recordings stay and are used again")
    arguments = parser.parse_args()
    measured = {}
    with tempfile.TemporaryDirectory() as folder:
        study = histograms.Study(arguments.study, folder, arguments.keep)
        if arguments.rows:
            print("| ramp | reached after, s | left, s: told (90 %) |\n|---|---|---|")
        for rig in study.study.get("rigs", [None]):
            measured.update(measure(study, rig, arguments.rows))
    heads = "| ramps | told | in the second half | held | earlier than the interval | later | median error |"
    print(f"\n{heads}\n{'|---' * 7}|")
    for name in study.study["judge"]:
        rows = [r for key, entry in measured.items() if key[0] == name for r in entry["rows"]]
        if rows:
            print(f"| {name} | {' | '.join(summary(rows))} |")
    print(f"| all | {' | '.join(summary([r for entry in measured.values() for r in entry['rows']]))} |")
    result = {", ".join(str(part) for part in key if part is not None): entry for key, entry in measured.items()}
    if arguments.picture:
        down = -(-len(result) // 4)
        figure, axes = plt.subplots(down, 4, figsize=(13, 3 * down), layout="constrained", squeeze=False)
        for axis in axes.flat[len(result) :]:
            axis.axis("off")
        for axis, (name, entry) in zip(axes.flat, result.items()):
            left = [r["left"] for r in entry["rows"]]
            most = 2.5 * left[0]
            axis.plot(left, left, "k--", label="true")
            for r in entry["rows"]:
                if r["low"] < most:
                    axis.plot([r["left"]] * 2, [r["low"], min(r["high"], most)], "C0-", linewidth=4, alpha=0.35)
                if r["value"] < NEVER:
                    axis.plot(r["left"], min(r["value"], most), "C0o")
            axis.set_xlabel("s left")
            axis.set_ylim(0, most)
            axis.invert_xaxis()
            axis.set_title(name, fontsize=9)
        axes[0, 0].set_ylabel("s left as told, with 90 % interval")
        figure.savefig(arguments.picture, dpi=110)
    if arguments.json:
        pathlib.Path(arguments.json).write_text(json.dumps(result, indent=1))


if __name__ == "__main__":
    main()
