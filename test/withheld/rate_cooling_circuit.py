"""One step of the cooling circuit's truth and its replay, compiled.

Pressures, valve and firing level go by a diagonally implicit method of order two that is L-stable; each stage solves
the eleven pressures by Newton, the branches eliminated onto the manifold. Temperatures are linear in what flows: an
implicit midpoint. The formulae are described in truth_cooling_circuit.py; y is laid out by Z, S, PM, QV, SPEED and, for
each branch, P1, P2, T1, T2, Q12 from FIRST on.
"""
import math

import numpy as np
from numba import njit

BRANCHES = ["m", "v1", "v2", "v3", "t"]
AMBIENT = 101325.0
POLYTROPIC = 1.1
COLD = 288.0  # K, at which the viscosity is the datasheet's
LAMINAR = 0.1  # sqrt(Pa): below its square an orifice is laminar
GAMMA = 1 - 1 / math.sqrt(2.0)
Z, S, PM, QV, SPEED, FIRST = range(6)
P1, P2, T1, T2, Q12 = range(5)
EACH = 5
STATES = FIRST + 5 * EACH
ITERATIONS = 12
TONES = 5

PLAIN = (
    "density specific_heat valve_gain valve_time manifold drain water outside firing_time substeps offset droop ripple"
    " ripple_w hum hum_w feed_inertance air exponent valve_leak damping thinning water_drift supply_level"
).split()
PER_BRANCH = (
    "b mass c feed throttle flux leak_1 laminar_1 leak_2 laminar_2 leak_3 power reference entrance inertance loss"
    " capacity shake shake_w"
).split()
CONSTANTS = np.dtype(
    [(name, np.float64) for name in PLAIN]
    + [(name, np.float64, (5,)) for name in PER_BRANCH]
    + [(name, np.float64, (TONES,)) for name in ("supply_a", "supply_w", "supply_p")]
)


@njit
def orifice(x, k, resistance, moved):
    """(flow, its slope over x) where x = q|q|/k^2 + LAMINAR |q|/k + resistance q - moved."""
    x += moved
    k = max(k, 1e-9)
    a, linear = 1 / (k * k), LAMINAR / k + resistance
    q = 2 * x / (linear + math.sqrt(linear * linear + 4 * a * abs(x)))
    return q, 1 / (2 * a * abs(q) + linear)


@njit
def loss(q, c, power, reference, entrance):
    """(pressure loss of a tube, slope over the flow): Blasius, its power about a reference flow, a share of it lost at
    the entrance, where it goes with the square."""
    size = max(abs(q), 1e-6)
    whole = reference**1.75 / (c * c)
    part = size / reference
    friction, mouth = (1 - entrance) * whole * part**power, entrance * whole * part * part
    slope = (power * friction + 2 * mouth) / size
    return (friction + mouth) * q / size, slope


@njit
def tube(x, guess, c, power, reference, entrance, inertia, moved):
    """(flow, slope over x) of a tube: loss(q) + inertia q = x + moved."""
    x += moved
    q = guess
    if entrance == 0.0 and inertia == 0.0:
        size = max(abs(x), 1e-3)
        q = reference * (size * c * c / reference**1.75) ** (1 / power)
        return q * x / size, q / (power * size)
    slope = 1.0
    for _ in range(30):
        drop, slope = loss(q, c, power, reference, entrance)
        slope += inertia
        change = (drop + inertia * q - x) / slope
        q -= change
        if abs(change) < 1e-9:
            break
    return q, 1 / slope


@njit
def leak(p, coefficient, laminar, density):
    """(kg/s through a leak to ambient, slope)"""
    over = p - AMBIENT
    if coefficient == 0.0 and laminar == 0.0:
        return 0.0, 0.0
    size = math.sqrt(math.sqrt(over * over + 1e4))
    return density * (coefficient * over / size + laminar * over), density * (0.5 * coefficient / size + laminar)


@njit
def command(t, drive):
    if drive[0] == 0:
        return drive[1]
    if drive[0] == 1:
        return drive[1] + (drive[2] - drive[1]) * math.exp(-(t - drive[4]) / drive[3])
    w = drive[2] + drive[3] * (t - drive[4])
    return drive[1] if (w - drive[1]) * drive[3] > 0 else w


@njit
def supply(t, c, given, since):
    if given[0] > 0:
        p = given[0] + given[1] * (t - since)
    else:
        p = c.supply_level
        for n in range(TONES):
            p += c.supply_a[n] * math.sin(c.supply_w[n] * t + c.supply_p[n])
    return p


@njit
def resistance_c(c, n, y):
    """The tube's coefficient with the water's viscosity."""
    if c.thinning == 1.0:
        return c.c[n]
    at = FIRST + EACH * n
    warm = 0.5 * (y[at + T1] + y[at + T2]) - COLD
    return c.c[n] * c.thinning ** (-0.125 * warm / 15.0)


@njit
def flows(t, y, c, gh, flow, slope, n, was):
    """Trim orifice, tube, throttle and both leaks of branch n, with slopes; gh: the stage's weight of inertia, was: the
    tube's flow before it."""
    at = FIRST + EACH * n
    p1, p2 = y[at + P1], y[at + P2]
    flow[0], slope[0] = orifice(y[PM] - p1, c.feed[n], 0.0, 0.0)
    heavy = c.inertance[n] / c.density / gh
    flow[1], slope[1] = tube(
        p1 - p2, y[at + Q12], resistance_c(c, n, y), c.power[n], c.reference[n], c.entrance[n], heavy, heavy * was
    )
    back = c.drain + c.shake[n] * math.sin(c.shake_w[n] * t)
    flow[2], slope[2] = orifice(p2 - back, c.throttle[n], 0.0, 0.0)
    flow[3], slope[3] = leak(p1, c.leak_1[n], c.laminar_1[n], c.density)
    flow[4], slope[4] = leak(p2, c.leak_2[n], c.laminar_2[n], c.density)
    more, rise = leak(p2, c.leak_3[n], 0.0, c.density)
    flow[2], slope[2] = flow[2] + more, slope[2] + rise


@njit
def stage(t, y, base, c, gh, drives, given, since):
    """Solves y = base + gh f(t, y) for valve, firing level, pressures and inert flows, from y as a guess."""
    u = min(max(command(t, drives[0]), 0.0), 1.0)
    if c.damping > 0:  # as late as the first order's lag
        w = 2 * c.damping / c.valve_time
        y[SPEED] = (base[SPEED] + gh * w * w * (u - base[Z])) / (1 + gh * (2 * c.damping * w + gh * w * w))
        y[Z] = base[Z] + gh * y[SPEED]
    else:
        y[Z] = (base[Z] + gh / c.valve_time * u) / (1 + gh / c.valve_time)
    y[S] = (base[S] + gh / c.firing_time * max(command(t, drives[1]), 0.0)) / (1 + gh / c.firing_time)
    z = max(y[Z], 0.0)
    k = c.valve_gain * ((z if c.exponent == 1.0 else z**c.exponent) + c.valve_leak)
    ps = supply(t, c, given, since) + c.offset + c.ripple * math.sin(c.ripple_w * t) + c.hum * math.sin(c.hum_w * t)
    heavy = c.feed_inertance / c.density / gh
    flow, slope = np.zeros(5), np.zeros(5)
    mine, theirs = np.zeros((5, 2)), np.zeros((5, 2))
    for _ in range(ITERATIONS):
        gas = c.air * (AMBIENT / max(y[PM], 2e4)) ** (1 / POLYTROPIC) / (POLYTROPIC * max(y[PM], 2e4))
        gm = gh / (c.manifold + gas)
        q, rise = orifice(ps - y[PM], k, c.droop / c.density + heavy, heavy * base[QV])
        rest, own = y[PM] - base[PM] - gm * q, 1 + gm * rise
        for n in range(5):
            at, g = FIRST + EACH * n, gh / c.b[n]
            flows(t, y, c, gh, flow, slope, n, base[at + Q12])
            r1 = y[at + P1] - base[at + P1] - g * (flow[0] - flow[1] - flow[3])
            r2 = y[at + P2] - base[at + P2] - g * (flow[1] - flow[2] - flow[4])
            a, b, d = 1 + g * (slope[0] + slope[1] + slope[3]), -g * slope[1], 1 + g * (slope[1] + slope[2] + slope[4])
            det = a * d - b * b
            side = -g * slope[0]
            mine[n, 0], mine[n, 1] = -(d * r1 - b * r2) / det, -(a * r2 - b * r1) / det
            theirs[n, 0], theirs[n, 1] = -d * side / det, b * side / det
            rest += gm * (flow[0] - slope[0] * mine[n, 0])
            own += gm * slope[0] * (1 - theirs[n, 0])
            y[at + Q12] = flow[1]
        change = -rest / own
        y[PM] += change
        most = abs(change)
        for n in range(5):
            at = FIRST + EACH * n
            for i in range(2):
                more = mine[n, i] + theirs[n, i] * change
                y[at + i] += more
                most = max(most, abs(more))
        y[QV] = q
        if most < 0.1:
            return True
    return most < 1e3


@njit
def advance(y, start, end, c, drives, given, since):
    """y from start to end; False where Newton's method failed."""
    count = max(1, int(math.ceil((end - start) / 1e-3 * c.substeps - 1e-9)))
    h = (end - start) / count
    gh = GAMMA * h
    flow, slope, before = np.zeros(5), np.zeros(5), np.zeros((5, 2))
    for n in range(5):
        before[n, 0] = orifice(y[PM] - y[FIRST + EACH * n + P1], c.feed[n], 0.0, 0.0)[0]
        before[n, 1] = y[FIRST + EACH * n + Q12]
    for step in range(count):
        t = start + step * h
        first = y.copy()
        level = y[S]
        if not stage(t + gh, first, y, c, gh, drives, given, since):
            return False
        base = y + (1 - GAMMA) / GAMMA * (first - y)
        last = first.copy()
        if not stage(t + h, last, base, c, gh, drives, given, since):
            return False
        for n in range(5):
            at = FIRST + EACH * n
            flows(t + h, last, c, gh, flow, slope, n, base[at + Q12])
            into, through = 0.5 * (before[n, 0] + flow[0]), 0.5 * (before[n, 1] + flow[1])
            before[n, 0], before[n, 1] = flow[0], flow[1]
            t1, t2 = y[at + T1], y[at + T2]
            water = c.water + c.water_drift * (t + 0.5 * h)
            r = 0.5 * h * max(into, 0.0) / c.mass[n]
            new = (t1 * (1 - r) + 2 * r * water) / (1 + r)
            whole = c.mass[n] * c.specific_heat + c.capacity[n]
            carried = 0.5 * h * c.specific_heat * max(through, 0.0) / whole
            lost = 0.5 * h * c.loss[n] / whole
            heat = h * c.flux[n] * 0.5 * (level + last[S]) / whole
            heat += carried * (t1 + new) + 2 * lost * c.outside
            last[at + T2] = (t2 * (1 - carried - lost) + heat) / (1 + carried + lost)
            last[at + T1] = new
        y[:] = last
    return True


@njit
def show(t, y, c, shown):
    """Both pressures, the meter and both temperatures of each branch."""
    for n in range(5):
        at = FIRST + EACH * n
        back = c.drain + c.shake[n] * math.sin(c.shake_w[n] * t)
        q = orifice(y[at + P2] - back, c.throttle[n], 0.0, 0.0)[0] + leak(y[at + P2], c.leak_3[n], 0.0, c.density)[0]
        shown[5 * n], shown[5 * n + 1], shown[5 * n + 2] = y[at + P1], y[at + P2], q
        shown[5 * n + 3], shown[5 * n + 4] = y[at + T1], y[at + T2]


@njit
def replay(y, pieces, first, last, period, pressures, c, states):
    """Outputs at the samples first..last-1, from y at `first`; states, where it is that long, takes y at each.

    pieces: rows of (sample, start, end, drive of the valve (kind, a, b, c, start), of the heat), in order. pressures:
    rows of (supply, slope), or of zeros where the constants' tones say it. Empty if the integration failed.
    """
    shown = np.empty((last - first, 25))
    drives, row = np.zeros((2, 5)), 0
    while pieces[row, 0] < first:
        row += 1
    for k in range(first, last):
        show(k * period, y, c, shown[k - first])
        if len(states) == last - first:
            states[k - first] = y
        while row < len(pieces) and pieces[row, 0] == k:
            drives[0], drives[1] = pieces[row, 3:8], pieces[row, 8:13]
            if not advance(y, pieces[row, 1], pieces[row, 2], c, drives, pressures[k], k * period):
                return shown[:0]
            row += 1
    return shown
