"""Checks of the withheld truth, of its cases and of its scorer: physics with numbers, and answers made by hand.

    python3 -m unittest discover -s test/withheld -p "test_*.py"
"""
import json
import math
import os
import re
import sys
import tempfile
import unittest

import numpy as np

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

import answer
import baselines
import excitation
import generate
import oracle
import score
import signature
import sizes
import twins
from datasheet import Datasheet
import truth_servo_actuator
from rate_servo_actuator import root
from signal_paths import CommandPath, Sensor, soft_deadband
from truth_servo_actuator import BRISTLE, NO_NUISANCE, OUTPUTS, Truth

SHEET = Datasheet("servo_actuator")
P = SHEET.nominal
SUPPLY = 6.89e6


def hold(volts):
    return lambda k, seen: (volts, 0.0)


def run(volts=None, duration=0.3, effects=None, controller=None, parameters=None, noise=0.0, **more):
    truth = Truth(SHEET, parameters, effects, **more)
    return truth.run(duration, controller or hold(volts), noise, 1)


def prbs(seed=4):
    return excitation.controller(SHEET, "prbs", np.random.default_rng(seed))


def datasheet_reference(commands, step=2.5e-5):
    """The datasheet's equations with set-valued friction, by small Euler steps: stick, or slide and stop at v = 0."""
    x = v = xv = 0.0
    pa = pb = SUPPLY / 2
    bulk, area = P["chamber_volume"] / (2 * P["compliance"]), P["ram_area"]
    gain = P["flow_coefficient"] * math.sqrt(2)

    def root(y):
        return y / (y * y + 1e6) ** 0.25

    rows = []
    per_sample = int(round(SHEET.sample_period / step))
    for u in commands:
        rows.append((x, v, pa - pb, pa, pb, xv))
        for _ in range(per_sample):
            if xv > 0:
                qa, qb = gain * xv * root(SUPPLY - pa), gain * xv * root(pb)
            else:
                qa, qb = gain * xv * root(pa), gain * xv * root(SUPPLY - pb)
            push = (pa - pb) * area
            if v == 0.0 and abs(push) <= P["coulomb_friction"] + P["static_excess"]:
                new = 0.0
            else:
                way = math.copysign(1.0, v) if v != 0 else math.copysign(1.0, push)
                level = P["coulomb_friction"] + P["static_excess"] * math.exp(-((v / P["stribeck_velocity"]) ** 2))
                new = v + step / P["moving_mass"] * (push - P["viscous_damping"] * v - way * level)
                if v * new < 0:
                    new = 0.0
            x += step * v
            pa += step * bulk / (P["chamber_volume"] + area * x) * (qa - area * v)
            pb += step * bulk / (P["chamber_volume"] - area * x) * (area * v - qb)
            xv += step / P["spool_time_constant"] * (P["spool_gain"] * u - xv)
            v = new
    return np.array(rows)


class Physics(unittest.TestCase):
    def test_steady_speed_follows_from_flow_and_friction(self):
        out = run(1.5, 0.4)
        v = out["clean"][-1, 1]
        force = (
            P["coulomb_friction"]
            + P["viscous_damping"] * v
            + P["static_excess"] * math.exp(-((v / P["stribeck_velocity"]) ** 2))
        )
        load = force / P["ram_area"]
        self.assertAlmostEqual(out["clean"][-1, 2] / load, 1.0, delta=0.01)
        supply = out["states"][-1, 5]
        flow = P["flow_coefficient"] * 1.5 * math.sqrt(supply - load)
        self.assertAlmostEqual(v * P["ram_area"] / flow, 1.0, delta=0.02)

    def test_sticks_below_breakaway_and_moves_above(self):
        still = run(0.0, 0.3, load=lambda t: 300.0 * min(1.0, t / 0.1))
        self.assertLess(abs(still["clean"][-1, 0]), 300 / BRISTLE + 3e-6)
        moved = run(0.0, 0.3, load=lambda t: 600.0)
        self.assertLess(moved["clean"][:, 1].min(), -1e-3)

    def test_agrees_with_the_datasheets_equations_within_the_noise(self):
        control = prbs()
        commands = [control(k, {"position": 0.0})[0] for k in range(1500)]
        truth = Truth(SHEET, supply=lambda t: SUPPLY)
        # the reference has a stiff pump: hold the supply state at its set value
        inner = truth.rhs
        truth.rhs = lambda t, y: [d if n != 5 else 0.0 for n, d in enumerate(inner(t, y))]
        out = truth.run(1.5, lambda k, seen: (commands[k], 0.0), 0.0)
        quantised = out["record"]["valve_command"]
        reference = datasheet_reference(quantised)
        noise = np.array([SHEET.noise[c] for c in OUTPUTS])
        apart = (out["clean"] - reference) / noise
        rms = np.sqrt(np.mean(apart[:, 1:] ** 2, axis=0))
        self.assertLess(rms.max(), 0.5, rms)
        self.assertLess(np.abs(np.diff(apart[:, 0])).max(), 0.2)  # the free position may drift, slowly

    def test_tolerance_of_the_solver_is_far_below_the_noise(self):
        coarse, fine = (Truth(SHEET).run(1.0, prbs(), 0.0, 1, tolerance=tol)["clean"] for tol in (1e-5, 1e-8))
        noise = np.array([SHEET.noise[c] for c in OUTPUTS])
        self.assertLess(np.sqrt(np.mean(((coarse - fine) / noise) ** 2, axis=0)).max(), 0.03)

    def test_energy_hydraulic_power_covers_friction_and_valve_losses(self):
        out = run(2.0, 0.4)
        v, pa, pb, ps = (out["states"][-1, n] for n in (1, 2, 3, 5))
        flow = P["ram_area"] * v
        supplied = ps * flow
        friction = (P["coulomb_friction"] + P["viscous_damping"] * v) * v
        valve = (ps - pa) * flow + pb * flow
        self.assertAlmostEqual(supplied / (friction + valve), 1.0, delta=0.01)

    def test_bypass_at_five_volts_leaks_about_0_032_litres_a_second(self):
        truth = Truth(SHEET, bypass_volts=5.0)
        self.assertAlmostEqual(truth.leak_coefficient * root(0.67e6) * 1e3, 0.032, delta=0.0005)

    def test_leak_slows_the_piston_by_its_flow(self):
        tight, leaking = run(1.5, 0.4), run(1.5, 0.4, bypass_volts=2.0)
        lost = (tight["clean"][-1, 1] - leaking["clean"][-1, 1]) * P["ram_area"]
        flow = 2 * P["leak_valve_gain"] * math.sqrt(leaking["clean"][-1, 2])
        self.assertAlmostEqual(lost / flow, 1.0, delta=0.08)  # and a little by the lower friction

    def test_droop_solves_its_quadratic(self):
        resistance = 5e9
        out = run(2.0, 0.4, {"droop@source.supply_pressure": {"resistance": resistance}})
        y = out["states"][-1]
        flow = P["ram_area"] * y[1]
        behind = y[5] - resistance * flow
        self.assertAlmostEqual(
            flow / (P["flow_coefficient"] * math.sqrt(2) * 2.0 * math.sqrt(behind - y[2])), 1.0, delta=0.01
        )

    def test_elastic_rod_stretches_under_load(self):
        out = run(
            0.0, 0.3, {"elasticity@transmission.rod": {"compliance": 1e-5, "damping": 500.0}}, load=lambda t: 400.0
        )
        y, truth = out["states"][-1], out["truth"]
        load_side = 0.4 * (P["coulomb_friction"] + P["static_excess"])
        stretch = y[0] - y[truth.rod_index]
        self.assertGreater(stretch, 1e-5 * (400 - load_side) * 0.95)
        self.assertLess(stretch, 1e-5 * 400 * 1.05)

    def test_end_of_the_stroke_holds(self):
        out = run(3.0, 1.2)
        self.assertLess(out["clean"][:, 0].max(), P["stroke_limit"] + 1e-3)
        self.assertGreater(out["clean"][-1, 0], P["stroke_limit"])
        self.assertLess(abs(out["clean"][-1, 1]), 1e-3)


class Signals(unittest.TestCase):
    def test_delay_switches_within_the_sample(self):
        path = CommandPath({"delay": {"time": 0.0025}}, 1e-3, 0.0, 10.0)
        path.pieces(0, 1.0)
        path.pieces(1, 1.0)
        first, second = path.pieces(2, 1.0)
        self.assertEqual((first[3], second[3]), (0.0, 1.0))
        self.assertAlmostEqual(first[1], 0.0025)

    def test_deadband_offset_removed_outside(self):
        self.assertAlmostEqual(soft_deadband(3.0, 1.0), 2.5, places=6)
        self.assertAlmostEqual(soft_deadband(-3.0, 1.0), -2.5, places=6)
        self.assertLess(abs(soft_deadband(0.2, 1.0)), 1e-4)

    def test_hysteresis_loop_has_its_width(self):
        path = CommandPath({"hysteresis": {"width": 0.4}}, 1e-3, 0.0, 10.0)
        up = [path.pieces(k, 0.01 * k)[0][3] for k in range(200)][150]
        down = [path.pieces(k, 0.01 * (400 - k))[0][3] for k in range(200, 400)][50]
        self.assertAlmostEqual(down - up, 0.4, places=9)

    def test_rate_limit_and_lag_are_exact(self):
        path = CommandPath({"rate_limit": {"rate": 100.0}}, 1e-3, 0.0, 10.0)
        for k in range(5):
            path.pieces(k, 1.0)
        self.assertAlmostEqual(path.out, 0.5)
        path = CommandPath({"lag": {"time_constant": 0.005}}, 1e-3, 0.0, 10.0)
        for k in range(5):
            path.pieces(k, 1.0)
        self.assertAlmostEqual(path.out, 1 - math.exp(-1), places=12)

    def test_sensor_lag_follows_a_ramp_late_by_its_time_constant(self):
        sensor = Sensor({"lag": {"time_constant": 0.004}}, 1e-3)
        last = [sensor(k * 1e-3, k * 1e-3) for k in range(100)][-1]
        self.assertAlmostEqual(0.099 - last, 0.004, places=9)

    def test_stuck_sensor_holds(self):
        sensor = Sensor({"stuck": {"from": 0.01}}, 1e-3)
        values = [sensor.last(k * 1e-3, float(k)) for k in range(20)]
        self.assertEqual(values[9:12], [9.0, 10.0, 10.0])


class Effects(unittest.TestCase):
    def test_every_effect_of_the_datasheet_does_nothing_at_its_no_effect_value_and_something_when_strong(self):
        random = np.random.default_rng(3)
        control = prbs(8)
        commands = [control(k, {"position": 0.0})[0] for k in range(300)]
        noise = np.array([SHEET.noise[c] for c in OUTPUTS])

        def clean(effects, duration=0.15):
            record = Truth(SHEET, effects=effects).run(duration, lambda k, seen: (commands[k], 0.0), 0.0)["record"]
            return np.column_stack([record[c] for c in OUTPUTS]) / noise

        plain = clean({})
        for key in SHEET.effects():
            bounds = SHEET.bounds[key]
            fixed = sizes.template(key, bounds, random)
            with self.subTest(key):
                if (
                    key.split("@")[0] != "stuck"
                    and key.split("@")[1] != "transmission.rod"
                    and "line_inertia" not in key
                ):
                    self.assertLess(np.abs(clean({key: sizes.nothing(key, fixed)}) - plain).max(), 0.05)
                strong = sizes.value(key, bounds, fixed, 1.0)
                if key.startswith("stuck"):
                    late = {key: {"from": 0.1}}
                    self.assertGreater(np.abs(clean(late, 0.25) - clean({}, 0.25)).max(), 0.5)
                    continue
                if key.startswith("end_stop"):
                    continue  # the piston does not get there in so short a time; see the next test
                self.assertGreater(np.abs(clean({key: strong}) - plain).max(), 0.5)

    def test_end_stop_holds_the_piston_back(self):
        out = run(1.5, 0.6, {"end_stop@force.piston": {"position": 0.02, "stiffness": 1e6}})
        force = (out["clean"][-1, 0] - 0.02) * 1e6
        self.assertGreater(force, 100.0)
        self.assertLess(abs(out["clean"][-1, 1]), 0.02)

    def test_weak_line_and_stiff_rod_tend_to_the_plain_rig(self):
        noise = np.array([SHEET.noise[c] for c in OUTPUTS])
        plain = run(1.0, 0.2)["clean"]
        for effects in (
            {"line_inertia@line.valve_cylinder": {"inertance": 1e5}},
            {"elasticity@transmission.rod": {"compliance": 1e-9, "damping": 2e4}},
        ):
            apart = np.abs(run(1.0, 0.2, effects)["clean"] - plain) / noise
            self.assertLess(np.sqrt(np.mean(apart**2)), 1.0, effects)

    def test_sizes_stay_in_the_ports_bounds_and_grow(self):
        random = np.random.default_rng(1)
        for key, bounds in SHEET.bounds.items():
            for _ in range(4):
                fixed = sizes.template(key, bounds, random)
                for q in (0.0, 0.4, 1.0):
                    for name, value in sizes.value(key, bounds, fixed, q).items():
                        self.assertGreaterEqual(value, bounds[name][0] - 1e-12, (key, name))
                        self.assertLessEqual(value, bounds[name][1] + 1e-12, (key, name))


class Cases(unittest.TestCase):
    def test_a_case_follows_from_its_seed(self):
        def facts(seed):
            case = generate.Case(SHEET, seed, "closed", 5)
            out = case.simulate(0, {}, 0.05)
            return case.keys, case.parameters, out["record"]["position"].tolist(), case.templates

        self.assertEqual(facts(7), facts(7))
        self.assertNotEqual(facts(7)[2], facts(8)[2])

    def test_open_cases_are_the_closed_ones(self):
        one, other = (generate.Case(SHEET, 7, part, 3) for part in ("closed", "open"))
        self.assertEqual((one.keys, one.parameters, one.run_seeds), (other.keys, other.parameters, other.run_seeds))

    def test_parameters_stay_within_tolerance_unless_moved(self):
        for number in range(20):
            case = generate.Case(SHEET, 7, "none", number)
            for name, value in case.parameters.items():
                z = abs(value / P[name] - 1) / SHEET.tolerance[name]
                if name in case.moved:
                    self.assertTrue(value == P[name] or abs(value / P[name] - 1) <= 0.3 + 1e-12)
                    self.assertLessEqual(z, 3 + 1e-9)
                else:
                    self.assertLessEqual(z, 1 + 1e-9)
            self.assertEqual(bool(case.moved), number % 2 == 1)

    def test_seeds_for_development_and_test_differ(self):
        self.assertEqual(len(set(generate.SEEDS.values())), len(generate.SEEDS))

    def test_names_and_recordings_tell_nothing(self):
        names = generate.plan(generate.PARTS, 5, 7)
        self.assertEqual(len(set(names.values())), 20)
        for name in names.values():
            self.assertRegex(name, r"^case_\d{4}$")
        by_part = [[int(n[-4:]) for (part, _), n in names.items() if part == p] for p in generate.PARTS]
        self.assertFalse(any(max(a) < min(b) for a, b in zip(by_part, by_part[1:])))  # not in order of parts

    def test_generated_folder_keeps_labels_apart(self):
        with tempfile.TemporaryDirectory() as folder:
            before = truth_servo_actuator.DURATION
            truth_servo_actuator.DURATION = 2.0
            try:
                manifest = generate.generate(folder, ["none"], 1, 7, 1)
            finally:
                truth_servo_actuator.DURATION = before
            self.assertEqual(manifest[0], generate.read(os.path.join(folder, "asked", "case_0001.json")))
            self.assertEqual(sorted(manifest[0]), ["case", "runs", "third", "without"])
            data = [os.path.join(at, f) for at, _, files in os.walk(os.path.join(folder, "data")) for f in files]
            self.assertEqual([os.path.basename(f) for f in sorted(data)], ["run_1.csv", "run_2.csv"])
            with open(data[0], encoding="ascii") as stream:
                head = stream.readline().strip()
                body = stream.read()
            self.assertEqual(head, ",".join(["t"] + SHEET.channels))
            self.assertEqual(len(body.splitlines()), 2000)
            self.assertIsNone(re.search("[a-df-z]", body))
            table = np.array([[float(f) for f in line.split(",")] for line in body.splitlines()])
            columns = dict(zip(head.split(","), table.T))
            self.assertEqual(np.abs(columns["leak_valve_command"]).max(), 0.0)
            self.assertLess(columns["leak_flow"].max(), 6 * 20 * SHEET.noise["leak_flow"])  # the meter's noise
            self.assertEqual(sorted(os.listdir(os.path.join(folder, "sealed"))), ["case_0001.json", "settings.json"])

    def test_noise_in_the_recording_has_its_size(self):
        for scale in (1.0, 5.0):
            out = run(1.0, 1.0, noise=scale)
            for n, name in enumerate(OUTPUTS):
                std = np.std(out["record"][name] - out["clean"][:, n])
                self.assertAlmostEqual(std / (scale * SHEET.noise[name]), 1.0, delta=0.12)


class Oracle(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        truth = Truth(SHEET)
        out = truth.run(0.8, prbs(2), 1.0, 5)
        cls.runs = [signature.Run(out, 1.0, 0, dict(P), dict(NO_NUISANCE), 3)]

    def verdict(self, effects):
        return oracle.identifiable(oracle.examine(self.runs, effects, SHEET, np.random.default_rng(0)))

    def test_two_tolerances_of_coulomb_friction_are_miscalibration(self):
        self.assertEqual(
            self.verdict({"coulomb_friction@force.piston": {"force": 0.12 * P["coulomb_friction"]}}), (False, False)
        )

    def test_an_overlapping_valve_is_told_from_everything(self):
        self.assertEqual(self.verdict({"deadband@restriction.valve": {"width": 0.8}}), (True, True))

    def test_of_two_effects_one_may_hide_beside_the_other(self):
        overlap, force = {"deadband@restriction.valve": {"width": 0.8}}, "coulomb_friction@force.piston"
        lagging = {"lag@sensor.position": {"time_constant": 0.02}}
        small = {force: {"force": 0.12 * P["coulomb_friction"]}}
        for second, expected in ((lagging, []), (small, [force])):
            facts = oracle.examine(self.runs, {**overlap, **second}, SHEET, np.random.default_rng(0))
            self.assertEqual(oracle.hidden(facts), expected, facts["beside"])
        alone = oracle.examine(self.runs, overlap, SHEET, np.random.default_rng(0))
        self.assertEqual(oracle.hidden(alone), [])

    def test_explained_keeps_what_is_orthogonal_and_bounds_parameters(self):
        target = np.array([1.0, 2.0, 0.0])
        free, left, _ = signature.explained(target, [np.array([1.0, 0.0, 0.0])], [0.0], 1.0)
        self.assertAlmostEqual(free, 4.0)
        self.assertTrue(np.allclose(left, [0, 2, 0]))
        bounded, _, _ = signature.explained(np.array([10.0]), [np.array([1.0])], [1.0], 1e6)
        self.assertAlmostEqual(bounded, 1e6 * 49 + 9)


def made(
    effect,
    port,
    verdict="named",
    place=None,
    kind=None,
    probability=0.9,
    equivalent=(),
    interval=(0.9, 1.1),
    unknown=None,
):
    entry = {
        "effect": effect,
        "port": port,
        "probability": probability,
        "parameters": {"width": {"value": 1.0, "low": interval[0], "high": interval[1]}},
    }
    data = {
        "where": {"ranked": [{"port": place or port}], "kind": kind or twins.place_kind(port)},
        "cause": {
            "verdict": verdict,
            "effects": [entry] if verdict == "named" else [],
            "ranked": [entry],
            "equivalent": list(equivalent),
        },
        "shrink": {"heldout": 0.9, "interval": [0.85, 0.95], "closable": 0.95},
    }
    if unknown is not None:
        data["cause"]["unknown_probability"] = unknown
    return answer.Answer(data)


def label(part, key, severity="2-5", off=(), **more):
    effects = {key: {"width": 1.0}} if key else {}
    return dict(
        {
            "part": part,
            "effects": effects,
            "severity": severity,
            "structure": True,
            "identifiable": True,
            "parameters_off": list(off),
            "noise": "0.1 %",
            "excitations": ["prbs", "duty"],
            "lift_after_refit": 3.0,
        },
        **more,
    )


class Scorer(unittest.TestCase):
    def setUp(self):
        self.labels = {
            "case_0001": label("closed", "deadband@command.valve_command"),
            "case_0002": label("closed", "deadband@restriction.valve"),
            "case_0003": label("closed", "deadband@command.valve_command"),
            "case_0004": label("closed", "deadband@command.valve_command", severity="1.2-2"),
            "case_0005": label("none", None),
            "case_0006": label("none", None, off=["compliance"]),
            "case_0007": label("open", "deadband@restriction.valve"),
            "case_0008": label("open", "deadband@command.valve_command"),
            "case_0009": label("two", None),
        }
        self.labels["case_0009"]["effects"] = {"lag@sensor.velocity": {}, "deadband@restriction.valve": {}}
        self.answers = {
            "case_0001": made("deadband", "command.valve_command", probability=0.9),
            "case_0002": made("deadband", "command.valve_command", probability=0.5, interval=(2, 3)),
            "case_0003": made(
                "hysteresis",
                "command.valve_command",
                probability=0.4,
                equivalent=[{"effect": "deadband", "port": "command.valve_command"}],
            ),
            "case_0004": made("lag", "sensor.velocity"),
            "case_0005": made("x", "y", verdict="none"),
            "case_0006": made("lag", "sensor.velocity"),
            "case_0007": made("x", "restriction.valve", verdict="unknown"),
            "case_0008": made("lag", "command.valve_command"),
            "case_0009": made("lag", "sensor.velocity"),
        }

    def summary(self):
        return score.summarise(self.labels, self.answers, {"case_0001": 2.0, "case_0002": 4.0, "case_0003": 9.0}, {})[0]

    def test_rates(self):
        found = self.summary()
        expected = {
            "top1": (1 / 3, 3),
            "family": (2 / 3, 3),
            "set": (2 / 3, 3),
            "place": (2 / 3, 3),
            "kind": (1.0, 3),
            "false": (0.0, 1),
            "false_off": (1.0, 1),
            "open_unknown": (0.5, 2),
            "two_both": (0.0, 1),
            "two_one": (1.0, 1),
            "seconds": (4.0, 3),
            "coverage": (1.0, 1),
            "missing": (0, 9),
        }
        for key, (value, count) in expected.items():
            self.assertAlmostEqual(found[key][0], value, msg=key)
            self.assertEqual(found[key][1], count, key)
        self.assertAlmostEqual(found["closable"][0], 0.95)

    def test_calibration_error_by_hand(self):
        value, count = score.calibration_error([(0.9, True), (0.95, False), (0.2, False)])
        self.assertEqual(count, 3)
        self.assertAlmostEqual(value, (abs(1.85 - 1) + 0.2) / 3)

    def test_unknown_rate_at_five_percent(self):
        closed = [0.1] * 19 + [0.9]
        self.assertAlmostEqual(score.unknown_at(closed, [0.5, 0.95])[0], 1.0)
        self.assertAlmostEqual(
            score.unknown_at([0.0] * 10, [0.0] * 4)[0], 0.05
        )  # a bare "no" wins nothing but the coin
        self.assertAlmostEqual(score.unknown_at([0.0] * 9 + [1.0], [1.0] * 4)[0], 0.5)

    def test_missing_answers_count_against(self):
        del self.answers["case_0001"]
        found = self.summary()
        self.assertAlmostEqual(found["top1"][0], 0.0)
        self.assertEqual(found["missing"], (1, 9))

    def test_twin_named_with_its_set_is_right(self):
        self.labels["case_0003"]["identifiable"] = False
        found = self.summary()
        self.assertEqual(found["twin_set"], (1.0, 1))
        self.assertAlmostEqual(found["top1"][0], 0.5)

    def test_table_is_markdown_with_all_lines(self):
        methods = {"faultline": score.summarise(self.labels, self.answers, {}, {}) + (self.answers,)}
        table = score.markdown(self.labels, methods, "by hand")
        for _, title in score.LINES:
            self.assertIn(f"| {title} |", table)
        self.assertIn("| top-1 | 33 % (3) |", table)
        self.assertIn("| 1.2-2 | yes | 1 | 0 % |", table)

    def test_intervals_in_every_form(self):
        self.assertEqual(answer.interval({"value": 1, "interval": [0, 2]}), (1.0, 0.0, 2.0))
        self.assertEqual(answer.interval({"value": 1, "low": 0, "high": 2}), (1.0, 0.0, 2.0))
        self.assertEqual(answer.interval([1, 0, 2]), (1.0, 0.0, 2.0))


class Twins(unittest.TestCase):
    def test_tables_use_only_names_of_a_datasheet(self):
        known = {key for rig in generate.RIGS for key in Datasheet(rig).bounds}
        for group in twins._GROUPS:
            for key in group:
                self.assertIn(key, known)
        for key in twins.PARAMETER_TWINS:
            self.assertIn(key, known)
        for key in known:
            self.assertIn(key.split("@")[0], twins.FAMILY)

    def test_an_exact_twin_is_exact(self):
        values = {
            "coulomb_friction@force.piston": {"force": 40.0},
            "viscous_friction@force.piston": {"coefficient": 90.0},
            "added_mass@force.piston": {"mass": 0.5},
            "compliance_factor@compliance.chambers": {"factor": 1 / 1.1},
            "clogging@restriction.valve": {"fraction": -0.1},
            "scale@command.valve_command": {"factor": 1.1},
        }
        noise = np.array([SHEET.noise[c] for c in OUTPUTS])
        for key, effect in values.items():
            name = twins.EXACT_TWIN[key][0]
            self.assertAlmostEqual(twins.twin_tolerances(key, effect, P, SHEET.tolerance), 0.1 / SHEET.tolerance[name])
            one = run(1.5, 0.1, {key: effect})["clean"]
            other = run(1.5, 0.1, parameters={name: 1.1 * P[name]})["clean"]
            self.assertLess(np.abs((one - other) / noise).max(), 0.05, key)

    def test_withheld_takes_the_effect_and_its_twins(self):
        out = twins.withheld("lag@command.valve_command", SHEET.bounds)
        self.assertIn("lag@command.valve_command", out)
        self.assertIn("delay@command.valve_command", out)


class Baselines(unittest.TestCase):
    def test_a_plain_sensor_offset_is_found_by_the_equation_errors(self):
        effects = {"offset@sensor.load_pressure": {"value": 1.5e5}}
        out = Truth(SHEET, effects=effects).run(4.0, prbs(3), 1.0, 2)
        table = dict(out["record"], t=out["t"])
        regression = baselines.Regression([table], P, SHEET.sample_period, SHEET.bounds)
        for method in ("bic", "greedy_rmse", "nominal"):
            order, weight, named = baselines.diagnose(regression, method, [])
            self.assertTrue(named)
            self.assertAlmostEqual(weight.sum(), 1.0)
            self.assertIn("offset@sensor.load_pressure", order[:3])  # its twins are the chamber transducers' offsets
            self.assertTrue(all("pressure" in key and "sensor" in key for key in order[:3]))
        self.assertEqual(baselines.diagnose(regression, "nominal", [])[0][0], "offset@sensor.load_pressure")
        order, _, _ = baselines.diagnose(regression, "bic", ["offset@sensor.load_pressure"])
        self.assertNotIn("offset@sensor.load_pressure", order)


if __name__ == "__main__":
    unittest.main()
