"""`faultline explain`: what explains a channel of a recording, the lines for a stage, bad input."""

import json
import math
import random
import unittest

from program import ProgramTest

RIG = "servo_actuator"


class Explain(ProgramTest):
    def recording(self):
        """Of the rig's channels, with numbers whose relations are known: spool from command, pressure from both."""
        self.run_program("simulate", RIG, "--duration", "0.01", "--quiet", "-o", "short.csv")
        names = (self.folder / "short.csv").read_text().splitlines()[0].split(",")
        generator = random.Random(1)
        lines = [",".join(names)]
        command = 0.0
        for k in range(20000):
            if k % 40 == 0:
                command = generator.uniform(-4, 4)
            supply = 6.9e6 + 2e5 * math.sin(k / 531)
            values = {
                "t": k / 1000,
                "valve_command": command,
                "supply_pressure": supply,
                "spool_position": 1e-4 * command + 1e-6 * generator.gauss(0, 1),
                "load_pressure": 5e5 * command + 5 * (supply - 6.9e6) + 1e4 * generator.gauss(0, 1),
            }
            lines.append(",".join(f"{values.get(name.split('[')[0], 0):.9g}" for name in names))
        (self.folder / "run.csv").write_text("\n".join(lines) + "\n")
        return "run.csv"

    def test_finds_what_was_put_in(self):
        words = ["--rig", RIG, "--by", "valve_command,supply_pressure", "--of", "spool_position,load_pressure,velocity"]
        text = self.run_program("explain", self.recording(), *words, "--json", "explain.json").stdout
        told = {v["name"]: v for v in json.loads((self.folder / "explain.json").read_text())["variables"]}
        self.assertEqual(told["spool_position"]["explained_by"], ["valve_command"])
        self.assertLess(told["spool_position"]["left"], 0.5 * told["spool_position"]["entropy"])
        self.assertEqual(told["load_pressure"]["explained_by"], ["valve_command", "supply_pressure"])
        self.assertEqual(told["velocity"]["entropy"], 0)
        self.assertIn('load_pressure_by: "valve_command, supply_pressure"\n', text)
        self.assertIn("it never moved", text)

    def test_bad_input(self):
        run = self.recording()
        for words, wanted in (
            (["--by", "wind"], "wind"),
            (["--bins", "1"], "--bins"),
            (["--least", "nan"], "--least"),
        ):
            with self.subTest(words=words):
                done = self.run_program("explain", run, "--rig", RIG, *words, check=2)
                self.assertIn(wanted, done.stderr)
                self.assertEqual(len(done.stderr.strip().splitlines()), 1, done.stderr)


if __name__ == "__main__":
    unittest.main()
