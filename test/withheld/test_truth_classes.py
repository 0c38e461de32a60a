"""Checks of random truths: every class changes the recording and nothing does when it is off; one seed one case; labels
sealed; one case as one command; tables by group.

    python3 -m unittest discover -s test/withheld -p "test_*.py"
"""
import json
import os
import re
import subprocess
import sys
import tempfile
import unittest

import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, HERE)

import generate
import groups
import nature
import leave_out
import levels
import score
import truth_classes
import twins
from generate import World

RIG = "hydraulic_drive"  # its truth is the cheapest
ODDS = {"noise": 1.0, "runs": 1, "length": 8.0}


def case(classes, seed=5, part="none", number=0, rig=RIG, **more):
    return generate.Case(generate.datasheet_of(rig), seed, part, number, World(classes, **{**ODDS, **more}))


def recorded(classes, **more):
    made = case(classes, **more)
    out = made.simulate(0, {}, 4.0)
    return np.column_stack([out["record"][name] for name in made.sheet.channels])


class Draw(unittest.TestCase):
    def test_a_seed_gives_one_truth_and_another_gives_another(self):
        one, again, other = (case(None, seed) for seed in (7, 7, 8))
        facts = lambda c: json.dumps([c.drawn, c.nuisance, c.parameters, c.kinds, c.run_seeds])
        self.assertEqual(facts(one), facts(again))
        self.assertNotEqual(facts(one), facts(other))

    def test_leaving_a_class_out_changes_no_other(self):
        for number in range(6):
            whole, less = case(None, number=number), case(None, number=number, without=["friction", "noise"])
            kept = {name: entry for name, entry in whole.drawn.items() if name not in ("friction", "noise")}
            self.assertEqual(less.drawn, kept)
            self.assertEqual(less.parameters, whole.parameters)

    def test_runs_length_and_noise_stay_in_their_ranges(self):
        runs, good = set(), 0
        for number in range(40):
            made = generate.Case(generate.datasheet_of(RIG), 5, "two", number, World([]))
            self.assertTrue(8 <= made.length <= 60 and 1 <= made.runs <= 5)
            self.assertLessEqual(made.runs * made.length, max(made.rig.BUDGET, made.length) + 1)
            self.assertTrue(5e-3 <= made.noise_scale <= 20)
            runs.add(made.runs)
            good += made.good
            self.assertEqual(len(made.kinds), made.runs + 1)
        self.assertEqual(runs, {1, 2, 3, 4, 5})
        self.assertGreater(good, 3)

    def test_every_variant_has_numbers_in_its_ranges_on_every_rig(self):
        random = np.random.default_rng(1)
        for rig in generate.RIGS:
            for name in truth_classes.CLASSES:
                known = truth_classes.variants(generate.truth_of(rig), name)
                self.assertGreater(len(known), 1, (rig, name))
                for ranges in known.values():
                    for bounds in ranges.values():
                        value = truth_classes.number(bounds, random)
                        low, high = bounds if isinstance(bounds, tuple) else (bounds, bounds)
                        self.assertTrue(low <= value <= high, (rig, name, bounds, value))


class Classes(unittest.TestCase):
    def test_each_class_changes_the_recording_and_none_does_not(self):
        plain = recorded([])
        self.assertTrue(np.array_equal(plain, recorded([], without=["noise"])))
        for name in truth_classes.CLASSES:
            changed = [recorded([name], seed=5, number=0)]
            self.assertFalse(np.array_equal(plain, changed[0]), name)

    def test_off_leaves_the_rigs_own_truth(self):
        made = case([])
        self.assertEqual(made.drawn, {})
        self.assertEqual(set(made.nuisance), set(made.rig.NO_NUISANCE))

    def test_every_variant_of_a_sensor_shows_and_stays_small(self):
        t = np.arange(2000) * 1e-3
        clean = np.column_stack([np.sin(9 * t), np.cos(5 * t)])
        ranges = np.array([2.0, 2.0])
        for name in ("sensor", "sampling"):
            for variant, bounds in truth_classes.VARIANTS[name].items():
                values = {n: truth_classes.number(b, np.random.default_rng(2)) for n, b in bounds.items()}
                drawn = {name: {"variant": variant, "values": values, "seed": 3}}
                apart = np.abs(truth_classes.distorted(clean, ranges, drawn) - clean).max()
                self.assertGreater(apart, 1e-5, variant)
                self.assertLess(apart, 0.15, variant)

    def test_noise_keeps_its_size_but_where_it_grows_with_the_signal(self):
        for variant, bounds in truth_classes.VARIANTS["noise"].items():
            values = {n: truth_classes.number(b, np.random.default_rng(4)) for n, b in bounds.items()}
            drawn = {"noise": {"variant": variant, "values": values, "seed": 3}}
            white, still = truth_classes.noise(40000, 3, drawn, np.zeros((40000, 3)), 1e-3, np.random.default_rng(1))
            self.assertAlmostEqual(np.std(white), 1.0, delta=0.1)
            self.assertEqual(bool(np.any(still)), variant == "hum")

    def test_good_transducers_leave_a_gap_of_ten_times_their_noise(self):
        number = next(n for n in range(50) if generate.Case(SHEET, 5, "none", n, World(["friction"])).good)
        made = generate.Case(SHEET, 5, "none", number, World(["friction", "hose"]))
        for gap, factor in zip(made.measure_level()[1], made.quiet):
            self.assertTrue(5 < gap < 20 or factor in (1.0, truth_classes.QUIETEST), (gap, factor))
        self.assertLess(made.sheet.resolution["motor_pressure"], SHEET.resolution["motor_pressure"])


SHEET = generate.datasheet_of(RIG)


class Commands(unittest.TestCase):
    def run_one(self, folder, *more):
        command = [sys.executable, os.path.join(HERE, "run.py"), folder, "--rig", RIG, "--truth", "random"]
        command += ["--cases", "2", "--part", "none", "--length", "8", "--jobs", "1", "--no-faultline", *more]
        return subprocess.run(command, capture_output=True, text=True, check=False)

    def test_one_case_is_one_command_and_its_label_is_sealed(self):
        with tempfile.TemporaryDirectory() as folder:
            done = self.run_one(folder, "--case", "2", "--classes", "sensor,noise", "--runs", "3")
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertEqual(os.listdir(os.path.join(folder, "data")), ["case_0002"])
            self.assertEqual(sorted(os.listdir(os.path.join(folder, "sealed"))), ["case_0002.json", "settings.json"])
            asked = generate.read(os.path.join(folder, "asked", "case_0002.json"))
            self.assertEqual(sorted(asked), ["case", "runs", "third", "without"])
            self.assertEqual(len(asked["runs"]), 3)
            label = generate.read(os.path.join(folder, "sealed", "case_0002.json"))
            self.assertEqual(sorted(label["classes"]), ["noise", "sensor"])
            self.assertEqual(label["runs"], 3)
            for name in asked["runs"]:
                with open(os.path.join(folder, name), encoding="ascii") as stream:
                    stream.readline()
                    self.assertIsNone(re.search("[a-df-z]", stream.read()))
            wrong = self.run_one(folder, "--case", "9", "--classes", "sensor,noise", "--runs", "3")
            self.assertNotEqual(wrong.returncode, 0)
            self.assertIn("--case 9", wrong.stderr)
            other = self.run_one(folder, "--case", "1", "--runs", "2")
            self.assertIn("holds cases of other settings", other.stderr)

    def test_only_what_counts_is_asked(self):
        with tempfile.TemporaryDirectory() as folder:
            asked, program = os.path.join(folder, "asked.txt"), os.path.join(folder, "program")
            with open(program, "w", encoding="ascii") as stream:
                stream.write(f'#!/bin/sh\necho "$@" >> {asked}\nexit 1\n')
            os.chmod(program, 0o755)
            out = os.path.join(folder, "out")
            command = [sys.executable, os.path.join(HERE, "run.py"), out, "--rig", RIG, "--truth", "random"]
            command += ["--counted", "--cases", "3", "--part", "closed", "--length", "4", "--jobs", "1"]
            command += ["--program", program]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            self.assertEqual(done.returncode, 1, done.stderr)
            labels = {f"case_{n:04d}": generate.read(f"{out}/sealed/case_{n:04d}.json") for n in range(1, 4)}
            expected = {name for name, label in labels.items() if groups.counted(label)}
            self.assertTrue(0 < len(expected) < 3, labels)
            with open(asked, encoding="ascii") as stream:
                said = stream.read()
            self.assertEqual({name for name in labels if name in said}, expected)

    def test_a_class_that_nobody_knows_is_named(self):
        with tempfile.TemporaryDirectory() as folder:
            done = self.run_one(folder, "--classes", "friktion")
            self.assertNotEqual(done.returncode, 0)
            self.assertIn("no class friktion; known: friction", done.stderr)


class Levels(unittest.TestCase):
    def test_a_valve_of_second_order_shows(self):
        gap, seconds = levels.one(RIG, "valve", "second_order", 0)
        self.assertGreater(gap.max(), 0.5)
        self.assertLess(seconds, 5.0)


class Tables(unittest.TestCase):
    def setUp(self):
        common = {"rig": RIG, "noise": "good", "runs": 2, "excitations": ["prbs"], "level": {"a": 1.0, "b": 9.0}}
        with_friction = {**common, "classes": {"friction": "dahl"}, "length": 9.0}
        without = {**common, "classes": {"sensor": "bow"}, "length": 45.0}
        effect = {"effects": {"lag@command.valve": {}}, "identifiable": True, "structure": True, "severity": "2-5"}
        self.labels = {
            "case_0001": {"part": "closed", **effect, **with_friction},
            "case_0002": {"part": "closed", **effect, **without},
            "case_0003": {"part": "none", "effects": {}, "parameters_off": [], **without},
        }
        named = {"cause": {"verdict": "named", "effects": [{"effect": "lag", "port": "command.valve"}]}}
        make = groups.answer.Answer
        unknown = {"cause": {"verdict": "unknown", "effects": []}}
        self.answers = {"case_0001": make(unknown), "case_0002": make(named), "case_0003": make(named)}

    def test_a_class_that_is_on_stands_beside_itself_off(self):
        found = groups.grouped("class", self.labels)
        self.assertEqual(sorted(found["friction, any"]), ["case_0001"])
        self.assertEqual(sorted(found["friction, off"]), ["case_0002", "case_0003"])
        self.assertEqual(sorted(found["friction: dahl"]), ["case_0001"])
        self.assertEqual(groups.counts(found["friction, any"], self.answers)["closed right"], [0, 1])
        off = groups.counts(found["friction, off"], self.answers)
        self.assertEqual((off["closed right"], off["none right"]), ([1, 1], [0, 1]))

    def test_what_a_truth_has_by_nature_is_no_error(self):
        label = {**self.labels["case_0003"], "classes": {"valve": "second_order", "sensor": "bow"}}
        names = ["lag@command.valve", "lag@sensor.speed", "gain_curve@sensor.speed"]
        self.assertEqual(nature.foreign(label, names), ["lag@sensor.speed"])
        labels = {"case_0003": label}
        self.assertEqual(groups.counts(labels, self.answers)["none, false name"], [0, 1])
        self.assertEqual(groups.counts(labels, self.answers)["none right"], [0, 1])
        found = score.summarise({**self.labels, **labels}, self.answers, {}, {})[0]
        self.assertEqual((found["none_name"], found["none_foreign"]), ((1, 1), (0, 1)))
        found = score.summarise(self.labels, self.answers, {}, {})[0]
        self.assertEqual(found["none_foreign"], (1, 1))

    def test_of_a_pair_what_nobody_could_tell_is_not_asked_for(self):
        effects = {"lag@command.valve": {}, "deadband@command.b": {}}
        pair = {**self.labels["case_0002"], "part": "two", "effects": effects}
        for hidden, expected in ((["deadband@command.b"], "of a hidden pair what shows"), ([], "both of two")):
            found = groups.counts({"case_0002": {**pair, "hidden": hidden}}, self.answers)
            self.assertEqual(found, {expected: [int(bool(hidden)), 1]})
            summary = score.summarise({"case_0002": {**pair, "hidden": hidden}}, self.answers, {}, {})[0]
            self.assertEqual(summary["two_both"][1], int(not hidden))

    def test_thresholds_are_judged_on_what_was_left_out(self):
        evidence = {"found": True, "plain": True, "shrink": 0.9, "perfect": 100.0, "effects": 80.0, "free_before": 70.0,
                    "free_after": 10.0, "readings": 10.0, "size": 0.1, "matters": 0.01, "excess": 3.0,
                    "calibrated": 0.0, "left": 1.0, "quiet": 0.05}
        judged = lambda **changed: leave_out.judged({**evidence, **changed}, leave_out.TODAY)
        self.assertEqual(judged(), "named")
        self.assertEqual(judged(free_after=21.0), "unknown")
        self.assertEqual(judged(free_after=21.0, left=0.04, shrink=0.95), "named")
        self.assertEqual(judged(spread=0.3), "unknown")
        self.assertEqual(judged(spread=0.3, size=0.009), "silent")
        self.assertEqual(judged(shrink_low=-0.1, free_before=0.0), "silent")
        self.assertEqual(judged(found=False, effects=0.0), "unknown")
        self.assertEqual(judged(found=False, effects=0.0, size=0.009, excess=40.0), "silent")
        self.assertEqual(judged(found=False, effects=0.0, free_before=0.0), "silent")
        self.assertEqual(judged(found=False, effects=0.0, free_before=0.0, excess=31.0), "unknown")
        with tempfile.TemporaryDirectory() as base:
            for number, (part, verdict) in enumerate([("closed", "named"), ("none", "none")], 1):
                for folder in ("sealed", "asked", "answers/faultline"):
                    os.makedirs(os.path.join(base, folder), exist_ok=True)
                label = dict(self.labels["case_0001" if part == "closed" else "case_0003"])
                effects = [{"effect": "lag", "port": "command.valve"}] * (part == "closed")
                cause = {"verdict": verdict, "effects": effects}
                silent = {} if part == "closed" else {"found": False, "effects": 0.0, "free_before": 0.0}
                for folder, content in (("sealed", label), ("asked", {}),
                                        ("answers/faultline", {"cause": cause, "evidence": {**evidence, **silent}})):
                    with open(f"{base}/{folder}/case_000{number}.json", "w", encoding="utf-8") as stream:
                        json.dump(content, stream)
            command = [sys.executable, os.path.join(HERE, "leave_out.py"), base, "--draws", "40"]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertIn("2 cases that count: closed 1, open 0, none 1, two 0", done.stdout)
            self.assertIn("Today's thresholds 1.00; the best of 40 draws", done.stdout)
            self.assertIn("| class friction | 1 |", done.stdout)
            path = f"{base}/answers/faultline/case_0002.json"
            with open(path, "w", encoding="utf-8") as stream:
                json.dump({"cause": {"verdict": "unknown", "effects": []}, "evidence": {**evidence, **silent}}, stream)
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            self.assertNotEqual(done.returncode, 0)
            self.assertIn("where today's thresholds say silent", done.stderr)

    def test_every_variant_has_a_nature_or_is_like_no_effect(self):
        like_none = {"cross_talk", "coloured", "hum", "heavy", "by_level", "jitter", "missed"}
        known = set()
        for rig in map(generate.truth_of, generate.RIGS):
            for name in truth_classes.CLASSES:
                for variant in truth_classes.variants(rig, name):
                    known |= {(name, variant), name}
                    if name != "integrator" and variant not in like_none:
                        self.assertTrue(nature.NATURE.get((name, variant), nature.NATURE.get(name)), (name, variant))
        self.assertEqual(set(nature.NATURE) - known, set())

    def test_what_no_line_counts_is_not_counted(self):
        def label(part, severity="2-5", structure=True, identifiable=True, effect="lag@command.valve_command"):
            return {"part": part, "severity": severity, "structure": structure, "identifiable": identifiable,
                    "effects": {effect: {}}}

        self.assertTrue(groups.counted({"part": "none", "effects": {}}))
        self.assertTrue(groups.counted(label("closed")))
        self.assertFalse(groups.counted(label("closed", identifiable=False)))
        self.assertFalse(groups.counted(label("closed", severity="1.2-2")))
        self.assertTrue(groups.counted(label("open", identifiable=False)))
        self.assertFalse(groups.counted(label("open", structure=False)))
        self.assertTrue(groups.counted(label("two", severity="above 5")))
        self.assertFalse(groups.counted(label("two", severity="below 1.2")))
        self.assertTrue(groups.counted({**label("two"), "hidden": []}))
        self.assertFalse(groups.counted({**label("two"), "hidden": ["lag@command.valve_command"]}))
        for effect in twins.PARAMETER_TWINS:
            self.assertFalse(groups.counted(label("open", effect=effect)))

    def test_the_rows_are_markdown(self):
        for title in groups.OF:
            text = groups.markdown(title, "faultline", self.labels, self.answers, {"case_0001": 3.0})
            rows = [line for line in text.splitlines() if line.startswith("|")]
            self.assertEqual(len({row.count("|") for row in rows}), 1, title)
        text = groups.markdown("length", "faultline", self.labels, self.answers, {})
        self.assertIn("| 8-15 s | 1 | 3.0 | 0 % (1) |", text)

    def test_several_folders_make_one_table(self):
        with tempfile.TemporaryDirectory() as base:
            for folder, names in (("one", ["case_0001"]), ("two", ["case_0002", "case_0003"])):
                for place in ("sealed", "asked", "answers/faultline"):
                    os.makedirs(os.path.join(base, folder, place))
                for name in names:
                    for place, content in (("sealed", self.labels[name]), ("asked", {}), ("answers/faultline", {})):
                        with open(os.path.join(base, folder, place, name + ".json"), "w", encoding="utf-8") as stream:
                            json.dump(content, stream)
            labels, methods = score.load_all([os.path.join(base, name) for name in ("one", "two")], True)
            self.assertEqual(sorted(labels), ["one/case_0001", "two/case_0002", "two/case_0003"])
            self.assertEqual(sorted(methods["faultline"][0]), sorted(labels))


if __name__ == "__main__":
    unittest.main()
