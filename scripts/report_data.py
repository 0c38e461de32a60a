"""What the report reads: the answer of `faultline diagnose` (JSON), its series (CSV) and the rig's datasheet (YAML).

The series: a column `t` [s], every channel by its name, then what was estimated, each only if there is such a thing:
  state:NAME  quantity:NAME  quantity_std:NAME  innovation:CHANNEL  innovation_std:CHANNEL  normalised_innovation
A name may carry its unit, `quantity:leak_flow[m^3/s]`. Empty cells are missing numbers.
"""
import json
import os
import re

import numpy as np
import yaml

ALARM_KINDS = ("fault", "sensor", "data", "model", "unknown")


class ReportError(Exception):
    """Bad input. Its text is one line: what, where, what to do."""


class Series:
    """The columns of a run; times count from its start."""

    def __init__(self, names, table):
        self.units = {}
        plain = []
        for name in names:
            match = re.fullmatch(r"(.*?)\s*\[([^\]]*)\]", name)
            plain.append(match.group(1) if match else name)
            if match:
                self.units[plain[-1]] = match.group(2)
        self.columns = {name: table[:, i] for i, name in enumerate(plain)}
        time = self.columns.pop("t")
        self.time = time - time[0]
        self.rows = len(time)

    def get(self, name):
        return self.columns.get(name)

    def with_prefix(self, prefix):
        return [name[len(prefix):] for name in self.columns if name.startswith(prefix)]

    def channels(self):
        return [name for name in self.columns if ":" not in name and name != "normalised_innovation"]


def _number(text):
    return float(text) if text.strip() else float("nan")


def read_series(path):
    try:
        with open(path, encoding="utf-8") as file:
            names = [name.strip() for name in file.readline().split(",")]
            if "t" not in names:
                raise ReportError("{}: no column t in its first line; it is not a series of `faultline diagnose --series`".format(path))
            rows = []
            for number, line in enumerate(file, start=2):
                cells = line.rstrip("\r\n").split(",")
                if cells == [""]:
                    continue
                if len(cells) != len(names):
                    raise ReportError("{}: line {} has {} cells, the header has {}; make the series again".format(
                        path, number, len(cells), len(names)))
                try:
                    rows.append(np.array(cells, dtype=float))
                except ValueError:
                    try:
                        rows.append(np.array([_number(cell) for cell in cells]))
                    except ValueError as error:
                        raise ReportError("{}: line {}: {}; make the series again".format(path, number, error))
    except (OSError, UnicodeDecodeError) as error:
        raise ReportError("{}: cannot be read: {}".format(path, getattr(error, "strerror", None) or "not a text file"))
    if len(rows) < 2:
        raise ReportError("{}: holds {} samples; a report needs at least two".format(path, len(rows)))
    return Series(names, np.array(rows))


def read_answer(path):
    """The JSON answer, with every key that the report uses checked."""
    try:
        with open(path, encoding="utf-8") as file:
            answer = json.load(file)
    except OSError as error:
        raise ReportError("{}: cannot be read: {}".format(path, error.strerror))
    except ValueError as error:
        raise ReportError("{}: is not JSON: {}".format(path, error))
    if not isinstance(answer, dict):
        raise ReportError("{}: is not an answer of `faultline diagnose --json`: a JSON object is wanted".format(path))
    for key in ("rig", "duration", "verdict", "alarms"):
        if key not in answer:
            raise ReportError("{}: key '{}' is missing; make the file with `faultline diagnose BAG --json FILE`".format(path, key))
    if not isinstance(answer["alarms"], list):
        raise ReportError("{}: key 'alarms' is not a list; make the file with `faultline diagnose BAG --json FILE`".format(path))
    for i, alarm in enumerate(answer["alarms"]):
        for key in ("kind", "since", "until"):
            if not isinstance(alarm, dict) or key not in alarm:
                raise ReportError("{}: alarm {} has no key '{}'; make the file with `faultline diagnose BAG --json FILE`".format(
                    path, i, key))
    return answer


def share_folder(here):
    """The folder that holds config/: the source tree, or share/faultline of an install space; None where there is none."""
    candidates = [os.environ.get("FAULTLINE_SHARE", ""), os.path.dirname(here),
                  os.path.join(here, "..", "..", "share", "faultline")]
    for folder in candidates:
        if folder and os.path.isdir(os.path.join(folder, "config")):
            return os.path.realpath(folder)
    return None


class Datasheet:
    """What the report needs of a rig's datasheet; empty where there is none, and then names stand for themselves."""

    def __init__(self, rig, folder):
        self.title, self.channels, self.ports = rig.replace("_", " "), {}, {}
        path = os.path.join(folder or "", "config", rig + ".yaml")
        if not folder or not os.path.isfile(path):
            return
        try:
            with open(path, encoding="utf-8") as file:
                sheet = yaml.safe_load(file)
        except (OSError, yaml.YAMLError) as error:
            raise ReportError("{}: cannot be read: {}".format(path, str(error).replace("\n", " ")))
        self.title = sheet.get("title", self.title)
        self.channels = {channel["name"]: channel for channel in sheet.get("channels", [])}
        self.ports = sheet.get("ports", {})

    def unit(self, channel):
        return self.channels.get(channel, {}).get("unit", "")

    def ground_truth(self, channel):
        return bool(self.channels.get(channel, {}).get("ground_truth", False))

    def component(self, port):
        return self.ports.get(port, {}).get("component", "")


# Where a series names no unit: what the last word of a quantity's name says.
_UNIT_OF_LAST_WORD = {"flow": "m^3/s", "force": "N", "pressure": "Pa", "parity": "Pa", "sum": "Pa", "position": "m",
                      "velocity": "m/s", "speed": "rad/s", "temperature": "K", "torque": "N m", "power": "W"}


def quantity_unit(name, series, sheet):
    if "quantity:" + name in series.units:
        return series.units["quantity:" + name]
    if sheet.unit(name):
        return sheet.unit(name)
    return _UNIT_OF_LAST_WORD.get(name.rsplit("_", 1)[-1], "")


def flatten(counts, prefix=""):
    """Nested counts as a list of (words, number)."""
    result = []
    for key, value in counts.items():
        if isinstance(value, dict):
            result += flatten(value, prefix + key + ": ")
        elif isinstance(value, (int, float, str)):
            result.append((prefix + key, value))
    return result
