"""fit and tune: their answers as JSON, the datasheets they write, and what they refuse."""
import json
import pathlib
import re
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from program import ROOT, ProgramTest  # noqa: E402

CONFIG = ROOT / "config/servo_actuator/rig.yaml"


class Fit(ProgramTest):
    def test_estimates_and_patch(self):
        run = self.simulate("a.bag", "--profile", "prbs", "--nuisance", duration=5)
        said = self.run_program("fit", "servo_actuator", run, "--json", "-", "--patch", "mine.yaml").stdout
        fit = json.loads(said)
        self.assertEqual(fit["rig"], "servo_actuator")
        self.assertEqual(fit["segments"], 20)
        found = {p["name"]: p for p in fit["parameters"]}
        self.assertLess(abs(found["coulomb_friction"]["estimate"] / 400 - 1), 0.03)
        for p in fit["parameters"]:
            self.assertLess(p["low"], p["estimate"])
            self.assertLess(p["estimate"], p["high"])
            self.assertEqual(p["determined"], p["reason"] == "")
        listed = json.loads(self.run_program("rigs", "servo_actuator", "--config", "mine.yaml", "--json", "-").stdout)
        values = {p["name"]: p["nominal"] for p in listed["rigs"][0]["parameters"]}
        self.assertAlmostEqual(values["coulomb_friction"] / found["coulomb_friction"]["estimate"], 1, places=5)
        self.assertEqual(values["ram_area"], 6.33e-4)

    def test_patches_what_stands_for_one_per_branch(self):
        words = ["--profile", "valve_steps", "--duration", 2, "--seed", 3, "--quiet"]
        self.run_program("simulate", "cooling_circuit", *words, "-o", "c.bag")
        said = self.run_program("fit", "cooling_circuit", "c.bag", "--json", "-", "--patch", "mine.yaml").stdout
        found = {p["name"]: p for p in json.loads(said)["parameters"]}
        listed = json.loads(self.run_program("rigs", "cooling_circuit", "--config", "mine.yaml", "--json", "-").stdout)
        values = {p["name"]: p for p in listed["rigs"][0]["parameters"]}
        branches = [name for name in found if re.match("(m|v1|v2|v3|t)_", name)]
        self.assertEqual(len(branches), 25)
        for name in found:
            self.assertAlmostEqual(values[name]["nominal"] / found[name]["estimate"], 1, places=5, msg=name)
        # One tolerance of all has become one of each.
        self.assertEqual(len({values[name]["tolerance"] for name in branches if name.endswith("_c")}), 5)

    def test_no_tolerance_is_written_that_a_datasheet_refuses(self):
        run = self.simulate("a.bag", "--profile", "prbs", duration=2)
        text = re.sub(r"tolerance: 0\.[0-9]+", "tolerance: 0.49", CONFIG.read_text())
        text = re.sub(r"(name: viscous_damping.*?nominal: )[0-9.]+", r"\g<1>1500", text)
        (self.folder / "wide.yaml").write_text(text)
        done = self.run_program("fit", "servo_actuator", run, "--config", "wide.yaml", "--patch", "mine.yaml")
        self.assertIn("viscous_damping", done.stdout)
        self.assertIn("mine.yaml: viscous_damping has the tolerance 0.499 there", done.stderr)
        self.run_program("rigs", "servo_actuator", "--config", "mine.yaml")

    def test_without_a_mark_those_with_a_tolerance_count(self):
        run = self.simulate("a.bag", "--profile", "prbs", duration=3)
        text = CONFIG.read_text().replace("identify: true, ", "")
        text = re.sub(r"tolerance: [0-9.]+", "tolerance: 0", text)
        text = re.sub(r"(name: coulomb_friction.*?)tolerance: 0", r"\1tolerance: 0.06", text)
        (self.folder / "unmarked.yaml").write_text(text)
        done = self.run_program("fit", "servo_actuator", run, "--config", "unmarked.yaml", "--json", "-")
        self.assertEqual([p["name"] for p in json.loads(done.stdout)["parameters"]], ["coulomb_friction"])
        self.assertIn("those with a tolerance are estimated", done.stderr)

    def test_what_import_put_between_samples_tells_nothing(self):
        self.run_program("simulate", "servo_actuator", "--profile", "prbs", "--duration", 3, "--quiet", "-o", "all.csv")
        names, *rows = (self.folder / "all.csv").read_text().splitlines()
        (self.folder / "slow.csv").write_text("\n".join([names, *rows[::5]]) + "\n")
        self.run_program("import", "slow.csv", "--rig", "servo_actuator", "--resample", "rig", "-o", "filled.bag")
        slow, filled = (
            self.run_program("fit", "servo_actuator", file, "--json", "-") for file in ("slow.csv", "filled.bag")
        )
        self.assertIn("one in 5 rows", filled.stderr)
        self.assertNotIn("one in", slow.stderr)
        for a, b in zip(json.loads(slow.stdout)["parameters"], json.loads(filled.stdout)["parameters"]):
            near = 0.05 * (a["high"] - a["low"]) + 1e-3 * abs(a["estimate"])
            self.assertAlmostEqual(a["estimate"], b["estimate"], delta=near)

    def test_refusals(self):
        run = self.simulate("a.bag", duration=1)
        text = re.sub("tolerance: [0-9.]+", "tolerance: 0", CONFIG.read_text().replace("identify: true, ", ""))
        (self.folder / "exact.yaml").write_text(text)
        self.complains(["fit", "servo_actuator", run, "--config", "exact.yaml"], "exact.yaml", "identify: true")
        self.complains(["fit", "servo_actuator", "none.bag"], "none.bag")
        short = self.simulate("b.bag", duration=0.2)
        self.complains(["fit", "servo_actuator", short], "b.bag", "record longer")


class Tune(ProgramTest):
    def test_thresholds_and_patch(self):
        run = self.simulate("a.bag", "--nuisance", "--off-nominal", duration=90)
        answer = json.loads(
            self.run_program(
                "tune", "servo_actuator", run, "--keep-noise", "--rate", 0.1, "--json", "-", "--patch", "tuned.yaml"
            ).stdout
        )
        thresholds = {t["detector"]: t for t in answer["thresholds"]}
        self.assertIn("internal_leak", thresholds)
        for t in answer["thresholds"]:
            self.assertGreaterEqual(t["upper"], t["chosen"])
            self.assertGreaterEqual(t["blocks"], 8)
        # Healthy runs may stay below what any leak needs.
        chosen = max(0, thresholds["internal_leak"]["chosen"])
        self.assertIn(f"threshold: {chosen:.4e}", (self.folder / "tuned.yaml").read_text())
        self.run_program("diagnose", run, "--config", "tuned.yaml")

    def test_patches_stages_on_one_line(self):
        run = self.folder / "c.bag"
        self.run_program("simulate", "pump_cylinder", "--off-nominal", "--duration", 42, "--quiet", "-o", run)
        words = ["tune", "pump_cylinder", run, "--keep-noise", "--block", 5, "--json", "-", "--patch", "tuned.yaml"]
        thresholds = {t["detector"]: t for t in json.loads(self.run_program(*words).stdout)["thresholds"]}
        text = (self.folder / "tuned.yaml").read_text()
        pump = thresholds["pump1_follows"]["chosen"]
        # No healthy run has a replaced reading, so its threshold stays.
        self.assertEqual(thresholds["chamber_a_pressure_replaced"]["chosen"], 1)
        self.assertRegex(text, f"name: pump1_follows, .* low: {-pump:.4e}, high: {pump:.4e}, ")
        self.run_program("diagnose", run, "--config", "tuned.yaml")

    def test_refusals(self):
        run = self.simulate("a.bag", duration=20)
        self.complains(["tune", "servo_actuator", run, "--keep-noise"], "blocks")
        self.complains(["tune", "servo_actuator", run, "--stage", "nobody"], "nobody", "leak_filter")


if __name__ == "__main__":
    unittest.main()
