#!/usr/bin/python3
"""Draws what a rig's histograms have learnt, as histogram_node publishes it: counts, means and limits of every bin.

  rosrun faultline draw_histograms.py --rig RIG [--out FILE.png] [--wait 30]

One panel a variable. To the right runs the explanatory variable whose bins they are; where there are two, the last
one, in the row of bins that was visited most, which the title names. Shaded: counts, each bin's largest the darkest.
Lines: mean and limits. The dot is the last sample. The second line of the title is what isolation reads: the shares of
the window beyond the limits, and the level (0.5 where nothing has shifted); "learning" while nothing is judged yet.
Exit: 0; 1 if nothing is heard in time; 2 for bad usage.
"""
import argparse
import math
import sys
import time

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402
import rospy  # noqa: E402

from faultline.msg import Histogram  # noqa: E402


def row_of(message):
    """(first bin, number of bins, words) of the bins that are drawn."""
    bins = list(message.axis_bins) or [1]
    if len(bins) == 1:
        return 0, bins[0], ""
    per_row = np.reshape(message.population, bins).sum(axis=1)
    row = int(np.argmax(per_row))
    step = (message.axis_high[0] - message.axis_low[0]) / bins[0]
    ends = [message.axis_low[0] + k * step for k in (row, row + 1)]
    return row * bins[1], bins[1], ", {} {:.4g} to {:.4g}".format(message.axes[0], *ends)


def shift_of(message):
    if not message.judging:
        return "learning"
    words = "beyond the limits: high {:.2f}, low {:.2f}; level {:.2f}"
    return words.format(message.above, message.below, message.level)


def draw(axis, message):
    first, number, words = row_of(message)
    low = message.axis_low[-1] if message.axes else 0
    step = (message.axis_high[-1] - low) / number if message.axes else 1
    counts = np.reshape(message.counts, (-1, message.sections))[first : first + number]
    lines = {"mean": [], "low": [], "high": []}
    for k in range(number):
        b = first + k
        left, right = low + k * step, low + (k + 1) * step
        if message.population[b] > 0:
            edges = message.start[b] + message.width[b] * np.arange(message.sections + 1)
            shade = counts[k][:, None] / max(1.0, counts[k].max())
            axis.pcolormesh([left, right], edges, shade, cmap="Blues", vmin=0, vmax=1, rasterized=True)
        for name, line in lines.items():
            line += [(left, getattr(message, name)[b]), (right, getattr(message, name)[b]), (right, math.nan)]
    for name, line in lines.items():
        axis.plot(*zip(*line), color="black" if name == "mean" else "tab:red", linewidth=1)
    known = [y for name in lines for _, y in lines[name] if not math.isnan(y)]
    if known:
        margin = 0.3 * (max(known) - min(known))
        axis.set_ylim(min(known) - margin, max(known) + margin)
    if first <= message.bin < first + number:
        axis.plot(low + (message.bin - first + 0.5) * step, message.value, "o", color="tab:orange", markersize=4)
    axis.set_title(message.variable + words + "\n" + shift_of(message), fontsize=7)
    axis.yaxis.get_offset_text().set_fontsize(7)
    axis.set_ylabel(message.unit, fontsize=8)
    axis.set_xlabel("{} [{}]".format(message.axes[-1], message.axis_units[-1]) if message.axes else "", fontsize=8)
    axis.tick_params(labelsize=7)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rig", required=True)
    parser.add_argument("--out", default="histograms.png")
    parser.add_argument("--wait", type=float, default=30, help="s, for the first message")
    options = parser.parse_args(rospy.myargv(sys.argv)[1:])
    heard = {}
    rospy.init_node("draw_histograms", anonymous=True, disable_signals=True)
    topic = "/{}/histogram".format(options.rig)
    rospy.Subscriber(topic, Histogram, lambda m: heard.__setitem__(m.stage + " " + m.variable, m), queue_size=100)
    end = time.monotonic() + options.wait
    while not heard and time.monotonic() < end:
        time.sleep(0.05)
    if not heard:
        problem = "draw_histograms: nothing came on {} in {:g} s; is histogram_node running?"
        sys.exit(problem.format(topic, options.wait))
    time.sleep(1.5)  # a message a variable comes once a second
    messages = list(heard.values())
    columns = min(4, len(messages))
    rows = math.ceil(len(messages) / columns)
    size = (3.4 * columns, 2.6 * rows)
    figure, axes = plt.subplots(rows, columns, figsize=size, squeeze=False, constrained_layout=True)
    for axis, message in zip(axes.flat, messages):
        draw(axis, message)
    for axis in axes.flat[len(messages) :]:
        axis.axis("off")
    figure.savefig(options.out, dpi=110)
    print("{} variables -> {}".format(len(messages), options.out))


if __name__ == "__main__":
    main()
