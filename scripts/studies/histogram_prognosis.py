#!/usr/bin/env python3
"""When will a variable reach the end of its range? Prognoses of histograms on ramps, against when it did.

histogram_prognosis.py STUDY.yaml [--picture FILE.png] [--json FILE]

STUDY.yaml as of histograms.py, with `settings` for its histograms (a horizon, ends), `profiles` beside those of the
rig's datasheet, and per entry of `judge` the variable that drifts, which `end` it reaches, the `run` with {seed} in it
and its `seeds`, and `held`: the same drift at the operating point that lies nearest to the end. The truth is when the
variable spends `share` of the time beyond the end there, for `stay` s: what a histogram's limit means. From the onset
on the prognosis is asked at tenths of the time that is left; told are the error and whether the interval held."""

import argparse
import json
import pathlib
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


def truth(study, sheet, entry):
    rows = ["--series-rows", 100000]
    _, series = rig_runs.diagnose(study.recording(entry["held"]), "--config", sheet, *rows, series=True)
    time, values = series["t"], series[entry["variable"]]
    upwards = entry["end"] >= np.median(values[: len(values) // 10])
    at = reached(time, values, entry["end"], upwards, study.study["share"], study.study["stay"])
    if at is None:
        raise SystemExit(f"{entry['variable']} did not reach {entry['end']:g}; simulate longer")
    return at


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


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("study")
    parser.add_argument("--picture")
    parser.add_argument("--json")
    parser.add_argument("--keep", metavar="FOLDER", help="where recordings stay and are used again")
    arguments = parser.parse_args()
    result = {}
    with tempfile.TemporaryDirectory() as folder:
        study = histograms.Study(arguments.study, folder, arguments.keep)
        sheet, learnt = study.learn(**study.study["settings"])
        print("| ramp | reached after, s | left, s: told (90 %) |\n|---|---|---|")
        for name, entry in study.study["judge"].items():
            at = truth(study, sheet, entry)
            for seed in entry["seeds"]:
                run = study.recording(entry["run"].format(seed=seed))
                _, series = rig_runs.diagnose(run, "--config", sheet, "--reference", learnt, series=True)
                rows = score(series, entry, at)
                result[f"{name}, {seed}"] = {"reached": at, "rows": rows}
                told = [f"{r['left']:.0f}: {words(r['value'])} ({words(r['low'])} to {words(r['high'])})" for r in rows]
                print(f"| {name}, {seed} | {at:.0f} | {'; '.join(told)} |", flush=True)
    rows = [r for entry in result.values() for r in entry["rows"] if r["value"] < NEVER]
    held = sum(r["low"] <= r["left"] <= r["high"] for r in rows)
    errors = sorted(abs(r["value"] / r["left"] - 1) for r in rows)
    if rows:
        middle = errors[len(errors) // 2]
        print(f"told in {len(rows)} of {9 * len(result)}; interval held {held}; median error {middle:.0%}")
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
