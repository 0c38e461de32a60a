"""rig_driver_node with a mapping: a stand's own topics become the samples that `faultline import` makes of a bag of
them."""

import io
import json
import math
import pathlib
import re
import subprocess
import sys
import threading
import time
import unittest

import rosbag

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "cli"))
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "scripts"))
import read_topic_fields  # noqa: E402
import stand_bag  # noqa: E402
from graph import Graph, devel_space  # noqa: E402

HERE = pathlib.Path(__file__).resolve().parent
MAPPING = """
resample: true
channels:
  stroke_wanted: {from: /motor/voltage/data, hold: .inf}
  voltage: {from: /command/point/x, hold: .inf}
  stroke: {from: "/joints/position[lift]", unit: mm}
  load: {from: /load/wrench/force/z, sign: -1}
  supply: {from: /supply/fluid_pressure}
"""
TOPICS = "/motor/voltage,/command,/joints,/load,/supply"


def with_command(made):
    """Only the first message without a header stays; the commands get one."""
    from geometry_msgs.msg import PointStamped

    kept = []
    for topic, message, received in made:
        if topic == "/motor/voltage":
            command = PointStamped()
            command.point.x = message.data
            command.header.stamp.secs, command.header.stamp.nsecs = divmod(received, 10**9)
            if not any(entry[0] == topic for entry in kept):
                kept.append((topic, message, received))
            kept.append(("/command", command, received))
        else:
            kept.append((topic, message, received))
    return kept


def plain(sample):
    """With missing values that are equal to each other."""
    return {**sample, "values": ["nan" if math.isnan(value) else value for value in sample["values"]]}


class TypesOfTopics(unittest.TestCase):
    def test_first_messages_that_arrive_at_once_do_not_mix_their_types(self):
        from geometry_msgs.msg import PointStamped, WrenchStamped
        from sensor_msgs.msg import FluidPressure, JointState
        from std_msgs.msg import Float64

        problems = []

        def read(kind):
            raw = io.BytesIO()
            kind().serialize(raw)
            header = {"type": kind._type, "md5sum": kind._md5sum, "message_definition": kind._full_text}
            try:
                made = read_topic_fields.TopicReader("/topic", "auto").type_of(header)
                made().deserialize(raw.getvalue())
            except Exception as problem:
                problems.append(f"{kind._type}: {problem}")

        self.addCleanup(sys.setswitchinterval, sys.getswitchinterval())
        sys.setswitchinterval(1e-6)
        for _ in range(5):
            kinds = (PointStamped, WrenchStamped, JointState, FluidPressure, Float64)
            threads = [threading.Thread(target=read, args=(kind,)) for kind in kinds]
            for thread in threads:
                thread.start()
            for thread in threads:
                thread.join()
        self.assertEqual(problems, [])


class TopicDriver(unittest.TestCase):
    def setUp(self):
        self.graph = Graph().__enter__()
        self.addCleanup(self.graph.__exit__)
        config = self.graph.path / "config/stand"
        config.mkdir(parents=True)
        (config / "rig.yaml").write_text(stand_bag.SHEET)
        self.map = self.graph.path / "map.yaml"
        self.map.write_text(MAPPING)

    def driver(self, **more):
        return self.graph.node(
            "rig_driver_node",
            "driver",
            rig="stand",
            config=str(self.graph.path / "config"),
            mapping=str(self.map),
            **more,
        )

    def offline(self, bag):
        made = self.graph.path / "offline.bag"
        ran = subprocess.run(
            [
                *(str(devel_space() / "lib/faultline/faultline"), "import", str(bag), "--rig", "stand"),
                *("--config", str(self.graph.path / "config/stand"), "--mapping", str(self.map), "-o", str(made)),
            ],
            env=self.graph.environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            timeout=60,
        )
        self.assertEqual(ran.returncode, 0, ran.stderr)
        with rosbag.Bag(str(made)) as offline:
            return [
                {"stamp": message.header.stamp.to_nsec(), "sequence": message.sequence, "values": list(message.values)}
                for _, message, _ in offline.read_messages("/stand/sample")
            ]

    def live(self, bag, last, ahead, topics=TOPICS, rounds=1):
        self.graph.set("/use_sim_time", True)
        driver = self.driver(wait_for="/stand", wait=1.0)
        heard = self.graph.path / "samples"
        player = self.graph.start(
            [
                *("python3", str(HERE / "play_stand.py"), str(bag), "stand"),
                *(topics, repr(last), str(ahead), str(rounds), str(heard)),
            ]
        )
        code, said = self.graph.wait(player, 90)
        self.assertEqual(code, 0, said + self.graph.said(driver))
        self.assertIsNone(driver.poll(), self.graph.said(driver))
        return [json.loads(line) for line in heard.read_text().splitlines()]

    def compare(self, ahead, change=with_command, **options):
        bag = self.graph.path / "stand.bag"
        stand_bag.write(bag, change, **options)
        offline = self.offline(bag)
        live = self.live(bag, offline[-1]["stamp"] * 1e-9, ahead)
        self.assertEqual([plain(sample) for sample in live], [plain(sample) for sample in offline])
        return offline

    def test_the_same_samples_as_offline(self):
        rows = self.compare(1.02, joints_every=0.001, load_every=0.04)
        self.assertGreater(len(rows), 370)
        self.assertEqual({row["values"][1] for row in rows}, {0.5, -1.5, 2.0})  # all three commands
        self.assertFalse(any(math.isnan(value) for row in rows for value in row["values"]))

    def test_a_silent_topic_is_missing_and_holds_nothing_up(self):
        # Between two commands, and for longer than `wait` and a gap.
        gone = range(stand_bag.START * 10**9 + 1_320_000_000, stand_bag.START * 10**9 + 2_450_000_000)
        rows = self.compare(
            1.1, lambda made: [e for e in with_command(made) if e[0] != "/load" or e[2] not in gone]
        )
        self.assertAlmostEqual(sum(math.isnan(row["values"][3]) for row in rows), 113, delta=2)

    def test_stamps_that_jump_back_begin_anew(self):
        self.map.write_text(re.sub(r"  stroke_wanted.*\n", "", MAPPING))
        bag = self.graph.path / "stand.bag"
        stand_bag.write(bag, with_command)
        offline = self.offline(bag)
        samples = self.live(bag, offline[-1]["stamp"] * 1e-9, 1.02, TOPICS.split(",", 1)[1], rounds=2)
        self.assertEqual(len(samples), 2 * len(offline))
        self.assertEqual([sample["sequence"] for sample in samples], list(range(len(samples))))
        for first, second in zip(samples, samples[len(offline) :]):
            self.assertEqual((first["stamp"], first["values"]), (second["stamp"], second["values"]))

    def wait_for_status(self, *says):
        """Until every one of these patterns stands in what was heard."""
        heard = self.graph.path / "status"
        # Under a name of its own: of two listeners of one name the master ends the first.
        self.graph.start(
            ["python3", str(HERE / "listen.py"), "stand", "60", str(heard), "diagnostics", "__name:=status_listener"]
        )
        limit = time.monotonic() + 40
        while time.monotonic() < limit:
            text = heard.read_text() if heard.exists() else ""
            if all(re.search(pattern, text) for pattern in says):
                return
            time.sleep(0.2)
        self.fail(text)

    def publish(self, topic, kind, fields="{}"):
        return self.graph.start(["rostopic", "pub", "-r", "20", topic, kind, fields])

    def test_what_is_not_there_is_told_and_nothing_is_sent(self):
        self.driver()
        self.publish("/supply", "sensor_msgs/FluidPressure")
        self.wait_for_status("nobody publishes", "/load/wrench/force/z", "no sample yet")

    def test_a_stand_at_another_rate_is_told(self):
        self.map.write_text(MAPPING.replace("resample: true\n", "").replace("/command/point/x", "/volts/data"))
        self.driver()
        self.publish("/joints", "sensor_msgs/JointState", "{name: [lift], position: [1.0]}")
        self.publish("/load", "geometry_msgs/WrenchStamped")
        self.publish("/supply", "sensor_msgs/FluidPressure")
        self.publish("/volts", "std_msgs/Float64")
        self.publish("/motor/voltage", "std_msgs/Float64")
        # rostopic keeps its rate to a few percent only: the measured period may be 0.04999 s.
        self.wait_for_status(r"samples come every 0\.0[45]\d* s, .* says 0\.01 s: say resample: true")

    def test_a_second_publisher_of_a_topic_is_left_out_and_told(self):
        self.map.write_text(MAPPING.replace("/command/point/x", "/volts/data"))
        self.driver()
        publishers = {
            "/joints": ("sensor_msgs/JointState", "{name: [lift], position: [1.0]}"),
            "/load": ("geometry_msgs/WrenchStamped", "{}"),
            "/supply": ("sensor_msgs/FluidPressure", "{}"),
            "/volts": ("std_msgs/Float64", "{}"),
        }
        for topic, (kind, fields) in publishers.items():
            self.publish(topic, kind, fields)
        # Of /joints another one, whose element is no field of the mapping: that is as it should be.
        self.publish("/joints", "sensor_msgs/JointState", "{name: [turn], position: [1.0]}")
        self.graph.start(["rostopic", "pub", "-r", "20", "/motor/voltage", "std_msgs/Float64", "1.0"])
        heard = self.graph.path / "samples"
        self.graph.start(["python3", str(HERE / "listen.py"), "stand", "60", str(heard), "sample"])

        def strokes(since=0):
            lines = heard.read_text().splitlines()[since:] if heard.exists() else []
            told = [json.loads(line)["values"][0] for line in lines if line.endswith("}")]
            return set(filter(math.isfinite, told))

        limit = time.monotonic() + 30
        while 1.0 not in strokes():
            self.assertLess(time.monotonic(), limit)
            time.sleep(0.1)
        second = self.graph.start(
            ["rostopic", "pub", "-r", "20", "/motor/voltage", "std_msgs/Float64", "2.0", "__name:=second"]
        )
        self.wait_for_status("/second publishes /motor/voltage/data too and is left out, /rostopic_[0-9_]+ counts")
        told = self.graph.path / "status"
        self.assertNotIn("publishes /joints", told.read_text())
        since = len(heard.read_text().splitlines())
        limit = time.monotonic() + 30
        while len(heard.read_text().splitlines()) < since + 20:
            self.assertLess(time.monotonic(), limit)
            time.sleep(0.1)
        self.assertEqual(strokes(since), {1.0})
        self.graph.end(second)
        before = len(told.read_text().splitlines())
        limit = time.monotonic() + 30
        while not any("driver" in line and "left out" not in line for line in told.read_text().splitlines()[before:]):
            self.assertLess(time.monotonic(), limit)
            time.sleep(0.2)

    def test_the_launch_files_start_the_driver_in_the_simulators_place(self):
        for file, *more in (("graph.launch", "rig:=servo_actuator", "estimators:=kalman"), ("servo_actuator.launch",)):
            ran = subprocess.run(
                ["roslaunch", "--nodes", "faultline", file, *more, f"mapping:={self.map}"],
                env=self.graph.environment,
                stdout=subprocess.PIPE,
                text=True,
                timeout=30,
                check=True,
            )
            wanted = {f"/servo_actuator/{name}" for name in ("alarms", "isolator", "kalman", "driver")}
            self.assertEqual(set(ran.stdout.split()), wanted)

    def test_a_field_that_is_not_there_ends_the_driver_in_one_line(self):
        self.map.write_text(MAPPING.replace("force/z", "fource/z"))
        self.publish("/load", "geometry_msgs/WrenchStamped")
        code, said = self.graph.wait(self.driver(), 20)
        self.assertEqual(code, 2, said)
        lines = [line for line in said.splitlines() if "rig_driver_node: " in line]
        self.assertEqual(len(lines), 1, said)
        self.assertIn("has no field 'fource'; its fields are force, torque; did you mean 'force'?", lines[0])
        self.assertNotIn("Traceback", said)

    def test_a_mapping_that_is_wrong_ends_the_driver_in_one_line(self):
        for text, says in (
            (MAPPING.replace("load:", "lod:"), "did you mean 'load'?"),
            (MAPPING.replace("/load/", "load/"), "no /topic/field"),
            (MAPPING + "time: {period: 1}\n", "'time' is that of a table"),
        ):
            self.map.write_text(text)
            code, said = self.graph.wait(self.driver(), 20)
            self.assertEqual(code, 2, said)
            self.assertIn(says, said)
            self.assertEqual(len(said.splitlines()), 1, said)
        code, said = self.graph.wait(self.driver(log="x.lcm"), 20)
        self.assertEqual(code, 2)
        self.assertIn("~mapping, ~log and ~lcm_url exclude each other", said)


if __name__ == "__main__":
    unittest.main()
