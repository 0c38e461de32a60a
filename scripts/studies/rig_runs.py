"""Runs of the program `faultline` for scripts that measure it: rigs off their datasheet, recordings as arrays, courses
of a diagnosis."""

import json
import pathlib
import random
import subprocess

import numpy as np
import yaml

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROGRAM = ROOT / "catkin_ws/devel/lib/faultline/faultline"


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
