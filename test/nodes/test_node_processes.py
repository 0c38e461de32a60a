"""Nodes as processes: what they say and how they end on bad parameters, without a master, and on good and bad LCM
logs."""

import json
import os
import pathlib
import random
import subprocess
import tempfile
import time
import unittest

from graph import ROOT, Graph, built_environment, devel_space, free_port, read_lcm_log, write_lcm_log

RIG = "servo_actuator"
BAG = str(ROOT / "bags/servo_actuator_healthy.bag")
NODES = (
    "rig_simulator_node",
    "rig_driver_node",
    "kalman_node",
    "parameter_node",
    "histogram_node",
    "neural_node",
    "isolator_node",
    "alarm_node",
    "bag_player_node",
)


def read_lines(path):
    with open(path) as file:
        return [json.loads(line) for line in file if line.endswith("\n")]


class WithoutMaster(unittest.TestCase):
    def test_every_node_says_so_and_ends(self):
        environment = built_environment()
        uri = f"http://127.0.0.1:{free_port()}"
        environment.update({"ROS_MASTER_URI": uri, "ROS_IP": "127.0.0.1"})
        with tempfile.TemporaryDirectory() as folder:
            environment.update({"ROS_HOME": folder, "ROS_LOG_DIR": folder})
            running = [
                subprocess.Popen(
                    [devel_space() / "lib/faultline" / node],
                    env=environment,
                    stdout=subprocess.PIPE,
                    stderr=subprocess.STDOUT,
                    text=True,
                )
                for node in NODES
            ]
            for node, process in zip(NODES, running):
                said, _ = process.communicate(timeout=15)
                self.assertEqual(process.returncode, 1, said)
                self.assertIn(f"{node}: no ROS master at {uri}", said)
                self.assertEqual(len(said.strip().splitlines()), 1, said)


class WithoutClock(unittest.TestCase):
    CLOCK = """
import rospy
from rosgraph_msgs.msg import Clock
rospy.init_node("clock", disable_signals=True)
publisher = rospy.Publisher("/clock", Clock, queue_size=10)
for k in range(10000):
    publisher.publish(Clock(rospy.Time(1000) + rospy.Duration(0.1 * k)))
    rospy.rostime.wallsleep(0.1)
"""

    def test_every_node_says_so_until_there_is_one(self):
        words = "simulated time is on but nobody publishes /clock"
        nodes = ("alarm_node", "isolator_node", "kalman_node", "gap_node", "view_node", "rig_simulator_node")
        with Graph() as graph:
            graph.set("/use_sim_time", True)
            heard = graph.path / "heard"
            graph.start(
                ["python3", str(pathlib.Path(__file__).parent / "listen.py"), RIG, "60", str(heard), "diagnostics"]
            )
            running = {node: graph.node(node, node, rig=RIG) for node in nodes}

            def latest():
                statuses = [s for entry in read_lines(heard) for s in entry["status"]] if heard.exists() else []
                return {node: [s for s in statuses if s["name"].startswith(f"{RIG}/{node}:")][-1:] for node in nodes}

            def wait_for(missing):
                limit = time.monotonic() + 25
                while any(not told or missing != (words in told[0]["message"]) for told in latest().values()):
                    self.assertLess(time.monotonic(), limit, latest())
                    time.sleep(0.2)

            wait_for(True)
            self.assertEqual({told[0]["level"] for told in latest().values()}, {1})
            clock = graph.start(["python3", "-c", self.CLOCK])
            wait_for(False)
            self.assertIsNone(clock.poll())
            for node, process in running.items():
                self.assertEqual(graph.said(process).count(words), 1, graph.said(process))


class BadParameters(unittest.TestCase):
    CASES = [
        # node, parameters, what the line must hold
        ("kalman_node", {}, ["~rig", "missing"]),
        ("kalman_node", {"rig": "pogo_stick"}, ["pogo_stick", RIG]),
        ("kalman_node", {"rig": 7}, ["~rig", "7", "text"]),
        ("kalman_node", {"rig": RIG, "stage": "none_such"}, ["~stage", "none_such", "there are"]),
        ("kalman_node", {"rig": RIG, "stge": "x"}, ["~stge", "unknown", "stage"]),
        ("kalman_node", {"rig": RIG, "wait_for": -1}, ["~wait_for", "-1", "text"]),
        ("parameter_node", {"rig": RIG}, ["no estimator of the family parameter"]),
        ("histogram_node", {"rig": RIG}, ["no estimator of the family histogram"]),
        ("neural_node", {"rig": RIG}, ["no estimator of the family neural"]),
        (
            "parameter_node",
            {"rig": "cooling_circuit", "stage": "branch_filter"},
            ["~stage", "branch_filter", "balances"],
        ),
        ("alarm_node", {"rig": RIG, "patience": 1000.0}, ["~patience", "1000", "0 to 60"]),
        ("alarm_node", {"rig": RIG, "patience": "long"}, ["~patience", "'long'", "number"]),
        ("isolator_node", {"rig": RIG, "reference": __file__}, ["test_node_processes.py", "no file of references"]),
        ("bag_player_node", {"bag": __file__, "recorded": RIG}, ["test_node_processes.py", "cannot be read as a bag"]),
        ("bag_player_node", {"bag": BAG, "recorded": "press_1"}, ["/press_1/sample", "recorded:="]),
        ("rig_simulator_node", {"rig": RIG, "rate": 0}, ["~rate", "0.01 to 100"]),
        ("rig_simulator_node", {"rig": RIG, "output": "tcp"}, ["~output", "'tcp'", "lcm, ros"]),
        ("rig_simulator_node", {"rig": RIG, "profile": "waltz"}, ["waltz", "square"]),
        ("rig_simulator_node", {"rig": RIG, "fault": "gremlin"}, ["gremlin", "internal_leak_ramp"]),
        ("rig_simulator_node", {"rig": RIG, "effects": "wobble@nowhere:x=1"}, ["wobble"]),
        (
            "rig_simulator_node",
            {"rig": RIG, "effects": ["scale@sensor.position:factor=1.1", 5]},
            ["~effects", "place 2"],
        ),
        ("rig_simulator_node", {"rig": RIG, "nuisance": "yes"}, ["~nuisance", "true or false"]),
        ("rig_simulator_node", {"rig": RIG, "output": "lcm", "lcm_url": "pigeon://"}, ["~lcm_url", "pigeon://"]),
        ("rig_driver_node", {"rig": RIG, "log": "/nowhere/session.lcm"}, ["/nowhere/session.lcm", "no such file"]),
        ("rig_driver_node", {"rig": RIG, "log": __file__}, ["not an LCM log"]),
        ("rig_driver_node", {"rig": RIG, "log": "a", "lcm_url": "memq://"}, ["~log", "~lcm_url", "exclude"]),
    ]

    def test_one_line_and_exit_code_2(self):
        with Graph() as graph:
            for number, (node, parameters, wanted) in enumerate(self.CASES):
                with self.subTest(node=node, parameters=parameters):
                    code, said = graph.wait(graph.node(node, f"n{number}", **parameters), 15)
                    line = [text for text in said.splitlines() if text.startswith(f"{node}: ")]
                    self.assertEqual(code, 2, said)
                    self.assertEqual(len(line), 1, said)
                    for word in wanted:
                        self.assertIn(word, line[0])

    def test_isolator_node_keeps_what_was_learnt_once(self):
        rig = "cooling_circuit"
        with Graph() as graph:
            kept = graph.path / "rig.reference"
            isolator = graph.node("isolator_node", "isolator", rig=rig, reference=str(kept))
            graph.node("kalman_node", "kalman", rig=rig, wait_for="isolator")
            graph.node("parameter_node", "parameter", rig=rig, wait_for="isolator")
            graph.node(
                "rig_simulator_node",
                "simulator",
                rig=rig,
                profile="steady",
                duration=30.0,
                rate=2,
                nuisance=True,
                wait_for="kalman parameter",
            )
            limit = time.monotonic() + 40
            while (
                not (kept.exists() and "stage branch_faults signatures" in kept.read_text())
                and time.monotonic() < limit
            ):
                time.sleep(0.2)
            text = kept.read_text()
            self.assertTrue(
                text.startswith("faultline references 1\nrig cooling_circuit\nstage redline_supply_pressure redline"),
                text,
            )
            time.sleep(3)
            self.assertEqual(kept.read_text(), text)
            self.assertEqual(
                [path.name for path in graph.path.iterdir() if path.name.startswith("rig.reference")], ["rig.reference"]
            )
            graph.end(isolator)
            again = graph.node("isolator_node", "isolator", rig=rig, reference=str(kept))
            time.sleep(2)
            self.assertIsNone(again.poll(), graph.said(again))
            graph.end(again)
            kept.write_text(text[:-2])
            code, said = graph.wait(graph.node("isolator_node", "isolator", rig=rig, reference=str(kept)), 15)
            self.assertEqual(code, 2, said)
            self.assertIn("rig.reference: the file is damaged or cut off", said)
            self.assertEqual(kept.read_text(), text[:-2])

    def test_a_word_on_the_command_line_is_refused(self):
        with Graph() as graph:
            code, said = graph.wait(graph.start([str(devel_space() / "lib/faultline/kalman_node"), "--rig=x"]), 10)
            self.assertEqual(code, 2)
            self.assertIn("'--rig=x' is not understood", said)


class LcmLog(unittest.TestCase):
    """The simulator writes a clean log; the test spoils it; the driver counts."""

    @classmethod
    def setUpClass(cls):
        cls.graph = Graph().__enter__()
        cls.clean = cls.graph.path / "clean.lcm"
        process = cls.graph.node(
            "rig_simulator_node",
            "writer",
            rig=RIG,
            output="lcm",
            lcm_url=f"file://{cls.clean}?mode=w",
            duration=4.0,
            rate=20,
            start=1000.0,
        )
        code, said = cls.graph.wait(process, 20)
        assert code == 0, said
        cls.events = read_lcm_log(cls.clean)
        # What the log recorded at twenty times real time is put at the pace of a rig.
        sequence = 0
        paced = []
        for _, channel, data in cls.events:
            paced.append((1_000_000_000 + 1000 * sequence, channel, data))
            sequence += channel == f"{RIG}.sample"
        cls.events = paced

    @classmethod
    def tearDownClass(cls):
        cls.graph.__exit__()

    def drive(self, path, seconds=25, rate=4, **more):
        lines = self.graph.path / "heard"
        listener = self.graph.start(
            [
                "python3",
                str(os.path.dirname(os.path.abspath(__file__))) + "/listen.py",
                RIG,
                "4",
                str(lines),
                "sample",
                "diagnostics",
            ]
        )
        driver = self.graph.node(
            "rig_driver_node", "driver", rig=RIG, log=str(path), rate=rate, wait_for="/listener", **more
        )
        code, said = self.graph.wait(driver, seconds)
        self.graph.end(listener)
        heard = read_lines(lines)
        samples = [entry for entry in heard if entry["topic"] == "sample"]
        status = [
            status
            for entry in heard
            if entry["topic"] == "diagnostics"
            for status in entry["status"]
            if status["name"] == f"{RIG}/driver: driver"
        ]
        return code, said, samples, status

    def samples(self):
        return [index for index, event in enumerate(self.events) if event[1] == f"{RIG}.sample"]

    def test_whole_log_comes_through_with_the_stamps_of_the_daq(self):
        code, said, samples, status = self.drive(self.write("whole.lcm", self.events))
        self.assertEqual(code, 0, said)
        self.assertEqual([sample["sequence"] for sample in samples], list(range(4001)))
        self.assertEqual(
            [sample["time"] for sample in samples], [1_000_000_000_000 + 1_000_000 * k for k in range(4001)]
        )
        self.assertEqual(
            {key: status[-1]["values"][key] for key in ("lost", "duplicate", "out of order", "late", "restarts")},
            {"lost": "0", "duplicate": "0", "out of order": "0", "late": "0", "restarts": "0"},
        )

    def write(self, name, events):
        path = self.graph.path / name
        write_lcm_log(path, events)
        return path

    def test_lost_duplicate_out_of_order_and_late_are_counted(self):
        events, where = list(self.events), self.samples()
        choose = random.Random(5)
        spots = choose.sample(range(100, 3900, 12), 60)
        lost, doubled, swapped, late = spots[:20], spots[20:35], spots[35:50], spots[50:]
        for k in late:  # arrives 80 ms after its time; so do not those around it
            stamp, channel, data = events[where[k]]
            events[where[k]] = (stamp + 80_000, channel, data)
        for k in swapped:
            events[where[k]], events[where[k + 1]] = events[where[k + 1]], events[where[k]]
        spoilt = []
        for index, event in enumerate(events):
            k = where.index(index) if index in where else -1
            if k in lost:
                continue
            spoilt.append(event)
            if k in doubled:
                spoilt.append(event)
        code, said, samples, status = self.drive(self.write("spoilt.lcm", spoilt))
        self.assertEqual(code, 0, said)
        values = status[-1]["values"]
        self.assertEqual(values["lost"], "20")
        self.assertEqual(values["duplicate"], "15")
        self.assertEqual(values["out of order"], "15")
        self.assertEqual(values["late"], "10")
        self.assertEqual(values["restarts"], "0")
        self.assertEqual(
            [sample["sequence"] for sample in samples], [k for k in range(4001) if k not in lost and k not in swapped]
        )

    def test_a_restart_of_the_daq_is_no_loss(self):
        later = [(stamp + 5_000_000, channel, data) for stamp, channel, data in self.events]
        code, said, samples, status = self.drive(self.write("twice.lcm", self.events + later), rate=8)
        self.assertEqual(code, 0, said)
        self.assertEqual([sample["sequence"] for sample in samples], 2 * list(range(4001)))
        self.assertEqual((status[-1]["values"]["restarts"], status[-1]["values"]["lost"]), ("1", "0"))

    def test_a_cut_off_log_is_used_up_to_the_cut(self):
        whole = self.write("whole.lcm", self.events).read_bytes()
        path = self.graph.path / "cut.lcm"
        path.write_bytes(whole[: len(whole) // 2 + 7])
        code, said, samples, _ = self.drive(path)
        self.assertEqual(code, 2, said)
        self.assertIn("cut off or damaged after event", said)
        self.assertGreater(len(samples), 1900)
        self.assertEqual([sample["sequence"] for sample in samples], list(range(len(samples))))

    def named(self, name):
        return [(stamp, channel.replace(RIG, name), data) for stamp, channel, data in self.events]

    def test_a_log_is_played_by_the_name_it_was_recorded_with(self):
        path = self.write("named.lcm", self.named("press_1"))
        code, said, samples, _ = self.drive(path)
        self.assertEqual(code, 0, said)
        self.assertEqual([sample["sequence"] for sample in samples], list(range(4001)))
        code, said = self.graph.wait(
            self.graph.node("rig_driver_node", "driver", rig=RIG, log=str(path), lcm_name="press_2"), 20
        )
        self.assertEqual(code, 2)
        self.assertIn("no LCM channel 'press_2.sample' in it; it holds the samples of press_1", said)

    def test_of_two_of_one_kind_in_a_log_one_is_chosen(self):
        later = [(stamp + 300, channel, data) for stamp, channel, data in self.named("press_2")]
        path = self.write("two.lcm", sorted(self.named("press_1") + later, key=lambda event: event[0]))
        code, said = self.graph.wait(self.graph.node("rig_driver_node", "driver", rig=RIG, log=str(path)), 20)
        self.assertEqual(code, 2)
        self.assertIn("it holds the samples of press_1, press_2: give one as lcm_name", said)
        code, said, samples, status = self.drive(path, lcm_name="press_2")
        self.assertEqual(code, 0, said)
        self.assertEqual([sample["sequence"] for sample in samples], list(range(4001)))
        self.assertEqual(status[-1]["values"]["restarts"], "0")

    def test_another_rigs_log_is_refused(self):
        foreign = [
            (stamp, channel, data.replace(b"servo_actuator", b"servo_actuatox"))
            for stamp, channel, data in self.events[:50]
        ]
        code, said, samples, _ = self.drive(self.write("foreign.lcm", foreign))
        self.assertEqual(code, 2)
        self.assertIn("servo_actuatox", said)
        self.assertEqual(samples, [])


if __name__ == "__main__":
    unittest.main()
