"""The recordings that stand for those of Kilic et al. (2014): the preset paper_rig, 50 001 samples each; errors in
MPa."""

import pathlib
import sys

import numpy as np
import yaml

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))
from rig_runs import faultline, read_table, record

RIG = "pump_cylinder"
PRESSURES = {"P_A": "chamber_a_pressure", "P_B": "chamber_b_pressure"}
RUNS = {"training": ("chirp", 1), "validation1": ("validation", 2), "validation2": ("validation", 3)}
BLUE, ORANGE, GREY, GREEN = "#1f5f99", "#d1741b", "#8a9199", "#3f7d4e"


def published():
    return yaml.safe_load((pathlib.Path(__file__).parent / "published.yaml").read_text())


def paper_run(folder, name):
    """The bag of a run and its channels as arrays."""
    profile, seed = RUNS[name]
    bag = pathlib.Path(folder) / f"{name}.bag"
    record(RIG, bag, "--fault", "paper_rig", "--nuisance", "--profile", profile, "--seed", seed)
    table = bag.with_suffix(".csv")
    faultline("export", bag, "-o", table)
    return bag, read_table(table)


def rms(a, b):
    return float(np.sqrt(np.mean((a - b) ** 2))) / 1e6


def errors(run, estimate):
    return {symbol: rms(run[channel], estimate[channel]) for symbol, channel in PRESSURES.items()}
