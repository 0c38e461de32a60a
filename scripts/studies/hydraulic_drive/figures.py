#!/usr/bin/python3
"""The parameter estimates of Yu (1997) on the hydraulic drive: the paper's three figures and relative changes beside
ours, and what forgetting, interpolation, bandwidth and noise do to them. Pictures, and tables on standard output.

Rigs are off their datasheet by their tolerances and carry the small effects of every recording; the estimator is the
datasheet's where nothing else is said. Seeds are none that settings were chosen with (1 to 20).

    scripts/studies/hydraulic_drive/figures.py [paper trade coverage] [--seeds 20] [-o docs/pictures]
"""

import argparse
import pathlib
import sys
import tempfile

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import yaml

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))
from rig_runs import datasheet, diagnose, drawn, record, values, write_datasheet

RIG = "hydraulic_drive"
BLUE, ORANGE, GREEN, GREY = "#1f5f99", "#d1741b", "#2f8f5b", "#8a9199"
NAMES = ("a11", "a12", "a13")
UNITS = "1/s, rpm/(s bar), rpm/(s bar)"  # the paper's
WEIGHTS = (0.1, 0.001, 0.001)  # of the paper's figures
SI = np.array([1, 1, 1]) * np.array([1, 30 / np.pi * 1e5, 30 / np.pi * 1e5])
PUBLISHED = yaml.safe_load((pathlib.Path(__file__).parent / "published.yaml").read_text())
ALLOWED = PUBLISHED["delay_samples"]
FIRST_SEED = 501
LAST = 3000
NEVER = 1e9  # renewal

# The paper's faults: symbol there, parameter, sample, and what a perfect estimator would see of a11, a12, a13.
SETS = {
    "set_1": [("eta_m", "motor_efficiency", 200, (1, 1.1, 1)), ("eta_p", "pump_efficiency", 1600, (1, 1, 1 / 1.1))],
    "set_2": [("I", "inertia", 200, (1 / 1.1,) * 3), ("D", "viscous_friction", 1600, (1.1, 1, 1))],
    "set_3": [
        ("C_r", "displacement", 200, (1, 1.1, 1.1)),
        ("K_0", "flow_coefficient", 1400, (1, 1, 1)),
        ("K_l", "leakage_coefficient", 1800, (1, 1, 1)),
        ("V_t", "trapped_volume", 2200, (1, 1, 1)),
        ("B", "bulk_modulus", 2600, (1, 1, 1)),
    ],
}
HALF = 0.05  # half a change of 10 %
STAY = 50  # samples
SETTLED = 400  # samples after a fault, from which its steady value is taken


def stage():
    sheet = datasheet(RIG)
    return next(dict(e) for e in sheet["estimators"] if e.get("model") == "differential_relation")


def true_values(parameters):
    p = parameters
    return SI * np.array(
        [
            -p["viscous_friction"] / p["inertia"],
            p["displacement"] * p["motor_efficiency"] / p["inertia"],
            -p["displacement"] / p["inertia"] / p["pump_efficiency"],
        ]
    )


def course(parameters, fault):
    """a11, a12, a13 at every sample of a fault set."""
    truth = np.tile(true_values(parameters), (LAST + 1, 1))
    for _, _, k, factors in SETS.get(fault, []):
        truth[k:] *= factors
    return truth


class Runs:
    def __init__(self, folder):
        self.folder = pathlib.Path(folder)
        self.sheet = datasheet(RIG)

    def record(self, seed, *arguments, nominal=False):
        """A recording of the rig of that seed, and its parameters."""
        rig = self.sheet if nominal else drawn(self.sheet, seed)
        config = write_datasheet(rig, self.folder / "drawn.yaml")
        bag = record(RIG, self.folder / "run.bag", "--config", config, "--seed", seed, *arguments)
        return bag, values(rig)

    def estimates(self, bag, variants):
        """Estimates and their sigma by variants of the stage, each of samples x 3, in the paper's units."""
        estimators = []
        for i, change in enumerate(variants):
            names = [f"{name}_{i}" for name in NAMES]
            channels = ("shaft_speed", "motor_pressure", "pump_pressure")
            sum_of = " + ".join(f"{name} {channel}" for name, channel in zip(names, channels))
            settings = {"relation": f"shaft_speed' = {sum_of}", "units": UNITS, "first": [-8.8, 828.9, -1144.9]}
            estimators.append({**stage(), "name": f"stage_{i}", **settings, **change})
        sheet = {**self.sheet, "estimators": estimators, "detectors": [], "isolators": []}
        config = write_datasheet(sheet, self.folder / "variants.yaml")
        _, series = diagnose(bag, "--config", config, series=True)
        columns = lambda i, end: np.stack([series[f"q.{name}_{i}{end}"] for name in NAMES], 1)  # noqa: E731
        return [(columns(i, ""), columns(i, ".std")) for i in range(len(variants))]


def delay(estimate, truth, k, until):
    """Samples until all three estimates stay, for half a second, within half a change of 10 % of the true values after
    the fault. None: never."""
    far = (np.abs(estimate[k:until] / truth[k] - 1) > HALF).any(1)
    for start in range(len(far) - STAY):
        if not far[start : start + STAY].any():
            return start
    return None


def judged(estimate, truth, fault):
    """Every fault of a set: symbol, factors, relative change of the steady estimates, delay, and where they are
    steady."""
    begin = 60
    for symbol, _, k, factors, until in ends(fault):
        before = estimate[begin:k].mean(0)
        begin = k + min(SETTLED, (until - k) // 2)
        after = estimate[begin:until]
        late = delay(estimate, truth, k, until) if any(f != 1 for f in factors) else None
        yield symbol, factors, after.mean(0) / before - 1, late, slice(begin, until)


def ends(fault):
    """Every fault of a set with the sample at which the next begins."""
    faults = SETS[fault]
    return [(*f, faults[i + 1][2] if i + 1 < len(faults) else LAST) for i, f in enumerate(faults)]


# ---- the paper's figures


WAYS = [
    ("as printed: forgetting 0.95", {"forgetting": PUBLISHED["forgetting_factor"], "renewal": NEVER}),
    (f"as shipped: forgetting {stage()['forgetting']:g}, renewal {stage()['renewal']:g}", {}),
    ("longer memory: forgetting 0.98, renewal 6", {"forgetting": 0.98, "renewal": 6}),
]


def paper(runs, out, seeds):
    figure, axes = plt.subplots(3, 2, figsize=(11.5, 8.2), constrained_layout=True, sharex=True, sharey=True)
    shown = [WAYS[0], WAYS[2]]
    for row, fault in zip(axes, SETS):
        bag, parameters = runs.record(FIRST_SEED, "--fault", fault, "--nuisance")
        truth = course(parameters, fault)
        for axis, found in zip(row, runs.estimates(bag, [change for _, change in shown])):
            draw(axis, fault, truth, *found)
    for axis, (title, _) in zip(axes[0], shown):
        axis.set_title(title, fontsize=10, pad=18)
    axes[0, 0].legend(frameon=False, fontsize=8, ncol=3, loc="lower left", bbox_to_anchor=(0, 0.98))
    for axis in axes[-1]:
        axis.set_xlabel("samples of 10 ms; grey: true values; bands: 90 %")
    figure.savefig(out / "drive_paper.png", dpi=100)
    changes(runs, seeds)


def draw(axis, fault, truth, estimate, sigma):
    samples = np.arange(len(estimate))
    for i, colour in enumerate((BLUE, ORANGE, GREEN)):
        w = WEIGHTS[i]
        axis.plot(samples, w * truth[:, i], color=GREY, linewidth=0.8)
        low, high = (w * (estimate[:, i] + z * sigma[:, i]) for z in (-1.645, 1.645))
        axis.fill_between(samples, low, high, color=colour, alpha=0.25, linewidth=0)
        axis.plot(samples, w * estimate[:, i], color=colour, linewidth=1, label=f"{NAMES[i]} times {w:g}")
    for symbol, _, k, _ in SETS[fault]:
        axis.axvline(k, color=GREY, linewidth=0.7, linestyle=":")
        box = {"facecolor": "white", "edgecolor": "none", "pad": 1}
        axis.text(k + 20, 1.42, symbol, color="#5a646e", fontsize=9, va="top", bbox=box)
    axis.set_ylim(-1.6, 1.5)
    axis.set_xlim(0, LAST)
    axis.spines[["top", "right"]].set_visible(False)


def changes(runs, seeds):
    """Relative changes and delays of the nine faults over seeds, beside the paper's."""
    rows = [{} for _ in WAYS]
    for fault in SETS:
        for seed in range(FIRST_SEED, FIRST_SEED + seeds):
            bag, parameters = runs.record(seed, "--fault", fault, "--nuisance")
            truth = course(parameters, fault)
            for kept, (estimate, _) in zip(rows, runs.estimates(bag, [change for _, change in WAYS])):
                for symbol, factors, change, late, _ in judged(estimate, truth, fault):
                    kept.setdefault(symbol, []).append((change, late, factors))
    for (title, _), kept in zip(WAYS, rows):
        print(f"\n{title[0].upper()}{title[1:]}:")
        table(kept, seeds)


def table(rows, seeds):
    print(
        f"\n| fault | exact | paper | ours, median of {seeds} rigs | ours, 5 to 95 % of the rigs |"
        f" delay, samples: median | largest | within {ALLOWED} |\n|---|---|---|---|---|---|---|---|"
    )
    for symbol, found in rows.items():
        change = np.array([c for c, _, _ in found])
        moved = [i for i in range(3) if found[0][2][i] != 1] or range(3)
        printed = PUBLISHED.get(symbol, {}).get("paper", {})
        text = lambda numbers: ", ".join(f"{NAMES[i]} {numbers[i]:+.3f}" for i in moved)  # noqa: E731
        low, high = np.percentile(change, [5, 95], axis=0)
        spans = ", ".join(f"{low[i]:+.3f}..{high[i]:+.3f}" for i in moved)
        delays = [d if d is not None else np.inf for _, d, _ in found]
        late = f"{np.median(delays):.0f} | {max(delays):.0f} | {sum(d <= ALLOWED for d in delays)} of {seeds}"
        late = late if any(f != 1 for f in found[0][2]) else "- | - | -"
        print(
            f"| {symbol} | {text(np.array(found[0][2]) - 1)} |"
            f" {', '.join(f'{name} {value:+.4f}' for name, value in printed.items()) or 'no significant change'} |"
            f" {text(np.median(change, 0))} | {spans} | {late} |"
        )


# ---- trade-offs

FORGETTING = (0.9, 0.93, 0.95, 0.97, 0.98, 0.985, 0.99, 0.995)
BANDWIDTH = (10, 20, 30, 40, 60, 80, 120, 250)
INTERPOLATION = (0, 1, 2, 3)


def trade(runs, out, seeds):
    variants = (
        [("forgetting", g, {"forgetting": g, "renewal": NEVER}) for g in FORGETTING]
        + [("forgetting with renewal", g, {"forgetting": g}) for g in FORGETTING]
        + [("bandwidth", w, {"bandwidth": w}) for w in BANDWIDTH]
        + [("interpolation", r, {"interpolation": r}) for r in INTERPOLATION]
    )
    results = {}  # what is varied, value, noise -> lists
    for noise in (True, False):
        for seed in range(FIRST_SEED, FIRST_SEED + seeds):
            for fault in SETS:
                more = [] if noise else ["--no-noise"]
                bag, parameters = runs.record(seed, "--fault", fault, "--nuisance", *more)
                truth = course(parameters, fault)
                found = runs.estimates(bag, [change for _, _, change in variants])
                for (name, value, _), (estimate, _) in zip(variants, found):
                    kept = results.setdefault((name, value, noise), {"delay": [], "error": []})
                    for _, factors, _, late, steady in judged(estimate, truth, fault):
                        if any(f != 1 for f in factors):
                            kept["delay"].append(late)
                        kept["error"].append((estimate / truth - 1)[steady])
    for name in dict.fromkeys(name for name, _, _ in variants):
        print(
            f"\n| {name} | bias %, a11, a12, a13 | scatter % (1 sigma) | delay, samples: median | largest |"
            " without noise: bias % | scatter % | delay: median | largest |\n|---|---|---|---|---|---|---|---|---|"
        )
        for value in [v for n, v, _ in variants if n == name]:
            cells = []
            for noise in (True, False):
                bias, scatter, delays = summary(results[(name, value, noise)])
                cells += [
                    ", ".join(f"{100 * b:+.2f}" for b in bias),
                    ", ".join(f"{100 * s:.2f}" for s in scatter),
                    f"{np.median(delays):.0f}",
                    f"{max(delays):.0f}",
                ]
            print(f"| {value:g} | " + " | ".join(c.replace("inf", "never") for c in cells) + " |")
    pictures(results, out)


def summary(result):
    error = np.concatenate(result["error"])
    delays = [np.inf if d is None else d for d in result["delay"]]
    return np.median(error, 0), error.std(0), delays


def pictures(results, out):
    figure, axes = plt.subplots(1, 3, figsize=(11.5, 3.9), constrained_layout=True)
    axis = axes[0]
    right, left, below = ((5, 2), "left"), ((-5, -2), "right"), ((-5, -8), "right")
    for name, noise, colour, label, places in (
        ("forgetting", True, BLUE, "as printed", {0.985: ((4, -9), "left"), 0.98: ((-2, 5), "left"), 0.9: None}),
        ("forgetting with renewal", True, ORANGE, "with renewal", {0.9: right, 0.995: below, 0.985: None}),
        ("forgetting", False, GREY, "as printed, noise off", {}),
    ):
        points = [summary(results[(name, g, noise)]) for g in FORGETTING]
        scatter, median = [100 * s[1][1] for s in points], [np.median(s[2]) for s in points]
        axis.plot(median, scatter, "o-", markersize=4, color=colour, label=label)
        if noise:
            for g, x, y in zip(FORGETTING, median, scatter):
                place = places.get(g, right if colour == BLUE else left)
                if place and np.isfinite(x):
                    text = {"textcoords": "offset points", "ha": place[1], "fontsize": 7, "color": colour}
                    axis.annotate(f"{g:g}", (x, y), xytext=place[0], **text)
    axis.axvline(ALLOWED, color=GREY, linewidth=0.7, linestyle=":")
    axis.set_xlim(left=0)
    axis.set_xlabel("median delay, samples")
    axis.set_ylabel("scatter of a12, %")
    axis.set_title("forgetting factor", fontsize=10)
    for axis, name, over in ((axes[1], "bandwidth", BANDWIDTH), (axes[2], "interpolation", INTERPOLATION)):
        for noise, line in ((True, "-"), (False, "--")):
            points = [summary(results[(name, v, noise)]) for v in over]
            for i, colour in enumerate((BLUE, ORANGE, GREEN)):
                label = f"{NAMES[i]}, noise {'on' if noise else 'off'}"
                rms = [100 * np.hypot(p[0][i], p[1][i]) for p in points]
                axis.plot(over, rms, line, marker="o", markersize=3, color=colour, label=label)
        axis.set_ylabel("error: bias and scatter together, %")
        axis.set_title(f"{name} of the filter", fontsize=10)
    axes[1].set_xscale("log")
    axes[1].set_xticks([10, 20, 50, 100, 200], ["10", "20", "50", "100", "200"])
    axes[1].xaxis.set_minor_formatter(matplotlib.ticker.NullFormatter())
    axes[1].set_xlabel("rad/s")
    axes[2].set_xticks(INTERPOLATION)
    axes[2].set_xlabel("order of the polynomial between samples")
    axes[2].legend(frameon=False, fontsize=7.5, loc="upper right")
    axes[0].legend(frameon=False, fontsize=8)
    for axis in axes:
        axis.set_yscale("log")
        axis.yaxis.set_major_formatter(matplotlib.ticker.FormatStrFormatter("%g"))
        axis.yaxis.set_minor_formatter(matplotlib.ticker.NullFormatter())
        axis.set_yticks([t for t in (0.1, 0.2, 0.5, 1, 2, 5, 10, 20)])
        axis.spines[["top", "right"]].set_visible(False)
    figure.savefig(out / "drive_trade.png", dpi=100)


# ---- do the intervals hold


def coverage(runs, out, seeds):
    del out
    print(
        "\n| recordings, 30 s each, healthy | forgetting | true value within 90 % interval, %: a11, a12, a13 |"
        " error in its own sigma, rms | bias, % |\n|---|---|---|---|---|"
    )
    cases = [
        ("paper, nominal rig, sensor noise alone", ["--profile", "paper"], True),
        ("paper", ["--profile", "paper", "--nuisance"], False),
        ("wide", ["--profile", "wide", "--nuisance"], False),
        ("speed_steps", ["--profile", "speed_steps", "--nuisance"], False),
        ("steady", ["--profile", "steady", "--nuisance"], False),
    ]
    for text, arguments, nominal in cases:
        kept = {}
        for seed in range(FIRST_SEED, FIRST_SEED + seeds):
            bag, parameters = runs.record(seed, *arguments, nominal=nominal)
            forgetting = (0.95, 0.98, 0.99)
            for g, (estimate, sigma) in zip(forgetting, runs.estimates(bag, [{"forgetting": g} for g in forgetting])):
                truth = true_values(parameters)
                kept.setdefault(g, []).append(((estimate - truth)[500:], sigma[500:], truth))
        for g, found in kept.items():
            normalised = np.concatenate([e / s for e, s, _ in found])
            within = 100 * (np.abs(normalised) < 1.645).mean(0)
            bias = 100 * np.median(np.concatenate([e / t for e, _, t in found]), 0)
            print(
                f"| {text} | {g:g} | {', '.join(f'{x:.0f}' for x in within)} |"
                f" {', '.join(f'{x:.2f}' for x in np.sqrt((normalised ** 2).mean(0)))} |"
                f" {', '.join(f'{x:+.2f}' for x in bias)} |"
            )


PARTS = {"paper": paper, "trade": trade, "coverage": coverage}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="*", help=f"{', '.join(PARTS)}; default: all")
    parser.add_argument("-o", "--out", type=pathlib.Path, default=pathlib.Path("docs/pictures"))
    parser.add_argument("--seeds", type=int, default=20, help="rigs of every number")
    arguments = parser.parse_args()
    for part in arguments.parts:
        if part not in PARTS:
            parser.error(f"there is no part {part}; there are {', '.join(PARTS)}")
    with tempfile.TemporaryDirectory() as folder:
        for part in arguments.parts or PARTS:
            PARTS[part](Runs(folder), arguments.out, arguments.seeds)


if __name__ == "__main__":
    main()
