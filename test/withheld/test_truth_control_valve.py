"""Checks of the withheld truth of the control valve: physics with numbers, every effect, one case.

    python3 -m unittest discover -s test/withheld -p "test_*.py"
"""
import math
import os
import sys
import unittest

import numpy as np

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

import case_check
import generate
import rate_control_valve as rate
import signature
import sizes
import truth_control_valve as valve
import twins
from truth_control_valve import OUTPUTS, Truth

SHEET = generate.datasheet_of("control_valve")
P = SHEET.nominal
NOISE = np.array([SHEET.noise[c] for c in OUTPUTS])


def driven(kind="duty", seed=4, duration=30.0, effects=None, noise=1.0):
    random = np.random.default_rng(seed)
    inputs = valve.excitation.supply(SHEET, random), valve.excitation.load(SHEET, random)
    control = valve.excitation.controller(SHEET, kind, random)
    return Truth(SHEET, None, effects, None, *inputs).run(duration, control, noise, seed)


def replayable(seed=4):
    return signature.Run(driven(seed=seed), 1.0, 0, dict(P), dict(valve.NO_NUISANCE), 4)


def held(volts, seconds, effects=None, flow=0.014):
    """The state after a constant voltage on a still supply."""
    truth = Truth(SHEET, None, effects)
    y, given = truth.rest(flow), np.array([5e5, 0.0, 293.15, 0.0])
    drive = np.array([volts, volts, 0.0, 0.0])
    rate.integrate(y, 0.0, seconds, 1e-4, truth.constants[0], drive, given, valve.TOLERANCE, valve.SCALE)
    return truth, y


def orifice(area, first, second, air):
    if second > first:
        return -orifice(area, second, first, air)
    r = second / first
    psi = 0.484178 if r <= 0.528282 else math.sqrt(3.5 * (min(r, 0.99) ** (10 / 7) - min(r, 0.99) ** (12 / 7)))
    psi *= min((1 - r) / 0.01, 1.0)
    return area * first * psi * math.sqrt(2 / (287 * air))


def datasheet_reference(y, volts, supply, air, seconds, step=5e-5):
    """The datasheet's equations (bodies without mass, set-valued friction) by small Euler steps, from a truth's state;
    supply and air as (value, slope). Returns the five outputs."""

    def beyond(force, low, high):
        return force - high if force > high else force - low if force < low else 0.0

    def at(name, x):
        return np.interp(x, *TABLES[name])

    xf, pp, spool, pc, x = (y[i] for i in (rate.X_F, rate.P_P, rate.SPOOL, rate.P_C, rate.X))
    ambient, radius = 101325.0, 0.0776 / math.sqrt(2)
    h = rate.angle(x) / (math.pi / 2)
    torque = 0.5 * (y[rate.SEAL_1] + y[rate.SEAL_2]) * P["seal_friction_factor"] * at("seal", h)
    torque *= P["seal_force"] * 0.05
    wall = P["nozzle_outer_diameter"] - P["nozzle_inner_diameter"]
    area = math.pi / 4 * (P["nozzle_inner_diameter"] + 0.4125 * wall) ** 2
    for n in range(int(round(seconds / step))):
        ps, ta = supply[0] + supply[1] * n * step, air[0] + air[1] * n * step
        coil = volts * P["coil_force_factor"] * ((ta - 293.15) * P["coil_temp_coef"] + 1)
        push = max(0.0, P["pressure_coef_0"] - P["pressure_coef_1"] * xf) * pp * area
        dxf = (push - coil - P["flapper_spring"] * (xf - P["flapper_rest"])) / P["flapper_damping"]
        force = P["prestage_area"] * pp - P["supply_area"] * ps - P["spool_spring"] * (spool + P["spool_pretension"])
        force -= P["diaphragm_stiffness"] * spool
        ds = beyond(force, -P["spool_coulomb"], P["spool_coulomb"]) / P["spool_viscous"]
        if (spool <= 0 and ds < 0) or (spool >= P["spool_stroke"] and ds > 0):
            ds = 0.0
        into = orifice(P["restrictor_cd"] * math.pi / 4 * P["restrictor_diameter"] ** 2, ps + ambient, pp + ambient, ta)
        ring = at("nozzle", xf) * math.pi * P["nozzle_inner_diameter"] * xf
        into -= orifice(ring, pp + ambient, ambient, ta)
        volume = P["prestage_volume"] + P["prestage_area"] * spool
        dpp = 1.4 / volume * (into * 287 * ta - (pp + ambient) * P["prestage_area"] * ds)
        s = spool / P["spool_stroke"]
        if s > 0.5:
            cd = rate.fill_cd(s, (pc + ambient) / (ps + ambient))
            filled = orifice(cd * P["port_area"] * (s - 0.5) / 0.5, ps + ambient, pc + ambient, ta)
        else:
            filled = -orifice(rate.exhaust_cd(s, pc) * P["port_area"] * (0.5 - s) / 0.5, pc + ambient, ambient, ta)
        turn = 1 / math.sqrt(radius**2 - (x - 0.0388) ** 2)
        thrust = P["cylinder_area"] * pc - P["spring_rate"] * (x + P["spring_pretension"]) - torque * turn
        v = beyond(thrust, -at("down", x), at("up", x)) / P["actuator_viscous"]
        dpc = 1.4 / (P["dead_volume"] + P["cylinder_area"] * x)
        dpc *= filled * 287 * ta - (pc + ambient) * P["cylinder_area"] * v
        h = (math.pi / 4 + math.asin((x - 0.0388) / radius)) / (math.pi / 2)
        level = P["seal_friction_factor"] * at("seal", h) * P["seal_force"] * 0.05
        w = v * turn
        torque += step * (w * level - abs(w) * torque) / P["windup_angle"]
        xf, spool = min(max(xf + step * dxf, 0.0), 1.2e-4), min(max(spool + step * ds, 0.0), P["spool_stroke"])
        pp, pc, x = pp + step * dpp, pc + step * dpc, x + step * v
    h = (math.pi / 4 + math.asin((x - 0.0388) / radius)) / (math.pi / 2)
    c = P["valve_cv_linear"] * h + (1 - P["valve_cv_linear"]) * h**3
    ratio = P["open_pressure_ratio"]
    drop = P["pump_pressure"] * ratio / (ratio + (1 - ratio) * c * c)
    return np.array([pp, pc, torque, h, 0.865 * P["valve_cv"] * c * math.sqrt(drop / 1e5) / 3600])


TABLES = {
    "nozzle": ([0, 35e-6, 70e-6, 105e-6], [0.95, 0.9467, 0.8067, 0.70]),
    "up": (np.linspace(0, 0.0776, 5), [110, 100, 150, 130, 130]),
    "down": (np.linspace(0, 0.0776, 5), [580, 580, 540, 580, 580]),
    "seal": (np.linspace(0, 1, 5), [0.30, 0.20, 0.16, 0.15, 0.15]),
}


class Physics(unittest.TestCase):
    def test_agrees_with_the_datasheets_equations_within_the_noise(self):
        out = driven("steps")
        run = signature.Run(out, 1.0, 0, dict(P), dict(valve.NO_NUISANCE))
        worst = []
        for first in (60, 150, 240):
            supply, air = (np.array([v[first], (v[first + 1] - v[first]) / 0.1]) for v in out["truth"].seen[:2])
            base, volts = out["states"][first], out["record"]["coil_voltage"][first]
            truth = out["truth"].again(dict(P), {}, {})
            shown = truth.replay(run.commands, [(first, first + 2)], [base])[1]
            worst.append((datasheet_reference(base, volts, supply, air, 0.1) - shown) / NOISE)
        self.assertLess(np.abs(worst).max(), 2.0, worst)  # bristles and masses; the seal's second bristle

    def test_the_spool_balances_and_the_nozzle_passes_what_the_restrictor_does(self):
        _, y = held(1.9, 4.0)
        spring = P["spool_spring"] * (y[rate.SPOOL] + P["spool_pretension"]) + P["diaphragm_stiffness"] * y[rate.SPOOL]
        self.assertAlmostEqual(P["prestage_area"] * y[rate.P_P] - P["supply_area"] * 5e5, spring, delta=0.45)
        ring = np.interp(y[rate.X_F], *TABLES["nozzle"]) * math.pi * P["nozzle_inner_diameter"] * y[rate.X_F]
        out = orifice(ring, y[rate.P_P] + 101325, 101325, 293.15)
        into = orifice(0.9 * math.pi / 4 * P["restrictor_diameter"] ** 2, 601325, y[rate.P_P] + 101325, 293.15)
        self.assertAlmostEqual(into / out, 1.0, delta=1e-3)

    def test_full_voltage_opens_to_the_stop_and_none_closes(self):
        for volts, end in ((4.5, rate.STROKE), (0.0, 0.0)):
            _, y = held(volts, 12.0)
            self.assertAlmostEqual(y[rate.X], end, delta=4e-5)

    def test_play_is_lost_and_a_soft_shaft_twists_by_its_torque(self):
        gap = {"backlash@transmission.linkage": {"gap": 0.004}}
        soft = {"elasticity@transmission.linkage": {"compliance": 1e-3, "damping": 1.0}}
        for effects, lost in ((gap, lambda y, t: 0.002 * rate.turning(y[rate.X])), (soft, lambda y, t: 1e-3 * t)):
            truth, y = held(2.3, 0.4, effects)  # on its way open
            torque = rate.joint_torque(truth.constants[0], y)
            self.assertGreater(torque, 5.0)
            apart = rate.angle(y[rate.X]) - y[rate.SHAFT]
            self.assertAlmostEqual(apart, lost(y, torque), delta=1e-3)

    def test_the_loops_follow_and_a_historian_records(self):
        out = driven("triangle", noise=0.0)
        self.assertEqual(len(out["t"]), 300)
        self.assertTrue(np.all(np.isnan(out["record"]["spool_position"])))
        record = {name: values[50:] for name, values in out["record"].items()}
        self.assertLess(np.abs(record["valve_setpoint"] - record["valve_position"]).max(), 0.03)
        self.assertGreater(np.corrcoef(record["flow_setpoint"], record["flow"])[0, 1], 0.9)  # it lags


class Effects(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.rig = replayable()

    def test_every_effect_does_nothing_at_its_no_effect_value_and_something_when_strong(self):
        random = np.random.default_rng(3)
        for key in SHEET.effects():
            with self.subTest(key):
                if key.startswith("stuck"):
                    continue
                fixed = sizes.template(key, SHEET.bounds[key], random)
                nothing = sizes.nothing(key, fixed)
                # a joint that may yield has a shaft with an inertia of its own
                still = 1.0 if key.endswith("@transmission.linkage") else 1e-6
                self.assertLess(np.abs(self.rig.signature({key: nothing})).max(), still)
                strong = sizes.value(key, SHEET.bounds[key], fixed, 1.0)
                self.assertGreater(np.abs(self.rig.signature({key: strong})).max(), 5.0)

    def test_an_exact_twin_is_exact(self):
        for key, effect in {
            "scale@command.coil_voltage": {"factor": 1.1},
            "coulomb_friction@force.spool": {"force": 0.1 * P["spool_coulomb"]},
            "viscous_friction@force.actuator": {"coefficient": 0.1 * P["actuator_viscous"]},
            "clogging@restriction.fixed_restrictor": {"fraction": -0.1},
            "clogging@restriction.nozzle": {"fraction": -0.1},
            "clogging@restriction.spool_ports": {"fraction": -0.1},
        }.items():
            name = twins.EXACT_TWIN[key][0]
            tolerances = twins.twin_tolerances(key, effect, P, SHEET.tolerance)
            self.assertAlmostEqual(tolerances * SHEET.tolerance[name], 0.1)
            apart = self.rig.signature({key: effect}) - self.rig.signature(parameters={name: 1.1 * P[name]})
            self.assertLess(np.abs(apart).max(), 0.05, key)

    def test_unequal_friction_is_a_load(self):
        unequal = self.rig.signature({"asymmetric_friction@force.actuator": {"difference": 200.0}})
        load = self.rig.signature({"load_force@force.actuator": {"constant": 100.0, "stiffness": 0.0}})
        self.assertLess(np.abs(unequal - load).max(), 1e-6)

    def test_a_late_flow_meter_shows_the_past(self):
        late = self.rig.outputs({"delay@sensor.flow": {"time": 0.3}})
        plain = self.rig.plain()
        self.assertLess(np.abs(late[6:24, 4] - plain[3:21, 4]).max(), 1e-9)


class Cases(unittest.TestCase):
    def test_a_case_is_made_without_its_label_in_the_data(self):
        case_check.check_case(self, valve, SHEET, "none", 20.0, 200)

    def test_effects_of_channels_that_nobody_records_are_left_out(self):
        self.assertFalse([key for key in SHEET.effects() if "flapper_position" in key or "spool_position" in key])
        self.assertEqual(len(SHEET.effects()), 45)


if __name__ == "__main__":
    unittest.main()
