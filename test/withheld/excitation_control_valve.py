"""How the truth of the control valve is driven: flow demands for all three loops or positions for the inner two, with
other tunings; supply and air that wander.

A controller has demand(t), 0..1, flow_control (whether the flow loop runs), and the loops' numbers.
"""
import math

from excitation import _hold, random_levels

KINDS = ["steps", "triangle", "prbs", "duty", "multisine", "valve_steps"]
LONGEST = 200.0  # s


def _levels(random, low, high, shortest, longest):
    return random_levels(random, low, high, shortest, longest, LONGEST)


def _binary(random):
    clock, side, t = random.uniform(0.7, 1.2), 1.0, 0.0
    times, levels = [], []
    while t < LONGEST:
        times.append(t)
        levels.append(0.5 + side * random.uniform(0.1, 0.3))
        side = -side
        t += clock * int(random.integers(1, 5))
    return _hold(times, levels)


def _multisine(random):
    count = int(random.integers(10, 20))
    terms = []
    for n in range(count):
        f = 0.03 * 30 ** (n / (count - 1)) * random.uniform(0.97, 1.03)
        terms.append((1 / (1 + f / 0.2), 2 * math.pi * f, random.uniform(0, 2 * math.pi)))
    size = random.uniform(0.2, 0.26) / math.sqrt(sum(a * a for a, _, _ in terms) / 2)
    mean = random.uniform(0.45, 0.55)
    return lambda t: mean + size * sum(a * math.sin(w * t + p) for a, w, p in terms)


class Control:
    """The datasheet's three laws with a tuning of their own."""

    def __init__(self, demand, flow_control, random):
        self.demand, self.flow_control = demand, flow_control
        self.flow_gain, self.flow_integral = random.uniform(6.5, 9.5), random.uniform(12, 20)
        self.position_gain = random.uniform(5, 7)
        self.bias, self.gain = random.uniform(1.9, 2.06), random.uniform(3.3, 4.7)
        self.integral, self.derivative = random.uniform(65, 95), random.uniform(0.007, 0.013)
        self.filter = random.uniform(0.004, 0.006)
        self.sum = 0.0

    def set_point(self, wish, flow):
        """Of the valve, from the demand (0..1) and the flow meter; once every 0.1 s."""
        if not self.flow_control:
            return wish
        error = 0.028 * wish - flow
        out = self.flow_gain * error + self.sum
        if not ((out > 1 and error > 0) or (out < 0 and error < 0)):
            self.sum += self.flow_integral * error * 0.1
        return min(max(self.flow_gain * error + self.sum, 0.0), 1.0)


def controller(sheet, kind, random):
    if kind in ("steps", "valve_steps"):
        demand = _levels(random, 0.1, 0.9, 2.0, 6.0)
    elif kind == "triangle":
        period, phase, size = random.uniform(12, 20), random.random(), random.uniform(0.3, 0.4)
        demand = lambda t: 0.5 + size * (4 * abs((t / period + phase) % 1 - 0.5) - 1)
    elif kind == "prbs":
        demand = _binary(random)
    elif kind == "duty":
        period, low, high = random.uniform(8, 12), random.uniform(0.15, 0.3), random.uniform(0.65, 0.85)
        demand = lambda t: high if (t / period) % 1 < 0.5 else low
    else:
        demand = _multisine(random)
    return Control(demand, kind != "valve_steps", random)


def _wander(random, low, high, shortest, longest, count):
    """Sines (amplitude, angular frequency, phase)."""
    size = random.uniform(low, high) / math.sqrt(count)
    return [
        (size, 2 * math.pi / period, random.uniform(0, 6.3))
        for period in (shortest * (longest / shortest) ** ((n + random.random()) / count) for n in range(count))
    ]


def supply(sheet, random):
    """(level, tones) in Pa."""
    return 5e5 + random.uniform(-3e4, 3e4), _wander(random, 2e4, 4e4, 18.0, 40.0, 3)


def load(sheet, random):
    """The air's temperature (level, tones) in K: what plays the load's part here."""
    return 293.15 + random.uniform(-8, 8), _wander(random, 3.0, 8.0, 50.0, 120.0, 3)
