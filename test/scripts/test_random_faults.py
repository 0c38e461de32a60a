"""Faults drawn at random: every effect of every rig can be drawn, and what the oracle calls hidden is."""

import json
import pathlib
import sys
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "scripts/studies"))
sys.dont_write_bytecode = True

import random_faults as study  # noqa: E402
from rig_runs import RIGS, datasheet, faultline  # noqa: E402


def described(rig):
    return json.loads(faultline("rigs", rig, "--json", "-"))["rigs"][0]


class Draws(unittest.TestCase):
    def test_every_rig_and_effect(self):
        for rig in RIGS:
            told, profiles, drawn = described(rig), datasheet(rig)["profiles"], set()
            for seed in range(1, 400):
                _, seconds, onset, name, words, share = study.draw(told["ports"], profiles, seed)
                drawn.add(name)
                self.assertTrue(0 < onset < seconds, (rig, seed))
                self.assertTrue(words.startswith(name), words)
                if share is not None:
                    self.assertTrue(0 <= share <= 1.001, (rig, seed, words, share))
            ports = [p for p in told["ports"] if p["effects"]]
            self.assertGreater(len(drawn), 0.5 * sum(len(p["effects"]) for p in ports), rig)

    def test_lost_samples_and_faults_from_the_start(self):
        table = "t,x\n0,1\n0.5,2\n1,3\n1.5,4\n"
        self.assertEqual(study.without(table, 0.5, 1.5), "t,x\n0,1\n1.5,4\n")
        told, profiles = described("servo_actuator"), datasheet("servo_actuator")["profiles"]
        later, first = study.draw(told["ports"], profiles, 7), study.draw(told["ports"], profiles, 7, from_start=True)
        self.assertEqual(first[2], 0)
        self.assertEqual(later[4].rsplit(",", 1)[0], first[4].rsplit(",", 1)[0])

    def test_the_oracle_knows_the_channels_of_branches(self):
        told = described("cooling_circuit")
        profiles = [{"name": "steady", "duration": 10}]
        found = study.oracle(told, profiles, 3)
        self.assertIn(found["channel"], [c["name"] for c in told["channels"]])
        self.assertGreater(found["sigma"], 0)


if __name__ == "__main__":
    unittest.main()
