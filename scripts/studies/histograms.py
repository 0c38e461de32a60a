#!/usr/bin/env python3
"""What histograms learn of a rig from its healthy recordings, and what they find in others.

histograms.py STUDY.yaml [--picture FILE.png] [--json FILE]
histograms.py STUDY.yaml --vary KEY=A,B,.. [--vary ..] [--picture FILE.png] [--json FILE]

STUDY.yaml names the rig; its stages, written out or (`own`) names of those in the rig's stages.yaml; the recordings to
learn from, in turn; and those to judge: files of bags/, or `simulate` and its options. Per recording: of every observed
variable the largest share of time above and below its limits, and the alarms. Those whose names begin with `healthy`
say how large a share is without a fault.

With --vary, the same for other values of the histograms' settings, each by itself: the largest share of a healthy
recording, and of each other one the largest share beyond what healthy ones have in that variable."""

import argparse
import json
import pathlib
import tempfile
import zlib

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import yaml

import rig_runs

SIDES = ["above", "below"]


def stages_of(study):
    given = study["stages"]
    if "own" not in given:
        return dict(given)
    names = given["own"]
    own = yaml.safe_load((rig_runs.ROOT / "config" / study["rig"] / "stages.yaml").read_text())
    kinds = ("estimators", "detectors", "isolators")
    return {kind: [s for s in own.get(kind) or [] if s["name"] in names] for kind in kinds}


class Study:
    """Recordings are made once; every setting learns and judges the same ones."""

    def __init__(self, path, folder, keep=None):
        self.study, self.folder = yaml.safe_load(pathlib.Path(path).read_text()), pathlib.Path(folder)
        self.rig = self.study["rig"]
        self.facts = yaml.safe_load((rig_runs.ROOT / "config" / self.rig / "rig.yaml").read_text())
        self.kept = pathlib.Path(keep or folder)
        self.kept.mkdir(exist_ok=True)
        self.facts["profiles"] = self.facts["profiles"] + self.study.get("profiles", [])
        for port, effects in self.study.get("ranges", {}).items():
            for effect, ranges in effects.items():
                self.facts["ports"][port]["effects"][effect].update(ranges)
        self.made_by = rig_runs.write_datasheet(self.facts, self.kept / "facts.yaml")

    def recording(self, text):
        if not text.startswith("simulate "):
            return rig_runs.ROOT / "bags" / text
        file = self.kept / f"{self.rig}_{zlib.crc32(text.encode()):08x}.bag"
        if not file.exists():
            words = ["--config", self.made_by, *text.split()[1:]]
            rig_runs.record(self.rig, file.with_suffix(".part.bag"), *words).replace(file)
        return file

    def learn(self, drawn=None, **settings):
        """(datasheet, reference); `drawn`: what stands for {rig} in the recordings to learn from."""
        stages = stages_of(self.study)
        stages["estimators"] = [{**s, **settings} for s in stages["estimators"]]
        sheet = rig_runs.write_datasheet({**self.facts, **stages}, self.folder / "sheet.yaml")
        learnt, more = self.folder / "learnt.reference", self.folder / "learnt.more"
        learnt.unlink(missing_ok=True)
        for text in self.study["learn"]:
            before = ["--reference", learnt] if learnt.exists() else []
            run = self.recording(text.format(rig=drawn))
            rig_runs.faultline("diagnose", run, "--config", sheet, *before, "--keep-reference", more)
            more.replace(learnt)
        return sheet, learnt

    def judge(self, **settings):
        """{recording: {"shares": {variable: [above, below]}, "alarms": [(time, text)]}}"""
        sheet, learnt = self.learn(**settings)
        result = {}
        for name, text in self.study["judge"].items():
            target = self.folder / "judged.bag"
            target.write_bytes(self.recording(text).read_bytes())
            report, series = rig_runs.diagnose(target, "--config", sheet, "--reference", learnt, series=True)
            shares = {}
            for column, values in series.items():
                variable, _, side = column[2:].rpartition(".")
                if side in SIDES:
                    shares.setdefault(variable, [0, 0])[SIDES.index(side)] = float(values.max())
            result[name] = {"shares": shares, "alarms": [(a["raised"], a["text"]) for a in report["alarms"]]}
        return result


def usual(result):
    """Largest shares of the healthy recordings: {variable: [above, below]}"""
    healthy = [r["shares"] for name, r in result.items() if name.startswith("healthy")]
    return {v: [max(h[v][k] for h in healthy) for k in (0, 1)] for v in healthy[0]}


def told(result, least):
    """Markdown: per recording the variables beyond their limits for `least` more of the window than in healthy ones."""
    base = usual(result)
    isolated = any(found["alarms"] for found in result.values())
    lines = ["| recording | beyond the limits, share of the window |" + " alarms |" * isolated]
    lines.append("|---|---|" + "---|" * isolated)
    for name, found in result.items():
        words = [
            (share - (0 if name.startswith("healthy") else base[v][k]), f"{v} {('high', 'low')[k]} {share:.2f}")
            for v, both in found["shares"].items()
            for k, share in enumerate(both)
        ]
        words = [text for more, text in sorted(words, reverse=True) if more >= least]
        alarms = "; ".join(f"{at:.0f} s: {text}" for at, text in found["alarms"]) or "-"
        lines.append(f"| {name} | {', '.join(words) or '-'} |" + f" {alarms} |" * isolated)
    return "\n".join(lines)


def draw(result, path, title):
    names = list(result)
    variables = list(result[names[0]]["shares"])
    high, low = (np.array([[result[n]["shares"][v][k] for v in variables] for n in names]) for k in (0, 1))
    figure, axis = plt.subplots(figsize=(2.8 + 0.62 * len(variables), 1.8 + 0.42 * len(names)), layout="constrained")
    shown = axis.imshow(np.where(high >= low, high, -low), cmap="RdBu_r", vmin=-1, vmax=1, aspect="auto")
    for i in range(len(names)):
        for k in range(len(variables)):
            parts = [f"{s}{v[i, k]:.2f}"[0:5] for s, v in (("+", high), ("-", low)) if v[i, k] >= 0.05]
            dark = max(high[i, k], low[i, k]) > 0.6
            axis.text(k, i, "\n".join(parts), ha="center", va="center", fontsize=7, color="white" if dark else "black")
    axis.set_xticks(range(len(variables)), variables, rotation=40, ha="right", fontsize=8)
    axis.set_yticks(range(len(names)), names, fontsize=8)
    axis.set_title(title, fontsize=9)
    scale = figure.colorbar(shown, fraction=0.04)
    scale.set_label("largest share of the window\nabove (+), below (-) the limits", fontsize=8)
    scale.ax.tick_params(labelsize=8)
    figure.savefig(path, dpi=110)


def vary(study, changes, picture):
    rows, curves = [], {}
    for key, values in changes:
        for value in values:
            result = study.judge(**{key: value})
            base = usual(result)
            row = {"setting": key, "value": value, "healthy": max(max(both) for both in base.values())}
            for name, found in result.items():
                if not name.startswith("healthy"):
                    pairs = [(s, base[v][k]) for v, both in found["shares"].items() for k, s in enumerate(both)]
                    row[name] = max(s - b for s, b in pairs)
            if not rows:
                print("|", " | ".join(row), "|\n" + "|---" * len(row) + "|")
            rows.append(row)
            numbers = [f"{v:.2f}" for k, v in row.items() if k not in ("setting", "value")]
            print("|", " | ".join([key, f"{value:g}", *numbers]), "|", flush=True)
    if picture:
        size = (4.2 * len(changes), 3.6)
        figure, axes = plt.subplots(1, len(changes), figsize=size, layout="constrained", sharey=True)
        for axis, (key, values) in zip(np.atleast_1d(axes), changes):
            for name in list(rows[0])[2:]:
                axis.plot(
                    values,
                    [r[name] for r in rows if r["setting"] == key],
                    "k--" if name == "healthy" else "o-",
                    label="largest of healthy" if name == "healthy" else name,
                )
            axis.set_xscale("log", base=2)
            axis.set_xlabel(key)
        np.atleast_1d(axes)[0].set_ylabel("share of the window beyond healthy ones")
        np.atleast_1d(axes)[-1].legend(fontsize=7)
        figure.savefig(picture, dpi=110)
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("study")
    parser.add_argument("--vary", action="append", default=[], metavar="KEY=A,B")
    parser.add_argument("--picture")
    parser.add_argument("--json")
    parser.add_argument("--keep", metavar="FOLDER", help="where recordings stay and are used again")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        study = Study(arguments.study, folder, arguments.keep)
        if arguments.vary:
            changes = [(k, [float(x) for x in v.split(",")]) for k, v in (text.split("=") for text in arguments.vary)]
            result = vary(study, changes, arguments.picture)
        else:
            result = study.judge()
            print(told(result, study.study.get("share_worth_telling", 0.1)))
            if arguments.picture:
                draw(result, arguments.picture, f"{study.rig}: shares beyond the limits that histograms learnt")
    if arguments.json:
        pathlib.Path(arguments.json).write_text(json.dumps(result, indent=1))


if __name__ == "__main__":
    main()
