"""How the truth of the hydraulic drive is driven: voltage profiles in an open loop and the datasheet's speed control,
with other tunings; the power unit's wander; the load valve's steps and flutter.

A controller is called once per sample with what the transducers say and returns (volts, speed_setpoint).
"""
import math

from excitation import _hold

KINDS = ["paper", "wide", "multisine", "prbs", "speed_steps", "duty"]
LONGEST = 400.0  # s


def _walk(random, low, high, smallest, largest, shortest, longest):
    """Levels that step by smallest..largest and hold for shortest..longest."""
    times, levels, t, level = [], [], 0.0, random.uniform(low, high)
    while t < LONGEST:
        times.append(t)
        levels.append(level)
        t += random.uniform(shortest, longest)
        step = random.uniform(smallest, largest) * (1 if random.random() < 0.5 else -1)
        level = level + step if low <= level + step <= high else min(max(level - step, low), high)
    return _hold(times, levels)


def _anywhere(random, low, high, shortest, longest):
    times, levels, t = [], [], 0.0
    while t < LONGEST:
        times.append(t)
        levels.append(random.uniform(low, high))
        t += random.uniform(shortest, longest)
    return _hold(times, levels)


def _multisine(random):
    count = int(random.integers(10, 20))
    top = random.uniform(4, 8)
    terms = []
    for n in range(count):
        f = 0.1 * (top / 0.1) ** (n / (count - 1)) * random.uniform(0.97, 1.03)
        terms.append((1 / (1 + (f / 1.5)), 2 * math.pi * f, random.uniform(0, 2 * math.pi)))
    size = random.uniform(0.25, 0.4) / math.sqrt(sum(a * a for a, _, _ in terms) / 2)
    mean = random.uniform(0.9, 1.15)
    return lambda t: min(max(mean + size * min(t, 1.0) * sum(a * math.sin(w * t + p) for a, w, p in terms), 0.0), 2.1)


def _binary(random):
    mean, clock = random.uniform(1.0, 1.3), random.uniform(0.08, 0.12)
    times, levels, t, side = [], [], 0.0, 1.0
    while t < LONGEST:
        times.append(t)
        levels.append(mean + side * random.uniform(0.15, 0.42))
        side = -side
        t += clock * int(random.integers(1, 8))
    return _hold(times, levels)


def _duty(random):
    """Machine cycle in rad/s: run up, work, run down, rest."""
    rest, work = random.uniform(8, 20), random.uniform(70, 95)
    move, hold = random.uniform(0.8, 1.8), random.uniform(0.8, 2.0)
    period = 2 * (move + hold)

    def value(t):
        s = t % period
        if s < move:
            return rest + (work - rest) * s / move
        if s < move + hold:
            return work
        if s < 2 * move + hold:
            return work - (work - rest) * (s - move - hold) / move
        return rest

    return value


class OpenLoop:
    def __init__(self, sheet, volts):
        self.h, self.volts = sheet.sample_period, volts

    def __call__(self, k, seen):
        volts = self.volts(k * self.h)
        return volts, 52.0 * volts


class SpeedControl:
    """The datasheet's law with a tuning of its own."""

    def __init__(self, sheet, set_point, random):
        self.h, self.set_point, self.sum = sheet.sample_period, set_point, 0.0
        self.forward, self.kp, self.ki = (
            random.uniform(48, 56),
            random.uniform(0.0012, 0.003),
            random.uniform(0.03, 0.07),
        )

    def __call__(self, k, seen):
        wish = self.set_point(k * self.h)
        error = wish - seen["shaft_speed"]
        volts = wish / self.forward + self.kp * error + self.sum
        if -0.5 <= volts <= 2.5 or (volts - 1) * error < 0:
            self.sum += self.ki * error * self.h
        return min(max(volts, -0.5), 2.5), wish


def controller(sheet, kind, random):
    """A fresh controller; the same random generator state gives the same one."""
    if kind == "paper":
        return OpenLoop(sheet, _walk(random, 0.35, 1.95, 0.15, 0.45, 0.3, 0.9))
    if kind == "wide":
        return OpenLoop(sheet, _walk(random, 0.0, 2.0, 0.1, 0.9, 0.3, 0.9))
    if kind == "multisine":
        return OpenLoop(sheet, _multisine(random))
    if kind == "prbs":
        return OpenLoop(sheet, _binary(random))
    set_point = _walk(random, 18, 100, 8, 40, 0.6, 1.6) if kind == "speed_steps" else _duty(random)
    return SpeedControl(sheet, set_point, random)


def _noise(random, rms, low, high, count=5):
    """Sines (amplitude, angular frequency, phase) between two frequencies, of a given size together."""
    weights = [random.uniform(0.5, 1.5) for _ in range(count)]
    size = rms / math.sqrt(sum(w * w for w in weights) / 2)
    return [
        (w * size, 2 * math.pi * low * (high / low) ** ((n + random.random()) / count), random.uniform(0, 6.3))
        for n, w in enumerate(weights)
    ]


def supply(sheet, random):
    """(level behind the power unit's resistance, tones)."""
    return 1.432e7 * random.uniform(0.99, 1.01), _noise(random, 6e4, 0.08, 4.0)


def load(sheet, random):
    """(set value of the load valve over time, tones of the flutter): the paper's steps, or the whole range."""
    if random.random() < 0.35:
        steps = _anywhere(random, 15e5, 48e5, 0.6, 1.6)
    else:
        steps = _walk(random, 30e5, 40e5, 2e5, 7e5, 0.6, 1.6)
    return steps, _noise(random, 4.5e4, 0.6, 7.0)
