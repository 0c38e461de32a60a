"""Every subcommand on a rig outside the tree: simulated runs of examples/cascaded_tanks, and the measured ones where
they are (a folder data/cascaded_tanks in `shared` beside the checkout, or named by FAULTLINE_SHARED)."""

import csv
import json
import os
import pathlib
import tempfile
import unittest

import yaml
from packages import OutsideTest, ROOT, build, copied, plain_environment, program, run

RIG = "cascaded_tanks"
SHARED = pathlib.Path(os.environ.get("FAULTLINE_SHARED", ROOT.parent / "shared"))
MEASURED = SHARED / "data/cascaded_tanks/tanque.csv"


def setUpModule():
    """The package, and runs of a rig that is off its datasheet: two healthy, one that clogs; and two of one as in its
    datasheet that overflow."""
    global space, path, package
    space = tempfile.TemporaryDirectory(prefix="faultline_tanks_")
    path = pathlib.Path(space.name).resolve()
    package = copied(RIG, path / RIG)
    build(package)
    rig = ("--off-nominal", "--rig-seed", "7", "--duration", "8000")
    simulate("one", "--seed", "1", *rig)
    simulate("two", "--seed", "2", *rig)
    simulate("clogs", "--seed", "3", *rig, "--fault", "lower_outlet_clogged")
    simulate("over_one", "--seed", "4", "--fault", "upper_tank_overflows")
    simulate("over_two", "--seed", "5", "--fault", "upper_tank_overflows")


def tearDownModule():
    space.cleanup()


def simulate(name, *options):
    run(program(), "simulate", RIG, *options, "-o", f"{name}.bag", env=tanks(), cwd=path)


def tanks():
    return plain_environment(FAULTLINE_RIG_PATH=str(package), MPLBACKEND="Agg", MPLCONFIGDIR=str(path))


class Tanks(OutsideTest):
    @property
    def env(self):
        return tanks()

    def bag(self, name):
        return path / f"{name}.bag"

    def write_network(self):
        sheet = yaml.safe_load((path / RIG / "config" / RIG / "rig.yaml").read_text())
        sheet["estimators"] = [
            {
                "name": "level_network",
                "type": "network",
                "weights": "level.txt",
                "inputs": "pump_voltage, lower_level.smooth",
                "outputs": "lower_level",
                "cut_off": 0.02,
                "lags": 1,
                "hidden": 3,
                "feedback": "none",
            }
        ]
        sheet.update(detectors=[], isolators=[])
        (self.folder / "net.yaml").write_text(yaml.safe_dump(sheet, sort_keys=False))

    def report(self, bag):
        env = dict(self.env, FAULTLINE_PROGRAM=program())
        run("/usr/bin/python3", ROOT / "scripts/report.py", bag, "-o", "report.html", env=env, cwd=self.folder)
        return (self.folder / "report.html").read_text()

    def answer(self, *words):
        self.faultline(*words, "--json", "answer.json")
        return json.loads((self.folder / "answer.json").read_text())


class Simulated(Tanks):
    def test_rigs(self):
        rig = self.answer("rigs", RIG)["rigs"][0]
        self.assertEqual(rig["sample_period"], 4)
        self.assertTrue(rig["simulated"] and rig["diagnosed"])
        self.assertGreaterEqual(len(rig["profiles"]), 1)

    def test_simulate_is_repeatable(self):
        for name in ("a.csv", "b.csv"):
            self.faultline("simulate", RIG, "--seed", "3", "--duration", "400", "-o", name)
        self.assertEqual((self.folder / "a.csv").read_bytes(), (self.folder / "b.csv").read_bytes())
        rows = list(csv.DictReader((self.folder / "a.csv").read_text().splitlines()))
        self.assertEqual(len(rows), 101)

    def test_export_and_import_are_inverse(self):
        self.faultline("export", self.bag("one"), "-o", "one.csv")
        self.faultline("import", "one.csv", "--rig", RIG, "-o", "again.bag")
        self.faultline("export", "again.bag", "-o", "again.csv")
        self.assertEqual((self.folder / "one.csv").read_bytes(), (self.folder / "again.csv").read_bytes())

    def test_diagnose(self):
        self.assertEqual(self.answer("diagnose", self.bag("one"))["verdict"], "healthy")
        alarms = self.answer("diagnose", self.bag("clogs"))["alarms"]
        self.assertIn(("clogging", "restriction.lower_outlet"), [(a["effect"], a["port"]) for a in alarms])

    def spoilt(self, bag, change):
        self.faultline("export", self.bag(bag), "-o", "whole.csv")
        head, *rows = (self.folder / "whole.csv").read_text().splitlines()
        (self.folder / "spoilt.csv").write_text("\n".join([head, *change(rows)]) + "\n")
        return "spoilt.csv"

    def test_diagnose_where_single_rows_are_missing(self):
        for change in (
            lambda rows: [row for k, row in enumerate(rows) if k % 43 != 7],
            lambda rows: [row.rsplit(",", 1)[0] + ",nan" if k % 43 == 7 else row for k, row in enumerate(rows)],
        ):
            alarms = self.answer("diagnose", self.spoilt("clogs", change), "--rig", RIG)["alarms"]
            self.assertIn(("clogging", "restriction.lower_outlet"), [(a["effect"], a["port"]) for a in alarms])

    def test_nothing_is_said_of_readings_that_are_none(self):
        spoilt = self.spoilt("one", lambda rows: [row.rsplit(",", 1)[0] + ",nan" for row in rows])
        for words in (("gap", spoilt, "--rig", RIG), ("fit", RIG, spoilt)):
            said = self.faultline(*words, code=2).stderr.splitlines()
            self.assertIn("spoilt.csv: every reading of every output is missing", said[-1])

    def test_fit(self):
        answer = self.answer("fit", RIG, self.bag("one"), self.bag("two"), "--patch", "fitted.yaml")
        self.assertEqual(
            {p["name"] for p in answer["parameters"]}, {"pump_gain", "upper_outlet", "lower_outlet", "outlet_drop"}
        )
        level = answer["channels"][0]
        self.assertGreater(level["before"], 10 * level["noise"])
        self.assertLess(level["after"], 1.5 * level["noise"])
        # The fitted datasheet is one, and knows the rig's equations.
        fitted = self.answer("rigs", "--config", "fitted.yaml")["rigs"][0]
        self.assertTrue(fitted["simulated"])
        self.faultline("diagnose", self.bag("two"), "--config", "fitted.yaml")

    def test_tune(self):
        answer = self.answer("tune", RIG, self.bag("one"), self.bag("two"), "--patch", "tuned.yaml")
        self.assertIn("model_fit", [threshold["detector"] for threshold in answer["thresholds"]])
        self.faultline("diagnose", self.bag("two"), "--config", "tuned.yaml")

    def test_isolability(self):
        faults = self.answer("isolability", self.bag("two"))["faults"]
        least = {(fault["effect"], fault["port"]): fault["least_size"] for fault in faults}
        self.assertLess(least["clogging", "restriction.lower_outlet"], 0.1)
        self.assertIn(("crack", "flow.upper_reservoir"), least)  # the package's own effect

    def test_gap(self):
        answer = self.answer("gap", self.bag("over_one"), "--holdout", self.bag("over_two"), "--report", "gap.html")
        named = [(effect["effect"], effect["port"]) for effect in answer["cause"]["effects"]]
        self.assertEqual(named, [("overflow", "flow.upper_lower")])
        self.assertGreater((self.folder / "gap.html").stat().st_size, 10000)

    def test_report(self):
        text = self.report(self.bag("clogs"))
        self.assertIn("Two tanks, one above the other", text)  # the datasheet's title: it was found
        self.assertIn("outlet of the lower tank", text)


    def test_simulate_drives_the_model_by_a_run(self):
        self.faultline("simulate", RIG, "--drive", self.bag("one"), "--no-noise", "-o", "driven.csv")
        self.faultline("export", self.bag("one"), "-o", "one.csv")
        driven, run = (
            list(csv.DictReader((self.folder / name).read_text().splitlines())) for name in ("driven.csv", "one.csv")
        )
        self.assertEqual(len(driven), len(run))
        column = next(name for name in run[0] if name.startswith("pump_voltage"))
        self.assertEqual([row[column] for row in driven], [row[column] for row in run])
        level = next(name for name in run[0] if name.startswith("lower_level"))
        off = [float(a[level]) - float(b[level]) for a, b in zip(driven, run)]
        self.assertLess(max(map(abs, off)), 3)  # V of 10: the model is off by its tolerances, not elsewhere
        self.assertGreater(max(map(abs, off)), 0.05)

    def test_explain(self):
        variables = self.answer("explain", self.bag("one"))["variables"]
        (level,) = [variable for variable in variables if variable["name"] == "lower_level"]
        self.assertEqual(level["first"][0]["by"], "pump_voltage")
        self.assertGreater(level["first"][0]["gain"], level["first"][0]["chance_most"])

    def test_train(self):
        self.write_network()
        told = self.answer(
            "train", RIG, self.bag("one"), "--config", "net.yaml", "--epochs", "10", "-o", "level.txt"
        )
        rms = [epoch["rms"] for epoch in told["epochs"]]
        self.assertLess(rms[-1], 0.9 * rms[0])
        self.faultline("diagnose", self.bag("two"), "--config", "net.yaml")


if MEASURED.is_file():

    class Measured(Tanks):
        def setUp(self):
            super().setUp()
            for name, part in (("estimation", "Est"), ("validation", "Val")):
                mapping = self.folder / f"{name}.yaml"
                mapping.write_text(
                    "time: {period: 4, unit: s}\n"
                    f"channels: {{pump_voltage: u{part}, lower_level: y{part}}}\n"
                )
                self.faultline("import", MEASURED, "--rig", RIG, "--mapping", mapping, "-o", f"{name}.bag")

        def test_every_subcommand_takes_them(self):
            self.write_network()
            self.assertIn("Two tanks, one above the other", self.report("validation.bag"))
            for words in (
                ("export", "estimation.bag", "-o", "again.csv"),
                ("fit", RIG, "estimation.bag", "--json", "fit.json", "--patch", "fitted.yaml"),
                ("diagnose", "validation.bag", "--json", "diagnose.json"),
                ("isolability", "validation.bag", "--json", "isolability.json"),
                ("tune", RIG, "estimation.bag", "validation.bag", "--block", "400", "--json", "tune.json"),
                ("gap", "estimation.bag", "--holdout", "validation.bag", "--json", "gap.json"),
                ("simulate", RIG, "--drive", "validation.bag", "-o", "driven.csv"),
                ("explain", "estimation.bag", "--json", "explain.json"),
                ("train", RIG, "estimation.bag", "--config", "net.yaml", "--epochs", "3", "-o", "level.txt"),
            ):
                with self.subTest(subcommand=words[0]):
                    print(" ".join(words), self.faultline(*words).stdout)
            # What is published of this stand: the upper tank overflows, and water of it falls into the lower one.
            ranked = json.loads((self.folder / "gap.json").read_text())["cause"]["ranked"]
            self.assertEqual((ranked[0]["effect"], ranked[0]["port"]), ("overflow", "flow.upper_lower"))
            fit = json.loads((self.folder / "fit.json").read_text())["channels"][0]
            self.assertLess(fit["after"], fit["before"])

else:
    print(f"{MEASURED}: the measured tanks are not here; simulated ones only")


if __name__ == "__main__":
    unittest.main()
