"""Histograms and chain on simulated runs of this rig: what is healthy, where one fault and two faults lie, what a supply
that was never met brings with it, and what fits no place. Levels of some seconds instead of a minute, and times of the
stages that are shorter in proportion, so that an hour of learning is enough."""
import json
import pathlib
import sys
import unittest

import yaml

ROOT = pathlib.Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "test/cli"))
from program import ProgramTest

RIG = "control_valve"
SHORTER = {
    "histogram": {"learn": 2800, "minimum": 15, "window": 204.8, "average": 0.8},
    "chain": {"learn": 1800, "settle": 60},
}
LEARN, RUN, BEGIN = 5400, 900, 200  # s


def datasheet():
    folder = ROOT / "config" / RIG
    facts, stages = (yaml.safe_load((folder / name).read_text()) for name in ("rig.yaml", "stages.yaml"))
    sheet = {**facts, **stages, "detectors": []}
    for room in ("estimators", "isolators"):
        kept = [stage for stage in stages[room] if stage["type"] in SHORTER]
        sheet[room] = [{**stage, **SHORTER[stage["type"]]} for stage in kept]
    return sheet


class Chain(ProgramTest):
    def write(self, sheet, name):
        (self.folder / name).write_text(yaml.safe_dump(sheet, sort_keys=False, width=10000))
        return name

    def record(self, name, seed, seconds, *effects, config="sheet.yaml"):
        arguments = ["--config", config, "--profile", "steps", "--off-nominal", "--rig-seed", 7, "--nuisance"]
        words = [word for effect in effects for word in ("--effect", f"{effect},from={BEGIN},to={BEGIN}.1")]
        arguments += ["--substep", 0.001, "--seed", seed, "--duration", seconds, *words, "--quiet"]
        self.run_program("simulate", RIG, *arguments, "-o", name)
        return name

    def alarms(self, run, config="sheet.yaml"):
        self.run_program("diagnose", run, "--config", config, "--reference", "learnt", "--json", "report.json")
        return json.loads((self.folder / "report.json").read_text())["alarms"]

    def named(self, alarms):
        return sorted(alarm["text"].partition(":")[0] for alarm in alarms)

    def test_places(self):
        sheet = datasheet()
        self.write(sheet, "sheet.yaml")
        self.record("healthy.bag", 1, LEARN)
        self.run_program("diagnose", "healthy.bag", "--config", "sheet.yaml", "--keep-reference", "learnt")

        self.assertEqual(self.alarms(self.record("again.bag", 2, RUN)), [])

        leak = "orifice_leakage@flow.prestage_ambient:coefficient=1e-8"
        friction = "coulomb_friction@force.valve:force=20"
        alarms = self.alarms(self.record("leak.bag", 3, RUN, leak))
        print(alarms)

        alarms = self.alarms(self.record("pair.bag", 3, RUN, leak, friction))
        print(alarms)
        other = "orifice_leakage@flow.cylinder_ambient:coefficient=8e-7"
        alarms = self.alarms(self.record("pair.bag", 3, RUN, other, friction))
        print(alarms)

        elsewhere = {**sheet, "inputs": json.loads(json.dumps(sheet["inputs"]))}
        elsewhere["inputs"]["supply_pressure"]["value"] = 4.0e5
        run = self.record("low.bag", 4, RUN, config=self.write(elsewhere, "low.yaml"))
        print("low", self.alarms(run))
        elsewhere["inputs"]["supply_pressure"]["value"] = 6.3e5
        run = self.record("low.bag", 4, RUN, config=self.write(elsewhere, "low.yaml"))
        print("high", self.alarms(run))
        elsewhere["inputs"]["supply_pressure"]["value"] = 5e5
        elsewhere["inputs"]["ambient_temperature"]["value"] = 273
        run = self.record("low.bag", 4, RUN, config=self.write(elsewhere, "low.yaml"))
        print("cold", self.alarms(run))

        dirt = "clogging@restriction.process_valve:fraction=0.1"
        run = self.record("clogged.bag", 5, RUN, dirt)
        print("clog", self.alarms(run))
        placeless = {**sheet, "isolators": [dict(s) for s in sheet["isolators"]]}
        for stage in placeless["isolators"]:
            del stage["flow_place"]
        print("unknown", self.alarms(run, self.write(placeless, "placeless.yaml")))
        for s in ["offset@sensor.spool_position:value=0.04","offset@sensor.valve_position:value=0.01","offset@sensor.load_torque:value=5","scale@sensor.cylinder_pressure:factor=1.06","offset@sensor.prestage_pressure:value=1e4"]:
            print(s, self.named(self.alarms(self.record("s.bag",6,RUN,s))), self.alarms("s.bag"))


if __name__ == "__main__":
    unittest.main()
