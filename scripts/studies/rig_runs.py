"""Runs of the program `faultline` for scripts that measure it: rigs off their datasheet, recordings as arrays, courses
of a diagnosis."""

import concurrent.futures
import json
import os
import pathlib
import random
import subprocess
import threading

import numpy as np
import yaml

ROOT = pathlib.Path(__file__).resolve().parents[2]
# Another build can be measured: FAULTLINE_PROGRAM names its program.
PROGRAM = pathlib.Path(os.environ.get("FAULTLINE_PROGRAM", ROOT / "catkin_ws/devel/lib/faultline/faultline"))
RIGS = sorted(folder.name for folder in (ROOT / "config").iterdir() if (folder / "rig.yaml").exists())


def faultline(*arguments):
    if not PROGRAM.exists():
        raise SystemExit("the program is not built; run ./faultline build first")
    done = subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"faultline {' '.join(map(str, arguments))}\n{done.stderr.strip()}")
    return done.stdout


def datasheet(rig):
    """Facts and stages in one, as --config takes them from a single file."""
    folder = ROOT / "config" / rig
    stages = yaml.safe_load((folder / "stages.yaml").read_text())
    for stage in stages["estimators"]:
        if "weights" in stage:  # a file beside them
            stage["weights"] = str(folder / stage["weights"])
    return {**yaml.safe_load((folder / "rig.yaml").read_text()), **stages}


def write_datasheet(sheet, file):
    file = pathlib.Path(file)
    file.write_text(yaml.safe_dump(sheet, sort_keys=False, allow_unicode=True, width=10000))
    return file


def drawn(sheet, seed):
    """A copy of the datasheet with parameters off by their tolerances, cut at two of them."""
    generator = random.Random(seed)
    copy = dict(sheet)
    copy["parameters"] = []
    for parameter in sheet["parameters"]:
        deviation = max(-2.0, min(2.0, generator.gauss(0, 1)))
        nominal = parameter["nominal"] * (1 + parameter["tolerance"] * deviation)
        copy["parameters"].append({**parameter, "nominal": float(f"{nominal:.9e}")})
    return copy


def other_noise(rig, seed, factor, folder):
    """Arguments of `simulate` with which each transducer's noise is 1/factor to factor times the datasheet's."""
    if factor == 1:
        return []
    generator = random.Random(seed)
    sheet = datasheet(rig)
    sheet["channels"] = [
        {**c, "noise_std": c.get("noise_std", 0) * factor ** generator.uniform(-1, 1)} for c in sheet["channels"]
    ]
    return ["--config", write_datasheet(sheet, pathlib.Path(folder) / "noise.yaml")]


def values(sheet):
    return {p["name"]: p["nominal"] for p in sheet["parameters"]}


def read_table(file):
    with open(file) as text:
        names = text.readline().strip().split(",")
    table = np.loadtxt(file, delimiter=",", skiprows=1, ndmin=2)
    return {name.split("[")[0]: table[:, i] for i, name in enumerate(names)}


def simulate(rig, folder, *arguments, name="run"):
    """A run as a mapping channel -> array."""
    file = pathlib.Path(folder) / f"{name}.csv"
    faultline("simulate", rig, *arguments, "--quiet", "-o", file)
    table = read_table(file)
    file.unlink()
    return table


def record(rig, file, *arguments):
    faultline("simulate", rig, *arguments, "--quiet", "--compression", "none", "-o", file)
    return file


def diagnose(file, *arguments, series=False):
    """The report of a recording; with series, also its course as a mapping column -> array."""
    file = pathlib.Path(file)
    report = file.with_suffix(".json")
    more = ["--series", file.with_suffix(".series.csv")] if series else []
    faultline("diagnose", file, *arguments, "--json", report, *more)
    answer = json.loads(report.read_text())
    report.unlink()
    if not series:
        return answer
    table = read_series(more[1])
    more[1].unlink()
    return answer, table


def read_series(file):
    with open(file) as text:
        names = text.readline().strip().split(",")
    table = np.genfromtxt(file, delimiter=",", skip_header=1)
    return {name: table[:, i] for i, name in enumerate(names)}


class Results:
    """What a study measured, one entry a line of FILE: a study that was stopped goes on where it was."""

    def __init__(self, file):
        self.file = pathlib.Path(file)
        self.file.parent.mkdir(parents=True, exist_ok=True)
        lines = self.file.read_text().splitlines() if self.file.exists() else []
        self.all = {}
        self.lock = threading.Lock()
        for line in lines:
            try:
                entry = json.loads(line)
            except json.JSONDecodeError:  # it was stopped while it wrote
                continue
            self.all[entry["name"]] = entry

    def once(self, name, measure):
        """What measure() gives, or gave when it was done before."""
        if name not in self.all:
            entry = {"name": name, **measure()}
            with self.lock, open(self.file, "a") as file:
                file.write(json.dumps(entry) + "\n")
            self.all[name] = entry
        return self.all[name]


def on_all_cores(function, tasks):
    """What function(*task) gives, in the order of the tasks; FAULTLINE_JOBS at once, else as many as there are cores.
    Ctrl-C leaves those that run their end."""
    with concurrent.futures.ThreadPoolExecutor(int(os.environ.get("FAULTLINE_JOBS") or os.cpu_count())) as pool:
        try:
            yield from pool.map(lambda task: function(*task), tasks)
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


def named_alarms(report):
    """Of a report what studies of reliability count by: its alarms without words, and the course of evidence."""
    keys = ("kind", "effect", "port", "since", "raised", "until", "active", "confidence", "equivalent", "text")
    return {
        "verdict": report["verdict"],
        "sentence": report["sentence"],
        "duration": report["duration"],
        "alarms": [{**{key: alarm[key] for key in keys}, "size": alarm["size"]} for alarm in report["alarms"]],
        "evidence": [[r["stage"], r["time"], r["evidence"], r["threshold"]] for r in report["rankings"]],
    }
