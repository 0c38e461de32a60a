"""Signals on their way into and out of a truth: commands, transducers. Shared by the truths of all rigs; shares nothing
with src/."""
import math

import numpy as np
from numba import njit


@njit
def soft_deadband(u, width):
    """u without its part inside +-width/2; corners rounded over 3 % of the width."""
    if width <= 0:
        return u
    s = 0.03 * width
    above, below = (u - width / 2) / s, (-u - width / 2) / s
    above = above if above > 40 else (math.log1p(math.exp(above)) if above > -40 else 0.0)
    below = below if below > 40 else (math.log1p(math.exp(below)) if below > -40 else 0.0)
    return s * (above - below)


def split(effects):
    """{"effect@port": {parameter: value}} as {port: {effect: {...}}}."""
    ports = {}
    for key, values in effects.items():
        effect, port = key.split("@")
        ports.setdefault(port, {})[effect] = values
    return ports


class CommandPath:
    """From the voltage that is recorded to the voltage that drives the spool.

    Each sample gives pieces (start, end, kind, a, b, c) on which the drive is a (kind 0), a + (b - a) exp(-(t -
    start)/c) (kind 1) or a ramp from b towards a with slope c (kind 2).
    """

    def __init__(self, effects, period, spool_hysteresis, full_scale):
        self.e = effects
        self.period = period
        self.full_scale = full_scale  # of a gain curve
        self.delay = effects.get("delay", {}).get("time", 0.0)
        width = effects.get("hysteresis", {}).get("width", 0.0)
        self.plays = [(0.8 * width, 0.25, [0.0]), (width, 0.5, [0.0]), (1.2 * width, 0.25, [0.0])] if width > 0 else []
        self.trace = spool_hysteresis
        self.trace_state = 0.0
        self.tau = effects.get("lag", {}).get("time_constant", 0.0)
        self.rate = effects.get("rate_limit", {}).get("rate", math.inf)
        self.stuck_from = effects.get("stuck", {}).get("from", math.inf)
        self.history, self.before = {}, 0.0
        self.out = 0.0

    def settle(self, command):
        """As it is when that command has stood for long: of a rig that does not begin at rest."""
        self.before = command
        self.out = self._static(command)

    def _static(self, u):
        e = self.e
        if self.trace > 0:
            self.trace_state = min(max(self.trace_state, u - self.trace / 2), u + self.trace / 2)
            u = self.trace_state
        if self.plays:
            total = 0.0
            for width, weight, state in self.plays:
                state[0] = min(max(state[0], u - width / 2), u + width / 2)
                total += weight * state[0]
            u = total
        if "deadband" in e:
            u = soft_deadband(u, e["deadband"]["width"])
        if "gain_curve" in e:
            u *= 1 + e["gain_curve"]["curvature"] * (abs(u) / self.full_scale - 1)
        if "scale" in e:
            u *= e["scale"]["factor"]
        if "offset" in e:
            u += e["offset"]["value"]
        if "saturation" in e:
            limit = e["saturation"]["limit"]
            u /= (1 + abs(u / limit) ** 24) ** (1 / 24)
        return u

    def pieces(self, k, command):
        h = self.period
        start, end = k * h, (k + 1) * h
        self.history[k] = command
        if self.delay > 0:
            whole = int(self.delay / h)
            rest = self.delay - whole * h
            old, new = self.history.get(k - whole - 1, self.before), self.history.get(k - whole, self.before)
            parts = [(start, start + rest, old), (start + rest, end, new)] if rest > 1e-9 else [(start, end, new)]
        else:
            parts = [(start, end, command)]
        result = []
        for a, b, u in parts:
            if a >= self.stuck_from - 1e-12:
                result.append((a, b, 0, self.out, 0.0, 1.0))
                continue
            target = self._static(u)
            if self.tau > 0:
                result.append((a, b, 1, target, self.out, self.tau))
                self.out = target + (self.out - target) * math.exp(-(b - a) / self.tau)
            elif self.rate < math.inf:
                slope = math.copysign(self.rate, target - self.out)
                result.append((a, b, 2, target, self.out, slope))
                step = slope * (b - a)
                self.out = target if abs(step) >= abs(target - self.out) else self.out + step
            else:
                self.out = target
                result.append((a, b, 0, target, 0.0, 1.0))
        return result


class Sensor:
    """One output channel on its way to the recording: exact lag between samples, then scale, drift, offset, steps,
    stuck."""

    def __init__(self, effects, period, gain=1.0, filter_time=0.0):
        self.e = effects
        self.period = period
        self.gain = gain
        self.lags = [t for t in (filter_time, effects.get("lag", {}).get("time_constant", 0.0)) if t > 0]
        self.state = [None] * len(self.lags)
        self.before = [0.0] * len(self.lags)
        self.held = None
        self.delay = effects.get("delay", {}).get("time", 0.0)
        self.past = []  # (value, slope) at the samples before, where there is a delay

    def _delayed(self, y, slope):
        """Cubic between samples; what was before the first one is that one."""
        self.past.append((y, slope))
        back = self.delay / self.period
        whole = int(back)
        if len(self.past) < whole + 2:
            return self.past[0][0]
        (left, rise), (right, fall) = self.past[-2 - whole], self.past[-1 - whole]
        s = 1 - (back - whole)
        rise, fall = rise * self.period, fall * self.period
        return (
            (1 + 2 * s) * (1 - s) ** 2 * left
            + s * (1 - s) ** 2 * rise
            + s * s * (3 - 2 * s) * right
            + s * s * (s - 1) * fall
        )

    def __call__(self, t, y, slope=0.0):
        """`slope`: of y, where the transducer may be late."""
        e = self.e
        if self.delay > 0:
            y = self._delayed(y, slope)
        y *= self.gain
        for n, tau in enumerate(self.lags):  # exact for an input that is straight between the samples
            if self.state[n] is None:
                self.state[n] = y
            else:
                decay = math.exp(-self.period / tau)
                slope = (y - self.before[n]) / self.period
                self.state[n] = y - tau * slope + (self.state[n] - self.before[n] + tau * slope) * decay
            self.before[n] = y
            y = self.state[n]
        if "scale" in e:
            y *= e["scale"]["factor"]
        if "offset" in e:
            y += e["offset"]["value"]
        if "drift" in e:
            y += e["drift"]["rate"] * t
        return y

    def all(self, times, values, slopes):
        """A whole stretch at once, last() included."""
        if not self.e and not self.lags:
            return self.gain * values
        return np.array([self.last(t, self(t, y, s)) for t, y, s in zip(times, values, slopes)])

    def last(self, t, y):
        """After the noise: what the electronics behind the transducer do."""
        e = self.e
        if e.get("quantisation", {}).get("step", 0.0) > 0:
            y = e["quantisation"]["step"] * math.floor(y / e["quantisation"]["step"] + 0.5)
        if "stuck" in e:
            if t >= e["stuck"]["from"]:
                if self.held is None:
                    self.held = y
                return self.held
        return y


class Transducers:
    """Channels on their way into a recording: noise of `noise_scale` times the datasheet's, rounding, range. A
    controller reads `seen`: its own, quieter path (one times the datasheet's noise, unrounded)."""

    def __init__(self, sheet, names, sensors, record, noise_scale, seed):
        count = len(record[names[0]])
        self.sheet, self.names, self.sensors, self.record, self.scale = sheet, names, sensors, record, noise_scale
        random = np.random.default_rng(seed)
        self.white, self.more = random.standard_normal((2, count, len(names)))
        self.more *= math.sqrt(max(noise_scale**2 - 1, 0.0))
        self.seen = {}

    def read(self, k, t, n, value, slope=0.0):
        """Channel n of sample k; returns what it says without noise."""
        name, sensor, sheet = self.names[n], self.sensors[n], self.sheet
        clean = sensor(t, value, slope)
        noise = min(self.scale, 1.0) * self.white[k, n] * sheet.noise[name]
        own = logged = sensor.last(t, clean + noise)
        if self.scale > 1 and "stuck" not in sensor.e:
            logged = sensor.last(t, clean + noise + self.more[k, n] * sheet.noise[name])
        low, high = sheet.range[name]
        logged = math.floor(logged / sheet.resolution[name] + 0.5) * sheet.resolution[name]
        self.seen[name], self.record[name][k] = own, min(max(logged, low), high)
        return clean
