"""Checks of the withheld truth of the pump-controlled cylinder: physics with numbers, every effect, one case.

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
import oracle
import signature
import sizes
import truth_pump_cylinder as cylinder
import twins
from datasheet import Datasheet
from truth_pump_cylinder import OUTPUTS, Truth

SHEET = Datasheet("pump_cylinder")
P = SHEET.nominal
NOISE = np.array([SHEET.noise[c] for c in OUTPUTS])


def control(kind="steps", seed=4):
    return cylinder.excitation.controller(SHEET, kind, np.random.default_rng(seed))


def run(effects=None, duration=3.0, kind="steps", parameters=None, nuisance=None, noise=1e-9):
    return Truth(SHEET, parameters, effects, nuisance).run(duration, control(kind), noise, 4)


def datasheet_reference(record, start, step=2e-5):
    """The datasheet's equations by small Heun steps, under a recording's commands."""

    def beta(p):
        p = max(p, -9e4)
        return (P["bulk_c1"] + p) * (1 / P["bulk_c2"] - math.log1p(p / P["bulk_c1"]))

    def rate(y, w1, w2):
        x, v, a, b = y
        ci, ea, eb, d = (
            P[n] for n in ("internal_leakage", "external_leakage_a", "external_leakage_b", "pump_displacement")
        )
        q_a = d * w1 - (ci + ea) * a + d * w2 - ci * (a - b) - ea * a
        q_b = d * w2 - ci * (a - b) + eb * b
        force = P["cap_area"] * a - P["rod_area"] * b - P["viscous_friction"] * v - P["mass"] * P["gravity"]
        force -= P["coulomb_friction"] * math.tanh(v / P["friction_width"])
        return np.array(
            [
                v,
                force / P["mass"],
                beta(a) / (P["chamber_a_volume"] + P["cap_area"] * x) * (q_a - P["cap_area"] * v),
                beta(b) / (P["chamber_b_volume"] - P["rod_area"] * x) * (P["rod_area"] * v - q_b),
            ]
        )

    y, rows = np.array(start), []
    for w1, w2 in zip(record["pump1_speed_command"], record["pump2_speed_command"]):
        rows.append(y[[0, 2, 3]])
        for _ in range(int(round(SHEET.sample_period / step))):
            k = rate(y, w1, w2)
            y = y + 0.5 * step * (k + rate(y + step * k, w1, w2))
    return np.array(rows)


class Physics(unittest.TestCase):
    def test_agrees_with_the_datasheets_equations_within_the_noise(self):
        out = run(duration=0.8)
        apart = (out["clean"][:, :3] - datasheet_reference(out["record"], out["states"][0][:4])) / NOISE[:3]
        rms = np.sqrt(np.mean(apart**2, axis=0))
        self.assertLess(rms.max(), 0.3, rms)

    def test_nuisance_stays_below_the_noise(self):
        random = np.random.default_rng(5)
        for kind in cylinder.excitation.KINDS:
            nuisance = cylinder.draw_nuisance(random)
            out = run(duration=6.0, kind=kind, nuisance=nuisance)
            rig = signature.Run(out, 1.0, 0, dict(P), nuisance, 4)
            size = np.sqrt(np.mean(rig.signature(nuisance=cylinder.NO_NUISANCE) ** 2, axis=0))
            self.assertLess(size.max(), 0.6, kind)

    def test_a_leak_lowers_the_level_by_what_flows(self):
        # In the mean what the pumps deliver leaks, or moves the piston.
        leak = 2e-13
        held = run({"laminar_leakage@flow.pump2_b_tank": {"coefficient": leak}}, 6.0, "duty")
        w1, w2 = (np.mean(held["clean"][-4000:, 3 + n]) for n in range(2))
        a, b = (np.mean(held["clean"][-4000:, 1 + n]) for n in range(2))
        ci, ea, eb, d = (
            P[n] for n in ("internal_leakage", "external_leakage_a", "external_leakage_b", "pump_displacement")
        )
        into = d * (w1 + w2) - 2 * (ci + ea) * a + ci * b
        out = d * w2 - ci * (a - b) + (eb + leak) * b
        moved = held["states"][-1][0] - held["states"][-4000][0]
        self.assertAlmostEqual((into - P["cap_area"] * moved / 4) / (ci * b), 0.0, delta=0.02)
        self.assertAlmostEqual((out - P["rod_area"] * moved / 4) / (ci * b), 0.0, delta=0.02)

    def test_speed_channels_are_means_over_a_sample(self):
        out = run(duration=1.0, nuisance={"drive_time": 1e-4})
        command, speed = out["record"]["pump2_speed_command"], out["clean"][:, 4]
        late = speed[1:] - command[1:]
        # a first-order lag of tau << T loses tau/T of each step
        self.assertLess(np.abs(late + 0.1 * np.diff(command)).max(), 0.02 * np.abs(np.diff(command)).max() + 1e-3)


class Effects(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.rig = signature.Run(run(duration=8.0, noise=1.0), 1.0, 0, dict(P), dict(cylinder.NO_NUISANCE), 4)

    def test_every_effect_does_nothing_at_its_no_effect_value_and_something_when_strong(self):
        random = np.random.default_rng(3)
        for key in SHEET.effects():
            with self.subTest(key):
                if key.startswith("stuck"):
                    continue
                fixed = sizes.template(key, SHEET.bounds[key], random)
                self.assertLess(np.abs(self.rig.signature({key: sizes.nothing(key, fixed)})).max(), 1e-3)
                strong = sizes.value(key, SHEET.bounds[key], fixed, 1.0)
                if not key.startswith("relief_opening"):  # it may crack above what this run reaches
                    self.assertGreater(np.abs(self.rig.signature({key: strong})).max(), 0.2)

    def test_an_exact_twin_is_exact(self):
        leak = {"coefficient": 0.1 * P["external_leakage_b"]}
        one = self.rig.signature({"laminar_leakage@flow.pump2_b_tank": leak})
        other = self.rig.signature(parameters={"external_leakage_b": 1.1 * P["external_leakage_b"]})
        self.assertLess(np.abs(one - other).max(), 0.02)
        leak = {"coefficient": 0.2 * P["external_leakage_a"]}
        for port in ("pump1_a_tank", "pump2_a_tank"):
            one = self.rig.signature({f"laminar_leakage@flow.{port}": leak})
            other = self.rig.signature(parameters={"external_leakage_a": 1.1 * P["external_leakage_a"]})
            self.assertLess(np.abs(one - other).max(), 0.02)
            key = f"laminar_leakage@flow.{port}"
            self.assertAlmostEqual(twins.twin_tolerances(key, leak, P, SHEET.tolerance), 0.1 / 0.25)


class Cases(unittest.TestCase):
    def test_a_case_is_made_without_its_label_in_the_data(self):
        case_check.check_case(self, cylinder, SHEET, "closed", 5.0, 5000)

    def test_what_is_not_measured_is_neither_recorded_nor_seen_by_the_oracle(self):
        sheet = SHEET.without(["chamber_a_pressure"])
        out = Truth(sheet, {}, {}, None).run(2.0, control(), 1.0, 4)
        rig = signature.Run(out, 1.0, 0, dict(P), dict(cylinder.NO_NUISANCE), 2)
        seen = rig.signature({"scale@sensor.chamber_a_pressure": {"factor": 0.5}})
        self.assertEqual(np.abs(seen).max(), 0.0)
        self.assertGreater(np.abs(rig.signature({"scale@sensor.chamber_b_pressure": {"factor": 0.5}})).max(), 1.0)
        sets = set()
        for number in range(8):
            case = generate.Case(SHEET, 7, "none", number, partly=True)
            hidden = case.sheet.empty
            sets.add(tuple(hidden))
            record = case.simulate(0, {}, 0.1)["record"]
            for name in OUTPUTS:
                self.assertEqual(np.isnan(record[name]).all(), name in hidden, name)
                self.assertEqual(any(k.endswith("@sensor." + name) for k in case.sheet.bounds), name not in hidden)
        self.assertEqual(len(sets), 3)
        self.assertEqual(SHEET.empty, [])

    def test_with_one_pressure_alone_the_oracle_finds_rivals_that_no_table_has(self):
        # With one pressure the level alone shows a leak: one of the other side looks the same.
        key, leak = "laminar_leakage@flow.pump2_b_tank", {"coefficient": 2e-13}
        other = "laminar_leakage@flow.pump1_a_tank"
        self.assertNotIn(other, twins.rivals(key, SHEET.effects()))
        for hidden, found in (([], False), (["chamber_a_pressure"], True)):
            sheet = SHEET.without(hidden)
            out = Truth(sheet, {}, {}, None).run(4.0, control("levels"), 1.0, 4)
            rig = signature.Run(out, 1.0, 0, dict(P), dict(cylinder.NO_NUISANCE), 3)
            target, columns = rig.signature({key: leak}).ravel(), signature.parameter_signatures([rig])
            # the leakage parameters would take all of either
            columns = {n: c for n, c in columns.items() if not n.startswith("external_leakage")}
            rivals = oracle.alike([rig], key, target, columns, sheet, np.random.default_rng(3))
            self.assertEqual(other in rivals, found, rivals)


if __name__ == "__main__":
    unittest.main()
