"""The right-hand side of the hydraulic drive's truth and its replay, compiled.

integrate(y, start, end, step, c, drive, given) takes y from start to end (dormand_prince.py). `c` is one record of
CONSTANTS, `drive` says how the voltage runs (kind, a, b, c, start; see CommandPath). `given`: supply and load pressure
and their slopes from `start` on, when a replay drives them; else they are states. The formulae are described in
truth_hydraulic_drive.py.
"""
import math

import numpy as np
from numba import njit

import dormand_prince
from friction_laws import SPREAD, wound

ORIFICE_LAMINAR = 8.0e3  # Pa
AMBIENT = 101325.0
RETURN = 2.0e5  # Pa, absolute, behind the motor
POLYTROPIC = 1.1
PUMP_RESISTANCE = 5.0e8  # Pa s/m^3, of the power unit
PUMP_TIME = 0.05  # s
LOAD_TIME = 0.03  # s, of each of the load valve's three lags
WINDING = 2.0e-3  # rad, over which bristles take up the friction, unless a random truth's are softer or stiffer
BRISTLE_TIME = 1.0e-3  # s, of their damping
RELAXATION = 2.0e-4  # s, no faster than which they turn over
PISTONS = 9
STATES = 12  # x1, X_s, P_m, S_s, angle, bristle, P_s, three lags of P_p, two more bristles; then what effects add
MOST_STATES = 16
TONES = 5

CONSTANTS = np.dtype(
    [
        (name, np.float64)
        for name in (
            "t1 t2 gain k0 c_r volume bulk leak eta_m eta_p inertia viscous warming seal pulsation coulomb more_viscous"
            " excess stribeck by_load push mass laminar orifice clogging exponent air droop ripple ripple_w viscosity"
            " motor pump displacement has_spring spring_k spring_d spring_at has_line inertance line_at friction"
            " supply_level load_set size dry winding shape turn null_opening overlap damping hum hum_w line"
            " stiffening"
        ).split()
    ]
    + [(name, np.float64, (TONES,)) for name in ("supply_a", "supply_w", "supply_p", "load_a", "load_w", "load_p")]
)


@njit
def root(y):
    return y / (abs(y) ** 3 + ORIFICE_LAMINAR**3) ** (1 / 6)


@njit
def tones(a, w, p, t):
    total = 0.0
    for n in range(TONES):
        total += a[n] * math.sin(w[n] * t + p[n])
    return total


@njit
def supplied(g, drop, droop):
    """Flow through an opening g >= 0 from the supply, behind a resistance."""
    if droop == 0.0 or drop <= 0.0:
        return g * root(drop)
    gg = g * g * droop
    return 0.5 * (math.sqrt(gg * gg + 4 * g * g * drop) - gg)


@njit
def bulk_with_air(bulk, air, p):
    p = max(p + RETURN, 2e4)
    return 1 / (1 / bulk + air * (AMBIENT / p) ** (1 / POLYTROPIC) / (POLYTROPIC * p))


@njit
def rate(t, y, c, inputs, dy):
    drive, given, since = inputs
    x1, xs, pm, speed = y[0], y[1], y[2], y[3]
    if given[0] > 0:
        ps, pp = given[0] + given[1] * (t - since), given[2] + given[3] * (t - since)
    else:
        ps, pp = y[6], y[9] + tones(c.load_a, c.load_w, c.load_p, t)
    kind = drive[0]
    if kind == 0:
        u = drive[1]
    elif kind == 1:
        u = drive[1] + (drive[2] - drive[1]) * math.exp(-(t - drive[4]) / drive[3])
    else:
        u = drive[2] + drive[3] * (t - drive[4])
        if (u - drive[1]) * drive[3] > 0:
            u = drive[1]
    u = min(max(u, -5.0), 5.0)
    line, spring = int(c.line_at), int(c.spring_at)
    has_line, has_spring = c.has_line > 0, c.has_spring > 0
    at_valve = y[line] if has_line else pm
    turning = y[spring] if has_spring else speed  # of the motor end

    if c.overlap > 0 or c.null_opening > 0:  # lands that open late, or never quite shut
        xs -= c.overlap * math.tanh(xs / (c.overlap + 1e-9))
        xs += c.null_opening / (1 + (xs / (4 * c.null_opening + 1e-9)) ** 2)
    opening = c.k0 * (1 - c.clogging) * xs
    if c.exponent != 1.0:
        opening *= ((xs * xs + 1e-14) / 4e-8) ** (0.5 * (c.exponent - 1))
    hose = ps + c.ripple * math.sin(c.ripple_w * t)
    if c.hum > 0:
        hose += c.hum * math.sin(c.hum_w * t)
    if opening >= 0:
        q = supplied(opening, hose - at_valve, c.droop + c.line)
    else:
        q = -supplied(-opening, hose + at_valve, c.droop + c.line)
    displacement = c.c_r * c.displacement
    thin = 1 + c.warming * t
    taken = displacement * turning * (1 + c.pulsation * math.sin(PISTONS * y[4]))
    taken += c.leak / (c.viscosity * thin) * pm + c.laminar * pm
    if c.orifice > 0:
        taken += c.orifice * root(pm)
    stiff = c.bulk if c.air == 0 else bulk_with_air(c.bulk, c.air, pm)
    if c.stiffening != 0.0:  # hoses: softer at low pressure
        stiff *= min(max(1 + c.stiffening * (pm / 5e6 - 1), 0.3), 2.0)
    dy[0], dy[1] = (c.gain * u - x1) / c.t1, (x1 - y[1]) / c.t2
    if c.damping > 0:  # a pair of complex poles that is as late; x1 is the spool and its speed times that
        late, four = c.t1 + c.t2, 4 * c.damping * c.damping
        dy[1] = (x1 - y[1]) / late
        dy[0] = (1 - four) * dy[1] + four / late * (c.gain * u - y[1])
    if has_line:
        stiff_v = c.bulk if c.air == 0 else bulk_with_air(c.bulk, c.air, at_valve)
        dy[2] = 2 * stiff / c.volume * (y[line + 1] - taken)
        dy[line] = 2 * stiff_v / c.volume * (q - y[line + 1])
        dy[line + 1] = (at_valve - pm) / c.inertance
    else:
        dy[2] = stiff / c.volume * (q - taken)

    load = displacement / c.eta_p * c.pump * pp + c.push
    viscous = c.viscous * c.viscosity * thin
    torque = displacement * c.eta_m * c.motor * pm - c.more_viscous * turning - c.seal * math.tanh(turning / 0.5)
    dy[5] = dy[10] = dy[11] = 0.0
    if c.friction > 0:
        level = c.coulomb + c.dry * (1 + c.turn * math.sin(y[4])) + c.by_load * math.sqrt(pm * pm + 1e8)
        r = 1.0586 * turning / c.stribeck
        if -20 < r < 20:
            level += c.excess / math.cosh(r) ** 2
        dy[5] = wound(turning, y[5], c.winding, RELAXATION, c.shape)
        if c.shape == 0.0:  # a Maxwell body's three elements
            dy[10] = wound(turning, y[10], c.winding * SPREAD[0], RELAXATION, 0.0)
            dy[11] = wound(turning, y[11], c.winding * SPREAD[2], RELAXATION, 0.0)
            torque -= level / 3 * (y[5] + y[10] + y[11] + BRISTLE_TIME * (dy[5] + dy[10] + dy[11]))
        else:
            torque -= level * (y[5] + BRISTLE_TIME * dy[5])
    if has_spring:
        twisted = c.spring_k * y[spring + 1] + c.spring_d * (turning - speed)
        dy[spring] = (torque - 0.5 * viscous * turning - twisted) / (0.5 * c.inertia + c.mass)
        dy[spring + 1] = turning - speed
        dy[3] = (twisted - 0.5 * viscous * speed - load) / (0.5 * c.inertia)
    else:
        dy[3] = (torque - viscous * speed - load) / (c.inertia + c.mass)
    dy[4] = turning
    if given[0] > 0:
        dy[6] = dy[7] = dy[8] = dy[9] = 0.0
    else:
        level = c.supply_level + tones(c.supply_a, c.supply_w, c.supply_p, t)
        dy[6] = (level - PUMP_RESISTANCE * abs(q) - ps) / PUMP_TIME
        dy[7] = (c.load_set - y[7]) / LOAD_TIME
        dy[8] = (y[7] - y[8]) / LOAD_TIME
        dy[9] = (y[8] - y[9]) / LOAD_TIME


@njit
def integrate(y, start, end, step, c, drive, given, tolerance, scale):
    return dormand_prince.integrate(rate, y, start, end, step, int(c.size), c, (drive, given, start), tolerance, scale)


@njit
def replay(y, pieces, first, last, period, pressures, c, tolerance, scale):
    """Motor pressure and shaft speed and their slopes at the samples first..last-1, from y at `first`.

    pieces: rows of (sample, start, end, kind, a, b, c), in order; pressures: rows of (supply, slope, load, slope) at
    the samples. Empty if the integration failed.
    """
    shown = np.empty((last - first, 4))
    dy, given, drive = np.zeros(MOST_STATES), np.zeros(4), np.zeros(5)
    step, row = 2e-3, 0
    while pieces[row, 0] < first:
        row += 1
    for k in range(first, last):
        given[:] = pressures[k]
        drive[:4], drive[4] = pieces[row, 3:], pieces[row, 1]
        rate(k * period, y, c, (drive, given, k * period), dy)
        shown[k - first, 0], shown[k - first, 1] = y[2], y[3]
        shown[k - first, 2], shown[k - first, 3] = dy[2], dy[3]
        while row < len(pieces) and pieces[row, 0] == k:
            start, end = pieces[row, 1], pieces[row, 2]
            drive[:4], drive[4] = pieces[row, 3:], start
            given[:] = pressures[k]
            given[0] += given[1] * (start - k * period)
            given[2] += given[3] * (start - k * period)
            step = integrate(y, start, end, min(step, 2e-3), c, drive, given, tolerance, scale)
            if step < 0:
                return shown[:0]
            row += 1
    return shown
