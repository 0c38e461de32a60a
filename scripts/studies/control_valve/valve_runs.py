"""Runs of the rig control_valve that its histograms learn from and judge, for the studies beside this file. A valve is
a number: the seed of its parameters within their tolerances. What is done lies in a folder named by the stages, the rig
and the hours of learning, so that a study that was stopped goes on where it was and no number is taken for another
setting's."""

import contextlib
import hashlib
import json
import os
import pathlib
import re
import sys

import numpy as np
import yaml

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))
import rig_runs  # noqa: E402

RIG = "control_valve"
SIGNS = {"high": 1, "low": -1, "high and low in turn": "+-1"}
PUBLISHED = yaml.safe_load((pathlib.Path(__file__).parent / "published.yaml").read_text())


def histograms_alone(sheet):
    """With these stages only: those that run the model cost hours on such runs."""
    chosen = {**sheet, "detectors": []}
    chosen["estimators"] = [stage for stage in sheet["estimators"] if stage["type"] == "histogram"]
    chosen["isolators"] = [stage for stage in sheet["isolators"] if stage["type"] == "chain"]
    return chosen


STAGES = ("estimators", "detectors", "isolators")


class Valves:
    """Valves of one datasheet with its stages, and what was measured on them; `always`: of every simulation. With
    `keep`, a folder, recordings stay there by what they were made of, whatever the stages, as bags of 25 MB an hour;
    else they are CSV, larger, but written in half the processor time."""

    def __init__(self, work, hours, sheet, always=(), keep=None):
        sheet = histograms_alone(sheet)
        facts = {key: value for key, value in sheet.items() if key not in STAGES}
        made = hashlib.sha256(json.dumps([facts, *always], sort_keys=True).encode()).hexdigest()[:12]
        self.kept = pathlib.Path(keep) / made if keep else None
        told = json.dumps([sheet, hours, *always], sort_keys=True)
        mark = hashlib.sha256(told.encode()).hexdigest()[:12]
        self.hours, self.always = hours, always
        self.demand_flow = sheet["controllers"]["flow"]["demand_flow"]
        self.folder = pathlib.Path(work) / mark
        self.folder.mkdir(parents=True, exist_ok=True)
        self.sheet = rig_runs.write_datasheet(sheet, self.folder / "sheet.yaml")

    def once(self, name, measure):
        """What measure() gives, or gave when it was done before."""
        file = self.folder / f"{name}.json"
        if not file.exists():
            part = file.with_suffix(".part")
            part.write_text(json.dumps(measure()))
            part.rename(file)
        return json.loads(file.read_text())

    def record(self, valve, seed, seconds, *more, sheet=None):
        form = [] if not self.kept else ["--compression", "lz4"]
        name = f"{valve}_{seed}_{os.getpid()}{'.bag' if self.kept else '.csv'}"  # studies may run at a time
        file = self.folder / name
        valve = ["--config", sheet or self.sheet, "--off-nominal", "--rig-seed", valve, "--nuisance", "--seed", seed]
        form += ["--duration", seconds, "--quiet", "-o", file]
        rig_runs.faultline("simulate", RIG, *valve, *more, *self.always, *form)
        return file

    @contextlib.contextmanager
    def recording(self, valve, seed, seconds, *effects, sheet=None):
        """Of the profile `paper`, for as long as it is looked at, or kept."""
        words = [word for effect in effects for word in ("--effect", effect)]
        mark = "".join(f"_{hashlib.sha256(effect.encode()).hexdigest()[:8]}" for effect in effects)
        file = self.kept / f"{valve}_{seed}_{seconds:g}{mark}.bag" if self.kept and not sheet else None
        if file and file.exists():
            yield file
            return
        run = self.record(valve, seed, seconds, "--profile", "paper", *words, sheet=sheet)
        if file:
            self.kept.mkdir(parents=True, exist_ok=True)
            run = run.rename(file)
        yield run
        if not file:
            run.unlink()

    def learnt(self, valve):
        """The file of what this valve learnt of its healthy run."""
        file = self.folder / f"{valve}.reference"
        if not file.exists():
            part = file.with_suffix(".part")
            with self.recording(valve, 10 * valve, 3600 * self.hours) as run:
                how = ["--rig", RIG, "--config", self.sheet]
                rig_runs.faultline("diagnose", run, *how, "--keep-reference", part)
            part.rename(file)
        return file

    def judge(self, valve, run, more=()):
        how = ["--rig", RIG, "--config", self.sheet]
        return rig_runs.diagnose(run, *how, "--reference", self.learnt(valve), *more)


def told(report):
    """Alarms of the chain."""
    return [alarm for alarm in report["alarms"] if alarm["kind"] in ("fault", "sensor", "unknown")]


def pattern(text):
    """The modules that an alarm's text names; variable -> sign."""
    places, _, shifts = text.partition(": shifted are ")
    signs = {}
    for part in shifts.split(", "):
        found = re.fullmatch(r"(\w+) (high and low in turn|high|low)", part)
        if found:
            signs[found.group(1)] = SIGNS[found.group(2)]
    named = set() if "names no place" in text else set(places.lower().split(" and "))
    return named, signs


def course(valves, valve, run, columns, seconds):
    """Report of a run, and a mapping column of the diagnosis's series -> array, some six rows a second."""
    file = run.with_suffix(".series.csv")
    report = valves.judge(valve, run, more=["--series", file, "--series-rows", max(100, 10 * seconds)])
    with open(file) as text:
        names = text.readline().strip().split(",")
        rows = np.loadtxt(text, delimiter=",", usecols=[names.index(c) for c in columns], ndmin=2)
    file.unlink()
    return report, {name: rows[:, i] for i, name in enumerate(columns)}


CONTROL = ["t", "flow_setpoint", "flow", "valve_setpoint", "valve_position"]


def control_error(rows, full=0.028, length=300, settling=15):
    """Ends of stretches of `length` s, and per stretch the RMS of position and flow from their set points, relative to
    the range of these (`full`: the flow of the highest demand), from `settling` s after each step on."""
    t, goal = rows["t"], rows["flow_setpoint"]
    second = max(1, int(round(1 / np.median(np.diff(t)))))
    moved = np.zeros(len(t), bool)
    moved[second:] = np.abs(goal[second:] - goal[:-second]) > 1.1e-3  # far more than its noise
    settled = t - np.maximum.accumulate(np.where(moved, t, t[0])) > settling
    position, flow = rows["valve_position"] - rows["valve_setpoint"], (rows["flow"] - goal) / full
    ends = np.arange(length, t[-1] + 1, length)
    answers = []
    for end in ends:
        part = settled & (t >= end - length) & (t < end)
        answers.append([float(np.sqrt(np.mean(x[part] ** 2))) if part.any() else 0.0 for x in (position, flow)])
    return ends, np.array(answers)
