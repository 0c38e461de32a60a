"""The right-hand side of the control valve's truth, its loops and its replay, compiled; told in truth_control_valve.py.

States: flapper gap, prestage pressure (gauge), spool, spool's bristle, cylinder pressure (gauge), piston, its speed,
its bristle, two bristles of the seal, drop of the supply, two elements of the diaphragms' hysteresis, shaft angle and
speed (where the joint yields). SI units.
"""
import math

import numpy as np
from numba import njit

import dormand_prince
from friction_laws import SPREAD, wound
from signal_paths import soft_deadband

GAMMA = 1.4
AMBIENT = 101325.0
REFERENCE = 293.15  # K, of the coil
STROKE = 0.0776
RADIUS = STROKE / math.sqrt(2.0)
LEVER = 0.05
WIDEST_GAP = 1.2e-4
LEAK = math.sqrt(1.2 / 2)  # from a leak's coefficient to its Cd A
PISTON_MASS = 8.0  # kg, with its rod
SHAFT_INERTIA = 0.02  # kg m^2, shaft and segment
STOP = (2e8, 1e5)  # N/m, N s/m
SPOOL_WINDING = 2e-6  # m, at 0.4 N; with the root of the level
PISTON_WINDING = 4e-5  # m
BRISTLE_TIME = 1e-3  # s, of the piston's bristles
SEAL_BRISTLE_TIME = 2e-3  # s
SHORT, LONG = 0.6, 1.4  # of the wind-up angle, of the seal's two bristles
DIAPHRAGM = (0.03, 0.07)  # of the stroke, over which each element turns over
SUPPLY_TIME = 5e-3  # s, of the volume behind the regulator
SHAFT_DRAG = 0.05  # N m s
PSI_LAST = math.sqrt(3.5 * 0.996 ** (10 / 7) * (1 - 0.996 ** (2 / 7)))
STATES = 17  # FAST, SLOW: two more bristles of the piston's, in a Maxwell body
TONES = 4
X_F, P_P, SPOOL, SPOOL_Z, P_C, X, V, PISTON_Z, SEAL_1, SEAL_2, DROP, HYST_1, HYST_2 = range(13)
SHAFT, SHAFT_W, FAST, SLOW = range(13, STATES)

CONSTANTS = np.dtype(
    [
        (name, np.float64)
        for name in (
            "nozzle_inner_diameter nozzle_outer_diameter restrictor_diameter restrictor_cd nozzle_cd_factor"
            " flapper_spring flapper_damping flapper_rest coil_force_factor coil_temp_coef pressure_coef_0"
            " pressure_coef_1 prestage_volume prestage_area supply_area spool_stroke spool_spring spool_pretension"
            " diaphragm_stiffness spool_viscous spool_coulomb port_area fill_cd_factor exhaust_cd_factor cylinder_area"
            " dead_volume spring_rate spring_pretension actuator_viscous coulomb_pos_factor coulomb_neg_factor"
            " seal_friction_factor seal_force windup_angle valve_cv valve_cv_linear pump_pressure open_pressure_ratio"
            " prestage_leak cylinder_leak restrictor_clog nozzle_clog ports_clog valve_clog overlap exponent compliance"
            " spool_friction spool_shift spool_stiffness diaphragm_width more_coulomb more_viscous excess stribeck"
            " piston_shift piston_stiffness valve_friction valve_by_load supply_offset droop joint joint_stiffness"
            " joint_damping gap ripple supply_level air_level gas_constant size"
            " piston_winding shape stroke_friction heat_friction null_area underlap hum hum_w gamma"
        ).split()
    ]
    + [(name, np.float64, (TONES,)) for name in ("supply_a", "supply_w", "supply_p", "air_a", "air_w", "air_p")]
)
LOOPS = np.dtype(
    [
        (name, np.float64)
        for name in (
            "position_gain bias gain integral derivative filter sum slow offset factor stuck_from held"
            " scale shift lag drive started noise position_noise spool_noise step"
        ).split()
    ]
)

_GAP_CD = np.array([0.95, 0.9467, 0.8067, 0.70])
_FILL_LOW = np.array([0.43, 0.43, 0.42, 0.35, 0.30])
_FILL_HIGH = np.array([0.6133, 0.6133, 0.6033, 0.54, 0.49])
_EXHAUST_P = np.array([0.0, 2e5, 5e5, 8e5])
_EXHAUST = np.array([[0.1, 0.58, 0.60, 0.60], [0.1, 0.66, 0.80, 0.80], [0.60, 0.70, 0.80, 0.95]])
_UP = np.array([110.0, 100.0, 150.0, 130.0, 130.0])
_DOWN = np.array([580.0, 580.0, 540.0, 580.0, 580.0])
_SEAL = np.array([0.30, 0.20, 0.16, 0.15, 0.15])


@njit
def table(values, x, step):
    """Linear between points `step` apart, flat beyond the ends."""
    s = x / step
    last = len(values) - 1
    if s <= 0:
        return values[0]
    if s >= last:
        return values[last]
    n = int(s)
    return values[n] + (s - n) * (values[n + 1] - values[n])


@njit
def psi(r):
    """Flow function; straight to zero from 0.996 on (datasheet: from 0.99)."""
    if r <= 0.528282:
        return 0.484178
    if r < 0.996:
        a = r ** (1 / 3.5)
        return math.sqrt(3.5 * a**5 * (1 - a))
    return PSI_LAST * (1 - r) / 0.004


@njit
def blown(area, first, second, air, gas):
    """kg/s through an orifice from `first` to `second`, absolute pressures."""
    if second > first:
        return -area * second * psi(first / second) * math.sqrt(2 / (gas * air))
    return area * first * psi(second / first) * math.sqrt(2 / (gas * air))


@njit
def fill_cd(s, ratio):
    low, high = table(_FILL_LOW, ratio, 0.25), table(_FILL_HIGH, ratio, 0.25)
    return low + min(max((s - 0.6) / 0.2, 0.0), 1.0) * (high - low)


@njit
def exhaust_cd(s, p):
    k = min(max(s, 0.0), 0.4) / 0.2
    n = min(int(k), 1)
    low, high = np.interp(p, _EXHAUST_P, _EXHAUST[n]), np.interp(p, _EXHAUST_P, _EXHAUST[n + 1])
    return low + (k - n) * (high - low)


@njit
def angle(x):
    return math.pi / 4 + math.asin(min(max((x - STROKE / 2) / RADIUS, -1.0), 1.0))


@njit
def turning(x):
    """rad of the shaft per m of the piston."""
    return 1 / math.sqrt(max(RADIUS**2 - (x - STROKE / 2) ** 2, 1e-6))


@njit
def opening(c, phi):
    h = min(max(phi / (math.pi / 2), 0.0), 1.0)
    h = h**c.exponent if c.exponent != 1.0 else h
    return (1 - c.valve_clog) * (c.valve_cv_linear * h + (1 - c.valve_cv_linear) * h**3)


@njit
def across(c, cv):
    """Pa across the process valve."""
    return c.pump_pressure * c.open_pressure_ratio / (c.open_pressure_ratio + (1 - c.open_pressure_ratio) * cv * cv)


@njit
def tones(a, w, p, t):
    total = 0.0
    for n in range(TONES):
        total += a[n] * math.sin(w[n] * t + p[n])
    return total


@njit
def surroundings(t, c, given, since):
    if given[0] > 0:
        return given[0] + given[1] * (t - since), given[2] + given[3] * (t - since)
    return (
        c.supply_level + tones(c.supply_a, c.supply_w, c.supply_p, t),
        c.air_level + tones(c.air_a, c.air_w, c.air_p, t),
    )


@njit
def bristle(v, z, winding):
    """Rate of a bristle that takes up a friction level over `winding`; z within -1..1."""
    return (v - abs(v) * z) / winding


@njit
def seal(c, phi, w, e1, e2):
    """(torque, rates of its two bristles)"""
    level = c.seal_friction_factor * table(_SEAL, phi / (math.pi / 2), 0.25) * c.seal_force * LEVER
    level += c.valve_friction
    if c.valve_by_load > 0:
        level += c.valve_by_load * across(c, opening(c, phi))
    first, second = bristle(w, e1, SHORT * c.windup_angle), bristle(w, e2, LONG * c.windup_angle)
    return 0.5 * level * (e1 + e2 + SEAL_BRISTLE_TIME * (first + second)), first, second


@njit
def joint_torque(c, y):
    turn = turning(y[X])
    apart = angle(y[X]) - y[SHAFT]
    half = 0.5 * c.gap * turn
    if abs(apart) <= half:
        return 0.0
    held = c.joint_stiffness * (apart - math.copysign(half, apart))
    held += c.joint_damping * (turn * y[V] - y[SHAFT_W])
    return held if held * apart > 0 else 0.0  # parts push, they do not stick


@njit
def rate(t, y, c, inputs, dy):
    drive, given, since = inputs
    supply, air = surroundings(t, c, given, since)
    supply += c.supply_offset - y[DROP]
    if c.hum > 0:
        supply += c.hum * math.sin(c.hum_w * t)
    u = drive[0]
    if drive[2] > 0:
        u += (drive[1] - drive[0]) * math.exp(-(t - drive[3]) / drive[2])
    ps, pp, pc = supply + AMBIENT, y[P_P] + AMBIENT, y[P_C] + AMBIENT
    gas = c.gas_constant

    wall = c.nozzle_outer_diameter - c.nozzle_inner_diameter
    effective = math.pi / 4 * (c.nozzle_inner_diameter + 0.4125 * wall) ** 2
    coil = u * c.coil_force_factor * ((air - REFERENCE) * c.coil_temp_coef + 1)
    push = max(0.0, c.pressure_coef_0 - c.pressure_coef_1 * y[X_F]) * y[P_P] * effective
    dy[X_F] = (push - coil - c.flapper_spring * (y[X_F] - c.flapper_rest)) / c.flapper_damping
    if (y[X_F] <= 0 and dy[X_F] < 0) or (y[X_F] >= WIDEST_GAP and dy[X_F] > 0):
        dy[X_F] = 0.0

    force = c.prestage_area * y[P_P] - c.supply_area * supply - c.spool_spring * (y[SPOOL] + c.spool_pretension)
    force -= c.diaphragm_stiffness * y[SPOOL] + 0.25 * c.diaphragm_width * (y[HYST_1] + y[HYST_2])
    force -= c.spool_shift + c.spool_stiffness * (y[SPOOL] - 0.5 * c.spool_stroke)
    level = c.spool_coulomb + c.spool_friction
    slide = (force - level * y[SPOOL_Z]) / c.spool_viscous
    if (y[SPOOL] <= 0 and slide < 0) or (y[SPOOL] >= c.spool_stroke and slide > 0):
        slide = 0.0
    dy[SPOOL] = slide
    dy[SPOOL_Z] = bristle(slide, y[SPOOL_Z], SPOOL_WINDING * math.sqrt(max(level, 0.04) / 0.4))
    dy[HYST_1] = bristle(slide, y[HYST_1], DIAPHRAGM[0] * c.spool_stroke)
    dy[HYST_2] = bristle(slide, y[HYST_2], DIAPHRAGM[1] * c.spool_stroke)

    gap = max(y[X_F], 0.0)
    into = blown(c.restrictor_cd * (1 - c.restrictor_clog) * math.pi / 4 * c.restrictor_diameter**2, ps, pp, air, gas)
    ring = c.nozzle_cd_factor * table(_GAP_CD, gap, 35e-6) * (1 - c.nozzle_clog) * math.pi * c.nozzle_inner_diameter
    into -= blown(ring * gap + LEAK * c.prestage_leak, pp, AMBIENT, air, gas)
    stored = gas * air * into - pp * c.prestage_area * slide
    dy[P_P] = c.gamma / (c.prestage_volume + c.prestage_area * y[SPOOL]) * stored

    s = y[SPOOL] / c.spool_stroke
    open_by = soft_deadband(s - 0.5, c.overlap) if c.overlap > 0 else s - 0.5
    port = c.port_area * (1 - c.ports_clog) * abs(open_by) / 0.5
    if open_by > 0:
        filled = blown(c.fill_cd_factor * fill_cd(s, pc / ps) * port, ps, pc, air, gas)
    else:
        filled = -blown(c.exhaust_cd_factor * exhaust_cd(s, y[P_C]) * port, pc, AMBIENT, air, gas)
    if c.null_area > 0 or c.underlap > 0:  # both lands pass a little; over an underlap much
        both = c.port_area * (c.null_area + max(0.0, c.underlap - 2 * abs(s - 0.5)))
        filled += blown(0.5 * both, ps, pc, air, gas) - blown(0.5 * both, pc, AMBIENT, air, gas)
    dy[DROP] = (c.droop * max(0.0, filled) - y[DROP]) / SUPPLY_TIME if c.droop > 0 else 0.0
    net = filled - blown(LEAK * c.cylinder_leak, pc, AMBIENT, air, gas) if c.cylinder_leak > 0 else filled
    x, v = y[X], y[V]
    stored = gas * air * net - pc * c.cylinder_area * v
    dy[P_C] = c.gamma * c.compliance / (c.dead_volume + c.cylinder_area * x) * stored

    turn = turning(x)
    mass = PISTON_MASS
    if c.joint > 0:
        torque = joint_torque(c, y)
        held, dy[SEAL_1], dy[SEAL_2] = seal(c, y[SHAFT], y[SHAFT_W], y[SEAL_1], y[SEAL_2])
        dy[SHAFT] = y[SHAFT_W]
        dy[SHAFT_W] = (torque - held - SHAFT_DRAG * y[SHAFT_W]) / SHAFT_INERTIA
    else:
        torque, dy[SEAL_1], dy[SEAL_2] = seal(c, angle(x), v * turn, y[SEAL_1], y[SEAL_2])
        mass += SHAFT_INERTIA * turn * turn
        dy[SHAFT], dy[SHAFT_W] = 0.0, 0.0
    up, down = c.coulomb_pos_factor * table(_UP, x, STROKE / 4), c.coulomb_neg_factor * table(_DOWN, x, STROKE / 4)
    z = y[PISTON_Z]
    dy[PISTON_Z] = wound(v, z, c.piston_winding, 0.0, c.shape)
    dz, dy[FAST], dy[SLOW] = dy[PISTON_Z], 0.0, 0.0
    if c.shape == 0.0:
        dy[FAST] = wound(v, y[FAST], c.piston_winding * SPREAD[0], 0.0, 0.0)
        dy[SLOW] = wound(v, y[SLOW], c.piston_winding * SPREAD[2], 0.0, 0.0)
        z, dz = (z + y[FAST] + y[SLOW]) / 3, (dz + dy[FAST] + dy[SLOW]) / 3
    if c.stroke_friction != 0.0 or c.heat_friction != 0.0:
        more = (1 + c.stroke_friction * math.sin(160.0 * x)) * max(0.2, 1 + c.heat_friction * (air - REFERENCE))
        up, down = up * more, down * more
    level = (up if z > 0 else down) + c.more_coulomb
    if c.excess > 0:
        r = 1.0586 * v / c.stribeck
        level += c.excess / math.cosh(r) ** 2 if -20 < r < 20 else 0.0
    thrust = c.cylinder_area * y[P_C] - c.spring_rate * (x + c.spring_pretension) - torque * turn
    thrust -= (c.actuator_viscous + c.more_viscous) * v + level * (z + BRISTLE_TIME * dz)
    thrust -= c.piston_shift + c.piston_stiffness * (x - STROKE / 2)
    if x < 0:
        thrust -= STOP[0] * x + STOP[1] * min(v, 0.0)
    elif x > STROKE:
        thrust -= STOP[0] * (x - STROKE) + STOP[1] * max(v, 0.0)
    dy[X], dy[V] = v, thrust / mass


@njit
def integrate(y, start, end, step, c, drive, given, tolerance, scale):
    return dormand_prince.integrate(rate, y, start, end, step, STATES, c, (drive, given, start), tolerance, scale)


@njit
def show(t, y, c, dy, shown):
    """Prestage and cylinder pressure, torque in the shaft, position, flow; dy: the states' rates."""
    turn = turning(y[X])
    if c.joint > 0:
        phi, torque = y[SHAFT], joint_torque(c, y)
    else:
        phi = angle(y[X])
        torque = seal(c, phi, y[V] * turn, y[SEAL_1], y[SEAL_2])[0]
    cv = opening(c, phi)
    flow = 0.865 * c.valve_cv * cv * math.sqrt(across(c, cv) / 1e5) / 3600
    flow *= 1 + c.ripple * math.sin(2 * math.pi * 0.7 * t)
    shown[0], shown[1], shown[2], shown[3], shown[4] = y[P_P], y[P_C], torque, phi / (math.pi / 2), flow


@njit
def sloped(t, y, c, drive, given, since, shown):
    """shown[:5] as of show, shown[5:] their slopes."""
    dy, later = np.zeros(STATES), np.zeros(5)
    rate(t, y, c, (drive, given, since), dy)
    show(t, y, c, dy, shown)
    show(t + 1e-5, y + 1e-5 * dy, c, dy, later)
    shown[5:10] = (later - shown[:5]) / 1e-5


@njit
def rounded(value, step):
    return step * math.floor(value / step + 0.5)


@njit
def clipped(value, low, high):
    return min(max(value, low), high)


@njit
def period(y, t, c, loops, set_point, white, tolerance, scale):
    """0.1 s of the device under a set point of the valve: position loop every 10 ms, spool loop every 1 ms, the plant
    between. Returns (mean voltage, first spool set point); a voltage below 0 where the integration failed."""
    drive, given, shown, dy = np.zeros(4), np.zeros(4), np.zeros(5), np.zeros(STATES)
    total, first, wish = 0.0, 0.0, 0.5
    for k in range(100):
        now = t + 1e-3 * k
        if k % 10 == 0:
            show(now, y, c, dy, shown)
            h = loops.factor * shown[3] + loops.offset + loops.noise * loops.position_noise * white[100 + k // 10]
            h = clipped(rounded(h, 2.5e-4), 0.0, 1.0)
            if now >= loops.stuck_from - 1e-9:
                if loops.held < 0:
                    loops.held = h
                h = loops.held
            wish = clipped(0.5 + loops.position_gain * (set_point - h), 0.0, 1.0)
            if k == 0:
                first = wish
        s = rounded(y[SPOOL] / c.spool_stroke + loops.noise * loops.spool_noise * white[k], 5e-4)
        if loops.started == 0:
            loops.slow, loops.started = s, 1.0
        before = loops.slow
        loops.slow += (s - loops.slow) * (1 - math.exp(-1e-3 / loops.filter))
        error = wish - s
        volts = loops.bias + loops.gain * error + loops.sum - loops.derivative * (loops.slow - before) / 1e-3
        if not ((volts > 4.5 and error > 0) or (volts < 0 and error < 0)):
            loops.sum += loops.integral * error * 1e-3
        volts = clipped(volts, 0.0, 4.5)
        total += volts
        target = loops.scale * volts + loops.shift
        drive[0], drive[1], drive[2], drive[3] = target, loops.drive, loops.lag, now
        loops.drive = target if loops.lag <= 0 else target + (loops.drive - target) * math.exp(-1e-3 / loops.lag)
        loops.step = integrate(y, now, now + 1e-3, min(loops.step, 1e-3), c, drive, given, tolerance, scale)
        if loops.step < 0:
            return -1.0, first
    return total / 100, first


@njit
def replay(y, drives, first, last, length, inputs, c, tolerance, scale):
    """Outputs and their slopes at the samples first..last-1, from y at `first`. drives: rows of (target, before, lag)
    of a held voltage at the samples; inputs: rows of (supply, slope, air, slope). Empty if the integration failed."""
    shown = np.empty((last - first, 10))
    given, drive, step = np.zeros(4), np.zeros(4), 1e-3
    for k in range(first, last):
        t = k * length
        given[:] = inputs[k]
        drive[:3], drive[3] = drives[k], t
        sloped(t, y, c, drive, given, t, shown[k - first])
        step = integrate(y, t, t + length, min(step, 5e-3), c, drive, given, tolerance, scale)
        if step < 0:
            return shown[:0]
    return shown
