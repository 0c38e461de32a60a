"""How the truth of the cooling circuit is driven: the sequencer issues valve and heat commands in an open loop, with
slopes of its own; a tank whose pressure wanders."""
import math

import numpy as np

KINDS = ["valve_steps", "valve_multisine", "heat_steps", "both_steps", "both_multisine", "cycle", "firing"]


def _steps(random, count, period, low, high, shortest, longest):
    values, k = np.empty(count), 0
    while k < count:
        more = max(1, int(random.uniform(shortest, longest) / period))
        values[k : k + more] = random.uniform(low, high)
        k += more
    return values


def _sines(random, count, period, low, high):
    t, number = np.arange(count) * period, int(random.integers(8, 20))
    f = 0.1 * 30 ** ((np.arange(number) + random.random(number)) / number)
    waves = np.sin(2 * math.pi * np.outer(t, f) + random.uniform(0, 2 * math.pi, number)) / (1 + f / 0.7)
    wave = waves.sum(axis=1)
    return 0.5 * (low + high) + 0.5 * (high - low) * wave / np.abs(wave).max()


def _cycle(random, count, period, low, high):
    move, rest = random.uniform(0.6, 1.5), random.uniform(1.0, 3.0)
    corners = np.cumsum([0.0, rest, move, rest, move])
    return np.interp(np.arange(count) * period % corners[-1], corners, [low, low, high, high, low])


class Sequence:
    """commands(count) -> (valve, heat) of each sample, slopes bounded, heat at most 1.6 times the valve's opening."""

    def __init__(self, kind, period, random):
        self.kind, self.period, self.seed = kind, period, int(random.integers(2**31))
        self.rates = random.uniform(4.0, 6.0), random.uniform(8.0, 12.0)

    def commands(self, count):
        random, period = np.random.default_rng(self.seed), self.period
        valve, heat = np.full(count, random.uniform(0.7, 0.95)), np.full(count, random.uniform(0.6, 1.0))
        low, high = random.uniform(0.15, 0.35), random.uniform(0.85, 1.0)
        if self.kind in ("valve_steps", "both_steps"):
            valve = _steps(random, count, period, low, high, 0.3, 3.0)
        elif self.kind in ("valve_multisine", "both_multisine"):
            valve = _sines(random, count, period, low + 0.1, high)
        elif self.kind == "cycle":
            valve = _cycle(random, count, period, low + 0.1, high)
        if self.kind in ("heat_steps", "both_steps"):
            heat = _steps(random, count, period, 0.2, 1.1, 0.3, 3.0)
        elif self.kind == "both_multisine":
            heat = _sines(random, count, period, 0.25, 1.05)
        elif self.kind == "firing":
            on, off = 0.15 * count * (1 + random.random()), count * random.uniform(0.75, 0.95)
            heat = np.where((np.arange(count) > on) & (np.arange(count) < off), heat, 0.0)
        else:
            heat[: int(random.uniform(0.5, 2.0) / period)] = 0.0
        wanted, now, shown = np.column_stack([valve, heat]).tolist(), [valve[0], heat[0]], np.empty((count, 2))
        most = [rate * period for rate in self.rates]
        for k, wish in enumerate(wanted):
            for n in range(2):
                now[n] += min(max(wish[n] - now[n], -most[n]), most[n])
            now[1] = min(now[1], 1.6 * now[0])
            shown[k] = now
        return shown


def controller(sheet, kind, random):
    return Sequence(kind, sheet.sample_period, random)


def supply(sheet, random):
    """(level, tones) of the tank's pressure in Pa."""
    weights = random.uniform(0.5, 1.5, 5)
    sizes = random.uniform(3e3, 4e4) * weights / math.sqrt(np.sum(weights**2) / 2)
    return random.uniform(5.5e6, 7.8e6), [
        (float(a), 2 * math.pi * 0.05 * 100 ** ((n + random.random()) / 5), random.uniform(0, 6.3))
        for n, a in enumerate(sizes)
    ]


def load(sheet, random):
    """The drains are open."""
    return None
