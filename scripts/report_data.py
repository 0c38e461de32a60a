"""What the report reads: the answer of `faultline diagnose` (JSON), its series (CSV) and the rig's datasheet (YAML).

The series: a column `t` [s from the start], every channel by its name, and what was estimated, as far as it is there:
  x.STATE  q.QUANTITY  i.CHANNEL (innovation), each with a column NAME.std beside it;  normalised_innovation
A long run comes as pairs of rows that hold the smallest and the largest number of a stretch, column by column, in the
order in which they came. A name may carry its unit, `q.leak_flow[m^3/s]`. Empty cells are missing numbers.
"""
import json
import os
import re

import numpy as np
import yaml

ALARM_KINDS = ("fault", "sensor", "data", "model", "unknown")


class ReportError(Exception):
    """Bad input. Its text is one line: what, where, what to do."""


def text_of(text):
    """What can be written as UTF-8: bytes of a file's name that are no text become question marks."""
    return text.encode("utf-8", "replace").decode("utf-8")


class Series:
    """The columns of a run."""

    def __init__(self, names, table):
        self.units, self.columns = {}, {}
        for i, name in enumerate(names):
            match = re.fullmatch(r"(.*?)\s*\[([^\]]*)\]", name)
            if match:
                name = match.group(1)
                self.units[name] = match.group(2)
            self.columns[name] = table[:, i]
        self.time = self.columns.pop("t")
        self.rows = len(self.time)

    def get(self, name):
        return self.columns.get(name)

    def std(self, name):
        return self.columns.get(name + ".std")

    def names(self, prefix):
        return [name[len(prefix) :] for name in self.columns if name.startswith(prefix) and not name.endswith(".std")]

    def channels(self):
        return [name for name in self.columns if "." not in name and name != "normalised_innovation"]


def _number(text):
    return float(text) if text.strip() else float("nan")


def read_series(path):
    try:
        with open(path, encoding="utf-8") as file:
            names = [name.strip() for name in file.readline().split(",")]
            if "t" not in names:
                raise ReportError(
                    "{}: no column t in its first line; it is not a series of `faultline diagnose --series`".format(
                        path
                    )
                )
            rows = []
            for number, line in enumerate(file, start=2):
                cells = line.rstrip("\r\n").split(",")
                if cells == [""]:
                    continue
                if len(cells) != len(names):
                    raise ReportError(
                        "{}: line {} has {} cells, the header has {}; make the series again".format(
                            path, number, len(cells), len(names)
                        )
                    )
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
    table = np.array(rows)
    if not np.isfinite(table[:, names.index("t")]).all():
        raise ReportError("{}: a sample has no time (column t); make the series again".format(path))
    return Series(names, open_gaps(table, names.index("t")))


def open_gaps(table, at, factor=20):
    """Rows without numbers where time jumps, so that no line is drawn over what was not recorded."""
    time = table[:, at]
    steps = np.diff(time)
    usual = np.median(steps)
    jumps = np.flatnonzero(steps > factor * usual) if usual > 0 else []
    if len(jumps) == 0 or len(jumps) > 1000:
        return table
    # Enough rows to fill a whole stretch of a picture, whatever rows it begins with; an even number, for pairs to stay
    # pairs.
    count = 4 * max(2, -(-len(table) // 1000))
    parts, begin = [], 0
    for jump in jumps:
        empty = np.full((count, table.shape[1]), np.nan)
        empty[:, at] = np.linspace(time[jump], time[jump + 1], count + 2)[1:-1]
        parts += [table[begin : jump + 1], empty]
        begin = jump + 1
    return np.vstack(parts + [table[begin:]])


def _is_number(value):
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def read_json(path):
    try:
        with open(path, encoding="utf-8") as file:
            return json.load(file)
    except OSError as error:
        raise ReportError("{}: cannot be read: {}".format(path, error.strerror))
    except (ValueError, RecursionError) as error:
        raise ReportError("{}: is not JSON: {}".format(path, error))


def read_answer(path):
    """The JSON answer, with every key that the report uses checked."""
    answer = read_json(path)
    if not isinstance(answer, dict):
        raise ReportError("{}: is not an answer of `faultline diagnose --json`: a JSON object is wanted".format(path))
    for key in ("rig", "duration", "verdict", "alarms"):
        if key not in answer:
            raise ReportError(
                "{}: key '{}' is missing; make the file with `faultline diagnose BAG --json FILE`".format(path, key)
            )
    remedy = "make the file with `faultline diagnose BAG --json FILE`"
    if not isinstance(answer["rig"], str):
        raise ReportError("{}: key 'rig' is not a name; {}".format(path, remedy))
    if not _is_number(answer["duration"]):
        raise ReportError("{}: key 'duration' is not a number; {}".format(path, remedy))
    if not isinstance(answer["alarms"], list):
        raise ReportError("{}: key 'alarms' is not a list; {}".format(path, remedy))
    for i, alarm in enumerate(answer["alarms"]):
        for key in ("kind", "since", "until"):
            if not isinstance(alarm, dict) or key not in alarm:
                raise ReportError("{}: alarm {} has no key '{}'; {}".format(path, i, key, remedy))
        for key in ("since", "until", "raised", "confidence"):
            if not _is_number(alarm.get(key)) and (key == "since" or alarm.get(key) is not None):
                raise ReportError("{}: alarm {}: key '{}' is not a number; {}".format(path, i, key, remedy))
    rankings = answer.get("rankings", [])
    if not isinstance(rankings, list):
        raise ReportError("{}: key 'rankings' is not a list; {}".format(path, remedy))
    for i, judgement in enumerate(rankings):
        _check_judgement(judgement, "{}: ranking {}".format(path, i), remedy)
    return answer


def config_folders(here):
    """config/ of the source tree, or of share/faultline in an install space."""
    shares = (
        os.environ.get("FAULTLINE_SHARE", ""),
        os.path.dirname(here),
        os.path.join(here, "..", "..", "share", "faultline"),
    )
    return [os.path.join(share, "config") for share in shares if share]


def _check_judgement(judgement, where, remedy):
    for key, kind in (
        ("stage", str),
        ("time", (int, float)),
        ("threshold", (int, float)),
        ("first", list),
        ("second", list),
    ):
        if not isinstance(judgement, dict) or not isinstance(judgement.get(key), kind):
            raise ReportError("{}: key '{}' is missing or of the wrong kind; {}".format(where, key, remedy))
    for value in [judgement.get("evidence")] + [
        h.get("evidence") if isinstance(h, dict) else "" for h in judgement["first"] + judgement["second"]
    ]:
        if value is not None and not _is_number(value):
            raise ReportError("{}: key 'evidence' is not a number; {}".format(where, remedy))
    for hypothesis in judgement["first"] + judgement["second"]:
        size = hypothesis.get("size")
        if (
            not all(isinstance(hypothesis.get(key), str) for key in ("effect", "port", "kind"))
            or not isinstance(size, dict)
            or not {"name", "value", "unit", "low", "high"} <= set(size)
        ):
            raise ReportError("{}: a hypothesis lacks effect, port, kind or size; {}".format(where, remedy))


def datasheet_path(rig, here):
    """config/<rig>/rig.yaml; None where there is none."""
    for folder in config_folders(here):
        path = os.path.join(folder, rig, "rig.yaml")
        if os.path.isfile(path):
            return path
    return None


class Datasheet:
    """What the report needs of a rig's datasheet; empty where there is none, and then names stand for themselves."""

    def __init__(self, rig, path):
        self.title, self.channels, self.ports = rig.replace("_", " "), {}, {}
        if not path:
            return
        if os.path.isdir(path):
            path = os.path.join(path, "rig.yaml")
        try:
            with open(path, encoding="utf-8") as file:
                sheet = yaml.safe_load(file)
            self.title = sheet.get("title", self.title)
            self.channels = {channel["name"]: channel for channel in sheet.get("channels", [])}
            self.ports = sheet.get("ports", {})
        except (OSError, UnicodeDecodeError, yaml.YAMLError, AttributeError, KeyError, TypeError) as error:
            raise ReportError(
                "{}: is no datasheet: {}; see docs/datasheet.md".format(path, str(error).replace("\n", " "))
            )

    def unit(self, channel):
        return self.channels.get(channel, {}).get("unit", "")

    def ground_truth(self, channel):
        return bool(self.channels.get(channel, {}).get("ground_truth", False))

    def component(self, port):
        return self.ports.get(port, {}).get("component", "")


# Where a series names no unit: a quantity known by its name, else what the last word of a quantity's name says.
_UNIT_OF_LAST_WORD = {
    "flow": "m^3/s",
    "force": "N",
    "pressure": "Pa",
    "parity": "Pa",
    "sum": "Pa",
    "position": "m",
    "velocity": "m/s",
    "speed": "rad/s",
    "temperature": "K",
    "torque": "N m",
    "power": "W",
}


_UNIT_OF_NAME = {"leak_coefficient": "m^3/(s sqrt(Pa))", "leak_drive": "sqrt(Pa)"}


def quantity_unit(name, series, sheet):
    if "q." + name in series.units:
        return series.units["q." + name]
    if sheet.unit(name):
        return sheet.unit(name)
    return _UNIT_OF_NAME.get(name) or _UNIT_OF_LAST_WORD.get(name.rsplit("_", 1)[-1], "")


COUNT_NAMES = {
    "used": "samples used",
    "not_newer": "not newer than the last",
    "restarts": "starts of the filter",
    "missing": "missing numbers",
    "out_of_range": "numbers out of range",
    "gaps": "gaps in time",
    "lost": "lost samples",
    "missed_at_start": "samples missed at the start",
    "duplicates": "duplicate samples",
    "backward": "jumps back in time",
}


def flatten(counts, prefix=""):
    """Nested counts as a list of (words, number)."""
    result = []
    for key, value in counts.items():
        if isinstance(value, dict):
            result += flatten(value, prefix + key + ": ")
        elif isinstance(value, (int, float, str)):
            result.append((prefix + COUNT_NAMES.get(key, key.replace("_", " ")), value))
    return result
