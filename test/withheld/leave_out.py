#!/usr/bin/python3
"""Would other thresholds of the verdict do better, and would they carry over?

    leave_out.py OUT [OUT2 ...] [--draws 3000] [--seed 1]

Judges the answers in the folders again from the evidence that they give (`evidence` in the answer), with the
thresholds of today and with drawn ones, each half of the time up to ten times smaller or larger. Scores are means over
closed, open, none and two of the rate of right verdicts, over the cases that a line about verdicts counts (groups.py);
the effects stay what the search found. For each class and each rig: the thresholds that are best without it, scored on
it, beside today's. Prints Markdown; stops where an answer's verdict is not what today's thresholds make of it.
"""
import argparse
import math
import os
import random
import sys

import answer
import groups
import nature
import score
import truth_classes

# Of src/faultline/gap/gap_options.h, Verdict
TODAY = {
    "material_evidence_fraction": 0.1,
    "material_shrink_fraction": 0.1,
    "hidden_shrink_fraction": 0.5,
    "small_gap_shrink_fraction": 0.4,
    "named_shrink_fraction": 0.5,
    "named_output_shrink_fraction": 0.75,
    "closed_shrink_fraction": 0.9,
    "nearly_closed_fraction": 0.95,
    "named_matters_fraction": 0.1,
    "free_evidence_fraction": 0.25,
    "beside_log_likelihood": 500.0,
    "partial_evidence_fraction": 0.2,
    "place_evidence_fraction": 0.1,
    "place_log_likelihood": 0.02,
    "material_excess_variances": 1.0,
    "silent_matters_ratio": 5.0,
    "silent_excess_variances": 4.0,
    "size_spread": 0.25,
}
# of 1: their distance from it is drawn
FRACTIONS = {"closed_shrink_fraction", "hidden_shrink_fraction", "nearly_closed_fraction"}
PARTS = ("closed", "open", "none", "two")
VERDICTS = ("named", "unknown", "silent")


def judged(evidence, options):
    """The verdict as src/faultline/gap/verdict.h describes it; miscalibrated and none are both "silent"."""
    e, o = evidence, options
    perfect, effects = max(e["perfect"], 1e-9), max(e["effects"], 1e-9)
    readings = max(e["readings"], 1.0)
    little = min(o["place_evidence_fraction"] * perfect, o["beside_log_likelihood"])
    typical = e.get("typical_shrink", 0.0)  # older answers hold none
    all_of_both = min(e["shrink"], typical)
    foremost = e["effects"] > max(e["free_before"], e["free_after"])
    nearly = all_of_both > (o["closed_shrink_fraction"] if foremost else o["nearly_closed_fraction"])
    free_beside = 0.0 if nearly else e["free_after"] / max(o["free_evidence_fraction"] * effects, little)
    beside = max(free_beside, e.get("spread", 0.0) / o["size_spread"])
    shrink = o["material_shrink_fraction"] if e["plain"] else o["hidden_shrink_fraction"]
    large = e["size"] > e["matters"] and e["excess"] > o["material_excess_variances"]
    closes_most = max(e["shrink"], typical)
    if large and closes_most < o["named_shrink_fraction"] and "output_shrink" in e:
        beside = max(beside, 2.0 if e["output_shrink"] < o["named_output_shrink_fraction"] else 0.0)
    beyond_free = e["plain"] and foremost and all_of_both > o["hidden_shrink_fraction"]
    closed = (e["left"] < e["quiet"] and e["shrink"] > o["closed_shrink_fraction"]) or (
        not e["plain"]
        and e["shrink"]
        > o["closed_shrink_fraction" if e["left"] < o["material_excess_variances"] else "nearly_closed_fraction"]
    )
    names = (
        e["found"]
        and e["size"] > o["named_matters_fraction"] * e["matters"]
        and (
            (e["shrink"] > shrink and e.get("shrink_low", 1.0) > 0)
            or (typical > shrink and e["typical_shrink_low"] > 0)
        )
        and (
            e["effects"] > o["material_evidence_fraction"] * perfect
            or ((beyond_free if e["plain"] else closed) and e["excess"] > o["material_excess_variances"])
        )
        and (large or closes_most >= o["small_gap_shrink_fraction"])
    )
    seen = max(o["place_evidence_fraction"] * perfect, o["place_log_likelihood"] * readings)
    place = (min(e["free_before"], e["free_after"]) if e["found"] else e["free_before"]) / seen
    misfit = min(
        e["size"] / (o["silent_matters_ratio"] * max(e["matters"], 1e-9)), e["excess"] / o["silent_excess_variances"]
    )
    silent = max(place if large else min(place, 0.5), misfit)
    if names and (beside <= 1 or closed) and not e.get("beyond", False):
        return "named"
    part = names and e["size"] > e["matters"]
    part = part and (large or e["effects"] > o["partial_evidence_fraction"] * perfect)
    return "unknown" if (e.get("beyond", False) or max(beside, silent) > 1 if part else silent > 1) else "silent"


def drawn(source):
    options = dict(TODAY)
    for name, value in TODAY.items():
        if source.random() < 0.5:
            factor = 10 ** source.uniform(-1, 1)
            options[name] = 1 - min(0.95, factor * (1 - value)) if name in FRACTIONS else factor * value
    return options


def names_of(given):
    """What the search found, in the answer's order: its effects, or the ranking where the verdict withdrew them."""
    effects = [name for name in given.effects if not name.startswith("quantisation@")]
    return effects or given.ranked[:1]


def right(label, names, verdict):
    part, keys = label["part"], list(label["effects"])
    if part == "none":
        return verdict == "silent" or (verdict == "named" and not nature.foreign(label, names))
    if part == "open":
        return verdict == "unknown"
    return verdict == "named" and (keys[0] in names if part == "closed" else set(keys) <= set(names))


def cases_of(folders):
    """[(label, evidence, {verdict: whether it would be right})] of what counts."""
    found = []
    for out in folders:
        labels, _ = score.load(out)
        for name, label in sorted(labels.items()):
            path = os.path.join(out, "answers", "faultline", name + ".json")
            if not os.path.exists(path) or not groups.counted(label):
                continue
            data = answer.data(path)
            if "evidence" not in data:
                raise SystemExit(f"{path}: no evidence in it; ask again with a program that writes it")
            given = answer.Answer(data)
            verdict = given.verdict if given.verdict in VERDICTS else "silent"
            rounded = verdict == "named" and all(effect.startswith("quantisation@") for effect in given.effects)
            if rounded:  # told of the recording, whatever the model makes of it
                continue
            if judged(data["evidence"], TODAY) != verdict:
                raise SystemExit(f"{path}: {verdict}, where today's thresholds say {judged(data['evidence'], TODAY)}")
            names = names_of(given)
            found.append((label, data["evidence"], {v: right(label, names, v) for v in VERDICTS}))
    return found


def mean_rate(cases, hits):
    """Mean over the parts of the rate of right verdicts."""
    rates = []
    for part in PARTS:
        of_part = [hit for (label, _, _), hit in zip(cases, hits) if label["part"] == part]
        if of_part:
            rates.append(sum(of_part) / len(of_part))
    return sum(rates) / len(rates) if rates else math.nan


def markdown(cases, draws, seed):
    source = random.Random(seed)
    options = [dict(TODAY)] + [drawn(source) for _ in range(draws)]
    table = [[outcome[judged(evidence, o)] for _, evidence, outcome in cases] for o in options]

    def score_of(row, which):
        return mean_rate([cases[i] for i in which], [row[i] for i in which])

    def best(which):
        return max(range(len(table)), key=lambda k: score_of(table[k], which))

    everything = range(len(cases))
    text = [
        f"{len(cases)} cases that count: "
        + ", ".join(f"{part} {sum(label['part'] == part for label, _, _ in cases)}" for part in PARTS),
        "",
        f"Today's thresholds {score_of(table[0], everything):.2f}; the best of {draws} draws, chosen on all of these,"
        f" {score_of(table[best(everything)], everything):.2f}.",
        "",
        "| left out | cases | chosen without it | today's |",
        "|---|---|---|---|",
    ]
    left_out = [
        (f"class {name}", [i for i in everything if name in cases[i][0].get("classes", {})])
        for name in truth_classes.CLASSES
    ] + [(rig, [i for i in everything if cases[i][0]["rig"] == rig]) for rig in sorted({c[0]["rig"] for c in cases})]
    for name, outside in left_out:
        inside = [i for i in everything if i not in set(outside)]
        if not inside or not outside:
            continue
        chosen = score_of(table[best(inside)], outside)
        text.append(f"| {name} | {len(outside)} | {chosen:.2f} | {score_of(table[0], outside):.2f} |")
    text += ["", "| part | cases | today's | most that any verdict could give |", "|---|---|---|---|"]
    for part in PARTS:
        which = [i for i in everything if cases[i][0]["part"] == part]
        if which:
            most = sum(any(cases[i][2].values()) for i in which) / len(which)
            text.append(f"| {part} | {len(which)} | {sum(table[0][i] for i in which) / len(which):.2f} | {most:.2f} |")
    return "\n".join(text) + "\n"


def main():
    reader = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    reader.add_argument("out", nargs="+")
    reader.add_argument("--draws", type=int, default=3000, help="sets of thresholds that are tried (default 3000)")
    reader.add_argument("--seed", type=int, default=1)
    given = reader.parse_args()
    cases = cases_of(given.out)
    if not cases:
        raise SystemExit("none of these cases counts and is answered")
    print(markdown(cases, given.draws, given.seed), end="")


if __name__ == "__main__":
    sys.exit(main())
