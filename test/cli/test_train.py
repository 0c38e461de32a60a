"""train: what it writes and tells, how it goes on after a kill, and what it and the stage refuse."""
import json
import pathlib
import signal
import subprocess
import sys
import time
import unittest

import yaml

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from program import ROOT, ProgramTest, program  # noqa: E402

RIG = "pump_cylinder"
STAGE = {
    "name": "sensor",
    "type": "network",
    "weights": "sensor.txt",
    "inputs": "pump1_speed, pump2_speed, position.smooth, position.rate",
    "outputs": "chamber_a_pressure, chamber_b_pressure",
    "cut_off": 15,
    "lags": 1,
    "hidden": 4,
    "feedback": "none",
}


class Train(ProgramTest):
    def setUp(self):
        super().setUp()
        self.config("net.yaml")
        common = ["--profile", "chirp", "--duration", 3, "--quiet"]
        self.run_program("simulate", RIG, *common, "-o", "run.bag")
        self.run_program("simulate", RIG, *common, "--seed", 2, "-o", "other.csv")

    def config(self, file, **changes):
        folder = ROOT / "config" / RIG
        sheet = yaml.safe_load((folder / "rig.yaml").read_text())
        sheet.update(estimators=[{**STAGE, **changes}], detectors=[], isolators=[])
        (self.folder / file).write_text(yaml.safe_dump(sheet, sort_keys=False))

    def arguments(self, output, *more, config="net.yaml"):
        return ["train", RIG, "run.bag", "--config", config, "-o", output, *more]

    def text(self, name):
        return (self.folder / name).read_text()

    def test_trains_and_diagnose_runs_it(self):
        more = ["--validate", "other.csv", "--epochs", 15, "--json", "-"]
        told = json.loads(self.run_program(*self.arguments("sensor.txt", *more)).stdout)
        head = [told[key] for key in ("rig", "stage", "samples", "weights")]
        self.assertEqual(head, [RIG, "sensor", 3001, 4 * 6 + 4 + 10])
        course = [epoch["rms"] for epoch in told["epochs"]]
        self.assertEqual(course, sorted(course, reverse=True))
        self.assertLess(course[-1], 0.85 * course[0])
        for output in told["outputs"]:
            self.assertEqual(output["unit"], "Pa")
            self.assertLess(output["validation_rms"], 1.2e5)  # noise is 0.08 MPa, the pressures vary by 0.2
        self.assertNotIn("unfinished", self.text("sensor.txt"))
        self.run_program("diagnose", "run.bag", "--config", "net.yaml", "--series", "course.csv", "--json", "d.json")
        names = self.text("course.csv").splitlines()[0].split(",")
        self.assertIn("q.chamber_a_pressure_network", names)
        self.assertIn("q.chamber_b_pressure_network_residual", names)

    def test_goes_on_after_a_kill_as_if_nothing_had_been(self):
        for name, number in (("killed.txt", signal.SIGKILL), ("stopped.txt", signal.SIGINT)):
            with self.subTest(signal=number):
                command = [program(), *map(str, self.arguments(name, "--epochs", 100000))]
                run = subprocess.Popen(command, cwd=self.folder, stderr=subprocess.PIPE, text=True)
                try:
                    until = time.monotonic() + 60
                    while time.monotonic() < until and not self.epochs_done(name) >= 3:
                        time.sleep(0.02)
                    run.send_signal(number)
                    said = run.communicate(timeout=30)[1]
                finally:
                    run.kill()
                if number == signal.SIGINT:
                    self.assertEqual(run.returncode, 130)
                    self.assertEqual(
                        said, f"faultline train: interrupted; {name} holds the best weights so far; --resume goes on\n"
                    )
                done = self.epochs_done(name)
                self.assertGreaterEqual(done, 3)
                self.complains(self.arguments(name), name, "unfinished training", "--resume")
                other = self.arguments(name, "--resume", "--seed", 2)
                self.complains(other, name, "other recordings, seed or settings")
                self.run_program(*self.arguments(name, "--resume", "--epochs", done + 5))
                self.run_program(*self.arguments(f"whole_{name}", "--epochs", done + 5))
                self.assertEqual(self.text(name), self.text(f"whole_{name}"))
                self.complains(self.arguments(name, "--resume"), name, "nothing to resume")

    def epochs_done(self, name):
        """Of an unfinished training; the file is whole at every moment."""
        if not (self.folder / name).exists():
            return 0
        lines = self.text(name).splitlines()
        self.assertTrue(lines[-1].startswith("crc32 "), lines[-1])
        return next((int(line.split()[1]) for line in lines if line.startswith("epoch ")), 0)

    def test_earlier_weights_and_feedback(self):
        self.run_program(*self.arguments("first.txt", "--epochs", 10))
        more = ["--from", "first.txt", "--feedback", "all", "--horizon", 0.05, "--epochs", 5, "--json", "a.json"]
        self.run_program(*self.arguments("second.txt", *more))
        course = [epoch["rms"] for epoch in json.loads(self.text("a.json"))["epochs"]]
        self.assertLess(course[-1], course[0])
        self.config("cold.yaml", feedback="all")
        again = ["--from", "second.txt", "--horizon", 0.5, "--cold", 0.1, "--epochs", 3]
        self.run_program(*self.arguments("third.txt", *again, config="cold.yaml"))
        self.assertIn("feedback 2\n", self.text("third.txt"))

    def test_copies_of_a_datasheet_find_the_weights(self):
        self.run_program(*self.arguments("sensor.txt", "--epochs", 1))
        self.run_program("simulate", RIG, "--profile", "steps", "--duration", 4, "--quiet", "-o", "steps.bag")
        (self.folder / "copies").mkdir()
        self.run_program("fit", RIG, "steps.bag", "--config", "net.yaml", "--patch", "copies/mine.yaml")
        self.assertTrue(f"weights: {self.folder.resolve()}/sensor.txt" in self.text("copies/mine.yaml"))
        self.run_program("diagnose", "run.bag", "--config", "copies/mine.yaml", "--json", "-")

    def test_keeps_what_is_another_stages(self):
        self.run_program(*self.arguments("sensor.txt", "--epochs", 1))
        self.config("second.yaml", name="second")
        self.run_program(*self.arguments("sensor.txt", "--epochs", 1, config="second.yaml"))
        heads = [line.split()[1] for line in self.text("sensor.txt").splitlines() if line.startswith("stage ")]
        self.assertEqual(sorted(heads), ["second", "sensor"])

    def test_refusals(self):
        self.run_program(*self.arguments("sensor.txt", "--epochs", 1))
        self.complains(self.arguments("x.txt", "--stage", "eye"), "eye", "sensor")
        self.complains(["train", "servo_actuator", "run.bag", "-o", "x.txt"], "no network to train")
        self.complains(self.arguments("x.txt", "--feedback", "some"), "--feedback", "none, own or all")
        self.complains(self.arguments("x.txt", "--horizon", 0.1, "--cold", 0.2), "--cold", "--horizon")
        self.complains(self.arguments("run.bag"), "run.bag")
        (self.folder / "notes.txt").write_text("mine\n")
        self.complains(self.arguments("notes.txt"), "notes.txt", "it is kept")
        self.assertEqual(self.text("notes.txt"), "mine\n")
        self.config("wider.yaml", hidden=5)
        wider = self.arguments("x.txt", "--from", "sensor.txt", config="wider.yaml")
        self.complains(wider, "sensor.txt", "another structure")
        self.complains(["diagnose", "run.bag", "--config", "wider.yaml"], "sensor.txt: sensor: ", "another structure")
        text = self.text("sensor.txt")
        (self.folder / "sensor.txt").write_text(text[: len(text) // 2])
        self.complains(["diagnose", "run.bag", "--config", "net.yaml"], "sensor.txt: the file is damaged or cut off")
        self.run_program("simulate", RIG, "--duration", 0.05, "--quiet", "-o", "short.bag")
        self.complains(["train", RIG, "short.bag", "--config", "net.yaml", "-o", "x.txt"], "short.bag", "record longer")
        self.assertFalse((self.folder / "x.txt").exists())


if __name__ == "__main__":
    unittest.main()
