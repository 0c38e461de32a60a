#!/usr/bin/env python3
"""What histograms learn of a rig from its healthy recordings, and what they find in others.

histograms.py STUDY.yaml [--json FILE]

STUDY.yaml names the rig, stages for its datasheet (estimators of type histogram, isolators or none), the recordings to
learn from, in turn, and those to judge: files of bags/, or `simulate` and its options. Per recording: of every observed
variable the largest share of time above and below its limits, and the alarms."""

import argparse
import json
import pathlib
import tempfile

import yaml

import rig_runs


def recording(rig, text, folder):
    if text.startswith("simulate "):
        return rig_runs.record(rig, pathlib.Path(folder) / "run.bag", *text.split()[1:])
    return rig_runs.ROOT / "bags" / text


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("study")
    parser.add_argument("--json")
    arguments = parser.parse_args()
    study = yaml.safe_load(pathlib.Path(arguments.study).read_text())
    rig = study["rig"]
    facts = yaml.safe_load((rig_runs.ROOT / "config" / rig / "rig.yaml").read_text())
    result = {}
    with tempfile.TemporaryDirectory() as folder:
        sheet = rig_runs.write_datasheet({**facts, **study["stages"]}, pathlib.Path(folder) / "sheet.yaml")
        learnt = pathlib.Path(folder) / "learnt.reference"
        for text in study["learn"]:
            before = ["--reference", learnt] if learnt.exists() else []
            more = learnt.with_suffix(".more")
            run = recording(rig, text, folder)
            rig_runs.faultline("diagnose", run, "--config", sheet, *before, "--keep-reference", more)
            more.replace(learnt)
        for name, text in study["judge"].items():
            run = recording(rig, text, folder)
            target = pathlib.Path(folder) / "judged.bag"
            target.write_bytes(run.read_bytes())
            report, series = rig_runs.diagnose(target, "--config", sheet, "--reference", learnt, series=True)
            shares = {}
            for column, values in series.items():
                if column.endswith((".above", ".below")):
                    shares[column[2:]] = float(values.max())
            result[name] = {"shares": shares, "alarms": [(a["raised"], a["text"]) for a in report["alarms"]]}
            least = study.get("share_worth_telling", 0.15)
            told = ", ".join(f"{key} {value:.2f}" for key, value in shares.items() if value >= least) or "none"
            print(f"{name} ({text})\n  beyond for {least:g} of the window or more: {told}")
            for raised, words in result[name]["alarms"]:
                print(f"  {raised:.1f} s: {words}")
    if arguments.json:
        pathlib.Path(arguments.json).write_text(json.dumps(result, indent=1))


if __name__ == "__main__":
    main()
