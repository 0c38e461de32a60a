"""simulate --drive: the rig's model under the commands and inputs of a recording, at its rows and times."""
import csv
import pathlib
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from program import ProgramTest  # noqa: E402

OUTPUTS = ("position", "velocity", "load_pressure", "chamber_a_pressure", "chamber_b_pressure", "spool_position")


def rows_of(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


class Drive(ProgramTest):
    def drive(self, run, output, *arguments):
        self.run_program("simulate", "servo_actuator", "--drive", run, "--quiet", *arguments, "-o", output)
        return rows_of(self.folder / output)

    def test_without_noise_it_is_the_run_that_drove_it(self):
        truth = rows_of(self.simulate("run.csv", "--no-noise", "--profile", "multisine"))
        model = self.drive("run.csv", "model.csv", "--no-noise")
        self.assertEqual([row["t"] for row in model], [row["t"] for row in truth])
        for name in ("valve_command", "supply_pressure", "load_force", "position_reference"):
            self.assertEqual([row[name] for row in model], [row[name] for row in truth], name)
        for name in OUTPUTS:
            span = max(float(r[name]) for r in truth) - min(float(r[name]) for r in truth)
            apart = max(abs(float(a[name]) - float(b[name])) for a, b in zip(truth, model))
            self.assertLess(apart, 0.01 * span, name)

    def test_noise_and_effects(self):
        self.simulate("run.csv")
        plain = self.drive("run.csv", "a.csv")
        self.assertEqual(plain, self.drive("run.csv", "b.csv"))
        self.assertNotEqual(plain, self.drive("run.csv", "c.csv", "--seed", 2))
        exact = self.drive("run.csv", "d.csv", "--no-noise")
        spread = [float(a["load_pressure"]) - float(b["load_pressure"]) for a, b in zip(plain, exact)]
        std = (sum(x * x for x in spread) / len(spread)) ** 0.5
        self.assertAlmostEqual(std, 1e4, delta=500)
        moved = self.drive("run.csv", "e.csv", "--no-noise", "--effect", "offset@sensor.velocity:value=0.02")
        # The first row shows a velocity that the sensor's offset is in; the rig forgets that start.
        for a, b in list(zip(exact, moved))[1000:]:
            self.assertAlmostEqual(float(b["velocity"]) - float(a["velocity"]), 0.02, delta=1e-4)

    def test_lost_rows_stay_lost_and_time_goes_on(self):
        lines = self.simulate("run.csv", "--no-noise", "--profile", "multisine").read_text().splitlines()
        (self.folder / "holes.csv").write_text("\n".join(lines[:500] + lines[503:]) + "\n")
        whole = self.drive("run.csv", "whole.csv", "--no-noise")
        model = self.drive("holes.csv", "model.csv", "--no-noise")
        self.assertEqual(len(model), len(whole) - 3)
        self.assertEqual(model[499]["t"], whole[502]["t"])
        for name in ("position", "spool_position"):
            self.assertAlmostEqual(float(model[-1][name]), float(whole[-1][name]), delta=2e-3)

    def test_a_run_of_another_sample_period(self):
        lines = self.simulate("run.csv", "--no-noise", "--profile", "multisine").read_text().splitlines()
        (self.folder / "half.csv").write_text("\n".join([lines[0]] + lines[1::2]) + "\n")
        whole = self.drive("run.csv", "whole.csv", "--no-noise")
        half = self.drive("half.csv", "model.csv", "--no-noise")
        self.assertEqual([row["t"] for row in half], [row["t"] for row in whole[::2]])
        for a, b in zip(whole[::2], half):
            self.assertAlmostEqual(float(a["position"]), float(b["position"]), delta=2e-3)

    def test_a_bag_keeps_its_stamps(self):
        self.simulate("run.bag", "--profile", "multisine", duration=0.5)
        self.run_program("simulate", "servo_actuator", "--drive", "run.bag", "--quiet", "-o", "model.bag")
        for name in ("run", "model"):
            self.run_program("export", f"{name}.bag", "-o", f"{name}.csv")
        run, model = rows_of(self.folder / "run.csv"), rows_of(self.folder / "model.csv")
        self.assertEqual([row["t"] for row in run], [row["t"] for row in model])

    def test_what_contradicts_it_is_refused(self):
        self.simulate("run.csv", duration=0.1)
        for extra in (("--profile", "steps"), ("--duration", "1"), ("--command", "valve_command:0=1")):
            done = self.run_program(
                "simulate", "servo_actuator", "--drive", "run.csv", *extra, "-o", "x.csv", check=None
            )
            self.assertEqual(done.returncode, 2, extra)
        self.complains(
            ("simulate", "servo_actuator", "--drive", "run.csv", "--fault", "internal_leak_ramp", "-o", "x.csv"),
            "--drive",
        )
        text = (self.folder / "run.csv").read_text().splitlines()
        (self.folder / "back.csv").write_text("\n".join(text[:50] + text[40:]) + "\n")
        self.run_program("simulate", "servo_actuator", "--drive", "back.csv", "-o", "x.csv", check=2)


if __name__ == "__main__":
    unittest.main()
