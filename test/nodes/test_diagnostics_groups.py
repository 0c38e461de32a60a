"""Every status of a rig's nodes stands in one group of launch/diagnostics.yaml, whatever its stages are called."""

import pathlib
import re
import unittest

import yaml

ROOT = pathlib.Path(__file__).resolve().parents[2]
KINDS = ["fault", "sensor", "model", "unknown", "data"]


class Groups(unittest.TestCase):
    def setUp(self):
        analyzers = yaml.safe_load((ROOT / "launch/diagnostics.yaml").read_text())["analyzers"]
        self.groups = {entry["path"]: entry["regex"] for entry in analyzers.values()}

    def groups_of(self, name):
        return [path for path, patterns in self.groups.items() if any(re.search(p, name) for p in patterns)]

    def test_nodes_are_nodes_whatever_their_stages_are_called(self):
        for config in sorted((ROOT / "config").glob("*/stages.yaml")):
            rig = config.parent.name
            stages = [stage["name"] for stage in yaml.safe_load(config.read_text())["estimators"]]
            for words in (*stages, ", ".join(stages), "samples", "alarms", "gap", "models", "data_driver"):
                for name in (f"{rig}/kalman: {words}", f"press_1/{rig}/kalman: {words}"):
                    self.assertEqual(self.groups_of(name), ["Nodes"], name)

    def test_alarms_and_verdicts_are_no_nodes(self):
        for kind in KINDS:
            for name in (f"servo_actuator: {kind}", f"press/servo_actuator: {kind} force.piston"):
                self.assertEqual(self.groups_of(name), ["Alarms"], name)
        self.assertEqual(self.groups_of("press/servo_actuator: verdict"), ["Rigs"])


if __name__ == "__main__":
    unittest.main()
