"""The plant against a second, independent reading of the datasheet's equations, row by row, and the datasheet's tables
against those of the thesis."""
import csv
import pathlib
import sys
import unittest

import yaml

ROOT = pathlib.Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "test/cli"))
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from equations import Valve
from program import ProgramTest

SUBSTEPS = 20  # of 0.5 ms in a sample period
NOISE = {
    "flapper_position": 3.0e-7,
    "prestage_pressure": 600,
    "spool_position": 0.002,
    "cylinder_pressure": 600,
    "load_torque": 0.5,
    "valve_position": 5.0e-4,
    "flow": 1.0e-4,
}


class Equations(ProgramTest):
    def simulated(self, *arguments):
        self.run_program("simulate", "control_valve", *arguments, "--quiet", "-o", "run.csv")
        with open(self.folder / "run.csv") as file:
            return [{k: float(v) for k, v in row.items()} for row in csv.DictReader(file)]

    def check(self, profile, rows=300):
        recorded = self.simulated("--profile", profile, "--duration", rows / 100, "--seed", 2)
        (self.folder / "run.csv").rename(self.folder / "recorded.csv")
        predicted = self.simulated("--drive", "recorded.csv", "--no-noise")
        valve, first = Valve(), recorded[0]
        state = [
            first["flapper_position"],
            first["prestage_pressure"],
            first["spool_position"] * valve.value["L_s"],
            first["cylinder_pressure"],
            valve.travel(first["valve_position"]),
            first["load_torque"],
        ]
        moved = 0
        for k in range(rows):
            for channel, value in valve.outputs(state).items():
                self.assertLess(abs(value - predicted[k][channel]), 0.05 * NOISE[channel], (profile, k, channel))
            moved = max(moved, abs(predicted[k]["valve_position"] - first["valve_position"]))
            now, after = recorded[k], recorded[k + 1]
            for i in range(SUBSTEPS):
                share = (i + 0.5) / SUBSTEPS
                supply, temperature = (
                    now[c] + share * (after[c] - now[c]) for c in ("supply_pressure", "ambient_temperature")
                )
                state = valve.step(state, 0.01 / SUBSTEPS, now["coil_voltage"], supply, temperature)
        self.assertGreater(moved, 0.02)

    def test_in_smooth_motion(self):
        self.check("multisine")

    def test_through_the_stops_of_spool_and_flapper(self):
        self.check("duty", rows=700)  # closes from 5 s on

    def test_without_loops(self):
        self.check("open_multisine")


class Tables(unittest.TestCase):
    def setUp(self):
        self.printed = yaml.safe_load((ROOT / "scripts/studies/control_valve/published.yaml").read_text())["tables"]
        self.used = yaml.safe_load((ROOT / "config/control_valve/rig.yaml").read_text())["tables"]

    @staticmethod
    def mean(rows):
        return [sum(v for v in column if v is not None) / sum(v is not None for v in column) for column in zip(*rows)]

    def assert_rows(self, rows, used):
        for one, other in zip(rows, used):
            self.assertAlmostEqual(one, other, delta=6e-5)

    def test_nozzle_is_the_mean_of_table_4(self):
        rows = [self.printed["table_4"][s] for s in ("0.2 MPa", "0.5 MPa", "0.8 MPa")]
        self.assert_rows(self.mean(rows), self.used["nozzle_cd"]["columns"]["value"])

    def test_restrictor_is_the_mean_of_table_3(self):
        self.assertAlmostEqual(sum(self.printed["table_3"].values()) / 3, 0.90, delta=0.005)

    def test_filling_is_the_mean_of_tables_5_to_7(self):
        tables = [self.printed[f"table_{n}"] for n in (5, 6, 7)]
        columns = self.used["fill_cd"]["columns"]
        self.assert_rows(self.mean([t["s_0.6"] for t in tables]), columns["s_0.6"])
        for row in ("s_0.8", "s_1"):
            self.assert_rows(self.mean([t[row] for t in tables]), columns["s_0.8_and_1"])

    def test_exhaust_is_table_8(self):
        for row in ("s_0", "s_0.2", "s_0.4"):
            self.assertEqual(self.printed["table_8"][row], self.used["exhaust_cd"]["columns"][row])

    def test_friction_is_that_at_half_a_megapascal(self):
        self.assertEqual(self.printed["table_9"]["0.5 MPa"], self.used["coulomb_pos"]["columns"]["value_N"])
        self.assertEqual(self.printed["table_10"]["0.5 MPa"], self.used["coulomb_neg"]["columns"]["value_N"])

    def test_pressure_force_is_the_line_through_table_2(self):
        x = [0, 35e-6, 52.5e-6, 70e-6, 105e-6]
        y = self.printed["table_2"]["0.5 MPa"]
        x_mean, y_mean = sum(x) / 5, sum(y) / 5
        slope = sum((a - x_mean) * (b - y_mean) for a, b in zip(x, y)) / sum((a - x_mean) ** 2 for a in x)
        self.assertAlmostEqual(-slope, 9473, delta=40)
        self.assertAlmostEqual(y_mean - slope * x_mean, 1.0232, delta=3e-3)


if __name__ == "__main__":
    unittest.main()
