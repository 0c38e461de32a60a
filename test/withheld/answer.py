"""Reads the JSON answer of `faultline gap` (and of the baselines, which write the same form). Only the keys of the
contract."""
import json
import math


def _number(value):
    return float(value) if isinstance(value, (int, float)) and not isinstance(value, bool) else math.nan


def interval(entry):
    """(value, low, high) of a parameter, written as a dictionary, as a list or as a bare number."""
    if isinstance(entry, dict):
        bounds = entry.get("interval") or [entry.get("low"), entry.get("high")]
        return _number(entry.get("value")), _number(bounds[0]), _number(bounds[1])
    if isinstance(entry, (list, tuple)):
        padded = list(entry) + [None] * 3
        return _number(padded[0]), _number(padded[1]), _number(padded[2])
    return _number(entry), math.nan, math.nan


def with_intervals(effect):
    """Parameters of an effect, each as [value, low, high] where the answer gives intervals beside the values."""
    beside = effect.get("intervals", {})
    return {
        name: [value, *beside[name]] if name in beside and not isinstance(value, (dict, list)) else value
        for name, value in effect.get("parameters", {}).items()
    }


class Answer:
    """What of an answer is scored."""

    def __init__(self, data):
        cause, where, shrink = data.get("cause", {}), data.get("where", {}), data.get("shrink", {})
        self.verdict = cause.get("verdict", "missing")
        self.effects = [f"{e['effect']}@{e['port']}" for e in cause.get("effects", [])]
        self.probability = [_number(e.get("probability")) for e in cause.get("effects", [])]
        self.parameters = {f"{e['effect']}@{e['port']}": with_intervals(e) for e in cause.get("effects", [])}
        self.equivalent = []
        for entry in cause.get("equivalent", []):
            members = entry.get("members", entry) if isinstance(entry, dict) else entry
            for member in members if isinstance(members, list) else [members]:
                if isinstance(member, dict) and "effect" in member:
                    self.equivalent.append(f"{member['effect']}@{member['port']}")
                elif isinstance(member, str):
                    self.equivalent.append(member)
        self.ranked = [f"{e['effect']}@{e['port']}" for e in cause.get("ranked", []) if "effect" in e]
        unknown = _number(cause.get("unknown_probability"))
        self.unknown = unknown if not math.isnan(unknown) else float(self.verdict == "unknown")
        ranked = where.get("ranked", [])
        self.place = ranked[0].get("port") if ranked else None
        self.place_group = [self.place] + list(ranked[0].get("group") or []) if ranked else []
        self.kind = where.get("kind")
        self.heldout, self.closable = _number(shrink.get("heldout")), _number(shrink.get("closable"))
        bounds = shrink.get("interval") or [None, None]
        self.low, self.high = _number(bounds[0]), _number(bounds[1])


def data(path):
    with open(path, encoding="utf-8") as stream:
        return json.load(stream)


def read(path):
    return Answer(data(path))
