"""Many truths: how the rig behind a recording is drawn. A truth has classes; each class has variants; a variant is a
table of ranges, and a case draws one variant and one number from every range of it.

friction, valve, supply, hose, integrator: physics. Their variants are the rig's own (VARIANTS in truth_RIG.py) and end
up in its nuisance. sensor, noise, sampling: what stands between the rig and the file, the same for all rigs, told here
and laid over the recording by record().

Every class draws from a stream of its own, so that leaving one out changes nothing of the others. A range (low, high)
is logarithmic where both are positive; (-high, high) is a sign and a logarithmic size from high/20 on; a single number
is that number.
"""
import copy
import math

import numpy as np
from numba import njit
from scipy.signal import bilinear, butter, lfilter, lfilter_zi

PHYSICS = ["friction", "valve", "supply", "hose", "integrator"]
SIGNALS = ["sensor", "noise", "sampling"]
CLASSES = PHYSICS + SIGNALS
SHARE = 0.7  # of cases in which a class is on that the command line does not ask for by name
GOOD = 0.25  # of cases: transducers far better than the model
GOOD_RATIO = 10.0  # the gap there, in units of the noise, in every channel
QUIETEST = 5e-3  # of the datasheet's noise, where the model is right about a channel
NOISE = (0.2, 20.0)  # factor on the datasheet's noise, of the others
LENGTH = (8.0, 60.0)  # s
MOST_RUNS = 5

# sensor: shares of a channel's range, times in samples. noise: in units of the noise. sampling: in samples.
VARIANTS = {
    "sensor": {
        "bandwidth": {"lag": (0.02, 0.6), "channels": 0.5},
        "hysteresis": {"play": (1e-4, 3e-3), "channels": 0.5},
        "cross_talk": {"leak": (1e-4, 3e-3)},
        "anti_aliasing": {"cutoff": (0.25, 0.49)},
        "bow": {"bow": (1e-4, 3e-3)},
    },
    "noise": {
        "coloured": {"memory": (2.0, 300.0), "share": (0.3, 1.0)},
        "hum": {"amplitude": (0.3, 3.0), "frequency": (49.0, 51.0)},
        "heavy": {"freedom": (3.0, 8.0)},
        "by_level": {"growth": (0.5, 4.0)},
        "coarse": {"step": (1.0, 6.0)},
    },
    "sampling": {
        "jitter": {"jitter": (0.01, 0.15)},
        "skew": {"skew": (0.1, 1.0)},
        "late": {"late": (0.02, 0.4)},
        "clock": {"gain": (-0.7, 0.7)},
        "missed": {"missed": (3e-4, 1e-2)},
    },
}


def number(bounds, random):
    if not isinstance(bounds, tuple):
        return bounds
    low, high = bounds
    if low < 0 < high:
        return math.copysign(high * 20 ** -random.random(), random.random() - 0.5)
    return low * (high / low) ** random.random()


def variants(rig, name):
    """What a class holds on a rig; rig: the module truth_RIG."""
    return VARIANTS[name] if name in SIGNALS else rig.VARIANTS.get(name, {})


def draw(rig, names, without, seeds):
    """{class: {"variant": ..., "values": {...}}} of the classes that are on. names: those that are on in any case;
    None: all but `without`, each by chance."""
    drawn = {}
    for index, name in enumerate(CLASSES):
        random = np.random.default_rng([*seeds, 1000 + index])
        known = variants(rig, name)
        chosen, by_chance = random.choice(sorted(known)) if known else None, random.random() < SHARE
        values = {n: number(bounds, random) for n, bounds in known[chosen].items()} if known else {}
        on = name in names if names is not None else name not in without and by_chance
        if known and on:
            drawn[name] = {"variant": str(chosen), "values": values, "seed": int(random.integers(2**31))}
    return drawn


def nuisance(drawn):
    """What the drawn physics adds to a rig's nuisance."""
    return {n: v for name in PHYSICS if name in drawn for n, v in drawn[name]["values"].items()}


def finer(sheet, factor):
    """A datasheet whose transducers round as finely as they are quiet."""
    sheet = copy.deepcopy(sheet)
    for channel in sheet.channels:
        if sheet.role[channel] in ("output", "input"):
            sheet.resolution[channel] *= min(1.0, factor)
    return sheet


def better(sheet, factors):
    """A datasheet with transducers as quiet and as fine as {output: factor}; measured inputs as the typical output."""
    sheet = copy.deepcopy(sheet)
    typical = math.exp(np.mean(np.log(list(factors.values()))))
    for channel in sheet.channels:
        if sheet.role[channel] in ("output", "input"):
            sheet.resolution[channel] *= factors.get(channel, typical)
            sheet.noise[channel] *= factors.get(channel, typical)
    return sheet


def _low_pass(values, lag):
    """First order, bilinear, settled at the first row."""
    b, a = bilinear([1.0], [lag, 1.0])
    return lfilter(b, a, values, zi=lfilter_zi(b, a) * values[0])[0]


@njit
def _play(values, width):
    shown, state = np.empty_like(values), values[0]
    for n, value in enumerate(values):
        state = min(max(state, value - width / 2), value + width / 2)
        shown[n] = state
    return shown


def _shifted(values, late):
    """Values `late` samples before each row, linear between rows."""
    rows = np.arange(len(values), dtype=float)
    return np.interp(rows - late, rows, values)


def distorted(clean, ranges, drawn):
    """Outputs as the drawn sensors and the drawn sampling show them, without noise. ranges: width of each column's
    range."""
    shown = clean.copy()
    count, columns = shown.shape
    used = [drawn[name] for name in ("sensor", "sampling") if name in drawn]
    for entry in used:
        random, v, kind = np.random.default_rng(entry["seed"]), entry["values"], entry["variant"]
        hit = random.random(columns) < v.get("channels", 1.0)
        hit[random.integers(columns)] = True
        sizes = 0.5 + random.random(columns)
        signs = np.where(random.random(columns) < 0.5, -1.0, 1.0)
        partner = random.permutation(columns)
        before = shown.copy()
        for n in np.flatnonzero(hit):
            y = before[:, n]
            if kind == "bandwidth":
                shown[:, n] = _low_pass(y, v["lag"] * sizes[n])
            elif kind == "hysteresis":
                shown[:, n] = _play(y, v["play"] * sizes[n] * ranges[n])
            elif kind == "cross_talk":
                other = before[:, partner[n]] / ranges[partner[n]]
                shown[:, n] = y + signs[n] * v["leak"] * sizes[n] * ranges[n] * (other - other[0])
            elif kind == "anti_aliasing":
                b, a = butter(2, 2 * v["cutoff"])
                shown[:, n] = lfilter(b, a, y, zi=lfilter_zi(b, a) * y[0])[0]
            elif kind == "bow":
                part = y / ranges[n]
                shown[:, n] = y + signs[n] * v["bow"] * sizes[n] * ranges[n] * 4 * part * part
            elif kind == "skew":
                shown[:, n] = _shifted(y, -v["skew"] * n / columns)
            elif kind == "late":
                shown[:, n] = _shifted(y, v["late"])
            elif kind == "clock":
                shown[:, n] = _shifted(y, v["gain"] * np.linspace(0.0, 1.0, count))
        if kind == "jitter":
            late = v["jitter"] * random.standard_normal(count)
            shown = np.column_stack([_shifted(before[:, n], late) for n in range(columns)])
        elif kind == "missed":  # the row before once more
            held = random.random(count) < v["missed"]
            held[0] = False
            rows = np.maximum.accumulate(np.where(held, 0, np.arange(count)))
            shown = before[rows]
    return shown


def noise(count, columns, drawn, shares, period, random):
    """In units of the noise: what is random of it, and what is not (hum). shares: |signal| over half its range."""
    white = random.standard_normal((count, columns))
    still = np.zeros((count, columns))
    if "noise" not in drawn:
        return white, still
    kind, v = drawn["noise"]["variant"], drawn["noise"]["values"]
    if kind == "coloured":
        keep = math.exp(-1.0 / v["memory"])
        slow = lfilter([math.sqrt(1 - keep * keep)], [1.0, -keep], random.standard_normal((count, columns)), axis=0)
        white = math.sqrt(1 - v["share"]) * white + math.sqrt(v["share"]) * slow
    elif kind == "heavy":
        white = random.standard_t(v["freedom"], (count, columns)) * math.sqrt((v["freedom"] - 2) / v["freedom"])
    elif kind == "by_level":
        white = white * (1 + v["growth"] * shares)
    elif kind == "hum":
        t = np.arange(count)[:, None] * period
        phase = random.uniform(0, 2 * math.pi, columns)
        still = v["amplitude"] * np.sin(2 * math.pi * v["frequency"] * t + phase)
    return white, still


def record(output, sheet, noise_scale, drawn, seed):
    """Writes the outputs' columns of a simulated run anew, behind the drawn sensors, noise and sampling, and returns
    the RMS of what these add to each output, in units of the noise (what is white of it left out).

    From output["clean"]; what electronics do after the noise (rounding, stuck, extra noise, range) as the effects say.
    """
    truth, table, period = output["truth"], output["record"], sheet.sample_period
    names, clean = truth.OUTPUTS, output["clean"]
    ranges = np.array([sheet.range[n][1] - sheet.range[n][0] for n in names])
    std = np.array([sheet.noise[n] for n in names]) * noise_scale
    random = np.random.default_rng([seed, 5])
    shown = distorted(clean, ranges, drawn)
    white, still = noise(len(clean), len(names), drawn, np.abs(clean) / (0.5 * ranges), period, random)
    added = (shown - clean) / std + still
    shown = shown + (white + still) * std
    coarse = drawn["noise"]["values"]["step"] if drawn.get("noise", {}).get("variant") == "coarse" else 0.0
    for n, name in enumerate(names):
        effects, low, high = truth.ports.get("sensor." + name, {}), *sheet.range[name]
        column = shown[:, n]
        if "noise" in effects:
            column = column + effects["noise"]["std"] * random.standard_normal(len(column))
        for step in (effects.get("quantisation", {}).get("step", 0.0), coarse * std[n], sheet.resolution[name]):
            if step > 0:
                column = step * np.floor(column / step + 0.5)
        if "stuck" in effects:
            at = int(math.ceil(effects["stuck"]["from"] / period - 1e-9))
            column = np.where(np.arange(len(column)) >= at, column[min(at, len(column) - 1)], column)
        table[name] = np.clip(column, low, high)
    rms = np.sqrt(np.mean(added**2, axis=0))
    return np.sqrt(rms**2 + coarse**2 / 12)
