"""What the withheld check takes from the project: the datasheet of a rig, config/<rig>/rig.yaml, and nothing else.

Only channels, parameters, ports, constants and the sample period are read. Everything the truth computes with these
numbers is written here a second time, on purpose.
"""
import copy
import os

import yaml

# Candidates of `gap` that no truth has as an effect to be found; its friction and valves may be so by nature.
NOT_IN_TRUTH = {"presliding_friction", "second_order_lag", "underlap", "flow_exponent", "overflow"}
NOT_IN_TRUTH_AT = {"hysteresis@sensor.load_pressure"}

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))


def _number(value):
    """YAML 1.1 readers take 1e+6 (no dot) for text; datasheets are written by hand."""
    return float(value)


def _branched(sheet):
    """Entries named with {b} once for each branch, numbers given by branch as that branch's."""
    branches = [str(b) for b in sheet.get("branches", [])]

    def each(entry, name):
        if "{b}" not in name:
            return [(name, entry)]
        one = lambda b: {k: v[b] if isinstance(v, dict) and b in v else v for k, v in entry.items()}
        return [(name.replace("{b}", b), one(b)) for b in branches]

    for part in ("channels", "parameters"):
        sheet[part] = [dict(one, name=name) for entry in sheet[part] for name, one in each(entry, entry["name"])]
    of = lambda entry: next((n for n, b in enumerate(branches) if entry["name"].startswith(b + "_")), -1)
    if branches:  # all channels of one branch, then those of the next
        sheet["channels"].sort(key=of)
    sheet["ports"] = dict(pair for name, entry in sheet["ports"].items() for pair in each(entry, name))
    return sheet


class Datasheet:
    """Channels, parameters and ports of one rig, as plain dictionaries."""

    def __init__(self, rig, path=None):
        self.path = path or os.environ.get("FAULTLINE_DATASHEET") or os.path.join(ROOT, "config", rig, "rig.yaml")
        if not os.path.exists(self.path):
            raise SystemExit(f"{self.path}: no such datasheet; run from a complete tree or set FAULTLINE_DATASHEET")
        with open(self.path, encoding="utf-8") as stream:
            sheet = yaml.safe_load(stream)
        sheet = _branched(sheet)
        self.rig = rig
        self.sample_period = _number(sheet["sample_period"])
        self.channels = [c["name"] for c in sheet["channels"]]
        self.role = {c["name"]: c["role"] for c in sheet["channels"]}
        self.range = {c["name"]: tuple(map(_number, c["range"])) for c in sheet["channels"]}
        self.noise = {c["name"]: _number(c.get("noise_std", 0)) for c in sheet["channels"]}
        self.resolution = {c["name"]: _number(c.get("resolution", 0)) for c in sheet["channels"]}
        self.nominal = {p["name"]: _number(p["nominal"]) for p in sheet["parameters"]}
        self.tolerance = {p["name"]: _number(p["tolerance"]) for p in sheet["parameters"]}
        self.constants = {}
        for name, entry in (sheet.get("constants") or {}).items():
            self.constants[name] = _number(entry["value"] if isinstance(entry, dict) else entry)
        self.bounds = {}  # "effect@port" -> {parameter: (low, high)}
        for port, entry in sheet["ports"].items():
            for effect, parameters in (entry.get("effects") or {}).items():
                self.bounds[f"{effect}@{port}"] = {n: tuple(map(_number, b)) for n, b in (parameters or {}).items()}
        self.empty = []  # channels that a recording has a column for and nothing in it

    def without(self, channels):
        """This sheet where nobody records these: their columns empty, no effects at their sensors."""
        sheet = copy.copy(self)
        sheet.empty = list(channels)
        ports = ["sensor." + name for name in channels]
        sheet.bounds = {key: b for key, b in self.bounds.items() if key.split("@")[1] not in ports}
        return sheet

    def effects(self):
        """Those that a truth can have."""
        return sorted(k for k in self.bounds if k.split("@")[0] not in NOT_IN_TRUTH and k not in NOT_IN_TRUTH_AT)
