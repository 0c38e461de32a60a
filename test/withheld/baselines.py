"""What others would do, as a yardstick: equation errors of the nominal model, without simulating anything.

Each equation of the datasheet is written as residual = regression on what an effect would add to it; signals and
derivatives are smoothed alike (Savitzky-Golay). Four methods pick from the same columns:

    equation_error   sequentially thresholded least squares over all effects at once (SINDy-style)
    bic              one effect after a free refit of the parameters, by the Bayesian information criterion; may say
    none greedy_rmse      one effect after the same refit, by root mean square alone; always names one
    nominal          one effect without any refit, by root mean square
Answers have the form of `faultline gap --json`.
"""
import json

import numpy as np
from scipy.signal import savgol_filter

RIG = "servo_actuator"  # whose equations these are
METHODS = ["greedy_rmse", "bic", "equation_error", "nominal"]
WINDOW = 31
STEP = 5  # rows kept, one in five: smoothed neighbours say the same
EQUATIONS = ["kinematics", "piston", "chamber_a", "chamber_b", "spool", "redundancy"]


def read_csv(path):
    with open(path, encoding="ascii") as stream:
        names = stream.readline().strip().split(",")
        return dict(zip(names, np.loadtxt(stream, delimiter=",", unpack=True)))


def root(y):
    return np.sign(y) * np.sqrt(np.abs(y))


class Regression:
    """Equation errors and the columns of parameters and effects, stacked over runs; each equation scaled by its
    error."""

    def __init__(self, runs, nominal, period, known):
        self.known = set(known)
        parts = [self._rows(run, nominal, period) for run in runs]
        equations = [np.concatenate([p[0][e] for p in parts]) for e in range(len(EQUATIONS))]
        # scale: what is left at high frequency is noise whatever the structure is
        spread = [np.std(np.diff(e)) / np.sqrt(2) + 1e-12 for e in equations]
        self.lengths = [len(e) for e in equations]
        self.target = np.concatenate([e / s for e, s in zip(equations, spread)])
        self.parameters = self._stack([p[1] for p in parts], spread)
        self.effects = self._stack([p[2] for p in parts], spread)

    def _stack(self, parts, spread):
        columns = {}
        for name in parts[0]:
            pieces = []
            for e, length in enumerate(self.lengths):
                if any(EQUATIONS[e] in p[name] for p in parts):
                    pieces.append(np.concatenate([p[name][EQUATIONS[e]] for p in parts]) / spread[e])
                else:
                    pieces.append(np.zeros(length))
            column = np.concatenate(pieces)
            if np.any(column):
                columns[name] = column
        return columns

    def _rows(self, run, p, h):
        def smooth(y, order=0):
            return savgol_filter(y, WINDOW, 3, deriv=order, delta=h)[WINDOW:-WINDOW:STEP]

        def smoothed(y):
            return smooth(np.asarray(y, dtype=float))

        x, v, pl = run["position"], run["velocity"], run["load_pressure"]
        pa, pb = run["chamber_a_pressure"], run["chamber_b_pressure"]
        xv, load, t = run["spool_position"], run["load_force"], run["t"]
        i = run["valve_command"]
        half = 0.5 * (i + np.concatenate([i[:1], i[:-1]]))  # a held command around a sample is half old, half new
        base = {c: savgol_filter(run[c], WINDOW, 3) for c in run if c != "t"}
        vs, pls, xvs = base["velocity"], base["load_pressure"], base["spool_position"]
        pas, pbs, pss = base["chamber_a_pressure"], base["chamber_b_pressure"], base["supply_pressure"]
        area, k = p["ram_area"], p["flow_coefficient"] * np.sqrt(2)
        bulk = p["chamber_volume"] / (2 * p["compliance"])
        drop_a, drop_b = np.where(xvs > 0, pss - pas, pas), np.where(xvs > 0, pbs, pss - pbs)
        qa, qb = k * xvs * root(drop_a), k * xvs * root(drop_b)
        ga, gb = k * root(drop_a), k * root(drop_b)
        ca, cb = (p["chamber_volume"] + area * x) / bulk, (p["chamber_volume"] - area * x) / bulk
        side = np.tanh(vs / 0.003)
        peak = np.exp(-((vs / p["stribeck_velocity"]) ** 2))
        friction = side * (p["coulomb_friction"] + p["static_excess"] * peak)
        dv, dpa, dpb, dpl, dxv, di = (np.zeros_like(x) for _ in range(6))
        for target, source in ((dv, v), (dpa, pa), (dpb, pb), (dpl, pl), (dxv, xv), (di, half)):
            target[:] = savgol_filter(source, WINDOW, 3, deriv=1, delta=h)
        ddv = savgol_filter(v, WINDOW, 3, deriv=2, delta=h)
        ddpl = savgol_filter(pl, WINDOW, 3, deriv=2, delta=h)
        tau = p["spool_time_constant"]
        rows = [
            smooth(x, 1) - smoothed(v),
            smoothed(p["moving_mass"] * dv - area * pl + p["viscous_damping"] * v + friction + load),
            smoothed(ca * dpa - qa + area * v),
            smoothed(cb * dpb + qb - area * v),
            smoothed(tau * dxv - p["spool_gain"] * half + xv),
            smoothed(pl - pa + pb),
        ]
        late = (t > t[len(t) // 2]).astype(float)
        ha, hb = (0.5 * k * np.abs(xvs) / np.sqrt(np.maximum(np.abs(d), 1e4)) for d in (drop_a, drop_b))
        fa, fb = np.where(xvs > 0, ha, 0.0), np.where(xvs > 0, 0.0, hb)  # of these, what the supply pressure moves
        reach = np.quantile(x, 0.85)
        top = np.quantile(np.abs(half), 0.9)
        fast = np.quantile(np.abs(di), 0.9)
        after = np.exp(-np.minimum(_since(np.sign(np.where(np.abs(vs) > 2e-3, vs, 0))) * h / 0.03, 30))
        log_opening = np.log(np.maximum(np.abs(xvs), 0.01) / 10)
        tone = _tone(rows[2])
        c, a, b, s, m, r = "piston", "chamber_a", "chamber_b", "spool", "kinematics", "redundancy"
        parameters = {
            "moving_mass": {c: -dv},
            "viscous_damping": {c: -v},
            "coulomb_friction": {c: -side},
            "static_excess": {c: -side * peak},
            "ram_area": {c: pl, a: -v, b: v},
            "compliance": {a: -ca * dpa, b: -cb * dpb},
            "chamber_volume": {a: -x * dpa, b: x * dpb},
            "flow_coefficient": {a: qa, b: -qb},
            "spool_time_constant": {s: -dxv},
            "spool_gain": {s: half},
        }
        one = np.ones_like(x)
        effects = {
            "deadband@command.valve_command": {s: -np.sign(half)},
            "hysteresis@command.valve_command": {s: -np.tanh(di)},
            "gain_curve@command.valve_command": {s: half * (np.abs(half) / 10 - 1)},
            "rate_limit@command.valve_command": {s: -np.sign(di) * np.maximum(0, np.abs(di) - fast)},
            "saturation@command.valve_command": {s: -np.sign(half) * np.maximum(0, np.abs(half) - top)},
            "offset@command.valve_command": {s: one},
            "scale@command.valve_command": {s: half},
            "lag@command.valve_command": {s: -di},
            "delay@command.valve_command": {s: -di},
            "stuck@command.valve_command": {s: -half * late},
            "scale@sensor.position": {m: v},
            "lag@sensor.position": {m: -dv},
            "drift@sensor.position": {m: one},
            "stuck@sensor.position": {m: -v * late},
            "offset@sensor.velocity": {m: -one, c: p["viscous_damping"] * one, a: area * one, b: -area * one},
            "scale@sensor.velocity": {m: -v, c: p["viscous_damping"] * v, a: area * v, b: -area * v},
            "lag@sensor.velocity": {
                m: dv,
                c: p["moving_mass"] * -ddv - p["viscous_damping"] * dv,
                a: -area * dv,
                b: area * dv,
            },
            "offset@sensor.load_pressure": {c: -area * one, r: one},
            "scale@sensor.load_pressure": {c: -area * pl, r: pl},
            "lag@sensor.load_pressure": {c: area * dpl, r: -dpl},
            "stuck@sensor.load_pressure": {c: area * pl * late, r: -pl * late},
            "offset@sensor.chamber_a_pressure": {a: ha, r: -one},
            "scale@sensor.chamber_a_pressure": {a: ha * pa + ca * dpa, r: -pa},
            "offset@sensor.chamber_b_pressure": {b: hb, r: one},
            "offset@sensor.spool_position": {s: one, a: -ga, b: gb},
            "scale@sensor.spool_position": {s: xv + tau * dxv, a: -qa, b: qb},
            "coulomb_friction@force.piston": {c: -side},
            "viscous_friction@force.piston": {c: -v},
            "stribeck_friction@force.piston": {c: -side * np.exp(-((vs / 0.03) ** 2))},
            "asymmetric_friction@force.piston": {c: -0.5 * np.abs(side)},
            "load_dependent_friction@force.piston": {c: -side * np.abs(pls)},
            "load_force@force.piston": {c: -one},
            "added_mass@force.piston": {c: -dv},
            "end_stop@force.piston": {c: -np.maximum(0, x - reach)},
            "orifice_leakage@flow.chamber_a_chamber_b": {a: -root(pls), b: root(pls)},
            "laminar_leakage@flow.chamber_a_chamber_b": {a: -pl, b: pl},
            "orifice_leakage@flow.chamber_a_tank": {a: -root(pas)},
            "orifice_leakage@flow.chamber_b_tank": {b: -root(pbs)},
            "entrained_air@compliance.chambers": {a: -dpa / (pas + 1e5) ** 2, b: -dpb / (pbs + 1e5) ** 2},
            "compliance_factor@compliance.chambers": {a: -ca * dpa, b: -cb * dpb},
            "clogging@restriction.valve": {a: -qa, b: qb},
            "area_curve@restriction.valve": {a: qa * log_opening, b: -qb * log_opening},
            "deadband@restriction.valve": {a: -np.tanh(xvs / 0.05) * ga, b: np.tanh(xvs / 0.05) * gb},
            "droop@source.supply_pressure": {a: -fa * np.abs(qa), b: -fb * np.abs(qb)},
            "ripple@source.supply_pressure": {
                a: fa * np.sin(2 * np.pi * tone * t),
                b: fb * np.sin(2 * np.pi * tone * t),
            },
            "offset@source.supply_pressure": {a: fa, b: fb},
            "line_inertia@line.valve_cylinder": {
                a: -savgol_filter(qa, WINDOW, 3, deriv=2, delta=h),
                b: savgol_filter(qb, WINDOW, 3, deriv=2, delta=h),
            },
            "backlash@transmission.rod": {c: dv * after},
            "elasticity@transmission.rod": {c: ddpl},
        }
        effects = {key: value for key, value in effects.items() if key in self.known}
        return (
            rows,
            {n: {e: smoothed(y) for e, y in d.items()} for n, d in parameters.items()},
            {n: {e: smoothed(y) for e, y in d.items()} for n, d in effects.items()},
        )


def _since(sign):
    """Samples since the sign last changed."""
    change = np.concatenate([[True], sign[1:] != sign[:-1]])
    index = np.arange(len(sign))
    return index - np.maximum.accumulate(np.where(change, index, 0))


def _tone(row):
    """Frequency of the strongest line of an equation error, in Hz, above 1 Hz."""
    spectrum = np.abs(np.fft.rfft(row - row.mean()))
    frequency = np.fft.rfftfreq(len(row), STEP * 1e-3)
    spectrum[frequency < 1] = 0
    return float(frequency[np.argmax(spectrum)])


def _left(target, columns):
    if not columns:
        return float(target @ target)
    matrix = np.column_stack(columns)
    size = np.linalg.norm(matrix, axis=0)
    solution = np.linalg.lstsq(matrix / size, target, rcond=None)[0]
    left = target - (matrix / size) @ solution
    return float(left @ left)


def diagnose(regression, method, without):
    """Ranked effects, best first, with a share of belief; and the verdict."""
    target, n = regression.target, len(regression.target)
    effects = {k: c for k, c in regression.effects.items() if k not in without}
    fixed = [] if method == "nominal" else list(regression.parameters.values())
    if method == "equation_error":
        names, active = list(effects), list(effects)
        coefficient = {}
        for threshold in (0.0, 0.02, 0.05, 0.1):
            matrix = np.column_stack(fixed + [effects[k] for k in active])
            size = np.linalg.norm(matrix, axis=0)
            solution = np.linalg.lstsq(matrix / size, target, rcond=1e-8)[0] / np.linalg.norm(target)
            coefficient = dict(zip(active, np.abs(solution[len(fixed) :])))
            active = [k for k in active if coefficient[k] > threshold]
            if not active:
                break
        order = sorted(active, key=lambda k: -coefficient[k])
        weight = np.array([coefficient[k] for k in order])
        return (
            order + [k for k in names if k not in order],
            weight / weight.sum() if len(order) else weight,
            bool(order),
        )
    start = _left(target, fixed)
    left = {k: _left(target, fixed + [c]) for k, c in effects.items()}
    order = sorted(left, key=left.get)
    bic = np.array([n * np.log(left[k] / n) for k in order])
    weight = np.exp(-0.5 * (bic - bic[0]))
    named = method != "bic" or n * np.log(left[order[0]] / n) + np.log(n) < n * np.log(start / n)
    return order, weight / weight.sum(), named


def answers(paths, sheet, without):
    """{method: answer} for a case."""
    regression = Regression([read_csv(p) for p in paths], sheet.nominal, sheet.sample_period, sheet.bounds)
    result = {}
    for method in METHODS:
        order, weight, named = diagnose(regression, method, without)
        ranked = [dict(zip(("effect", "port"), k.split("@"))) for k in order[:10]]
        for entry, w in zip(ranked, weight):
            entry["probability"] = float(w)
        port = ranked[0]["port"]
        result[method] = {
            "rig": sheet.rig,
            "runs": list(paths),
            "where": {"ranked": [{"port": port}], "kind": "sensor" if port.startswith("sensor.") else "process"},
            "cause": {
                "verdict": "named" if named else "none",
                "effects": [dict(ranked[0], parameters={})] if named else [],
                "equivalent": [],
                "ranked": ranked,
            },
            "shrink": {},
        }
    return result


def write(path, data):
    with open(path, "w", encoding="utf-8") as stream:
        json.dump(data, stream, indent=1)
