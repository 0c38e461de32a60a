"""The node graph on a rig outside the tree: the package's launch file, and what a node says of a rig that it cannot
load."""

import json
import unittest

from packages import FOREIGN, OutsideTest, ROOT, build, copied, environment, program, run

from graph import Graph  # packages makes it known

RIG = "cascaded_tanks"
LISTEN = str(ROOT / "test/nodes/listen.py")
# Slow enough for the gap node to learn what is normal while another suite runs.
ARGUMENTS = ["rate:=50", "duration:=5600", "fault:=lower_outlet_clogged"]


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

    def offline(self, samples):
        """What the program says of samples that were heard."""
        begin = samples[0]["time"]
        table, bag, answer = (self.folder / name for name in ("heard.csv", "heard.bag", "heard.json"))
        names = ("pump_voltage", "lower_level")
        rows = [",".join(("t",) + names)]
        for sample in samples:
            rows.append(",".join([f"{(sample['time'] - begin) * 1e-9:.9f}"] + [repr(v) for v in sample["values"]]))
        table.write_text("\n".join(rows) + "\n")
        for command in (["import", table, "--rig", RIG, "-o", bag], ["diagnose", bag, "--json", answer]):
            run(program(), *command, env=self.graph.environment)
        return json.loads(answer.read_text())["alarms"]

    def test_the_packages_launch_file_diagnoses(self):
        """Live says what offline says of the same samples, though a recorder listens before the estimators do."""
        heard = self.folder / "heard"
        listener = self.graph.start(["python3", LISTEN, RIG, "60", str(heard), "alarms", "sample", "gap"])
        code, said = self.graph.wait(
            self.graph.start(
                ["roslaunch", RIG, f"{RIG}.launch", "gap:=true", *ARGUMENTS]
            ),
            240,
        )
        self.graph.end(listener)
        self.assertEqual(code, 0, said)
        entries = [json.loads(line) for line in heard.read_text().splitlines()]
        samples = [entry for entry in entries if entry["topic"] == "sample"]
        self.assertEqual([sample["sequence"] for sample in samples], list(range(1401)))
        # The datasheet does not say which gap is normal; the node finds it from the tolerances.
        gaps = [entry for entry in entries if entry["topic"] == "gap"]
        self.assertTrue(gaps)
        for entry in gaps:
            self.assertEqual(entry["channels"], ["lower_level"])
            self.assertGreaterEqual(entry["normal"][0], 1)
        alarms = [entry for entry in entries if entry["topic"] == "alarms"][-1]["alarms"]
        # By which name the clogging is told, the default stages' own tests judge.
        self.assertTrue({"fault", "sensor"} & {alarm["kind"] for alarm in alarms}, alarms)
        offline = self.offline(samples)
        for key in ("kind", "effect", "port"):
            self.assertEqual([alarm[key] for alarm in alarms], [alarm[key] for alarm in offline])
        for live, other in zip(alarms, offline):
            self.assertAlmostEqual((live["since"] - samples[0]["time"]) * 1e-9, other["since"], delta=0.01)
            size = other["size"]["value"] if other["size"] else 0
            self.assertAlmostEqual(live["size"], size, delta=1e-6 * abs(size))

    def test_a_rig_that_cannot_be_loaded_ends_the_node(self):
        (self.package / f"build/devel/lib/lib{RIG}.so").unlink()
        programs = ("alarm_node", "isolator_node", "kalman_node", "rig_simulator_node", "gap_node", "rig_driver_node")
        for program in programs:
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
