"""diagnose: the JSON form keeps its contract, finds the leak it is shown, and says the same of a bag and of its CSV
file."""
import json
import pathlib
import shutil
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from cut_bag import cut_start  # noqa: E402
from program import ROOT, ProgramTest, check_schema  # noqa: E402

SCHEMA = json.loads((ROOT / "docs/diagnose.schema.json").read_text())


class Diagnose(ProgramTest):
    def report(self, *arguments):
        report = json.loads(self.run_program("diagnose", *arguments, "--json", "-").stdout)
        self.assertEqual(check_schema(report, SCHEMA), [])
        return report

    def test_healthy(self):
        bag = self.simulate("a.bag", duration=30)
        report = self.report(bag)
        self.assertEqual(report["verdict"], "healthy")
        self.assertEqual(report["rig"], "servo_actuator")
        self.assertAlmostEqual(report["duration"], 30, places=6)
        self.assertEqual(report["counts"]["samples"], 30001)
        self.assertEqual(report["counts"]["used"], 30001)
        self.assertEqual(report["alarms"], [])
        self.assertIn("--seed 1", report["made_by"])
        self.assertIn("healthy", self.run_program("diagnose", bag).stdout)

    def test_oil_off_by_less_than_its_tolerance_is_no_fault(self):
        # The first stretch has the compliance half a tolerance too high; it is 0.8 too low.
        off = ["--profile", "random", "--seed", 1, "--rig-seed", 5, "--off-nominal", "--nuisance"]
        done = self.run_program("diagnose", self.simulate("soft.bag", *off, duration=12), "--json", "-")
        self.assertEqual(json.loads(done.stdout)["verdict"], "healthy")

    def test_leak_step(self):
        bag = self.simulate("a.bag", "--command", "leak_valve_command:20=0,20.001=5", duration=60)
        report = self.report(bag)
        self.assertEqual(report["verdict"], "fault")
        fault = [alarm for alarm in report["alarms"] if alarm["kind"] == "fault"][0]
        self.assertEqual((fault["effect"], fault["port"]), ("orifice_leakage", "flow.chamber_a_chamber_b"))
        self.assertTrue(fault["active"])
        self.assertGreater(fault["raised"], 20)
        self.assertLess(fault["raised"], 40)
        self.assertGreaterEqual(fault["raised"], fault["since"])
        self.assertEqual(fault["until"], 60)
        self.assertLess(fault["size"]["low"], fault["size"]["value"])
        self.assertLess(fault["size"]["value"], fault["size"]["high"])
        self.assertIn("still there at the end", report["sentence"])

    def test_rankings_over_the_run(self):
        leak = "orifice_leakage@flow.chamber_a_chamber_b:coefficient=1.5e-8,from=6.6"
        bag = self.simulate("a.bag", "--profile", "random", "--effect", leak, duration=14)
        report = self.report(bag)
        rankings = report["rankings"]
        self.assertEqual([round(judgement["time"], 1) for judgement in rankings], [1.5, 3.5, 5.5, 7.5, 9.5, 11.5, 13.5])
        for judgement in rankings:
            self.assertEqual((judgement["stage"], judgement["threshold"]), ("responses", 15))
            self.assertAlmostEqual(judgement["time"] - judgement["judged_until"], 1, places=2)
            if judgement["time"] < 9:
                self.assertEqual((judgement["first"], judgement["since"]), ([], None))
                self.assertLess(judgement["evidence"], 15)
                continue
            best = judgement["first"][0]
            self.assertEqual(
                (best["effect"], best["port"], best["kind"]), ("orifice_leakage", "flow.chamber_a_chamber_b", "fault")
            )
            self.assertEqual((best["size"]["name"], best["size"]["unit"]), ("coefficient", "m^3/(s sqrt(Pa))"))
            self.assertLess(best["size"]["low"], 1.5e-8)
            self.assertGreater(best["size"]["high"], 1.5e-8)
            self.assertAlmostEqual(best["size"]["value"], 1.5e-8, delta=0.3e-8)
            self.assertGreater(best["evidence"], 50)
            self.assertAlmostEqual(judgement["since"], 8, places=2)
            evidences = [cause["evidence"] for cause in judgement["first"]]
            self.assertEqual(evidences, sorted(evidences, reverse=True))

    def test_unknown_types_are_refused_with_their_line(self):
        bag = self.simulate("a.bag", duration=1)
        for kind, given in (("estimator", "fault_response"), ("detector", "consistency"), ("isolator", "response")):
            folder = self.folder / kind / "servo_actuator"
            shutil.copytree(ROOT / "config/servo_actuator", folder)
            stages = folder / "stages.yaml"
            lines = stages.read_text().splitlines()
            at = next(k for k, line in enumerate(lines) if line.strip() == "type: " + given)
            lines[at] = lines[at].replace(given, "wishful")
            stages.write_text("\n".join(lines) + "\n")
            said = self.complains(
                ("diagnose", bag, "--config", folder), "there is no " + kind + " type 'wishful'", given
            )
            self.assertIn("stages.yaml:{}:".format(at), said)  # the stage's first line, which names it

    def test_bag_and_csv_say_the_same(self):
        bag = self.simulate("a.bag", "--command", "leak_valve_command:5=0,5.001=5", duration=40)
        self.run_program("export", bag, "-o", "a.csv")
        from_bag = self.report(bag)
        from_csv = self.report("a.csv", "--rig", "servo_actuator")
        from_bag.pop("made_by"), from_csv.pop("made_by")
        self.assertEqual(from_bag, from_csv)

    def test_missing_numbers_are_a_data_alarm(self):
        lines = self.simulate("a.csv", duration=10).read_text().splitlines()
        column = lines[0].split(",").index("load_pressure")
        for k in range(4001, 6001):
            cells = lines[k].split(",")
            cells[column] = "nan"
            lines[k] = ",".join(cells)
        (self.folder / "b.csv").write_text("\n".join(lines) + "\n")
        report = self.report("b.csv", "--rig", "servo_actuator")
        data = [alarm for alarm in report["alarms"] if alarm["kind"] == "data"]
        self.assertEqual(report["verdict"], "data")
        self.assertEqual(len(data), 1)
        self.assertEqual(data[0]["port"], "sensor.load_pressure")
        self.assertAlmostEqual(data[0]["since"], 4.0, places=3)
        self.assertAlmostEqual(data[0]["until"], 5.999, places=3)
        self.assertEqual(report["counts"]["missing"], 2000)

    def test_a_gap_is_told_and_survived(self):
        lines = self.simulate("a.csv", duration=10).read_text().splitlines()
        (self.folder / "b.csv").write_text("\n".join(lines[:3001] + lines[5001:]) + "\n")
        report = self.report("b.csv", "--rig", "servo_actuator")
        self.assertEqual(report["counts"]["gaps"], 1)
        self.assertEqual(report["counts"]["restarts"], 2)
        self.assertEqual([alarm["kind"] for alarm in report["alarms"]], ["data"])
        self.assertEqual(report["alarms"][0]["level"], "stale")

    def test_a_missing_start_is_counted(self):
        whole, cut = self.simulate("a.bag", duration=3), self.folder / "cut.bag"
        self.assertEqual(self.report(whole)["counts"]["missed_at_start"], 0)
        self.assertNotIn("missed at the start", self.run_program("diagnose", whole).stderr)
        cut_start(whole, cut, 196)
        self.assertEqual(self.report(cut)["counts"]["missed_at_start"], 196)
        said = self.run_program("diagnose", cut).stderr
        self.assertIn("cut.bag: 196 samples missed at the start of the run", said)
        # By the first sample's number where nothing else tells it.
        self.run_program("export", cut, "-o", "cut.csv")
        report = self.report("cut.csv", "--rig", "servo_actuator")
        self.assertEqual(report["counts"]["missed_at_start"], 196)
        self.run_program("import", "cut.csv", "--rig", "servo_actuator", "-o", "back.bag")
        self.assertEqual(self.report("back.bag")["counts"]["missed_at_start"], 196)

    def test_of_a_bag_of_two_runs_both_starts_count(self):
        whole = self.simulate("a.bag", duration=3)
        cut_start(whole, self.folder / "one.bag", 100)
        cut_start(whole, self.folder / "both.bag", 100, again=30)
        self.assertEqual(self.report("one.bag")["counts"]["missed_at_start"], 100)
        self.assertEqual(self.report("both.bag")["counts"]["missed_at_start"], 130)

    def test_series_of_every_sample(self):
        bag = self.simulate("a.bag", duration=6)
        self.run_program("diagnose", bag, "--series", "all.csv", "--series-rows", "6001")
        self.run_program("export", bag, "-o", "a.csv")
        rows = [line.split(",") for line in (self.folder / "all.csv").read_text().splitlines()]
        full = [line.split(",") for line in (self.folder / "a.csv").read_text().splitlines()]
        self.assertEqual(len(rows), 6002)
        position, recorded = rows[0].index("position"), full[0].index("position")
        off = [abs(float(r[position]) - float(f[recorded])) for r, f in zip(rows[1:], full[1:])]
        self.assertLess(max(off), 1e-8)
        self.run_program("diagnose", bag, "--series", "few.csv", "--series-rows", "10")
        self.assertLessEqual(len((self.folder / "few.csv").read_text().splitlines()), 17)

    def test_series(self):
        bag = self.simulate("a.bag", "--effect", "offset@sensor.velocity:value=0.05,from=3.0", duration=10)
        self.run_program("diagnose", bag, "--series", "series.csv")
        lines = (self.folder / "series.csv").read_text().splitlines()
        self.assertLessEqual(len(lines), 4001)
        self.assertGreater(len(lines), 2000)
        header = lines[0].split(",")
        for name in (
            "t",
            "load_pressure",
            "x.position",
            "x.position.std",
            "i.velocity",
            "i.velocity.std",
            "normalised_innovation",
        ):
            self.assertIn(name, header)
        rows = [[float(cell) for cell in line.split(",")] for line in lines[1:]]
        self.assertTrue(all(len(row) == len(header) for row in rows))
        times = [row[0] for row in rows]
        self.assertEqual(times, sorted(times))
        self.assertTrue(0 <= times[0] < 0.01 and 9.98 < times[-1] <= 10)
        # No extreme is lost by thinning out.
        self.run_program("export", bag, "-o", "a.csv")
        full = (self.folder / "a.csv").read_text().splitlines()
        column = full[0].split(",").index("velocity")
        velocity = [float(line.split(",")[column]) for line in full[1:]]
        thinned = [row[header.index("velocity")] for row in rows]
        self.assertAlmostEqual(max(velocity), max(thinned), places=6)
        self.assertAlmostEqual(min(velocity), min(thinned), places=6)

    def cooling(self, name, *arguments):
        self.run_program(
            "simulate",
            "cooling_circuit",
            "--profile",
            "steady",
            "--duration",
            6,
            "--nuisance",
            "--quiet",
            *arguments,
            "-o",
            name,
        )
        return name

    def test_a_kept_reference_shows_a_leak_that_is_there_from_the_start(self):
        self.cooling("healthy.bag", "--seed", 51)
        self.cooling("leak.bag", "--seed", 52, "--effect", "orifice_leakage@flow.v2_outlet_ambient:coefficient=2e-8")
        self.assertEqual(self.report("healthy.bag", "--keep-reference", "rig.reference")["verdict"], "healthy")
        self.assertEqual(self.report("leak.bag")["verdict"], "healthy")  # learnt as normal
        report = self.report("leak.bag", "--reference", "rig.reference")
        self.assertEqual(report["verdict"], "fault")
        self.assertEqual(
            (report["alarms"][0]["effect"], report["alarms"][0]["port"]), ("orifice_leakage", "flow.v2_outlet_ambient")
        )
        self.assertAlmostEqual(report["alarms"][0]["size"]["value"], 2e-8, delta=2e-9)
        self.assertEqual(self.report("healthy.bag", "--reference", "rig.reference")["verdict"], "healthy")

        kept = (self.folder / "rig.reference").read_text()
        (self.folder / "cut.reference").write_text(kept[: len(kept) // 2])
        self.complains(
            ["diagnose", "leak.bag", "--reference", "cut.reference"], "cut.reference: ", "damaged or cut off"
        )
        self.complains(["diagnose", "leak.bag", "--keep-reference", "cut.reference"], "cut.reference: ", "it is kept")
        self.assertEqual((self.folder / "cut.reference").read_text(), kept[: len(kept) // 2])
        bag = (self.folder / "leak.bag").read_bytes()
        (self.folder / "old.bag").write_bytes(bag)
        self.complains(["diagnose", "leak.bag", "--keep-reference", "old.bag"], "old.bag: ", "no file of references")
        self.assertEqual((self.folder / "old.bag").read_bytes(), bag)
        servo = self.simulate("servo.bag")
        self.complains(
            ["diagnose", servo, "--reference", "rig.reference"],
            "rig.reference:2: ",
            "cooling_circuit",
            "servo_actuator",
        )
        done = self.run_program("diagnose", servo, "--keep-reference", "servo.reference", check=2)
        self.assertIn("nothing was learnt", done.stderr)
        self.assertFalse((self.folder / "servo.reference").exists())
        self.assertEqual([name for name in self.files() if "reference." in name], [])

    def test_a_kind_of_alarm_that_there_is_not_is_named_with_file_and_line(self):
        bag = self.simulate("a.bag")
        shutil.copytree(ROOT / "config/servo_actuator", self.folder / "own")
        stages = self.folder / "own/stages.yaml"
        text = stages.read_text()
        stages.write_text(text.replace("kind: fault", "kind: falt", 1))
        line = 1 + text[: text.index("- name: internal_leak")].count("\n")
        self.complains(
            ["diagnose", bag, "--config", "own"],
            f"own/stages.yaml:{line}: ",
            "there is no kind 'falt'; allowed are fault, " "sensor, model, unknown, data",
        )

    def test_config_of_ones_own(self):
        bag = self.simulate("a.bag")
        report = self.report(bag, "--config", ROOT / "config/servo_actuator")
        self.assertEqual(report["rig"], "servo_actuator")


class SchemaCheck(unittest.TestCase):
    def test_the_check_can_fail(self):
        self.assertTrue(check_schema({}, SCHEMA))
        self.assertTrue(check_schema({"rig": 3}, {"properties": {"rig": {"type": "string"}}}))
        self.assertTrue(check_schema(True, {"type": "number"}))


if __name__ == "__main__":
    unittest.main()
