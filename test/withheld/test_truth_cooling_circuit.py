"""Checks of the withheld truth of the cooling circuit: physics with numbers, every effect, one case.

    python3 -m unittest discover -s test/withheld -p "test_*.py"
"""
import os
import sys
import unittest

import numpy as np
from scipy.integrate import solve_ivp

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

import case_check
import generate
import rate_cooling_circuit as rate
import signature
import sizes
import truth_cooling_circuit as cooling
import twins
from truth_cooling_circuit import BRANCHES, OUTPUTS, Truth

SHEET = generate.datasheet_of("cooling_circuit")
P = SHEET.nominal
NOISE = np.array([SHEET.noise[c] for c in OUTPUTS])


class Given:
    """Commands as they are told."""

    def __init__(self, *rows):
        self.rows = np.array(rows, dtype=float)

    def commands(self, count):
        return self.rows[np.arange(count) * len(self.rows) // count]


def run(duration, control, effects=None, nuisance=None, supply=(7e6, []), parameters=None):
    return Truth(SHEET, parameters, effects, nuisance, supply).run(duration, control, 1.0, 4)


def sequence(kind="both_steps", seed=4):
    return cooling.excitation.controller(SHEET, kind, np.random.default_rng(seed))


def datasheet_reference(record, supply, start, samples):
    """The datasheet's equations by a stiff solver, under a recording's commands."""
    root = lambda x: x / (x * x + 1e4) ** 0.25
    of = lambda name: np.array([P[f"{b}_{name}"] for b in BRANCHES])
    b, c, feed, drain = of("b"), of("c"), of("feed_coefficient"), of("drain_coefficient")
    mass = P["density"] * b * P["sound_speed"] ** 2
    column = P["manifold_volume"] / P["sound_speed"] ** 2

    def rates(t, y, u, h, ps):
        z, s, pm = y[:3]
        p1, p2, t1, t2 = y[3:].reshape(4, 5)
        q_f, q_2 = feed * root(pm - p1), drain * root(p2 - P["drain_pressure"])
        q_12 = c ** (8 / 7) * (p1 - p2) / ((p1 - p2) ** 2 + 1e4) ** (3 / 14)
        return np.concatenate(
            [
                [(u - z) / P["valve_time_constant"], (h - s) / P["firing_time_constant"]],
                [(P["valve_coefficient"] * z * root(ps - pm) - q_f.sum()) / column],
                (q_f - q_12) / b,
                (q_12 - q_2) / b,
                q_f * (P["water_temperature"] - t1) / mass,
                (P["specific_heat"] * q_12 * (t1 - t2) + of("heat_flux") * s) / (mass * P["specific_heat"]),
            ]
        )

    branches = start[rate.FIRST :].reshape(5, rate.EACH)
    y, rows = np.concatenate([start[[rate.Z, rate.S, rate.PM]], branches[:, :4].T.ravel()]), []
    for k in range(samples):
        p1, p2, t1, t2 = y[3:].reshape(4, 5)
        rows.append(np.column_stack([p1, p2, drain * root(p2 - P["drain_pressure"]), t1, t2]).ravel())
        inputs = (*record["commands"][k], supply)
        y = solve_ivp(rates, (0, SHEET.sample_period), y, "Radau", args=inputs, rtol=1e-6, atol=1e-3).y[:, -1]
    return np.array(rows)


class Physics(unittest.TestCase):
    def test_agrees_with_the_datasheets_equations_within_the_noise(self):
        out = run(0.15, Given([0.5, 0.5], [0.9, 1.0]))
        apart = (out["clean"] - datasheet_reference(out["record"], 7e6, out["states"][0], 150)) / NOISE
        rms = np.sqrt(np.mean(apart**2, axis=0))
        self.assertLess(rms.max(), 0.3, rms)

    def test_reference_point(self):
        out = run(0.05, Given([1.0, 1.0]))
        shown = dict(zip(OUTPUTS, out["clean"][-1]))
        self.assertAlmostEqual(shown["v2_mass_flow"], 1.5, delta=0.01)
        self.assertAlmostEqual(shown["t_mass_flow"], 2.0, delta=0.01)
        self.assertAlmostEqual(shown["t_outlet_pressure"], 34.6e5, delta=0.5e5)
        self.assertAlmostEqual(shown["t_outlet_temperature"], 324, delta=1)

    def test_steps_are_fine_enough(self):
        coarse, fine = (run(3.0, sequence(), nuisance={"substeps": n})["clean"] for n in (0.0, 8.0))
        self.assertLess(np.abs((coarse - fine) / NOISE).max(), 0.3)

    def test_a_leak_before_the_meter_is_missed_by_it_and_one_after_it_is_not(self):
        leak, flows = {"coefficient": 1e-7}, {}
        for place in ("outlet", "drain"):
            key = f"orifice_leakage@flow.v2_{place}_ambient"
            flows[place] = dict(zip(OUTPUTS, run(0.05, Given([0.9, 0.8]), {key: leak})["clean"][-1]))["v2_mass_flow"]
        plain = dict(zip(OUTPUTS, run(0.05, Given([0.9, 0.8]))["clean"][-1]))["v2_mass_flow"]
        self.assertLess(flows["outlet"], plain - 0.03)
        self.assertGreater(flows["drain"], plain + 0.02)

    def test_nuisance_stays_below_the_noise(self):
        nuisance = cooling.draw_nuisance(np.random.default_rng(5))
        out = run(4.0, sequence(), nuisance=nuisance)
        rig = signature.Run(out, 1.0, 0, dict(P), nuisance, 4)
        size = np.sqrt(np.mean(rig.signature(nuisance=cooling.NO_NUISANCE) ** 2, axis=0))
        self.assertLess(size.max(), 0.6)


class Effects(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        out = run(8.0, sequence(), supply=cooling.excitation.supply(SHEET, np.random.default_rng(1)))
        cls.rig = signature.Run(out, 1.0, 0, dict(P), dict(cooling.NO_NUISANCE), 4)

    def test_every_effect_does_nothing_at_its_no_effect_value_and_something_when_strong(self):
        random = np.random.default_rng(3)
        for key in SHEET.effects():
            if any(f"{b}_" in key for b in ("v1", "v2", "v3")) or key.startswith("stuck"):
                continue  # the five branches share their code
            with self.subTest(key):
                fixed = sizes.template(key, SHEET.bounds[key], random)
                self.assertLess(np.abs(self.rig.signature({key: sizes.nothing(key, fixed)})).max(), 2e-2)
                strong = sizes.value(key, SHEET.bounds[key], fixed, 1.0)
                self.assertGreater(np.abs(self.rig.signature({key: strong})).max(), 0.5)

    def test_an_exact_twin_is_exact(self):
        one = self.rig.signature({"clogging@restriction.t_feed": {"fraction": 0.02}})
        other = self.rig.signature(parameters={"t_feed_coefficient": 0.98 * P["t_feed_coefficient"]})
        self.assertLess(np.abs(one - other).max(), 0.02)
        found = twins.twin_tolerances("clogging@restriction.t_feed", {"fraction": 0.02}, P, SHEET.tolerance)
        self.assertAlmostEqual(found, 1.0)


class Cases(unittest.TestCase):
    def test_a_case_is_made_without_its_label_in_the_data(self):
        case_check.check_case(self, cooling, SHEET, "none", 4.0, 4000)


if __name__ == "__main__":
    unittest.main()
