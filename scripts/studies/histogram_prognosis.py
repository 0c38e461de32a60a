#!/usr/bin/env python3
"""When will a variable reach the end of its range? Prognoses of histograms on ramps, against when it did.

histogram_prognosis.py STUDY.yaml [--picture FILE.png] [--json FILE]

STUDY.yaml as of histograms.py, with `settings` for its histograms (a horizon, ends) and per entry of `judge` the
variable that drifts, which `end` it reaches, and the run. It has reached it when it touches the end in every stretch
of the series (some seconds) for `stay` s. From the onset on the prognosis is asked at tenths of the time that is left;
told are the error and whether the interval held."""

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


def reached(time, values, end, upwards, stay):
    """When the variable began to touch the end again and again; none if it did not. A long series has its extremes in
    rows of two."""
    beyond = values >= end if upwards else values <= end
    even = len(beyond) // 2 * 2
    touched = beyond[:even].reshape(-1, 2).any(axis=1)
    first = None
    for t, now in zip(time[:even:2], touched):
        first = (t if first is None else first) if now else None
        if first is not None and t - first >= stay:
            return first
    return None


def score(series, entry, stay):
    time, variable = series["t"], entry["variable"]
    end = entry["end"]
    at = reached(time, series[variable], end, end >= np.median(series[variable][: len(time) // 10]), stay)
    if at is None:
        raise SystemExit(f"{variable} did not reach {end:g}; simulate longer")
    rows = []
    for tenth in TENTHS:
        now = entry["onset"] + tenth * (at - entry["onset"])
        k = int(np.searchsorted(time, now))
        value, low, high = (float(series[f"q.{variable}.saturation{part}"][k]) for part in ("", "_low", "_high"))
        rows.append({"tenth": float(tenth), "left": at - time[k], "value": value, "low": low, "high": high})
    return at, rows


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
            run = study.recording(entry["run"])
            _, series = rig_runs.diagnose(run, "--config", sheet, "--reference", learnt, series=True)
            at, rows = score(series, entry, study.study["stay"])
            result[name] = {"reached": at, "rows": rows, "series": {k: series[k].tolist() for k in ("t",)}}
            told = [f"{r['left']:.0f}: {words(r['value'])} ({words(r['low'])} to {words(r['high'])})" for r in rows]
            print(f"| {name} | {at:.0f} | {'; '.join(told)} |", flush=True)
    rows = [r for entry in result.values() for r in entry["rows"] if r["value"] < NEVER]
    held = sum(r["low"] <= r["left"] <= r["high"] for r in rows)
    errors = sorted(abs(r["value"] / r["left"] - 1) for r in rows)
    if rows:
        middle = errors[len(errors) // 2]
        print(f"told in {len(rows)} of {9 * len(result)}; interval held {held}; median error {middle:.0%}")
    if arguments.picture:
        figure, axes = plt.subplots(1, len(result), figsize=(4 * len(result), 3.4), layout="constrained")
        for axis, (name, entry) in zip(np.atleast_1d(axes), result.items()):
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
        np.atleast_1d(axes)[0].set_ylabel("s left as told, with 90 % interval")
        figure.savefig(arguments.picture, dpi=110)
    if arguments.json:
        pathlib.Path(arguments.json).write_text(json.dumps(result, indent=1))


if __name__ == "__main__":
    main()
