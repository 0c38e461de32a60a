"""The right-hand side of the pump-controlled cylinder's truth and its replay, compiled.

`c` is one record of CONSTANTS, `drive` says how the two speeds run: a row for each pump of (kind, a, b, c, start), see
CommandPath. The formulae are described in truth_pump_cylinder.py.
"""
import math

import numpy as np
from numba import njit

import dormand_prince
from friction_laws import SPREAD, wound

ORIFICE_LAMINAR = 6.0e3  # Pa
AMBIENT = 101325.0
POLYTROPIC = 1.1
LOWEST = -9.0e4  # Pa gauge: below, air comes in
ROUNDING = 2.0e4  # Pa, of a relief valve's corner
WINDING = 2.0e-5  # m, over which bristles take up friction, unless a random truth's are softer or stiffer
BRISTLE_TIME = 5.0e-4  # s, of their damping
RELAXATION = 2.0e-4  # s, no faster than which they turn over
ROD_SHARE = 0.7 / 12.3  # of the moving mass
CONTACT = 1.5e7  # N/m
CONTACT_DAMPING = 1.5e3  # N s/m
STROKE = 0.05  # m
LINE_DAMPING = 50.0  # 1/s
PISTONS = 9
X, V, PA, PB, ANGLE1, ANGLE2, BRISTLE, ROD_X, ROD_V, LINE_A, COLUMN_A, LINE_B, COLUMN_B, FAST, SLOW = range(15)
STATES = 15  # FAST, SLOW: two more bristles of a Maxwell body

CONSTANTS = np.dtype(
    [
        (name, np.float64)
        for name in (
            "mass area_a area_b volume_a volume_b displacement internal external_a external_b viscous coulomb c1 c2"
            " weight width line_a_volume line_b_volume stiction warming pulsation mismatch more_coulomb more_viscous"
            " excess stribeck asymmetry by_load push spring added end_x end_k lam_2ab orf_2ab spd_2ab lam_2a lam_2b"
            " orf_2b crack relief lam_1a orf_1a spd_1a lam_ab orf_ab air_a air_b factor_a factor_b inertance_a"
            " inertance_b gap ripple order viscosity winding shape stroke_friction slip"
            " hum stiffening"
        ).split()
    ]
)


@njit
def root(y):
    return y / (abs(y) ** 3 + ORIFICE_LAMINAR**3) ** (1 / 6)


@njit
def modulus(p, c1, c2, air, factor):
    """The datasheet's curve as a series about P = 0, and gas that is compressed polytropically."""
    g = max(p, LOWEST)
    oil = factor * (c1 / c2 + (1 / c2 - 1) * g - g * g / (2 * c1))
    if air == 0.0:
        return oil
    absolute = max(p + AMBIENT, 2e4)
    return 1 / (1 / oil + air * (AMBIENT / absolute) ** (1 / POLYTROPIC) / (POLYTROPIC * absolute))


@njit
def speed(t, drive):
    if drive[0] == 0:
        return drive[1]
    if drive[0] == 1:
        return drive[1] + (drive[2] - drive[1]) * math.exp(-(t - drive[4]) / drive[3])
    w = drive[2] + drive[3] * (t - drive[4])
    return drive[1] if (w - drive[1]) * drive[3] > 0 else w


@njit
def contact(pen, closing):
    return max(0.0, CONTACT * pen + CONTACT_DAMPING * closing) if pen > 0 else 0.0


@njit
def rate(t, y, c, drive, dy):
    w1, w2 = speed(t, drive[0]), speed(t, drive[1])
    x, v, pa, pb = y[X], y[V], y[PA], y[PB]
    has_gap, has_a, has_b = c.gap > 0, c.inertance_a > 0, c.inertance_b > 0
    xr, vr = (y[ROD_X], y[ROD_V]) if has_gap else (x, v)
    at_a = y[LINE_A] if has_a else pa
    at_b = y[LINE_B] if has_b else pb
    thick = c.viscosity * (1 + c.warming * t)
    # pumps
    d1 = c.displacement * (1 - c.mismatch) * w1 * (1 + c.pulsation * math.sin(PISTONS * y[ANGLE1]))
    d2 = c.displacement * (1 + c.mismatch) * w2 * (1 + c.pulsation * math.sin(PISTONS * y[ANGLE2] + 1.0))
    d2 += c.displacement * w2 * c.ripple * math.sin(c.order * y[ANGLE2])
    if c.slip != 0.0:  # what a pump loses grows with its speed too
        d1, d2 = d1 * (1 - c.slip * abs(w1) / 50), d2 * (1 - c.slip * abs(w2) / 50)
    if c.hum > 0:  # once a turn: a shaft out of true
        d1 *= 1 + c.hum * math.sin(y[ANGLE1])
        d2 *= 1 + c.hum * math.sin(y[ANGLE2] + 1.0)
    across = (c.internal / thick + c.lam_2ab + c.spd_2ab * abs(w2)) * (at_a - at_b) + c.orf_2ab * root(at_a - at_b)
    q_a = d1 + d2 - across - ((c.internal + 2 * c.external_a) / thick + c.lam_2a + c.lam_1a) * at_a
    q_a -= c.orf_1a * root(at_a) + c.spd_1a * abs(w1) * at_a
    q_b = d2 - across + (c.external_b / thick + c.lam_2b) * at_b + c.orf_2b * root(at_b)
    if c.relief > 0:
        over = (at_b - c.crack) / ROUNDING
        q_b += c.relief * ROUNDING * (over if over > 30 else math.log1p(math.exp(over)) if over > -30 else 0.0)
    # chambers
    past = c.lam_ab * (pa - pb) + c.orf_ab * root(pa - pb)
    beta_a = modulus(pa, c.c1, c.c2, c.air_a, c.factor_a)
    beta_b = modulus(pb, c.c1, c.c2, c.air_b, c.factor_b)
    if c.stiffening != 0.0:  # hoses
        beta_a *= min(max(1 + c.stiffening * (pa / 4e6 - 1), 0.3), 2.0)
        beta_b *= min(max(1 + c.stiffening * (pb / 4e6 - 1), 0.3), 2.0)
    volume_a, volume_b = c.volume_a + c.area_a * xr, c.volume_b - c.area_b * xr
    if has_a:
        volume_a -= c.line_a_volume
        dy[LINE_A] = modulus(at_a, c.c1, c.c2, c.air_a, c.factor_a) / c.line_a_volume * (q_a - y[COLUMN_A])
        dy[COLUMN_A] = (at_a - pa) / c.inertance_a - LINE_DAMPING * y[COLUMN_A]
        q_a = y[COLUMN_A]
    else:
        dy[LINE_A] = dy[COLUMN_A] = 0.0
    if has_b:
        volume_b -= c.line_b_volume
        dy[LINE_B] = modulus(at_b, c.c1, c.c2, c.air_b, c.factor_b) / c.line_b_volume * (y[COLUMN_B] - q_b)
        dy[COLUMN_B] = (pb - at_b) / c.inertance_b - LINE_DAMPING * y[COLUMN_B]
        q_b = y[COLUMN_B]
    else:
        dy[LINE_B] = dy[COLUMN_B] = 0.0
    dy[PA] = beta_a / max(volume_a, 1e-5) * (q_a - c.area_a * vr - past)
    dy[PB] = beta_b / max(volume_b, 1e-5) * (c.area_b * vr - q_b + past)
    if pa < LOWEST:
        dy[PA] += 3e3 * (LOWEST - pa)
    if pb < LOWEST:
        dy[PB] += 3e3 * (LOWEST - pb)
    # friction: the datasheet's smooth level, a little of it and all of the effects' on bristles
    smooth = (1 - c.stiction) * c.coulomb
    viscous = c.viscous * thick
    level = c.stiction * c.coulomb + c.more_coulomb
    if c.by_load > 0:
        level += c.by_load * math.sqrt((pa - pb) ** 2 + 1e8)
    if c.excess > 0:
        r = 1.0586 * vr / c.stribeck
        if -20 < r < 20:
            level += c.excess / math.cosh(r) ** 2
    dy[BRISTLE] = dy[FAST] = dy[SLOW] = 0.0
    if c.stroke_friction != 0.0:
        level *= 1 + c.stroke_friction * math.sin(80.0 * x)
        smooth *= 1 + c.stroke_friction * math.sin(80.0 * x)
    force = c.area_a * pa - c.area_b * pb - c.more_viscous * vr - c.push - c.spring * x
    if level > 0:
        dy[BRISTLE] = wound(vr, y[BRISTLE], c.winding, RELAXATION, c.shape)
        if c.shape == 0.0:
            dy[FAST] = wound(vr, y[FAST], c.winding * SPREAD[0], RELAXATION, 0.0)
            dy[SLOW] = wound(vr, y[SLOW], c.winding * SPREAD[2], RELAXATION, 0.0)
            held = y[BRISTLE] + y[FAST] + y[SLOW] + BRISTLE_TIME * (dy[BRISTLE] + dy[FAST] + dy[SLOW])
            force -= level / 3 * held
        else:
            force -= level * (y[BRISTLE] + BRISTLE_TIME * dy[BRISTLE])
    if c.asymmetry != 0.0:
        force -= 0.5 * c.asymmetry * math.tanh(vr / 2e-3) ** 2
    if c.end_k > 0 and x > c.end_x:
        force -= max(0.0, c.end_k * (x - c.end_x) * (1 + 0.5 * v))
    force -= contact(xr - STROKE, vr) - contact(-STROKE - xr, -vr)
    own = smooth * vr / (abs(vr) ** 3 + c.width**3) ** (1 / 3) + viscous * vr
    dy[X], dy[ROD_X] = v, vr
    if has_gap:
        apart, closing = xr - x, vr - v
        pen = abs(apart) - 0.5 * c.gap
        side = 1.0 if apart > 0 else -1.0
        held = side * contact(pen, side * closing)
        plates = smooth * v / (abs(v) ** 3 + c.width**3) ** (1 / 3) + viscous * v
        rod = ROD_SHARE * c.mass
        dy[ROD_V] = (force - 0.5 * own - ROD_SHARE * c.weight - held) / (rod + c.added)
        dy[V] = (held - 0.5 * plates - (1 - ROD_SHARE) * c.weight) / (c.mass - rod)
    else:
        dy[V] = (force - own - c.weight) / (c.mass + c.added)
        dy[ROD_V] = dy[V]
    dy[ANGLE1], dy[ANGLE2] = w1, w2


@njit
def integrate(y, start, end, step, c, drive, tolerance, scale):
    return dormand_prince.integrate(rate, y, start, end, step, STATES, c, drive, tolerance, scale)


@njit
def replay(y, pieces, first, last, period, c, tolerance, scale):
    """Position, both pressures and both mean speeds at the samples first..last-1, from y at `first`.

    pieces: a row a sample of (kind, a, b, c) for each pump. Empty if the integration failed.
    """
    shown = np.empty((last - first, 5))
    drive = np.zeros((2, 5))
    step = 1e-4
    for k in range(first, last):
        drive[0, :4], drive[1, :4] = pieces[k, :4], pieces[k, 4:]
        drive[:, 4] = k * period
        row = shown[k - first]
        row[0], row[1], row[2], row[3], row[4] = y[X], y[PA], y[PB], y[ANGLE1], y[ANGLE2]
        step = integrate(y, k * period, (k + 1) * period, min(step, period), c, drive, tolerance, scale)
        if step < 0:
            return shown[:0]
        row[3], row[4] = (y[ANGLE1] - row[3]) / period, (y[ANGLE2] - row[4]) / period
    return shown
