"""Tables over groups of cases: by class of truth, by rig, by noise, by length, for what was left out as well as in.

A case stands in several groups of "class": in one for each class that was on (class:variant too), and in `no CLASS` for
each that was off. Held beside each other, the two rows say what a class costs.
"""
import math

import answer
import nature
import truth_classes
import twins

MISSING = answer.Answer({})


def _length(label):
    length = label.get("length")
    if length is None:
        return "as the rig's"
    return "8-15 s" if length < 15 else "15-30 s" if length < 30 else "30-60 s"


def _own_level(label):
    """Of the channel in which the truth without any effect is farthest from the model, in units of the noise."""
    level = max(label["level"].values(), default=0) if label.get("level") else None
    if level is None:
        return "not known"
    return "1: below 2" if level < 2 else "2: 2-5" if level < 5 else "3: above 5"


def _classes(label):
    if "classes" not in label:
        return ["plain"]
    on = label["classes"]
    rows = [f"{name}: {variant}" for name, variant in on.items()] + [f"{name}, any" for name in on]
    return rows + [f"{name}, off" for name in truth_classes.CLASSES if name not in on]


OF = {
    "class": _classes,
    "rig": lambda label: [label["rig"]],
    "noise": lambda label: [label["noise"]],
    "level": lambda label: [_own_level(label)],
    "length": lambda label: [_length(label)],
    "runs": lambda label: [str(label.get("runs", 2))],
    "excitation": lambda label: [label["excitations"][0]],
    "severity": lambda label: [label.get("severity", "no effect")],
    "unmeasured": lambda label: [", ".join(label.get("empty", [])) or "nothing"],
    "effect": lambda label: sorted(label["effects"]) or ["no effect"],
}


def plain(label):
    """A case whose verdict the table's first lines count: identifiable, severity above 2."""
    return label.get("identifiable") and label.get("severity") in ("2-5", "above 5")


def counted(label):
    """A case that any line about verdicts counts: without effect, or with effects that show beside all parameters and
    beside each other."""
    if label["part"] == "none":
        return True
    if label["part"] == "closed":
        return plain(label)
    if label["part"] == "open" and next(iter(label["effects"])) in twins.PARAMETER_TWINS:
        return False
    if label.get("hidden"):
        return False
    return label.get("structure") and label.get("severity") in ("2-5", "above 5")


def right(label, given):
    """Whether the verdict is right: named with exactly these effects, none (or miscalibrated) without, unknown if they
    were withheld."""
    if label["part"] == "open":
        return given.verdict == "unknown"
    if label["part"] == "none":
        return given.verdict in ("none", "miscalibrated")
    return given.verdict == "named" and set(given.effects) == set(label["effects"])


def counts(cases, answers):
    """{column: [hits, cases]} of labels {name: label}."""
    table = {}

    def add(column, hit):
        row = table.setdefault(column, [0, 0])
        row[0], row[1] = row[0] + bool(hit), row[1] + 1

    for name, label in cases.items():
        given = answers.get(name, MISSING)
        part = label["part"]
        if part == "none":
            add("none right", right(label, given))
            add("none, false name", given.verdict == "named" and nature.foreign(label, given.effects))
            continue
        keys = list(label["effects"])
        if not label.get("structure") or label.get("severity") not in ("2-5", "above 5"):
            continue
        if part == "closed":
            add("named or equivalent", given.verdict == "named" and keys[0] in given.effects + given.equivalent)
        if part == "closed" and plain(label):
            top = (given.effects + given.ranked + [None])[0]
            add("closed right", right(label, given))
            found = given.verdict == "named" and keys[0] in given.effects
            add("right but for nature", found and not nature.foreign(label, given.effects))
            add("ranks first", top == keys[0])
            add("place", given.place == keys[0].split("@")[1])
            add("false unknown", given.verdict == "unknown")
            add("false name", given.verdict == "named" and keys[0] not in given.effects + given.equivalent)
        elif part == "open" and keys[0] not in twins.PARAMETER_TWINS:
            add("open unknown", right(label, given))
        elif part == "two" and label.get("hidden"):
            seen = set(keys) - set(label["hidden"])
            add("of a hidden pair what shows", seen <= set(given.effects))
        elif part == "two":
            add("both of two", set(keys) <= set(given.effects))
    return table


COLUMNS = [
    "closed right",
    "right but for nature",
    "ranks first",
    "place",
    "false unknown",
    "false name",
    "named or equivalent",
    "open unknown",
    "none right",
    "none, false name",
    "both of two",
    "of a hidden pair what shows",
]


def grouped(title, labels):
    found = {}
    for name, label in labels.items():
        for group in OF[title](label):
            found.setdefault(group, {})[name] = label
    return dict(sorted(found.items()))


def _level(cases):
    """Median over cases of the typical channel's residual over noise without any effect (geometric mean)."""
    sizes = sorted(
        math.exp(sum(math.log(v) for v in label["level"].values()) / len(label["level"]))
        for label in cases.values()
        if label.get("level")
    )
    return f"{sizes[len(sizes) // 2]:.1f}" if sizes else "-"


def markdown(title, method, labels, answers, seconds):
    text = [
        f"## {method} by {title}",
        "",
        "Right: the verdict with exactly the true effects; but for nature: further effects may be what the drawn truth"
        " has by nature (nature.py). All but none: severity above 2 and more than parameters can"
        " explain; the first six columns: told from every near-equivalent too. Of a hidden pair one effect does not"
        " show beside the other and the parameters. Level: median residual over noise that"
        " the truth leaves without any effect. In brackets: number of cases.",
        "",
        f"| {title} | cases | level | " + " | ".join(COLUMNS) + " | s |",
        "|---" * (len(COLUMNS) + 4) + "|",
    ]
    for group, cases in grouped(title, labels).items():
        table = counts(cases, answers)
        cells = []
        for column in COLUMNS:
            hits, total = table.get(column, (0, 0))
            cells.append(f"{100 * hits / total:.0f} % ({total})" if total else "-")
        spent = sorted(seconds[n] for n in cases if n in seconds)
        cells.append(f"{spent[len(spent) // 2]:.0f}" if spent else "-")
        text.append(f"| {group} | {len(cases)} | {_level(cases)} | " + " | ".join(cells) + " |")
    return "\n".join(text) + "\n"
