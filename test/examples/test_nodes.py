"""The node graph on a rig outside the tree: the package's launch file, and what a node says of a rig that it cannot
load."""

import json
import unittest

from packages import FOREIGN, OutsideTest, ROOT, build, copied, environment, run

from graph import Graph  # packages makes it known

RIG = "cascaded_tanks"
LISTEN = str(ROOT / "test/nodes/listen.py")


class Nodes(OutsideTest):
    def setUp(self):
        super().setUp()
        self.package = copied(RIG, self.folder / RIG)
        devel = build(self.package)
        said = run("bash", "-c", f"source {devel}/setup.bash && env -0", env=environment()).stdout
        sourced = dict(line.split("=", 1) for line in said.split("\0") if "=" in line)
        self.graph = Graph().__enter__()
        self.addCleanup(self.graph.__exit__)
        for name in FOREIGN:
            self.graph.environment.pop(name, None)
        for name in ("CMAKE_PREFIX_PATH", "ROS_PACKAGE_PATH", "LD_LIBRARY_PATH", "PYTHONPATH"):
            if name in sourced:
                self.graph.environment[name] = sourced[name]

    def test_the_packages_launch_file_diagnoses(self):
        heard = self.folder / "heard"
        listener = self.graph.start(["python3", LISTEN, RIG, "60", str(heard), "alarms", "sample"])
        code, said = self.graph.wait(
            self.graph.start(
                ["roslaunch", RIG, f"{RIG}.launch", "rate:=100", "duration:=5600", "fault:=lower_outlet_clogged"]
            ),
            180,
        )
        self.graph.end(listener)
        self.assertEqual(code, 0, said)
        entries = [json.loads(line) for line in heard.read_text().splitlines()]
        self.assertGreaterEqual(sum(entry["topic"] == "sample" for entry in entries), 1390)
        alarms = [entry for entry in entries if entry["topic"] == "alarms"][-1]
        # That the clogging is seen; by which name, the default stages' own tests judge.
        self.assertTrue({"fault", "sensor"} & {alarm["kind"] for alarm in alarms["alarms"]}, alarms)

    def test_a_rig_that_cannot_be_loaded_ends_the_node(self):
        (self.package / f"build/devel/lib/lib{RIG}.so").unlink()
        for program in ("alarm_node", "kalman_node", "rig_simulator_node", "gap_node", "rig_driver_node"):
            node = self.graph.node(program, "some_node", rig=RIG)
            code, said = self.graph.wait(node, 30)
            self.assertEqual(code, 2, said)
            self.assertIn(f"rig '{RIG}': {self.package}: its library lib{RIG}.so is not in", said)
        # Beside it another rig runs, with a warning.
        node = self.graph.node("rig_simulator_node", "other", rig="servo_actuator", duration=0.1)
        code, said = self.graph.wait(node, 30)
        self.assertEqual(code, 0, said)
        self.assertIn(f"rig '{RIG}' is left out", said)


if __name__ == "__main__":
    unittest.main()
