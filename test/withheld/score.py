#!/usr/bin/python3
"""Scores answers against the sealed labels and writes the table as Markdown.

    score.py OUT [OUT2 ...] [--table FILE] [--answered] [--by class|rig|noise|length|runs|excitation]

Several folders make one table (one of each rig, say). --answered leaves out cases that faultline has not answered
(yet): the table of a run that was stopped. Otherwise they count as wrong. Reads OUT/sealed/CASE.json and
OUT/answers/METHOD/CASE.json; METHOD faultline and the baselines side by side.
"""
import argparse
import json
import math
import os

import answer
import groups
import nature
import sizes
import twins

CLASSES = ["below 1.2", "1.2-2", "2-5", "above 5"]
MISSING = answer.Answer({})


def rate(values):
    values = list(values)
    return (sum(map(bool, values)) / len(values), len(values)) if values else (math.nan, 0)


def median(values):
    values = sorted(v for v in values if not math.isnan(v))
    if not values:
        return math.nan
    half = len(values) // 2
    return values[half] if len(values) % 2 else 0.5 * (values[half - 1] + values[half])


def show(pair):
    value, count = pair
    return "-" if count == 0 or math.isnan(value) else f"{100 * value:.0f} % ({count})"


def single(label, given):
    """Scores of one case with one effect."""
    key = next(iter(label["effects"]))
    port = key.split("@")[1]
    top = given.effects[0] if given.verdict == "named" and given.effects else None
    two = []
    for name in given.effects + given.ranked:
        if name not in two:
            two.append(name)
    return {
        "top1": top == key,
        "top2": given.verdict == "named" and key in two[:2],
        "set": given.verdict == "named" and key in given.effects + given.equivalent,
        "family": top is not None and twins.family(top) == twins.family(key),
        "place": given.place == port,
        "place_group": port in given.place_group,
        "kind": given.kind == twins.place_kind(port),
        "unknown": given.verdict == "unknown",
        "missed": given.verdict in ("none", "miscalibrated"),
    }


def coverage(cases, answers):
    """Share of true parameter values inside their intervals, for effects named rightly whose numbers mean the same."""
    hits = []
    for name, label in cases.items():
        given = answers.get(name, MISSING)
        for key, truth in label["effects"].items():
            if key.split("@")[0] in sizes.NOT_COMPARABLE or key not in given.parameters or given.verdict != "named":
                continue
            for parameter, value in truth.items():
                main = sizes.main_parameter(key.split("@")[0]) or parameter
                if parameter != main or parameter not in given.parameters[key]:
                    continue
                _, low, high = answer.interval(given.parameters[key][parameter])
                if not math.isnan(low) and not math.isnan(high):
                    hits.append(low <= value <= high)
    return rate(hits)


def calibration_error(pairs, bins=10):
    """Expected calibration error of (probability, right) pairs."""
    pairs = [(p, r) for p, r in pairs if not math.isnan(p)]
    if not pairs:
        return math.nan, 0
    total = 0.0
    for b in range(bins):
        inside = [(p, r) for p, r in pairs if min(int(p * bins), bins - 1) == b]
        if inside:
            total += abs(sum(p for p, _ in inside) - sum(r for _, r in inside))
    return total / len(pairs), len(pairs)


def unknown_at(closed, opened, allowed=0.05):
    """Share of open cases called unknown at the threshold that calls at most `allowed` of the closed ones unknown.

    Ties at the threshold are split, as a coin would, so that a bare yes-or-no verdict is scored fairly too.
    """
    if not closed or not opened:
        return math.nan, 0
    best = 0.0
    for threshold in sorted(set(closed + opened)):
        above, at = sum(c > threshold for c in closed) / len(closed), sum(c == threshold for c in closed) / len(closed)
        if above > allowed:
            continue
        part = 1.0 if above + at <= allowed else (allowed - above) / at
        hit = sum(o > threshold for o in opened) / len(opened) + part * sum(o == threshold for o in opened) / len(
            opened
        )
        best = max(best, hit)
    return best, len(opened)


def summarise(labels, answers, seconds, third):
    """All numbers of one method: {name: (value, count)} and the rows by severity."""
    parts = {part: {n: l for n, l in labels.items() if l["part"] == part} for part in ("closed", "open", "none", "two")}
    result = {}
    rows = []
    scored = {n: single(l, answers.get(n, MISSING)) for n, l in parts["closed"].items()}
    for wanted in (True, False):
        for cls in CLASSES:
            inside = [n for n, l in parts["closed"].items() if l["severity"] == cls and l["identifiable"] == wanted]
            if inside:
                rows.append((cls, wanted, {k: rate(scored[n][k] for n in inside) for k in next(iter(scored.values()))}))
    aimed = [n for n, l in parts["closed"].items() if l["identifiable"] and l["severity"] in ("2-5", "above 5")]
    for k in ("top1", "top2", "set", "family", "place", "place_group", "kind", "unknown", "missed"):
        result[k] = rate(scored[n][k] for n in aimed)
    # an effect that one run cannot tell from its twin: naming it, or naming its twin and listing it, is right
    twin = [
        n
        for n, l in parts["closed"].items()
        if l["structure"] and not l["identifiable"] and l["severity"] in ("2-5", "above 5")
    ]
    result["twin_set"] = rate(scored[n]["set"] for n in twin)
    for off in (False, True):
        inside = [n for n, l in parts["none"].items() if bool(l["parameters_off"]) == off]
        result["false_off" if off else "false"] = rate(
            answers.get(n, MISSING).verdict not in ("none", "miscalibrated") for n in inside
        )
    bare = {n: (l, answers.get(n, MISSING)) for n, l in parts["none"].items()}
    result["none_unknown"] = rate(a.verdict == "unknown" for _, a in bare.values())
    result["none_name"] = rate(a.verdict == "named" for _, a in bare.values())
    result["none_foreign"] = rate(a.verdict == "named" and nature.foreign(l, a.effects) for l, a in bare.values())
    opened = [
        n
        for n, l in parts["open"].items()
        if l["structure"]
        and l["severity"] in ("2-5", "above 5")
        and next(iter(l["effects"])) not in twins.PARAMETER_TWINS
    ]
    result["open_unknown"] = rate(answers.get(n, MISSING).verdict == "unknown" for n in opened)
    result["open_at_5"] = unknown_at(
        [answers.get(n, MISSING).unknown for n in aimed], [answers.get(n, MISSING).unknown for n in opened]
    )
    result["open_place"] = rate(
        next(iter(parts["open"][n]["effects"])).split("@")[1] == answers.get(n, MISSING).place for n in opened
    )
    both = [n for n, l in parts["two"].items() if groups.counted(l)]
    result["two_both"] = rate(set(parts["two"][n]["effects"]) <= set(answers.get(n, MISSING).effects) for n in both)
    result["two_one"] = rate(bool(set(parts["two"][n]["effects"]) & set(answers.get(n, MISSING).effects)) for n in both)
    shares, kept = [], []
    for n in aimed:
        a = answers.get(n, MISSING)
        if a.verdict == "named" and not math.isnan(a.heldout) and a.closable > 0:
            shares.append(a.closable)
            kept.append(a.heldout)
    result["closable"] = (median(shares), len(shares))
    result["heldout"] = (median(kept), len(kept))
    near, inside = [], []
    for n in aimed:
        a, after = answers.get(n, MISSING), third.get(n, MISSING)
        if a.verdict == "named" and not math.isnan(a.heldout) and not math.isnan(after.heldout):
            near.append(abs(a.heldout - after.heldout) <= 0.05)
            if not math.isnan(a.low):
                inside.append(a.low <= after.heldout <= a.high)
    result["shrink_near"], result["shrink_inside"] = rate(near), rate(inside)
    result["coverage"] = coverage({n: parts["closed"][n] for n in aimed}, answers)
    result["calibration"] = calibration_error(
        [
            (a.probability[0], scored[n]["top1"])
            for n in parts["closed"]
            for a in [answers.get(n, MISSING)]
            if a.verdict == "named" and a.probability
        ]
    )
    result["seconds"] = (median(seconds.values()), len(seconds))
    result["missing"] = (sum(n not in answers for n in labels), len(labels))
    return result, rows


LINES = [
    ("top1", "top-1"),
    ("top2", "top-2"),
    ("set", "named or in its equivalence set"),
    ("family", "family"),
    ("place", "place top-1"),
    ("place_group", "place, or in the first place's group"),
    ("kind", "sensor against process"),
    ("unknown", "false unknowns"),
    ("missed", "missed (none or miscalibrated)"),
    ("twin_set", "not separable: named or in its set"),
    ("false", "false alarms, parameters within tolerance"),
    ("false_off", "false alarms, parameters off by up to 30 %"),
    ("none_unknown", "no effect: unknown"),
    ("none_name", "no effect: a name"),
    ("none_foreign", "no effect: a name that the truth does not have by nature either"),
    ("open_unknown", "open: verdict unknown"),
    ("open_at_5", "open: unknown at 5 % false unknowns"),
    ("open_place", "open: place top-1"),
    ("two_both", "two effects: both named"),
    ("two_one", "two effects: at least one"),
    ("closable", "closable share won, median"),
    ("heldout", "held-out shrink, median"),
    ("shrink_near", "shrink on a third run within 5 points"),
    ("shrink_inside", "shrink on a third run inside its interval"),
    ("coverage", "parameter inside its interval"),
    ("calibration", "calibration error"),
]


def markdown(labels, methods, heading):
    """The table of all methods; then the first one's by severity and by what the oracle says."""
    text = [
        "# Withheld check of `faultline gap`",
        "",
        heading,
        "",
        "Closed-set lines: cases that the oracle calls identifiable, severity above 2. In brackets: number of cases.",
        "",
    ]
    names = list(methods)
    text += ["| | " + " | ".join(names) + " |", "|---" * (len(names) + 1) + "|"]
    for key, title in LINES:
        text.append(f"| {title} | " + " | ".join(show(methods[m][0][key]) for m in names) + " |")
    text.append(
        "| seconds a case, median | "
        + " | ".join(
            "-" if math.isnan(methods[m][0]["seconds"][0]) else f"{methods[m][0]['seconds'][0]:.1f}" for m in names
        )
        + " |"
    )
    text.append("| cases without an answer | " + " | ".join(str(methods[m][0]["missing"][0]) for m in names) + " |")
    first = names[0]
    text += [
        "",
        f"## {first} by severity (closed set)",
        "",
        (
            "| severity | identifiable | cases | top-1 | top-2 | in its set | family | place | sensor/process | unknown"
            " | missed |"
        ),
        "|---" * 11 + "|",
    ]
    for cls, wanted, v in methods[first][1]:
        text.append(
            f"| {cls} | {'yes' if wanted else 'no'} | {v['top1'][1]} | "
            + " | ".join(
                f"{100 * v[k][0]:.0f} %"
                for k in ("top1", "top2", "set", "family", "place", "kind", "unknown", "missed")
            )
            + " |"
        )
    for title, field in (("noise", "noise"), ("excitation of the first run", "excitations")):
        text += [
            "",
            f"## {first} by {title} (identifiable, severity above 2)",
            "",
            f"| {title} | cases | top-1 | place |",
            "|---|---|---|---|",
        ]
        groups = {}
        for n, l in labels.items():
            if l["part"] == "closed" and l["identifiable"] and l["severity"] in ("2-5", "above 5"):
                group = l[field] if field == "noise" else l[field][0]
                groups.setdefault(group, []).append(single(l, methods[first][2].get(n, MISSING)))
        for g in sorted(groups):
            text.append(
                f"| {g} | {len(groups[g])} | {show(rate(s['top1'] for s in groups[g])).split(' (')[0]} | "
                f"{show(rate(s['place'] for s in groups[g])).split(' (')[0]} |"
            )
    wrong = []
    for n in sorted(labels):
        l = labels[n]
        if l["part"] == "closed" and l["identifiable"] and l["severity"] in ("2-5", "above 5"):
            a = methods[first][2].get(n, MISSING)
            key = next(iter(l["effects"]))
            if not single(l, a)["top1"]:
                said = a.effects[0] if a.effects else ""
                wrong.append(f"| {n} | {key} | {l['lift_after_refit']:.1f} | {l['noise']} | {a.verdict} | {said} |")
    if wrong:
        text += [
            "",
            f"## Where {first} is wrong",
            "",
            "| case | truth | severity | noise | verdict | first named |",
            "|---" * 6 + "|",
        ] + wrong
    return "\n".join(text) + "\n"


def load_answers(folder):
    answers, seconds = {}, {}
    for name in sorted(os.listdir(folder) if os.path.isdir(folder) else []):
        stem, kind = os.path.splitext(name)
        if kind == ".json":
            answers[stem] = answer.read(os.path.join(folder, name))
        elif kind == ".seconds":
            with open(os.path.join(folder, name), encoding="ascii") as stream:
                seconds[stem] = float(stream.read())
    return answers, seconds


def load(out, prefix=""):
    """({case: label}, {method: (answers, seconds)}) of one folder; prefix: of its cases' names."""
    sealed, base = os.path.join(out, "sealed"), os.path.join(out, "answers")
    if not os.path.isdir(sealed):
        raise SystemExit(f"{out}: no cases there; run run.py first")
    names = sorted(n[:-5] for n in os.listdir(sealed) if n.startswith("case_") and n.endswith(".json"))
    asked = os.listdir(os.path.join(out, "asked"))
    labels = {}
    for name in names:
        if name + ".json" in asked:  # a closed case may be there for its open one alone
            with open(os.path.join(sealed, name + ".json"), encoding="utf-8") as stream:
                labels[prefix + name] = json.load(stream)
    methods = {}
    for method in os.listdir(base) if os.path.isdir(base) else []:
        answers, seconds = load_answers(os.path.join(base, method))
        methods[method] = ({prefix + n: a for n, a in answers.items()}, {prefix + n: s for n, s in seconds.items()})
    if not methods:
        raise SystemExit(f"{base}: no answers yet; run run.py first")
    return labels, methods


def load_all(outs, answered):
    labels, methods = {}, {}
    for out in outs:
        prefix = os.path.basename(os.path.abspath(out)) + "/" if len(outs) > 1 else ""
        found, given = load(out, prefix)
        labels.update(found)
        for method, (answers, seconds) in given.items():
            known = methods.setdefault(method, ({}, {}))
            known[0].update(answers)
            known[1].update(seconds)
    if answered:
        labels = {n: l for n, l in labels.items() if n in methods.get("faultline", next(iter(methods.values())))[0]}
    return labels, methods


def score(outs, heading, answered=False, by=()):
    """The Markdown of everything answered in the folders; by: more tables, grouped so."""
    labels, given = load_all(outs, answered)
    third = given.pop("third", ({}, {}))[0]
    methods = {}
    for name in sorted(given, key=lambda d: (d != "faultline", d)):
        answers, seconds = given[name]
        methods[name] = summarise(labels, answers, seconds, third if name == "faultline" else {}) + (answers,)
    text = markdown(labels, methods, heading)
    first = next(iter(methods))
    for title in by:
        text += "\n" + groups.markdown(title, first, labels, *given[first])
    return text


if __name__ == "__main__":
    reader = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    reader.add_argument("out", nargs="+")
    reader.add_argument("--table", help="write the table here (default OUT/table.md, of the first OUT)")
    reader.add_argument("--answered", action="store_true", help="leave out cases without an answer")
    choices = sorted(groups.OF)
    reader.add_argument("--by", action="append", choices=choices, default=[], help="a table by this; repeatable")
    given = reader.parse_args()
    heading = f"Cases in {', '.join(os.path.basename(os.path.abspath(out)) for out in given.out)}."
    made = score(given.out, heading, given.answered, given.by)
    with open(given.table or os.path.join(given.out[0], "table.md"), "w", encoding="utf-8") as out_stream:
        out_stream.write(made)
    print(made)
