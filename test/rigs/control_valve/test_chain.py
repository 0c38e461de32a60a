"""Histograms and chain on simulated runs of this rig: what is healthy, where one fault and two faults lie, what a
supply that was never met brings with it, and what fits no place. Levels of some seconds instead of a minute, and times
of the stages that are shorter in proportion, so that an hour of learning is enough."""
import json
import pathlib
import sys
import unittest

import yaml

ROOT = pathlib.Path(__file__).resolve().parents[3]
sys.path[:0] = [str(ROOT / "test/cli"), str(ROOT / "scripts/studies/control_valve")]
from program import ProgramTest
from valve_sizes import SIZES, sized

RIG = "control_valve"
SHORTER = {
    "histogram": {"learn": 2800, "minimum": 15, "window": 204.8, "average": 0.8},
    "chain": {"learn": 1800, "settle": 60},
}
LEARN, RUN, BEGIN = 5400, 600, 200  # s
PRESTAGE_LEAK = "orifice_leakage@flow.prestage_ambient:coefficient=1e-8"
CYLINDER_LEAK = "orifice_leakage@flow.cylinder_ambient:coefficient=8e-7"
VALVE_FRICTION = "coulomb_friction@force.valve:force=20"
CLOGGED = "clogging@restriction.process_valve:fraction=0.1"


def datasheet():
    folder = ROOT / "config" / RIG
    facts, stages = (yaml.safe_load((folder / name).read_text()) for name in ("rig.yaml", "stages.yaml"))
    sheet = {**facts, **stages, "detectors": []}
    for room in ("estimators", "isolators"):
        kept = [stage for stage in stages[room] if stage["type"] in SHORTER]
        sheet[room] = [{**stage, **SHORTER[stage["type"]]} for stage in kept]
    return sheet


class Chain(ProgramTest):
    kept = {}  # what a size learnt

    def setUp(self):
        super().setUp()
        self.use(datasheet(), "as it ships")

    def use(self, sheet, size):
        self.sheet = sheet
        self.write(sheet, "sheet.yaml")
        if size not in self.kept:
            self.record("healthy.bag", 1, LEARN)
            self.run_program("diagnose", "healthy.bag", "--config", "sheet.yaml", "--keep-reference", "learnt")
            self.kept[size] = (self.folder / "learnt").read_bytes()
        (self.folder / "learnt").write_bytes(self.kept[size])

    def write(self, sheet, name):
        (self.folder / name).write_text(yaml.safe_dump(sheet, sort_keys=False, width=10000))
        return name

    def record(self, name, seed, seconds, *effects, config="sheet.yaml"):
        arguments = ["--config", config, "--profile", "steps", "--off-nominal", "--rig-seed", 7, "--nuisance"]
        words = [word for effect in effects for word in ("--effect", f"{effect},from={BEGIN}")]
        arguments += ["--substep", 0.001, "--seed", seed, "--duration", seconds, *words, "--quiet"]
        self.run_program("simulate", RIG, *arguments, "-o", name)
        return name

    def alarms(self, run, config="sheet.yaml"):
        self.run_program("diagnose", run, "--config", config, "--reference", "learnt", "--json", "report.json")
        return json.loads((self.folder / "report.json").read_text())["alarms"]

    def named(self, alarms, within=SHORTER["histogram"]["window"]):
        """Kind, effect@port and modules of each; raised within so many seconds."""
        for alarm in alarms:
            self.assertTrue(BEGIN < alarm["raised"] < BEGIN + within, alarm)
            self.assertTrue(alarm["active"])
        return [
            (alarm["kind"], f'{alarm["effect"]}@{alarm["port"]}', alarm["text"].partition(":")[0]) for alarm in alarms
        ]

    def test_a_healthy_run_says_nothing(self):
        self.assertEqual(self.alarms(self.record("run.bag", 2, RUN)), [])

    def test_one_fault_is_told_by_its_place(self):
        self.assertEqual(
            self.named(self.alarms(self.record("run.bag", 3, RUN, PRESTAGE_LEAK))),
            [("fault", "clogging@restriction.fixed_restrictor", "Nozzle-flapper")],
        )

    def test_two_faults_are_two_alarms(self):
        self.assertEqual(
            self.named(self.alarms(self.record("run.bag", 3, RUN, PRESTAGE_LEAK, VALVE_FRICTION))),
            [
                ("fault", "coulomb_friction@force.valve", "Valve and nozzle-flapper"),
                ("fault", "clogging@restriction.fixed_restrictor", "Nozzle-flapper and valve"),
            ],
        )
        self.assertEqual(
            self.named(self.alarms(self.record("run.bag", 3, RUN, CYLINDER_LEAK, VALVE_FRICTION))),
            [
                ("fault", "coulomb_friction@force.valve", "Valve and actuator"),
                ("fault", "orifice_leakage@flow.cylinder_ambient", "Actuator and valve"),
            ],
        )

    def test_a_supply_or_temperature_that_was_never_met_is_no_fault(self):
        for name, mean in (("supply_pressure", 4.0e5), ("supply_pressure", 6.3e5), ("ambient_temperature", 273)):
            with self.subTest(name, mean=mean):
                inputs = {**self.sheet["inputs"], name: {**self.sheet["inputs"][name], "value": mean}}
                other = self.write({**self.sheet, "inputs": inputs}, "other.yaml")
                run = self.record("run.bag", 4, RUN, config=other)
                self.assertEqual(self.alarms(run), [])

    def test_other_sizes_without_retuning(self):
        for size in SIZES:
            with self.subTest(size):
                self.use(sized(datasheet(), size), size)
                self.assertEqual(self.alarms(self.record("run.bag", 2, RUN)), [])
                alarms = self.alarms(self.record("run.bag", 3, RUN, "clogging@restriction.nozzle:fraction=0.08"))
                self.assertEqual(
                    self.named(alarms, RUN - BEGIN), [("fault", "clogging@restriction.nozzle", "Nozzle-flapper")]
                )
                alarms = self.alarms(self.record("run.bag", 3, RUN, CYLINDER_LEAK))
                self.assertEqual(
                    self.named(alarms, RUN - BEGIN), [("fault", "orifice_leakage@flow.cylinder_ambient", "Actuator")]
                )

    def test_what_nothing_drives_is_its_transducer(self):
        for name, value in (("flapper_position", 3e-6), ("prestage_pressure", 1e4)):
            run = self.record("run.bag", 3, RUN, f"offset@sensor.{name}:value={value:g}")
            told = ("sensor", f"offset@sensor.{name}", f"Transducer of {name}")
            self.assertEqual(self.named(self.alarms(run)), [told])

    def test_what_fits_no_place_is_unknown(self):
        run = self.record("run.bag", 5, RUN, CLOGGED)
        # The valve, its flow meter or its position transducer: no one of three has earned a name.
        alarm = self.alarms(run)[0]
        self.assertEqual(alarm["kind"], "unknown", alarm)
        self.assertEqual(alarm["candidates"][0], "clogging@restriction.process_valve", alarm)
        self.assertEqual(len(alarm["candidates"]), 3, alarm)
        for stage in self.sheet["isolators"]:
            del stage["flow_place"]
        placeless = self.write(self.sheet, "placeless.yaml")
        self.assertEqual(
            self.named(self.alarms(run, placeless)), [("unknown", "@", "Something shifted that names no place")]
        )


if __name__ == "__main__":
    unittest.main()
