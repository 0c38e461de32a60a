"""The ranking of causes over time: whether something is wrong, which causes explain it, and how large the named one is.

A judgement (docs/diagnose.schema.json, `rankings`) holds from when it was told until the next one.
"""
import warnings

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.ticker import FuncFormatter, LogLocator

import report_pictures as base
from report_units import Scale, show, words

ROWS = 6  # causes that are shown, each in a strip of its own
SOFT, OTHER, BEHIND = "#5a646e", "#1f5f99", "#e4e8ec"
LEAST_EVIDENCE = 1.0  # what is less is drawn as this, for the logarithm
NUMBERED = 45  # judgements, up to which there is room for the ranks
MOST = 300  # judgements that are drawn


def fewer(judgements, end, most=MOST):
    """Of a long run, the judgement of most evidence in each of `most` equal stretches: a fault that was there for short
    is not lost."""
    if len(judgements) <= most:
        return judgements
    kept = {}
    for judgement in judgements:
        slot = min(most - 1, int(most * judgement["time"] / end))
        if slot not in kept or (judgement["evidence"] or 0.0) > (kept[slot]["evidence"] or 0.0):
            kept[slot] = judgement
    return [kept[slot] for slot in sorted(kept)]


def cause_name(hypothesis):
    return hypothesis["effect"] + "@" + hypothesis["port"]


def spans(judgements, end):
    """(judgement, begin, end) of when each was the last word."""
    times = [judgement["time"] for judgement in judgements] + [end]
    return [(judgement, times[i], max(times[i], times[i + 1])) for i, judgement in enumerate(judgements)]


def share_of(hypothesis, ranked):
    """Its evidence over the leader's, 0 to 1."""
    best, own = ranked[0]["evidence"], hypothesis["evidence"]
    return min(1.0, max(0.0, own / best)) if best and own else 0.0


def leading(judgements, which, first=(), most=ROWS):
    """Causes by how much of the leader's evidence they have over the run, those of `first` before all; and how many
    more there are."""
    weight = {}
    for judgement in judgements:
        for hypothesis in judgement[which]:
            name = cause_name(hypothesis)
            weight[name] = weight.get(name, 0.0) + share_of(hypothesis, judgement[which])
    order = sorted(weight, key=lambda name: (list(first).index(name) if name in first else len(first), -weight[name]))
    return order[:most], max(0, len(order) - most)


def named(judgements, alarms, which):
    """What the longest alarm of a cause of this ranking names, then what it says cannot be told from it; empty: no
    alarm names one."""
    ranked = {cause_name(h) for judgement in judgements for h in judgement[which]}
    naming = [alarm for alarm in alarms if "{}@{}".format(alarm.get("effect"), alarm.get("port")) in ranked]
    if not naming:
        return []
    longest = max(naming, key=lambda alarm: alarm["until"] - alarm["since"])
    return [longest["effect"] + "@" + longest["port"]] + list(longest.get("equivalent") or [])


def sizes_of(judgements, cause, end):
    """Rows (begin, end, value, low, high) of the cause's size, in SI; its name and unit."""
    rows, name, unit = [], "", ""
    for judgement, begin, until in spans(judgements, end):
        for hypothesis in judgement["first"]:
            size = hypothesis["size"]
            if cause_name(hypothesis) != cause or None in (size["value"], size["low"], size["high"]):
                continue
            rows.append((begin, until, size["value"], size["low"], size["high"]))
            name, unit = size["name"], size["unit"]
            break
    return np.array(rows), name, unit


def _evidence(axis, judgements, end, threshold):
    """As a staircase: a judgement stands until the next."""
    time = [judgement["time"] for judgement in judgements] + [end]
    best = [max(judgement["evidence"] or 0.0, LEAST_EVIDENCE) for judgement in judgements]
    values = np.array(best + best[-1:])
    low = 0.7 * LEAST_EVIDENCE
    axis.set_yscale("log")
    axis.set_ylim(low, 2.5 * max(values.max(), threshold))
    axis.fill_between(time, low, values, where=values > 0, step="post", color=OTHER, alpha=0.13, linewidth=0, zorder=2)
    axis.step(time, values, where="post", color=OTHER, linewidth=1.3, zorder=3)
    axis.axhline(threshold, color=base.KIND_COLOURS["fault"], linewidth=1.0, zorder=4)
    axis.text(
        0.004 * end,
        1.15 * threshold,
        "threshold {}: from here on there is a fault".format(show(threshold, 2)),
        color=base.KIND_COLOURS["fault"],
        fontsize=8.5,
        va="bottom",
        zorder=5,
    )
    axis.yaxis.set_major_locator(LogLocator(numticks=8))
    axis.yaxis.set_major_formatter(FuncFormatter(lambda value, _: "{:g}".format(value)))
    axis.minorticks_off()
    axis.set_ylabel("evidence")
    base._title(axis, "Is something wrong? Evidence of the best cause, as judged so far")


def _strips(axis, judgements, which, causes, told, left_out, sheet, end, title):
    """One strip per cause, the paler the less of the leader's evidence it has, with its rank where there is room."""
    numbered = len(judgements) <= NUMBERED
    for row, cause in enumerate(causes):
        effect, port = cause.split("@", 1)
        component = sheet.component(port)
        remark = "named" if told[:1] == [cause] else "cannot be told from it" if cause in told else ""
        axis.annotate(
            words(effect) + (", " + component if component else ""),
            (0, row - 0.31),
            fontsize=9,
            fontweight="bold",
            color="#20272e",
            va="center",
            annotation_clip=False,
        )
        if remark:
            axis.text(
                0.5 * end,
                row - 0.31,
                remark,
                fontsize=8.5,
                va="center",
                color=colour_of(judgements, which, cause) if remark == "named" else OTHER,
            )
        axis.text(end, row - 0.31, cause, fontsize=8.2, color=SOFT, va="center", ha="right", family="monospace")
        axis.barh(row + 0.14, end, height=0.42, color=BEHIND, alpha=0.35, linewidth=0, zorder=1)
        for judgement, begin, until in spans(judgements, end):
            ranked = judgement[which]
            rank = next((k for k, h in enumerate(ranked) if cause_name(h) == cause), None)
            if rank is None:
                continue
            colour = base.KIND_COLOURS.get(ranked[rank]["kind"], OTHER) if told[:1] == [cause] else OTHER
            alpha = 0.06 + (0.86 if told[:1] == [cause] else 0.62) * share_of(ranked[rank], ranked) ** 2
            axis.barh(
                row + 0.14, until - begin, left=begin, height=0.42, color=colour, alpha=alpha, linewidth=0, zorder=2
            )
            if numbered and until - begin > 0.012 * end:
                axis.text(
                    0.5 * (begin + until),
                    row + 0.15,
                    str(rank + 1),
                    fontsize=7.6,
                    ha="center",
                    va="center",
                    color="white" if alpha > 0.45 else "#3b444d",
                    zorder=3,
                )
    axis.set_ylim(len(causes) - 0.55, -0.65)
    axis.set_yticks([])
    axis.spines["left"].set_visible(False)
    axis.grid(False)
    base._title(axis, title)
    if left_out:
        axis.set_title(
            "and {} more".format(left_out), loc="right", pad=6, fontsize=8.5, fontweight="normal", color=SOFT
        )


def colour_of(judgements, which, cause):
    kinds = [h["kind"] for judgement in judgements for h in judgement[which] if cause_name(h) == cause]
    return base.KIND_COLOURS.get(kinds[-1] if kinds else "", OTHER)


def _size(axis, rows, name, unit, cause, colour):
    scale = Scale(unit)
    begin, until = rows[:, 0], rows[:, 1]
    value, low, high = (scale.factor * rows[:, column] + scale.shift for column in (2, 3, 4))
    largest = np.max(np.abs(value))
    power = int(np.floor(np.log10(largest))) if largest > 0 else 0
    power = power if not -4 <= power < 5 else 0
    value, low, high = (part / 10.0**power for part in (value, low, high))
    for k in range(len(rows)):
        axis.fill_between([begin[k], until[k]], low[k], high[k], color=colour, alpha=0.2, linewidth=0, zorder=2)
        axis.plot([begin[k], until[k]], [value[k]] * 2, color=colour, linewidth=1.6, zorder=4)
    # An interval may be wide at first: what came after the first quarter sets the scale, and the values all of it.
    late = slice(len(rows) // 4, None)
    least, most = min(0.0, value.min(), low[late].min()), max(0.0, value.max(), high[late].max())
    room = 0.1 * (most - least) or 1.0
    axis.set_ylim(least - (room if least < 0 else 0), most + room)
    axis.set_ylabel(base.raised(power) + scale.unit)
    effect = words(cause.partition("@")[0])
    base._title(
        axis, "How much? {} of the {}, with its 90 % interval".format(words(name).capitalize(), effect), entries=False
    )
    base._remark(
        axis,
        "last: {} ({} to {}) ".format(*(show(part[-1]) for part in (value, low, high)))
        + base.raised(power)
        + scale.unit,
        colour,
    )


def picture(judgements, sheet, alarms, end, label):
    """Of one stage."""
    judgements = fewer(judgements, end)
    told, told_beside = (named(judgements, alarms, which) for which in ("first", "second"))
    first, first_out = leading(judgements, "first", told)
    second, second_out = leading(judgements, "second", told_beside, 3)
    cause = first[0] if first else None
    # What explains more than all of them is told, and the size of what came nearest means nothing.
    doubt = judgements[-1].get("doubt")
    sized = cause and not doubt
    rows, name, unit = sizes_of(judgements, cause, end) if sized else (np.zeros((0, 5)), "", "")
    strip = 0.44
    heights = (
        [1.15] + [strip * len(causes) + 0.1 for causes in (first, second) if causes] + ([1.25] if len(rows) else [])
    )
    figure, axes = base._panels_of(heights, end, gap=0.46)
    axes = list(axes)
    for axis in axes:
        base._shade(axis, [alarm for alarm in alarms if alarm["kind"] in ("fault", "sensor")])
    _evidence(axes.pop(0), judgements, end, judgements[-1]["threshold"])
    if first:
        _strips(
            axes.pop(0),
            judgements,
            "first",
            first,
            told,
            first_out,
            sheet,
            end,
            "None of these causes: {}. They came nearest".format(doubt)
            if doubt
            else "What is it? Causes and their rank; the paler, the less of the leader's evidence",
        )
    if second:
        _strips(
            axes.pop(0),
            judgements,
            "second",
            second,
            told_beside,
            second_out,
            sheet,
            end,
            "What else is wrong beside it?",
        )
    if len(rows):
        _size(axes.pop(0), rows, name, unit, cause, colour_of(judgements, "first", cause))
    return base._svg(figure, label)


def draw_all(answer, sheet, end):
    """One picture per stage that ranks causes: [(stage, svg)]."""
    stages = {}
    for judgement in answer.get("rankings") or []:
        stages.setdefault(judgement["stage"], []).append(judgement)
    with plt.rc_context(base.STYLE), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return [
            (stage, picture(judgements, sheet, answer["alarms"], end, "ranking-{}".format(number)))
            for number, (stage, judgements) in enumerate(stages.items())
        ]
