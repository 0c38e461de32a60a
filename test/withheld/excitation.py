"""How the truth is driven: the datasheet's position control on five set points, and its open-loop PRBS, with other
tunings.

A controller is called once per sample with what the transducers say and returns (volts, position_reference).
"""
import math

import numpy as np

KINDS = ["multisine", "steps", "triangle", "prbs", "duty"]


def _multisine(random):
    count = int(random.integers(10, 20))
    f = np.linspace(0.11, random.uniform(2.5, 4.0), count) * random.uniform(0.97, 1.03, count)
    phase = random.uniform(0, 2 * math.pi, count)
    amplitude = 1 / (1 + (f / 0.6) ** 1.5)
    t = np.arange(0, 20, 0.01)
    peak = np.max(np.abs(sum(a * np.sin(2 * math.pi * g * t + p) for a, g, p in zip(amplitude, f, phase))))
    amplitude *= random.uniform(0.025, 0.05) / peak
    terms = list(zip(amplitude.tolist(), (2 * math.pi * f).tolist(), phase.tolist()))
    return lambda t: min(t, 1.0) * sum(a * math.sin(w * t + p) for a, w, p in terms)


def _steps(random):
    times, levels, t = [], [], 0.0
    while t < 400:
        times.append(t)
        levels.append(random.uniform(-0.05, 0.05))
        t += random.uniform(0.5, 1.6)
    return _hold(times, levels)


def _hold(times, levels):
    state = [0]

    def value(t):
        n = state[0]
        while n + 1 < len(times) and times[n + 1] <= t:
            n += 1
        state[0] = n
        return levels[n]

    return value


def random_levels(random, low, high, shortest, longest, end):
    """Levels from low to high, each held for shortest to longest seconds, until `end`."""
    times, levels, t = [], [], 0.0
    while t < end:
        times.append(t)
        levels.append(random.uniform(low, high))
        t += random.uniform(shortest, longest)
    return _hold(times, levels)


def _triangle(random):
    amplitude, frequency = random.uniform(0.02, 0.045), random.uniform(0.3, 0.6)
    mean, phase = random.uniform(-0.02, 0.02), random.uniform(0, 1)
    return lambda t: mean + amplitude * (4 * abs((t * frequency + phase) % 1 - 0.5) - 1)


def _duty(random):
    """Machine cycle: fast approach, slow work stroke, dwell, fast return, dwell."""
    near, far = random.uniform(-0.05, -0.02), random.uniform(0.02, 0.05)
    meet = far - random.uniform(0.3, 0.6) * (far - near)
    slow = random.uniform(0.02, 0.06)
    fast = random.uniform(0.15, 0.28)
    rest = random.uniform(0.2, 0.8)
    t1 = (meet - near) / fast
    t2 = t1 + (far - meet) / slow
    t3 = t2 + rest
    t4 = t3 + (far - near) / fast
    period = t4 + rest

    def value(t):
        s = t % period
        if s < t1:
            return near + fast * s
        if s < t2:
            return meet + slow * (s - t1)
        if s < t3:
            return far
        if s < t4:
            return far - fast * (s - t3)
        return near

    return value


class PositionControl:
    """The datasheet's cascade on the measured channels, with nominal parameters and a tuning of its own."""

    def __init__(self, sheet, set_point, gains):
        self.p, self.h = sheet.nominal, sheet.sample_period
        self.raw, self.kp, self.kv, self.kf = set_point, *gains
        self.r = self.x = self.v = self.a = 0.0
        self.sign = 0.0
        self.side = 0.0

    def __call__(self, k, seen):
        p, h, w = self.p, self.h, 40.0
        wish = self.raw(k * h)
        self.r += min(max(wish - self.r, -0.3 * h), 0.3 * h)
        jerk = w**3 * (self.r - self.x) - 3 * w * w * self.v - 3 * w * self.a
        self.a += jerk * h
        self.v += self.a * h
        self.x += self.v * h
        if abs(self.v) > 1e-3:
            self.side = math.copysign(1.0, self.v)
        self.sign += h / 0.01 * (self.side - self.sign)
        area, pl, v = p["ram_area"], seen["load_pressure"], seen["velocity"]
        error = seen["position"] - self.x
        friction = p["coulomb_friction"] * self.sign + p["viscous_damping"] * self.v
        force = p["moving_mass"] * self.a - self.kv * (v - self.v) - self.kp * error + friction + seen["load_force"]
        rate = p["moving_mass"] * jerk - self.kp * (v - self.v)
        n = area**2 * v / p["compliance"] + rate - self.kf * (area * pl - force)
        drop = seen["supply_pressure"] - math.copysign(1.0, n) * pl
        gain = area * p["flow_coefficient"] * math.sqrt(max(drop, 1e5)) / p["compliance"]
        return n / (gain * p["spool_gain"]), self.x


class OpenLoop:
    """Random binary voltage, held for 1..7 clocks, with a weak pull towards the middle of the stroke."""

    def __init__(self, sheet, random):
        low, high = random.uniform(0.7, 1.3), random.uniform(1.8, 2.5)
        clock = random.uniform(0.04, 0.06)
        times, levels, t, side = [], [], 0.0, 1.0
        while t < 400:
            times.append(t)
            levels.append(side * random.uniform(low, high))
            side = -side
            t += clock * int(random.integers(1, 8))
        self.h, self.value, self.pull = sheet.sample_period, _hold(times, levels), random.uniform(14, 22)

    def __call__(self, k, seen):
        return self.value(k * self.h) - self.pull * seen["position"], 0.0


def controller(sheet, kind, random):
    """A fresh controller; the same random generator state gives the same one."""
    if kind == "prbs":
        return OpenLoop(sheet, random)
    set_point = {"multisine": _multisine, "steps": _steps, "triangle": _triangle, "duty": _duty}[kind](random)
    gains = (random.uniform(1.4e5, 2.4e5), random.uniform(80, 300), random.uniform(26, 70))
    return PositionControl(sheet, set_point, gains)


class Tones:
    """A level and three sines."""

    def __init__(self, level, terms=((0.0, 0.0, 0.0),) * 3):
        self.level, self.terms = level, terms

    def __call__(self, t):
        return self.level + sum(a * math.sin(w * t + p) for a, w, p in self.terms)


def supply(sheet, random):
    """True level behind the pump: the set value, a slow wander and a few bar of hum."""
    level = sheet.constants.get("supply_pressure_set", 6.89e6) * random.uniform(0.985, 1.015)
    terms = [
        (random.uniform(1e4, 4e4), 2 * math.pi * random.uniform(0.03, 0.4), random.uniform(0, 6.3)) for _ in range(3)
    ]

    return Tones(level, terms)


def load(sheet, random):
    """Load loop off (a few newtons), or on with a slow random push of some hundred newtons."""
    size = random.uniform(150, 500) if random.random() < 0.35 else random.uniform(0.5, 3.0)
    terms = [
        (size * random.uniform(0.3, 0.7), 2 * math.pi * random.uniform(0.1, 1.5), random.uniform(0, 6.3))
        for _ in range(3)
    ]

    return Tones(0.0, terms)
