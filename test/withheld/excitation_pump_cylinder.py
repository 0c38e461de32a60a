"""How the truth of the pump-controlled cylinder is driven: the datasheet's position control with other tunings, and
multi-level speeds with a weak centring; the sum of pressures held or varied.

A controller is called once per sample with what the transducers say and returns (speed command 1, speed command 2,
wanted position, wanted sum of pressures); `start` is the position it begins at.
"""
import math

from excitation import random_levels

KINDS = ["multisine", "steps", "triangle", "duty", "levels", "sweep"]
LONGEST = 60.0  # s


def _random_steps(random, low, high, shortest, longest):
    return random_levels(random, low, high, shortest, longest, LONGEST)


def _multisine(random):
    count, top = int(random.integers(10, 20)), random.uniform(2.5, 4.0)
    terms = []
    for n in range(count):
        f = 0.11 + (top - 0.11) * n / (count - 1) * random.uniform(0.97, 1.03)
        terms.append((1 / (1 + (f / 0.5) ** 1.5), 2 * math.pi * f, random.uniform(0, 2 * math.pi)))
    size = random.uniform(0.012, 0.022) / (2.2 * math.sqrt(sum(a * a for a, _, _ in terms) / 2))
    return lambda t: size * min(t, 1.0) * sum(a * math.sin(w * t + p) for a, w, p in terms)


def _triangle(random):
    amplitude, frequency = random.uniform(0.015, 0.035), random.uniform(0.3, 0.8)
    mean, phase = random.uniform(-0.008, 0.008), random.uniform(0, 1)
    return lambda t: mean + amplitude * (4 * abs((t * frequency + phase) % 1 - 0.5) - 1)


def _duty(random):
    near, far = random.uniform(-0.04, -0.02), random.uniform(0.02, 0.04)
    fast, slow, rest = random.uniform(0.5, 0.9), random.uniform(0.9, 1.6), random.uniform(0.3, 0.9)
    meet = far - random.uniform(0.2, 0.5) * (far - near)

    def value(t):
        s = t % (2 * fast + slow + 2 * rest)
        if s < fast:
            return near + (meet - near) * s / fast
        s -= fast
        if s < slow:
            return meet + (far - meet) * s / slow
        s -= slow + rest
        if s < 0:
            return far
        return far + (near - far) * s / fast if s < fast else near

    return value


def _sweep(random):
    low, high, period = random.uniform(0.1, 0.3), random.uniform(3, 5), random.uniform(8, 14)
    speed = random.uniform(0.05, 0.1)

    def value(t):
        s = t % period
        f = low + (high - low) * s / period
        angle = 2 * math.pi * (low * s + (high - low) * s * s / (2 * period))
        return min(0.03, speed / (2 * math.pi * f)) * math.sin(angle)

    return value


def _pressure_sum(random):
    if random.random() < 0.3:
        level = random.uniform(9.0e6, 10.5e6)
        return lambda t: level
    mean, size = random.uniform(9.6e6, 10.0e6), random.uniform(0.6e6, 1.1e6)
    period, phase = random.uniform(6, 12), random.uniform(0, 6.3)
    return lambda t: mean + size * math.sin(2 * math.pi * t / period + phase)


class _Pumps:
    def __init__(self, sheet, random):
        p = sheet.nominal
        self.h = sheet.sample_period
        self.per_speed = p["rod_area"] / p["pump_displacement"]
        self.ratio = p["cap_area"] / p["rod_area"] - 1
        self.gain, self.share = p["offset_gain"], p["offset_ratio"]
        self.sum = _pressure_sum(random)
        self.smoothing = 1 - math.exp(-2 * math.pi * random.uniform(20, 40) * self.h)
        self.smooth = None

    def filtered(self, position):
        self.smooth = position if self.smooth is None else self.smooth + self.smoothing * (position - self.smooth)
        return self.smooth

    def commands(self, dynamic, wanted, t):
        total = self.sum(t)
        first = self.ratio * dynamic + self.share * self.gain * total
        return first, dynamic + self.gain * total, wanted, total


class PositionControl(_Pumps):
    def __init__(self, sheet, set_point, random):
        super().__init__(sheet, random)
        self.set_point, self.start = set_point, set_point(0.0)
        self.stiffness, self.forward = random.uniform(12, 32), random.uniform(0.9, 1.02)
        self.bandwidth = random.uniform(20, 40)
        self.wanted, self.speed = self.start, 0.0

    def __call__(self, k, seen):
        w, wish = self.bandwidth, self.set_point(k * self.h)
        push = min(max(w * w * (wish - self.wanted) - 2 * w * self.speed, -5.0), 5.0)
        # slow down in time: no faster than can be braked to the set point
        limit = min(0.15, math.sqrt(2 * 4.0 * abs(wish - self.wanted)) + 0.002)
        self.speed = min(max(self.speed + push * self.h, -limit), limit)
        self.wanted += self.speed * self.h
        error = self.wanted - self.filtered(seen["position"])
        dynamic = self.per_speed * (self.stiffness * error + self.forward * self.speed)
        return self.commands(dynamic, self.wanted, k * self.h)


class Levels(_Pumps):
    """Speed of pump 2 at random levels, with limited slope and a weak pull to mid stroke."""

    def __init__(self, sheet, random):
        super().__init__(sheet, random)
        size = random.uniform(25, 42)
        self.level = _random_steps(random, -size, size, 0.06, 0.25)
        self.start, self.centring = random.uniform(-0.01, 0.01), random.uniform(800, 1400)
        self.slope, self.dynamic = random.uniform(1200, 2000), 0.0

    def __call__(self, k, seen):
        wish = self.level(k * self.h) - self.centring * self.filtered(seen["position"])
        most = self.slope * self.h
        self.dynamic += min(max(wish - self.dynamic, -most), most)
        return self.commands(self.dynamic, 0.0, k * self.h)


def controller(sheet, kind, random):
    """A fresh controller; the same random generator state gives the same one."""
    if kind == "levels":
        return Levels(sheet, random)
    if kind == "steps":
        return PositionControl(sheet, _random_steps(random, -0.038, 0.038, 0.6, 1.8), random)
    set_point = {"multisine": _multisine, "triangle": _triangle, "duty": _duty, "sweep": _sweep}[kind](random)
    return PositionControl(sheet, set_point, random)


def supply(sheet, random):
    """This rig has no supply: its pumps make the pressure."""
    return None


def load(sheet, random):
    """The load is a weight."""
    return None
