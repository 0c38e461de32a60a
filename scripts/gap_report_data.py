"""What the report of a gap reads: the answer of `faultline gap --json` (docs/gap.schema.json) and what it needs of a
datasheet."""
import yaml

from report_data import ReportError, read_json

VERDICTS = ("none", "miscalibrated", "named", "unknown")
REMEDY = "make the file with `faultline gap RUN... --json FILE`"


def _check(path, condition, key):
    if not condition:
        raise ReportError("{}: key '{}' is missing or of the wrong kind; {}".format(path, key, REMEDY))


def read_gap(path):
    """The JSON answer, with the keys that the report uses checked."""
    answer = read_json(path)
    _check(path, isinstance(answer, dict), "rig")
    for key, kind in (
        ("rig", str),
        ("runs", list),
        ("holdout", list),
        ("gap", dict),
        ("where", dict),
        ("cause", dict),
        ("shrink", dict),
        ("next", list),
    ):
        _check(path, isinstance(answer.get(key), kind), key)
    for level in ("nominal", "refit", "explained"):
        entry = answer["gap"].get(level)
        _check(
            path,
            isinstance(entry, dict) and isinstance(entry.get("channels"), dict) and entry["channels"],
            "gap." + level,
        )
        for name, channel in entry["channels"].items():
            for key in ("unit", "noise_floor", "rms", "fit", "excess"):
                _check(path, key in channel, "gap.{}.channels.{}.{}".format(level, name, key))
    for key in ("ranked", "regions", "bands"):
        _check(path, isinstance(answer["where"].get(key), list), "where." + key)
    for key in ("effects", "equivalent", "ranked"):
        _check(path, isinstance(answer["cause"].get(key), list), "cause." + key)
    _check(path, answer["cause"].get("verdict") in VERDICTS, "cause.verdict")
    for key in ("heldout", "against_nominal", "interval", "closable"):
        _check(path, key in answer["shrink"], "shrink." + key)
    return answer


def expand(entries, branches):
    """Entries that stand for one per branch, as docs/datasheet.md has it."""
    result = []
    for entry in entries:
        if "{b}" not in entry["name"]:
            result.append(entry)
            continue
        for branch in branches:
            one = {}
            for key, value in entry.items():
                if isinstance(value, str):
                    value = value.replace("{b}", branch)
                elif isinstance(value, dict) and set(value) == set(branches):
                    value = value[branch]
                one[key] = value
            result.append(one)
    return result


class GapSheet:
    """Title, ports and parameters of a rig, branches expanded."""

    def __init__(self, rig, path):
        self.title, self.ports, self.parameters, self.profiles = rig.replace("_", " "), {}, {}, {}
        if not path:
            return
        try:
            with open(path, encoding="utf-8") as file:
                sheet = yaml.safe_load(file)
            branches = sheet.get("branches") or []
            self.title = sheet.get("title", self.title)
            ports = [dict(port, name=name) for name, port in sheet.get("ports", {}).items()]
            self.ports = {port["name"]: port.get("component", "") for port in expand(ports, branches)}
            self.parameters = {entry["name"]: entry for entry in expand(sheet.get("parameters", []), branches)}
            self.profiles = {entry["name"]: entry for entry in sheet.get("profiles", [])}
        except (OSError, UnicodeDecodeError, yaml.YAMLError, AttributeError, KeyError, TypeError) as error:
            raise ReportError(
                "{}: is no datasheet: {}; see docs/datasheet.md".format(path, str(error).replace("\n", " "))
            )

    def component(self, port):
        return self.ports.get(port) or port.partition(".")[2].replace("_", " ")
