"""Pictures of a gap: measured against simulated before and after, and how far each channel is from its noise."""
import warnings

import matplotlib.pyplot as plt
import numpy as np

import report_pictures as base
from report_units import Scale, show, words

LEVELS = {
    "nominal": ("#d1741b", "model as in the datasheet"),
    "refit": ("#1f5f99", "parameters refitted"),
    "explained": ("#2f8f5b", "cause added"),
}
MEASURED = "#1c1c1c"
ZOOM = 0.12  # of a run: the stretch that is shown close up


def shown_levels(answer):
    """Without an effect, `explained` is the refit once more."""
    return [name for name in LEVELS if name != "explained" or answer["cause"]["effects"]]


def began(answer):
    """Whether the cause began during a run; else runs have it from their beginning on, all or some."""
    since = answer["cause"].get("since")
    return bool(since) and since["time"] > 0


def level_name(answer, level):
    """Of a cause that began, the levels are of what follows."""
    return "model as calibrated before" if level == "nominal" and began(answer) else LEVELS[level][1]


def telling_channels(answer, most=4):
    """Channels that show the gap, the plainest first; at least one."""
    gap = answer["gap"]

    def ratio(name, level):
        entry = gap[level]["channels"][name]
        return entry["rms"]["segment"] / max(entry["noise_floor"], 1e-300)

    names = sorted(gap["refit"]["channels"], key=lambda name: -ratio(name, "refit"))
    plain = [name for name in names if ratio(name, "refit") > 1.2 or ratio(name, "nominal") > 1.5]
    return (plain or names[:1])[:most]


def worst_stretch(time, difference):
    """Start and end of the stretch in which the refitted model is furthest off."""
    rows = max(8, int(ZOOM * len(time)))
    if len(time) <= rows:
        return time[0], time[-1]
    sums = np.convolve(np.where(np.isfinite(difference), difference, 0) ** 2, np.ones(rows), "valid")
    first = int(np.argmax(sums))
    return time[first], time[first + rows - 1]


def comparison(answer, series, sheet, label="comparison"):
    names = [name for name in telling_channels(answer) if series.get("y:" + name) is not None]
    if not names:
        return None
    levels, height, gap, top, bottom = shown_levels(answer), 1.75, 0.62, 0.62, 0.5
    total = top + bottom + len(names) * height + (len(names) - 1) * gap
    figure = plt.figure(figsize=(base.WIDTH, total))
    wide, close = 0.54 * base.WIDTH, 0.30 * base.WIDTH
    for i, name in enumerate(names):
        entry = answer["gap"]["refit"]["channels"][name]
        scale, low = Scale(entry["unit"]), (total - top - (i + 1) * height - i * gap) / total
        left = figure.add_axes([base.LEFT / base.WIDTH, low, wide / base.WIDTH, height / total])
        right = figure.add_axes(
            [(base.WIDTH - base.RIGHT - close) / base.WIDTH, low, close / base.WIDTH, height / total]
        )
        time, measured = series.time, series.get("y:" + name)
        begin, end = worst_stretch(time, series.get("refit:" + name) - measured)
        noise = scale.span(entry["noise_floor"])
        left.axhspan(
            -2 * noise, 2 * noise, color="#c9cfd6", alpha=0.6, linewidth=0, zorder=1, label="±2 σ of the noise"
        )
        left.axvspan(begin, end, color="#6b4fa3", alpha=0.08, linewidth=0, zorder=0)
        inside = (time >= begin) & (time <= end)
        right.plot(
            time[inside], scale.value(measured[inside]), color=MEASURED, linewidth=1.3, zorder=3, label="measured"
        )
        parts = []
        for order, level in enumerate(levels):
            colour, text = LEVELS[level][0], level_name(answer, level)
            simulated = series.get(level + ":" + name)
            difference = scale.span(1) * (measured - simulated)
            parts.append(difference)
            left.plot(time, difference, color=colour, linewidth=0.7, alpha=0.9, zorder=2 + 0.1 * order, label=text)
            right.plot(
                time[inside],
                scale.value(simulated[inside]),
                color=colour,
                linewidth=1.1,
                zorder=4 + order,
                linestyle="-" if level == "explained" else (0, (4, 1.5)),
                label=text,
            )
        base._limits(left, parts + [np.array([-2 * noise, 2 * noise])])
        left.set_xlim(time[0], time[-1])
        right.set_xlim(begin, end)
        left.set_ylabel(scale.unit)
        left.set_title("{}: measured minus simulated".format(words(name).capitalize()), loc="left", pad=5)
        right.set_title(
            "Close up, {} to {} s".format(show(begin, decimals=1), show(end, decimals=1)), loc="left", pad=5
        )
        if i == 0:
            handles, texts = left.get_legend_handles_labels()
            more, names_of_more = right.get_legend_handles_labels()
            figure.legend(
                handles + more[:1],
                texts + names_of_more[:1],
                loc="upper left",
                ncol=5,
                handlelength=1.6,
                bbox_to_anchor=(base.LEFT / base.WIDTH - 0.01, 1.0),
                borderaxespad=0.1,
                columnspacing=1.6,
            )
        if i == len(names) - 1:
            left.set_xlabel("time from the start of the run [s]")
            right.set_xlabel("time [s]")
    return base._svg(figure, label)


def shrink(answer, label="shrink"):
    """Per channel, where the three levels lie in multiples of the noise."""
    levels = shown_levels(answer)
    names = list(answer["gap"]["refit"]["channels"])
    height = 0.36 * len(names)
    total = height + 0.95
    figure = plt.figure(figsize=(base.WIDTH, total))
    axis = figure.add_axes([2.0 / base.WIDTH, 0.5 / total, (base.WIDTH - 2.1) / base.WIDTH, height / total])
    largest = 1.0
    for row, name in enumerate(names):
        values = []
        for level in levels:
            entry = answer["gap"][level]["channels"][name]
            values.append(max(entry["rms"]["segment"] / max(entry["noise_floor"], 1e-300), 0.1))
        largest = max([largest] + values)
        axis.plot(
            [min(values), max(values)], [row, row], color="#c9cfd6", linewidth=4, solid_capstyle="round", zorder=2
        )
        for level, value in zip(levels, values):
            axis.plot(
                [value],
                [row],
                "o",
                color=LEVELS[level][0],
                markersize=7,
                zorder=3,
                label=level_name(answer, level) if row == 0 else None,
            )
    axis.axvline(1, color="#5a646e", linewidth=1.0, linestyle=(0, (3, 2)), zorder=1)
    axis.set_xscale("log")
    axis.set_xlim(0.75, 1.35 * max(largest, 4))
    ticks = [
        tick for tick in (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10000) if tick < 1.35 * max(largest, 4)
    ]
    axis.set_xticks(ticks)
    axis.set_xticklabels(["noise" if tick == 1 else "{} ×".format(tick) for tick in ticks])
    axis.minorticks_off()
    axis.set_yticks(range(len(names)))
    axis.set_yticklabels([words(name) for name in names])
    axis.set_ylim(len(names) - 0.5, -0.5)
    axis.set_xlabel("root mean square of measured minus simulated, in multiples of the noise")
    figure.legend(
        loc="upper left", ncol=3, handlelength=1.0, bbox_to_anchor=(2.0 / base.WIDTH - 0.01, 1.0), borderaxespad=0.1
    )
    return base._svg(figure, label)


def _in_brackets(unit):
    return " [{}]".format(unit) if unit else ""


def missing(answer, label="missing"):
    """The reconstructed signal over the variable that explains most, and over time, in SI units as the formula."""
    found = answer.get("missing")
    if not found or not found["course"]["time"]:
        return None
    unit = Scale(found["unit"], engineering=False).unit
    curve, course = found["curve"], {key: np.array(values) for key, values in found["course"].items() if key != "run"}
    total, low, height = 2.9, 0.5 / 2.9, 1.9 / 2.9
    figure = plt.figure(figsize=(base.WIDTH, total))
    if curve:
        left = figure.add_axes([base.LEFT / base.WIDTH, low, 0.36, height])
        left.plot(found["points"]["at"], found["points"]["value"], ".", color="#8a949e", markersize=3, zorder=1)
        at, value, error = (np.array(curve[key]) for key in ("at", "value", "standard_error"))
        left.fill_between(
            at, value - 1.645 * error, value + 1.645 * error, color="#6b4fa3", alpha=0.2, linewidth=0, zorder=2
        )
        left.plot(at, value, "o-", color="#6b4fa3", linewidth=1.4, markersize=4, zorder=3)
        variable_unit = Scale(curve["unit"], engineering=False).unit
        left.set_xlabel(words(curve["variable"]) + _in_brackets(variable_unit))
        left.set_ylabel("signal" + _in_brackets(unit))
        left.set_title("Over {}".format(words(curve["variable"])), loc="left", pad=5)
    begin, width = (0.56, 0.42) if curve else (base.LEFT / base.WIDTH, 0.86)
    right = figure.add_axes([begin, low, width, height])
    right.fill_between(
        course["time"],
        course["value"] - 1.645 * course["standard_error"],
        course["value"] + 1.645 * course["standard_error"],
        color="#8a949e",
        alpha=0.35,
        linewidth=0,
        label="reconstructed, 90 %",
    )
    right.plot(course["time"], course["value"], color=MEASURED, linewidth=1.0)
    if found["formula"]:
        right.plot(course["time"], course["formula"], color="#6b4fa3", linewidth=1.1, label="formula")
    right.set_xlim(course["time"][0], course["time"][-1])
    right.set_xlabel("time from the start of the run [s]")
    right.set_title("Over time", loc="left", pad=5)
    right.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncol=2, handlelength=1.4, borderaxespad=0.1)
    return base._svg(figure, label)


def draw_all(answer, series, sheet):
    with plt.rc_context(base.STYLE), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return {"comparison": comparison(answer, series, sheet), "shrink": shrink(answer), "missing": missing(answer)}
