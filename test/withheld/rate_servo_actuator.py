"""The right-hand side of the servo actuator's truth, compiled: LSODA calls it without passing through Python.

rate(t, y, c, drive, dy) writes dy/dt. `c` is one record of CONSTANTS; `drive` says how the voltage runs on the present
piece: (kind, a, b, c, start), see CommandPath. The formulae are described in truth_servo_actuator.py.
"""
import ctypes
import math

import numpy as np
from numba import carray, cfunc, njit, types
from numba.core import cgutils
from numba.extending import intrinsic

from friction_laws import SPREAD, wound
from signal_paths import soft_deadband

ORIFICE_LAMINAR = 600.0  # Pa
ATMOSPHERE = 101325.0
POLYTROPIC = 1.1
PUMP_RESISTANCE = 5.0e8  # Pa s/m^3, seen by the supply transducer
PUMP_TIME = 0.05  # s
BRISTLE_DAMPING = 5.0e3  # N s/m
MOST_STATES = 17

CONSTANTS = np.dtype(
    [
        (name, np.float64)
        for name in (
            "area piston_mass load_mass volume viscous coulomb excess stribeck bulk flow_gain tau_v spool_gain stop"
            " stop_k stop_d bristle stroke_friction warming more_coulomb more_viscous more_excess more_velocity"
            " asymmetry by_load push spring end_x end_k leak_ab laminar_ab leak_a leak_b air exponent overlap droop"
            " ripple ripple_w supply_offset has_rod has_line rod_index line_index inertance share_f gap rod_k rod_d"
            " supply_level load_level extra_friction any_leak shape maxwell maxwell_index second_order spool_damping"
            " spool_index lap rounding uneven pulsation pulsation_w line stiffening"
        ).split()
    ]
    + [(name, np.float64, (3,)) for name in ("supply_a", "supply_w", "supply_p", "load_a", "load_w", "load_p")]
)


@njit
def root(y):
    return y / (abs(y) ** 3 + ORIFICE_LAMINAR**3) ** (1 / 6)


@njit
def supplied(g, drop, droop):
    """Flow through an opening g from the supply, behind the resistance of the line if there is one."""
    if droop == 0.0 or drop <= 0.0:
        return g * root(drop)
    gg = g * g * droop
    return 0.5 * (math.sqrt(gg * gg + 4 * g * g * drop) - gg) * (1 if g >= 0 else -1)


@njit
def stop_force(x, v, stop, stop_k, stop_d):
    if x > stop:
        return max(0.0, stop_k * (x - stop) + stop_d * v)
    if x < -stop:
        return min(0.0, stop_k * (x + stop) + stop_d * v)
    return 0.0


@njit
def bulk_with_air(bulk, air, p):
    p = max(p, 0.0) + ATMOSPHERE
    return 1 / (1 / bulk + air * (ATMOSPHERE / p) ** (1 / POLYTROPIC) / (POLYTROPIC * p))


@njit
def land(opening, rounding):
    """How far a land is open; never quite shut."""
    s = opening / rounding
    return opening if s > 40 else rounding * math.log1p(math.exp(s)) if s > -40 else 0.0


@njit
def winding(v, z, stiffness, level, shape):
    """Rate of an element's winding z (m) that slips at a force."""
    reach = level / stiffness
    return reach * wound(v, z / reach, reach, 0.0, shape)


@njit
def rate(t, y, c, drive, dy):
    x, v, pa, pb, xv, ps, z = y[0], y[1], y[2], y[3], y[4], y[5], y[6]
    supply, outer = c.supply_level, c.load_level
    for n in range(3):
        supply += c.supply_a[n] * math.sin(c.supply_w[n] * t + c.supply_p[n])
        outer += c.load_a[n] * math.sin(c.load_w[n] * t + c.load_p[n])
    kind = drive[0]
    if kind == 0:
        u = drive[1]
    elif kind == 1:
        u = drive[1] + (drive[2] - drive[1]) * math.exp(-(t - drive[4]) / drive[3])
    else:
        u = drive[2] + drive[3] * (t - drive[4])
        if (u - drive[1]) * drive[3] > 0:
            u = drive[1]
    dxv = (c.spool_gain * u - xv) / c.tau_v
    if c.second_order > 0:  # as slow as the first order's lag
        spool, w = int(c.spool_index), 2 * c.spool_damping / c.tau_v
        dy[spool] = w * w * (c.spool_gain * u - xv) - 2 * c.spool_damping * w * y[spool]
        dxv = y[spool]
    if (xv >= 10 and dxv > 0) or (xv <= -10 and dxv < 0):
        dxv = 0.0
    # valve
    opening = soft_deadband(xv, c.overlap)
    if c.exponent != 1.0:
        opening *= ((opening * opening + 1e-8) / 100.0) ** (0.5 * (c.exponent - 1))
    line, rod = int(c.line_index), int(c.rod_index)
    has_line, has_rod = c.has_line > 0, c.has_rod > 0
    pva, pvb = pa, pb
    if has_line:
        pva, pvb = y[line], y[line + 2]
    pv = ps + c.supply_offset + c.ripple * math.sin(c.ripple_w * t)
    if c.pulsation > 0:
        pv += c.pulsation * math.sin(c.pulsation_w * t)
    g = c.flow_gain * opening
    if c.rounding > 0:  # four lands; where two of a side are open, oil passes from supply to tank
        into = c.flow_gain * land(opening - 0.5 * c.lap, c.rounding)
        out = c.flow_gain * land(-opening - 0.5 * c.lap, c.rounding)
        qa = supplied(into, pv - pva, c.droop + c.line) - out * root(pva)
        qb = into * root(pvb) - supplied(out, pv - pvb, c.droop + c.line)
        drawn = into * root(pv - pva) + out * root(pv - pvb)
    elif opening > 0:
        qa, qb = supplied(g, pv - pva, c.droop + c.line), g * root(pvb)
        drawn = qa
    else:
        qa, qb = g * root(pva), supplied(g, pv - pvb, c.droop + c.line)
        drawn = -qb
    if c.uneven != 0.0:
        qa, qb = qa * (1 + c.uneven), qb * (1 - c.uneven)
    # chambers
    pl = pa - pb
    ca = cb = c.bulk
    if c.air > 0:
        ca, cb = bulk_with_air(c.bulk, c.air, pa), bulk_with_air(c.bulk, c.air, pb)
    if c.stiffening != 0.0:  # hoses: softer below half the supply's pressure, stiffer above
        ca *= min(max(1 + c.stiffening * (pa / 3.4e6 - 1), 0.3), 2.0)
        cb *= min(max(1 + c.stiffening * (pb / 3.4e6 - 1), 0.3), 2.0)
    out_a = out_b = 0.0
    if c.any_leak > 0:
        across = c.leak_ab * root(pl) + c.laminar_ab * pl
        out_a, out_b = across + c.leak_a * root(pa), c.leak_b * root(pb) - across
    if has_line:
        in_a, in_b = y[line + 1], -y[line + 3]
        dpa = ca / (0.8 * c.volume + c.area * x) * (in_a - c.area * v - out_a)
        dpb = cb / (0.8 * c.volume - c.area * x) * (in_b + c.area * v - out_b)
        node = 0.2 * c.volume
        dy[line], dy[line + 1] = ca / node * (qa - in_a), (pva - pa) / c.inertance
        dy[line + 2], dy[line + 3] = cb / node * (-in_b - qb), (pb - pvb) / c.inertance
    else:
        dpa = ca / (c.volume + c.area * x) * (qa - c.area * v - out_a)
        dpb = cb / (c.volume - c.area * x) * (c.area * v - qb - out_b)
    if pa < 0:
        dpa -= 3e3 * pa  # make-up valve
    if pb < 0:
        dpb -= 3e3 * pb
    # friction of the piston (and, without a rod effect, of all that moves)
    own = 1 - c.share_f
    r = v / c.stribeck
    level = own * (c.coulomb + c.excess * math.exp(-r * r)) * (1 + c.stroke_friction * math.sin(60.0 * x))
    b = c.viscous * (1 + c.warming * t)
    if c.extra_friction > 0:
        level += c.more_coulomb
        r = 1.0586 * v / c.more_velocity
        if -20 < r < 20:
            level += c.more_excess / math.cosh(r) ** 2
        level += 0.5 * c.asymmetry * math.tanh(v / 5e-4) + c.by_load * math.sqrt(pl * pl + 1e6)
        level = max(level, 1.0)
    dz = v - c.bristle * abs(v) * z / level
    rubbed = c.bristle * z
    if c.maxwell > 0:  # z and two more elements, a third of the level each
        dz = winding(v, z, c.bristle * SPREAD[1], level / 3, 0.0)
        first = int(c.maxwell_index)
        dy[first] = winding(v, y[first], c.bristle * SPREAD[0], level / 3, 0.0)
        dy[first + 1] = winding(v, y[first + 1], c.bristle * SPREAD[2], level / 3, 0.0)
        rubbed += c.bristle * (SPREAD[0] * y[first] + SPREAD[2] * y[first + 1])
    elif c.shape != 1.0:
        dz = winding(v, z, c.bristle, level, c.shape)
    force = c.area * pl - rubbed - BRISTLE_DAMPING * dz - (own * b + c.more_viscous) * v - c.push - c.spring * x
    if c.end_k > 0 and x > c.end_x:
        force -= max(0.0, c.end_k * (x - c.end_x) * (1 + 0.5 * v))
    if has_rod:
        xl, vl, zl = y[rod], y[rod + 1], y[rod + 2]
        stretch, speed = x - xl, v - vl
        if c.gap > 0:
            held = 0.0
            pen = abs(stretch) - 0.5 * c.gap
            if pen > 0:
                side = 1.0 if stretch > 0 else -1.0
                held = max(0.0, c.rod_k * pen + c.rod_d * speed * side * min(1.0, pen * 1e5)) * side
        else:
            held = c.rod_k * stretch + c.rod_d * speed
        r = vl / c.stribeck
        dzl = vl - c.bristle * abs(vl) * zl / (c.share_f * (c.coulomb + c.excess * math.exp(-r * r)))
        rubbing = c.bristle * zl + BRISTLE_DAMPING * dzl + c.share_f * b * vl
        force -= held
        dy[rod], dy[rod + 2] = vl, dzl
        dy[rod + 1] = (held - outer - stop_force(xl, vl, c.stop, c.stop_k, c.stop_d) - rubbing) / c.load_mass
    else:
        force -= outer + stop_force(x, v, c.stop, c.stop_k, c.stop_d)
    dy[0], dy[1], dy[2], dy[3], dy[4] = v, force / c.piston_mass, dpa, dpb, dxv
    dy[5], dy[6] = (supply - PUMP_RESISTANCE * max(drawn, 0.0) - ps) / PUMP_TIME, dz


# What the compiled function reads: the record and the drive of the truth that is being integrated.
NOW = np.zeros(1, CONSTANTS)
DRIVE = np.zeros(5)
_NOW_AT, _DRIVE_AT = NOW.ctypes.data, DRIVE.ctypes.data


@intrinsic
def _pointer(typing, address):
    def generate(context, builder, signature, arguments):
        return builder.inttoptr(arguments[0], cgutils.voidptr_t)

    return types.voidptr(address), generate


_double = types.CPointer(types.float64)


@cfunc(types.void(types.CPointer(types.int32), _double, _double, _double))
def _fortran(n, t, y, dy):
    rate(
        t[0],
        carray(y, MOST_STATES),
        carray(_pointer(_NOW_AT), 1, dtype=CONSTANTS)[0],
        carray(_pointer(_DRIVE_AT), 5, dtype=np.float64),
        carray(dy, MOST_STATES),
    )


_capsule = ctypes.pythonapi.PyCapsule_New
_capsule.restype, _capsule.argtypes = ctypes.py_object, [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p]
FORTRAN = _capsule(_fortran.address, None, None)  # f2py hands it to LSODA as it is
