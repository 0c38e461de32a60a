"""The report's pictures, each an SVG string: alarms over time, signals, estimates with bounds, residuals.

A run has far more samples than a screen has pixels. Signals are reduced to the extremes of each of a thousand or so
stretches and the middle between them, so that no spike is lost; estimates to that middle.
"""
import io
import re
import warnings

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402

from report_data import quantity_unit  # noqa: E402
from report_units import Scale, show, words  # noqa: E402

KIND_COLOURS = {"fault": "#c0362c", "sensor": "#b4570f", "data": "#8a6d0b", "model": "#2f6fa8", "unknown": "#6b4fa3"}
LINES = ["#1f5f99", "#d1741b", "#2f8f5b", "#8d4fa8", "#4d4d4d", "#b8336a", "#0f8b8d"]
TRUTH, BAND = "#1c1c1c", "#2f8f5b"
NINETY = 1.6449  # two-sided 90 % bounds of a normal distribution, in standard deviations
STRETCHES = 1100
WIDTH, LEFT, RIGHT = 10.6, 0.8, 0.1  # inches, of the picture and of its margins; the page scales it

STYLE = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 9,
    "svg.fonttype": "none",
    "axes.edgecolor": "#9aa3ad",
    "axes.linewidth": 0.7,
    "axes.labelcolor": "#3b444d",
    "axes.labelsize": 9,
    "axes.titlesize": 9.5,
    "axes.titleweight": "bold",
    "axes.titlecolor": "#20272e",
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e6e9ed",
    "grid.linewidth": 0.7,
    "xtick.color": "#5a646e",
    "ytick.color": "#5a646e",
    "xtick.labelsize": 8.5,
    "ytick.labelsize": 8.5,
    "xtick.major.size": 3,
    "ytick.major.size": 3,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "lines.linewidth": 0.9,
    "lines.solid_joinstyle": "round",
    "figure.facecolor": "none",
    "axes.facecolor": "none",
    "savefig.facecolor": "none",
}
PAGE_FONTS = "system-ui,-apple-system,'Segoe UI',Roboto,'Helvetica Neue','Noto Sans','Liberation Sans',sans-serif"


# ---- Fewer points


def stretches(rows, wanted=STRETCHES):
    """First rows of about `wanted` stretches of equal length; of even length, since the series comes in pairs."""
    step = -(-rows // wanted)
    return np.arange(0, rows, step + step % 2 if step > 1 else 1)


def envelope(values, wanted=STRETCHES):
    """First row, smallest and largest number of every stretch; not a number where a stretch has none."""
    starts = stretches(len(values), wanted)
    good = np.isfinite(values)
    low = np.minimum.reduceat(np.where(good, values, np.inf), starts)
    high = np.maximum.reduceat(np.where(good, values, -np.inf), starts)
    empty = low > high
    low[empty], high[empty] = np.nan, np.nan
    return starts, low, high


def middle(time, values):
    """Time and middle between the extremes of every stretch."""
    starts, low, high = envelope(values)
    return time[starts], 0.5 * (low + high)


# ---- Parts of a picture


def _svg(figure, label):
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    plt.close(figure)
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.S)
    text = re.sub(r"<!--.*?-->", "", text, flags=re.S)
    # Names must differ between the pictures of one page.
    text = re.sub(r'\bid="([^"]+)"', r'id="{}-\1"'.format(label), text)
    text = re.sub(r"url\(#([^)]+)\)", r"url(#{}-\1)".format(label), text)
    text = re.sub(r'xlink:href="#([^"]+)"', r'xlink:href="#{}-\1"'.format(label), text)
    text = re.sub(r"(font(?:-family)?:[^;\"]*?)'DejaVu Sans'[^;\"]*", lambda m: m.group(1) + PAGE_FONTS, text)
    width, height = re.search(r'viewBox="0 0 ([\d.]+) ([\d.]+)"', text).groups()
    text = re.sub(
        r'<svg [^>]*>',
        '<svg viewBox="0 0 {} {}" role="img" xmlns="http://www.w3.org/2000/svg" '
        'xmlns:xlink="http://www.w3.org/1999/xlink">'.format(width, height),
        text,
        count=1,
    )
    return text


def _panels(count, height, end, gap=0.5):
    return _panels_of([height] * count, end, gap)


def _panels_of(heights, end, gap=0.5):
    """A column of panels that share the time axis; sizes in inches, so that all pictures of the page line up."""
    top, bottom, left, right = 0.32, 0.5, LEFT, RIGHT
    total = top + bottom + sum(heights) + (len(heights) - 1) * gap
    figure = plt.figure(figsize=(WIDTH, total))
    axes = []
    low = total - top + gap
    for i, height in enumerate(heights):
        low -= height + gap
        axis = figure.add_axes([left / WIDTH, low / total, (WIDTH - left - right) / WIDTH, height / total])
        axis.set_xlim(0, end)
        if i < len(heights) - 1:
            axis.tick_params(labelbottom=False)
        axes.append(axis)
    axes[-1].set_xlabel("time from the start [s]")
    return figure, axes


def _trace(axis, time, values, colour, width=0.9, label=None, style="-", order=3):
    """A signal: its extremes as a pale band, so that no spike is lost, and the middle between them as a line."""
    starts, low, high = envelope(values)
    axis.fill_between(time[starts], low, high, color=colour, alpha=0.3, linewidth=0, zorder=order - 0.5)
    axis.plot(
        time[starts], 0.5 * (low + high), color=colour, linewidth=width, linestyle=style, zorder=order, label=label
    )
    return low, high


def _shade(axis, alarms):
    for alarm in alarms:
        colour = KIND_COLOURS.get(alarm["kind"], KIND_COLOURS["unknown"])
        axis.axvspan(alarm["since"], alarm["until"], color=colour, alpha=0.07, linewidth=0, zorder=0)
        axis.axvline(alarm["since"], color=colour, alpha=0.55, linewidth=0.8, linestyle=(0, (4, 2)), zorder=1)


def _title(axis, text, entries=True):
    axis.set_title(text, loc="left", pad=6)
    handles, labels = axis.get_legend_handles_labels()
    if entries and handles:
        axis.legend(
            handles,
            labels,
            loc="lower right",
            bbox_to_anchor=(1.0, 0.985),
            ncol=len(handles),
            borderaxespad=0,
            handlelength=1.6,
            columnspacing=1.4,
            handletextpad=0.5,
        )


def _remark(axis, text, colour="#5a646e"):
    axis.text(1.0, 1.05, text, transform=axis.transAxes, ha="right", va="bottom", fontsize=8.5, color=colour)


def raised(power):
    """`10⁻⁸ ` for a label; nothing where there is no power."""
    superscript = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
    return "10" + str(power).translate(superscript) + " " if power else ""


def chi_square_99(degrees):
    """What 99 of 100 chi-square numbers stay below; Wilson and Hilferty 1931, good to one per cent."""
    part = 2.0 / (9.0 * degrees)
    return degrees * (1.0 - part + 2.326 * part**0.5) ** 3


def _limits(axis, parts, spread=0.08):
    """Limits that hold all but the rarest values: the first instants of an estimate may be far off."""
    good = np.concatenate([part[np.isfinite(part)] for part in parts])
    if len(good) == 0:
        return
    low, high = np.percentile(good, [0.3, 99.7])
    room = spread * (high - low) if high > low else max(abs(high), 1.0) * 0.1
    axis.set_ylim(low - room, high + room)


# ---- The pictures


def alarm_line(alarms, end, label="alarms", most=24):
    shown = alarms[:most]
    height = 0.34 * len(shown) + 0.1
    figure = plt.figure(figsize=(WIDTH, height + 0.6))
    axis = figure.add_axes(
        [LEFT / WIDTH, 0.5 / (height + 0.6), (WIDTH - LEFT - RIGHT) / WIDTH, height / (height + 0.6)]
    )
    for row, alarm in enumerate(shown):
        colour = KIND_COLOURS.get(alarm["kind"], KIND_COLOURS["unknown"])
        since, until = alarm["since"], alarm["until"]
        axis.barh(row, max(until - since, end * 0.002), left=since, height=0.62, color=colour, alpha=0.85, linewidth=0)
        if alarm.get("raised") is not None:
            axis.plot([alarm["raised"]] * 2, [row - 0.42, row + 0.42], color="#15191d", linewidth=1.4)
        place = (alarm.get("port") or "").partition(".")[2] if not alarm.get("effect") else ""
        name = alarm["what"] + (": " + words(place) if place else "")
        # Beside the bar where there is room, else in it.
        before = since / end > 0.28
        after = not before and (end - until) / end > 0.28
        x = since - end * 0.008 if before else until + end * 0.008 if after else since + end * 0.012
        axis.text(
            x,
            row,
            "{}  {}".format(alarm["number"], name),
            va="center",
            ha="right" if before else "left",
            fontsize=8.8,
            color="#20272e" if before or after else "white",
        )
    axis.set_ylim(len(shown) - 0.4, -0.6)
    axis.set_xlim(0, end)
    axis.set_yticks([])
    axis.spines["left"].set_visible(False)
    axis.set_xlabel("time from the start [s]")
    return _svg(figure, label)


def settled(end):
    """s: before, a rig moves to where it works and an estimate knows little; such moments do not set a picture's
    scale."""
    return min(3.0, 0.05 * end)


def signals(series, sheet, alarms, end, label="signals"):
    """One panel for every unit: set point and commands behind, what was measured in front."""
    order = {"output": 0, "input": 1, "setpoint": 2, "command": 3}
    groups = {}
    for name in series.channels():
        if np.isfinite(series.get(name)).any():
            groups.setdefault(sheet.unit(name) or series.units.get(name, ""), []).append(name)
    if not groups:
        return None
    figure, axes = _panels(len(groups), 1.32, end)
    for axis, (unit, names) in zip(axes, groups.items()):
        scale = Scale(unit)
        names.sort(key=lambda name: order.get(sheet.channels.get(name, {}).get("role"), 0))
        _shade(axis, alarms)
        lowest, highest = np.inf, -np.inf
        for i, name in enumerate(names):
            role = sheet.channels.get(name, {}).get("role")
            truth = sheet.ground_truth(name)
            low, high = _trace(
                axis,
                series.time,
                scale.value(series.get(name)),
                TRUTH if truth else LINES[i % len(LINES)],
                label=words(name) + (" (ground truth)" if truth else ""),
                order=4 - 0.1 * i,
                style=(0, (4, 1.5)) if role == "setpoint" else "-",
            )
            # A broken cable may send anything: what the transducer cannot show does not set the scale.
            floor, ceiling = sheet.channels.get(name, {}).get("range", (-np.inf, np.inf))
            shown = np.isfinite(low) & (series.time[stretches(series.rows)] >= settled(end))
            if shown.any():
                lowest = min(lowest, max(low[shown].min(), scale.value(floor)))
                highest = max(highest, min(high[shown].max(), scale.value(ceiling)))
        if lowest > highest:
            lowest, highest = 0.0, 0.0
        room = 0.08 * (highest - lowest) if highest > lowest else max(0.1 * abs(highest), 1e-3)
        axis.set_ylim(lowest - room, highest + room)
        axis.set_ylabel(scale.unit)
        _title(
            axis,
            {
                "m": "Position",
                "m/s": "Velocity",
                "Pa": "Pressure",
                "V": "Voltage",
                "m^3/s": "Flow",
                "N": "Force",
                "K": "Temperature",
                "rad/s": "Speed",
                "rad": "Angle",
                "N m": "Torque",
                "A": "Current",
                "kg/s": "Mass flow",
            }.get(unit, "Signals in " + scale.unit if scale.unit else "Signals"),
        )
    return _svg(figure, label)


def estimated(series):
    """Names of the quantities that carry an uncertainty of their own; the others follow from measurements alone."""
    result = []
    for name in series.names("q."):
        std = series.std("q." + name)
        if std is not None and np.nanmax(np.where(np.isfinite(std), std, 0.0)) > 0:
            result.append(name)
    return result


def estimates(series, sheet, alarms, end, label="estimates"):
    # A flow or a force says more than the coefficient behind it: coefficients last.
    names = sorted(estimated(series), key=lambda name: name.endswith("coefficient"))
    if not names:
        return None
    figure, axes = _panels(len(names), 1.75, end)
    for axis, name in zip(axes, names):
        unit = quantity_unit(name, series, sheet)
        scale = Scale(unit)
        time, value = middle(series.time, scale.value(series.get("q." + name)))
        spread = NINETY * middle(series.time, scale.span(series.std("q." + name)))[1]
        largest = np.nanmax(np.abs(value)) if np.isfinite(value).any() else 0
        power = int(np.floor(np.log10(largest))) if largest > 0 else 0
        power = power if not -4 <= power < 5 else 0
        value, spread = value / 10.0**power, spread / 10.0**power
        _shade(axis, alarms)
        axis.fill_between(
            time, value - spread, value + spread, color=LINES[0], alpha=0.2, linewidth=0, zorder=2, label="90 % bounds"
        )
        axis.plot(time, value, color=LINES[0], linewidth=1.1, zorder=4, label="estimate")
        known = time >= settled(end)
        parts = [value[known], (value - spread)[known], (value + spread)[known]]
        truth = series.get(name)
        if truth is not None and np.isfinite(truth).any() and sheet.ground_truth(name):
            at, true = middle(series.time, scale.value(truth) / 10.0**power)
            axis.plot(
                at,
                true,
                color=TRUTH,
                linewidth=0.8,
                zorder=3,
                alpha=0.85,
                label="flow meter" if unit == "m^3/s" else "measured",
            )
            parts.append(true)
        _limits(axis, parts)
        axis.set_ylabel(raised(power) + scale.unit)
        _title(axis, words(name).capitalize())
    return _svg(figure, label)


def residuals(series, alarms, end, label="residuals"):
    """Every innovation in units of its own predicted standard deviation, and their normalised sum of squares."""
    names = [name for name in series.names("i.") if series.std("i." + name) is not None]
    whole = series.get("normalised_innovation")
    count = len(names) + (whole is not None)
    if count == 0:
        return None
    figure, axes = _panels(count, 1.05, end, gap=0.42)
    for axis, name in zip(axes, names):
        std = series.std("i." + name)
        with np.errstate(invalid="ignore", divide="ignore"):
            ratio = np.where(std > 0, series.get("i." + name) / std, np.nan)
        good = np.abs(ratio[np.isfinite(ratio)])
        _shade(axis, alarms)
        for level in (-2, 2):
            axis.axhline(level, color=BAND, linewidth=0.8, zorder=4)
        _trace(axis, series.time, ratio, LINES[0])
        top = min(12.0, max(3.2, 1.15 * np.percentile(good, 99.9))) if len(good) else 3.2
        axis.set_ylim(-top, top)
        axis.set_ylabel("σ")
        _title(axis, words(name).capitalize())
        _remark(axis, "largest: {} σ".format(show(np.max(good), 2)) if len(good) else "not observed")
    if whole is not None:
        axis = axes[-1]
        _shade(axis, alarms)
        _, high = _trace(axis, series.time, whole, LINES[3])
        degrees = max(len(names), 1)
        limit = chi_square_99(degrees)
        axis.axhline(limit, color=BAND, linewidth=1.0, zorder=4)
        good = high[np.isfinite(high)]
        axis.set_ylim(0, max(1.2 * limit, 1.1 * np.percentile(good, 99.0)) if len(good) else 1.2 * limit)
        _title(axis, "Normalised innovation squared, all channels")
        _remark(axis, "where model and noise are right, 99 of 100 samples lie below {:.1f}".format(limit), BAND)
    return _svg(figure, label)


def balances(series, sheet, alarms, end, label="balances"):
    """Quantities that follow from measurements alone: what redundant transducers say about each other."""
    names = [
        name
        for name in series.names("q.")
        if name not in estimated(series) and np.isfinite(series.get("q." + name)).any()
    ]
    if not names:
        return None
    figure, axes = _panels(len(names), 1.05, end, gap=0.42)
    for axis, name in zip(axes, names):
        scale = Scale(quantity_unit(name, series, sheet))
        _shade(axis, alarms)
        _limits(axis, _trace(axis, series.time, scale.value(series.get("q." + name)), LINES[2]))
        axis.set_ylabel(scale.unit)
        _title(axis, words(name).capitalize())
    return _svg(figure, label)


def draw_all(answer, series, sheet, end):
    alarms = answer["alarms"]
    with plt.rc_context(STYLE), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return {
            "alarms": alarm_line(alarms, end) if alarms else None,
            "signals": signals(series, sheet, alarms, end),
            "estimates": estimates(series, sheet, alarms, end),
            "residuals": residuals(series, alarms, end),
            "balances": balances(series, sheet, alarms, end),
        }
