"""The ranking of causes over time: whether something is wrong, which causes explain it, and how large the named one is.

A judgement (docs/diagnose.schema.json, `rankings`) holds from when it was told until the next one.
"""
import warnings

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

import report_pictures as base
from report_units import Scale, show, words

ROWS = 6  # causes that are shown, each in a strip of its own
SOFT, OTHER, BEHIND = "#5a646e", "#1f5f99", "#e4e8ec"
LEAST_EVIDENCE = 1.0  # what is less is drawn as this, for the logarithm
NUMBERED = 45  # judgements, up to which there is room for the ranks


def cause_name(hypothesis):
    return hypothesis["effect"] + "@" + hypothesis["port"]


def spans(judgements, end):
    """(judgement, begin, end) of when each was the last word."""
    times = [judgement["time"] for judgement in judgements] + [end]
    return [(judgement, times[i], max(times[i], times[i + 1])) for i, judgement in enumerate(judgements)]


def leading(judgements, which, most=ROWS):
    """Causes, the one that leads longest first; each by its best rank, how often it has that, and its evidence."""
    weight = {}
    for judgement in judgements:
        for rank, hypothesis in enumerate(judgement[which]):
            best = judgement[which][0]["evidence"]
            weight.setdefault(cause_name(hypothesis), []).append((rank, hypothesis["evidence"] / best if best else 0.0))

    def order(cause):
        ranks = [rank for rank, _ in weight[cause]]
        return -ranks.count(0), -sum(share for _, share in weight[cause])

    return sorted(weight, key=order)[:most], max(0, len(weight) - most)


def named_cause(judgements, alarms):
    """The cause whose size is told: what an alarm names, else what leads longest; None while nothing is wrong."""
    ranked = {cause_name(h) for judgement in judgements for h in judgement["first"]}
    named = [alarm for alarm in alarms if "{}@{}".format(alarm.get("effect"), alarm.get("port")) in ranked]
    if named:
        longest = max(named, key=lambda alarm: alarm["until"] - alarm["since"])
        return longest["effect"] + "@" + longest["port"]
    causes, _ = leading(judgements, "first", 1)
    return causes[0] if causes else None


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
    axis.text(0.004 * end, 1.15 * threshold, "threshold {}: from here on there is a fault".format(show(threshold, 2)),
              color=base.KIND_COLOURS["fault"], fontsize=8.5, va="bottom", zorder=5)
    axis.yaxis.set_major_locator(LogLocator(numticks=8))
    axis.yaxis.set_major_formatter(FuncFormatter(lambda value, _: "{:g}".format(value)))
    axis.yaxis.set_minor_formatter(NullFormatter())
    axis.set_ylabel("evidence")
    base._title(axis, "Is something wrong? Evidence of the best cause, as judged so far")


def _strips(axis, judgements, which, causes, left_out, sheet, end, title):
    """One strip per cause: dark where it leads, paler the less of the leader's evidence it has; its rank where there is room."""
    numbered = len(judgements) <= NUMBERED
    for row, cause in enumerate(causes):
        effect, port = cause.split("@", 1)
        component = sheet.component(port)
        axis.text(0, row - 0.31, words(effect) + (", " + component if component else ""), fontsize=9, fontweight="bold",
                  color="#20272e", va="center")
        axis.text(end, row - 0.31, cause, fontsize=8.2, color=SOFT, va="center", ha="right", family="monospace")
        axis.barh(row + 0.14, end, height=0.42, color=BEHIND, alpha=0.35, linewidth=0, zorder=1)
        for judgement, begin, until in spans(judgements, end):
            ranked = judgement[which]
            rank = next((k for k, h in enumerate(ranked) if cause_name(h) == cause), None)
            if rank is None:
                continue
            share = max(0.0, min(1.0, ranked[rank]["evidence"] / ranked[0]["evidence"])) if ranked[0]["evidence"] else 0.0
            colour = base.KIND_COLOURS.get(ranked[rank]["kind"], OTHER) if rank == 0 else OTHER
            alpha = 0.92 if rank == 0 else 0.08 + 0.6 * share**2
            axis.barh(row + 0.14, until - begin, left=begin, height=0.42, color=colour, alpha=alpha, linewidth=0, zorder=2)
            if numbered and until - begin > 0.012 * end:
                axis.text(0.5 * (begin + until), row + 0.15, str(rank + 1), fontsize=7.6, ha="center", va="center",
                          color="white" if alpha > 0.45 else "#3b444d", zorder=3)
    axis.set_ylim(len(causes) - 0.55, -0.65)
    axis.set_yticks([])
    axis.spines["left"].set_visible(False)
    axis.grid(False)
    base._title(axis, title)
    if left_out:
        base._remark(axis, "{} more that never came close are left out".format(left_out))


def _size(axis, rows, name, unit, cause):
    scale = Scale(unit)
    begin, until = rows[:, 0], rows[:, 1]
    value, low, high = (scale.factor * rows[:, column] + scale.shift for column in (2, 3, 4))
    largest = np.max(np.abs(value))
    power = int(np.floor(np.log10(largest))) if largest > 0 else 0
    power = power if not -4 <= power < 5 else 0
    value, low, high = (part / 10.0**power for part in (value, low, high))
    colour = base.KIND_COLOURS["fault"]
    for k in range(len(rows)):
        axis.fill_between([begin[k], until[k]], low[k], high[k], color=colour, alpha=0.2, linewidth=0, zorder=2)
        axis.plot([begin[k], until[k]], [value[k]] * 2, color=colour, linewidth=1.6, zorder=4)
    # Early intervals may be wide: what came after the first quarter sets the scale, and the values all of it.
    late = slice(len(rows) // 4, None)
    base._limits(axis, [value, low[late], high[late], np.zeros(1)])
    axis.set_ylabel(base.raised(power) + scale.unit)
    effect = words(cause.partition("@")[0])
    base._title(axis, "How much? {} of the {}, with its 90 % interval".format(words(name).capitalize(), effect), entries=False)
    base._remark(axis, "last: {} ({} to {}) ".format(*(show(part[-1]) for part in (value, low, high)))
                 + base.raised(power) + scale.unit, colour)


def picture(judgements, sheet, alarms, end, label):
    """Of one stage."""
    first, first_out = leading(judgements, "first")
    second, second_out = leading(judgements, "second", 3)
    cause = named_cause(judgements, alarms)
    rows, name, unit = sizes_of(judgements, cause, end) if cause else (np.zeros((0, 5)), "", "")
    strip = 0.44
    heights = [1.15] + [strip * len(causes) + 0.1 for causes in (first, second) if causes] + ([1.25] if len(rows) else [])
    figure, axes = base._panels_of(heights, end, gap=0.46)
    axes = list(axes)
    for axis in axes:
        base._shade(axis, [alarm for alarm in alarms if alarm["kind"] in ("fault", "sensor")])
    _evidence(axes.pop(0), judgements, end, judgements[-1]["threshold"])
    if first:
        _strips(axes.pop(0), judgements, "first", first, first_out, sheet, end,
                "What is it? Causes by rank; the paler, the less of the leader's evidence")
    if second:
        _strips(axes.pop(0), judgements, "second", second, second_out, sheet, end, "What else is wrong beside the first?")
    if len(rows):
        _size(axes.pop(0), rows, name, unit, cause)
    return base._svg(figure, label)


def draw_all(answer, sheet, end):
    """One picture per stage that ranks causes: [(stage, svg)]."""
    stages = {}
    for judgement in answer.get("rankings") or []:
        stages.setdefault(judgement["stage"], []).append(judgement)
    with plt.rc_context(base.STYLE), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return [(stage, picture(judgements, sheet, answer["alarms"], end, "ranking-{}".format(number)))
                for number, (stage, judgements) in enumerate(stages.items())]
