"""Checks of the withheld truth of the hydraulic drive: physics with numbers, every effect, one case.

    python3 -m unittest discover -s test/withheld -p "test_*.py"
"""
import math
import os
import sys
import unittest

import numpy as np

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

import case_check
import signature
import sizes
import truth_hydraulic_drive as drive
import twins
from datasheet import Datasheet
from truth_hydraulic_drive import OUTPUTS, Truth

SHEET = Datasheet("hydraulic_drive")
P = SHEET.nominal
NOISE = np.array([SHEET.noise[c] for c in OUTPUTS])


def run(volts=1.2, duration=2.0, effects=None, parameters=None, load=(lambda t: 3.5e6, [])):
    control = volts if callable(volts) else lambda k, seen: (volts, 0.0)
    return Truth(SHEET, parameters, effects, load=load).run(duration, control, 0.0)


def paper(seed=4, kind="paper"):
    return drive.excitation.controller(SHEET, kind, np.random.default_rng(seed))


def replayable(duration=20.0, seed=4):
    random = np.random.default_rng(seed)
    truth = Truth(SHEET, supply=drive.excitation.supply(SHEET, random), load=drive.excitation.load(SHEET, random))
    out = truth.run(duration, paper(seed, "wide"), 1.0, seed)
    return signature.Run(out, 1.0, 0, dict(P), dict(drive.NO_NUISANCE), 4)


def datasheet_reference(record, step=5e-5):
    """The datasheet's equations by small Euler steps, under a recording's voltage and inputs."""

    def root(y):
        return y / (y * y + 1e8) ** 0.25

    def first(name):
        return record[name][0]

    x1 = xs = P["valve_gain"] * first("valve_voltage")
    pm, s = first("motor_pressure"), first("shaft_speed")
    rows, per_sample = [], int(round(SHEET.sample_period / step))
    for k in range(len(record["valve_voltage"]) - 1):
        rows.append((pm, s))
        v = record["valve_voltage"][k]
        for i in range(per_sample):
            w = (i + 0.5) / per_sample
            ps, pp = ((1 - w) * record[c][k] + w * record[c][k + 1] for c in drive.INPUTS)
            q = P["flow_coefficient"] * xs * root(ps - math.copysign(1.0, xs) * pm)
            dx1, dxs = (P["valve_gain"] * v - x1) / P["valve_time_constant_1"], (x1 - xs) / P["valve_time_constant_2"]
            lost = P["displacement"] * s + P["leakage_coefficient"] * pm
            dpm = P["bulk_modulus"] / P["trapped_volume"] * (q - lost)
            torque = P["displacement"] * (P["motor_efficiency"] * pm - pp / P["pump_efficiency"])
            ds = (torque - P["viscous_friction"] * s) / P["inertia"]
            x1, xs, pm, s = x1 + step * dx1, xs + step * dxs, pm + step * dpm, s + step * ds
    return np.array(rows)


class Physics(unittest.TestCase):
    def test_steady_torque_and_flow_balance(self):
        out = run()
        pm, s, ps = out["states"][-1][[2, 3, 6]]
        torque = P["displacement"] * (P["motor_efficiency"] * pm - 3.5e6 / P["pump_efficiency"])
        self.assertAlmostEqual(torque / (P["viscous_friction"] * s), 1.0, delta=1e-3)
        flow = P["flow_coefficient"] * P["valve_gain"] * 1.2 * math.sqrt(ps - pm)
        self.assertAlmostEqual(flow / (P["displacement"] * s + P["leakage_coefficient"] * pm), 1.0, delta=3e-3)
        self.assertAlmostEqual(ps / (1.432e7 - 5e8 * flow), 1.0, delta=1e-4)

    def test_agrees_with_the_datasheets_equations_within_the_noise(self):
        random = np.random.default_rng(2)
        truth = Truth(SHEET, supply=drive.excitation.supply(SHEET, random), load=drive.excitation.load(SHEET, random))
        out = truth.run(6.0, paper(), 1e-9, 2)
        apart = (out["clean"][:-1] - datasheet_reference(out["record"])) / NOISE
        rms = np.sqrt(np.mean(apart[100:] ** 2, axis=0))
        self.assertLess(rms.max(), 0.7, rms)  # inputs of a recording are rounded, and straight between samples

    def test_dry_friction_stands_and_slides(self):
        friction = {"coulomb_friction@force.shaft": {"force": 0.8}}
        out = run(lambda k, seen: (1.0 if k < 50 else 0.0785, 0.0), 6.0, friction)
        self.assertLess(abs(out["states"][-1][3]), 0.02)  # the valve makes up the leak: friction holds the shaft
        fast, free = run(1.2, 3.0, friction)["states"][-1], run(1.2, 3.0)["states"][-1]
        slowed = P["displacement"] * P["motor_efficiency"] * (fast[2] - free[2])
        slowed -= P["viscous_friction"] * (fast[3] - free[3])
        self.assertAlmostEqual(slowed / 0.8, 1.0, delta=0.01)

    def test_a_spring_winds_up_and_an_oil_column_rings(self):
        spring = {"elasticity@transmission.shaft": {"compliance": 0.1, "damping": 0.01}}
        column = {"line_inertia@line.motor": {"inertance": 2e8}}
        for effects in (spring, column):
            still, changed = run(1.2, 3.0)["states"][-1], run(1.2, 3.0, effects)["states"][-1]
            self.assertLess(np.abs((still - changed)[[2, 3]] / NOISE).max(), 0.2)  # at rest neither shows
            moving = run(paper(), 3.0, effects)["clean"] - run(paper(), 3.0)["clean"]
            self.assertGreater(np.abs(moving / NOISE).max(), 5.0)


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
                if not key.startswith("elasticity"):  # a spring yields, if only to nothing
                    self.assertLess(np.abs(self.rig.signature({key: nothing})).max(), 1e-6)
                strong = sizes.value(key, SHEET.bounds[key], fixed, 1.0)
                self.assertGreater(np.abs(self.rig.signature({key: strong})).max(), 1.0)

    def test_a_late_sensor_shows_the_past(self):
        late = self.rig.outputs({"delay@sensor.shaft_speed": {"time": 0.03}})
        plain = self.rig.plain()
        self.assertLess(np.abs(late[10:140, 1] - plain[7:137, 1]).max(), 1e-6)

    def test_an_exact_twin_is_exact(self):
        for key, effect in {
            "viscous_friction@force.shaft": {"coefficient": 0.1 * P["viscous_friction"]},
            "added_mass@force.shaft": {"mass": 0.1 * P["inertia"]},
            "laminar_leakage@flow.motor_in_motor_out": {"coefficient": 0.1 * P["leakage_coefficient"]},
            "compliance_factor@compliance.motor_line": {"factor": 1.1},
            "clogging@restriction.valve": {"fraction": -0.1},
            "scale@command.valve": {"factor": 1.1},
            "scale@transmission.motor": {"factor": 1.1},
            "scale@transmission.pump": {"factor": 1 / 1.1},
            "scale@transmission.displacement": {"factor": 1.1},
        }.items():
            name = twins.EXACT_TWIN[key][0]
            tolerances = twins.twin_tolerances(key, effect, P, SHEET.tolerance)
            self.assertAlmostEqual(tolerances * SHEET.tolerance[name], 0.1)
            apart = self.rig.signature({key: effect}) - self.rig.signature(parameters={name: 1.1 * P[name]})
            self.assertLess(np.abs(apart).max(), 0.05, key)

    def test_a_load_reading_too_high_looks_like_a_load_that_pulls(self):
        push = 2e5 * P["displacement"] / P["pump_efficiency"]
        reading = self.rig.signature({"offset@sensor.pump_pressure": {"value": 2e5}})
        pulling = self.rig.signature({"load_force@force.shaft": {"constant": push}})
        self.assertLess(np.abs(reading - pulling).max(), 1e-3 * np.abs(pulling).max())


class Cases(unittest.TestCase):
    def test_a_case_is_made_without_its_label_in_the_data(self):
        case_check.check_case(self, drive, SHEET, "closed", 15.0, 1500)

    def test_rivals_are_those_that_the_datasheet_knows(self):
        self.assertEqual(twins.rivals("scale@sensor.pump_pressure", SHEET.bounds), ["scale@transmission.pump"])
        self.assertNotIn("droop@source.supply_pressure", twins.rivals("clogging@restriction.valve", SHEET.bounds))


if __name__ == "__main__":
    unittest.main()
