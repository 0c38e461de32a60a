"""The launch files as a user starts them: a live leak, a recording of it, and its replay, held against the offline
program."""

import glob
import json
import os
import pathlib
import signal
import subprocess
import sys
import time
import unittest
import xmlrpc.client

import yaml

from graph import ROOT, Graph, devel_space

sys.path.insert(0, str(ROOT / "test/cli"))
from cut_bag import cut_start  # noqa: E402

RIG = "servo_actuator"
LISTEN = str(pathlib.Path(__file__).resolve().parent / "listen.py")
NANO = 1_000_000_000


def read_lines(path):
    return [json.loads(line) for line in pathlib.Path(path).read_text().splitlines()]


def last_alarms(entries):
    return [entry for entry in entries if entry["topic"] == "alarms"][-1]


class LaunchFiles(unittest.TestCase):
    def setUp(self):
        self.graph = Graph().__enter__()
        self.addCleanup(self.graph.__exit__)

    def listen(self, *topics, rig=RIG):
        path = self.graph.path / f"heard{len(self.graph.processes)}"
        return path, self.graph.start(["python3", LISTEN, rig, "60", str(path), *topics])

    def launch(self, *arguments):
        return self.graph.start(["roslaunch", "faultline", *arguments])

    def program(self, *arguments):
        ran = subprocess.run(
            [str(devel_space() / "lib/faultline/faultline"), *map(str, arguments)],
            env=self.graph.environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            timeout=60,
        )
        self.assertEqual(ran.returncode, 0, ran.stderr)

    def test_arguments_that_no_launch_file_has_are_refused(self):
        for file, *arguments in (
            ("servo_actuator.launch",),
            ("replay.launch", f"rig:={RIG}", "bag:=x.bag", "rate:=2"),
            ("view.launch", f"rig:={RIG}", "frame_rate:=5"),
            ("view.launch", f"rig:={RIG}", "bag:=x.bag"),
            ("record.launch", f"rig:={RIG}", "bag:=x.bag"),
            ("diagnostics.launch",),
        ):
            with self.subTest(file):
                command = ["roslaunch", "--nodes", "faultline", file, *arguments]
                code, said = self.graph.wait(self.graph.start([*command, "ratte:=3"]), 60)
                self.assertIn("no such argument: ratte", said)
                self.assertNotIn(f"/{RIG}/", said)
        # Of a file whose arguments go through all others, none is refused.
        command = ["roslaunch", "--nodes", "faultline", "view.launch", f"rig:={RIG}", "bag:=x.bag", "rate:=2"]
        code, said = self.graph.wait(self.graph.start(command), 60)
        self.assertEqual(code, 0, said)
        self.assertIn(f"/{RIG}/player", said)

    def test_a_live_leak_is_found(self):
        heard, listener = self.listen("alarms")
        code, said = self.graph.wait(
            self.launch(
                "servo_actuator.launch",
                "rate:=3",
                "duration:=40",
                "seed:=3",
                "effects:=orifice_leakage@flow.chamber_a_chamber_b:coefficient=1.5e-8,from=25",
            ),
            60,
        )
        self.assertEqual(code, 0, said)
        self.graph.end(listener)
        alarms = last_alarms(read_lines(heard))
        faults = [alarm for alarm in alarms["alarms"] if alarm["kind"] == "fault"]
        self.assertEqual([alarm["effect"] for alarm in faults], ["orifice_leakage"], alarms)
        self.assertTrue(faults[0]["active"])

    def test_a_live_leak_of_the_cooling_circuit_is_found_by_two_estimator_nodes(self):
        heard, listener = self.listen("alarms", "estimate", rig="cooling_circuit")
        code, said = self.graph.wait(
            self.launch(
                "cooling_circuit.launch",
                "rate:=1",  # two estimates a sample are much for a listener in Python
                "duration:=10",
                "seed:=3",
                "profile:=steady",
                "effects:=orifice_leakage@flow.v2_inlet_ambient:coefficient=2e-7,from=7",
            ),
            60,
        )
        self.assertEqual(code, 0, said)
        self.graph.end(listener)
        entries = read_lines(heard)
        alarms = last_alarms(entries)
        faults = [alarm for alarm in alarms["alarms"] if alarm["kind"] == "fault"]
        self.assertEqual(
            [f'{alarm["effect"]}@{alarm["port"]}' for alarm in faults],
            ["orifice_leakage@flow.v2_inlet_ambient"],
            alarms,
        )
        self.assertLess((faults[0]["raised"] - faults[0]["since"]) / NANO, 0.012)
        # Both nodes spoke about every sample.
        numbers = [entry["sequence"] for entry in entries if entry["topic"] == "estimate"]
        self.assertEqual(len(numbers), 2 * len(set(numbers)))

    def test_parameters_of_the_hydraulic_drive_are_estimated_live(self):
        heard, listener = self.listen("estimate", rig="hydraulic_drive")
        code, said = self.graph.wait(
            self.launch("hydraulic_drive.launch", "rate:=3", "duration:=14", "seed:=3", "fault:=motor_efficiency"), 60
        )
        self.assertEqual(code, 0, said)
        self.graph.end(listener)
        entries = read_lines(heard)
        told = [entry for entry in entries if entry["topic"] == "estimate" and entry["stage"] == "shaft"]
        numbers = [entry["sequence"] for entry in told]
        self.assertEqual(numbers, list(range(numbers[0], numbers[0] + 1401)))
        last = told[-1]["quantities"]
        # Nominal parameters, and 10 % more torque of the motor from 2 s on.
        for name, value, within in (("a11", -8.8, 0.08), ("a12", 1.1 * 8.6802e-4, 0.05), ("a13", -1.19895e-3, 0.05)):
            self.assertLess(abs(last[name] / value - 1), within, name)

    def test_a_session_is_recorded_whole(self):
        # Slowly: rosbag record itself queues 100 messages a topic, which is little on a busy
        # machine.
        bag = self.graph.path / "session.bag"
        recorder = self.launch("record.launch", f"rig:={RIG}", f"bag:={bag}", "compression:=lz4")
        own, names = f"/{RIG}/recorder", ("sample", "estimate", "detections", "hypotheses")
        for name in names:
            self.wait_until(lambda: own in self.registered(1, f"/{RIG}/{name}"), recorder)
        # It comes late: others are connected long before it, and would be reason enough to begin.
        pid = self.pid_of(own)
        os.kill(pid, signal.SIGSTOP)
        try:
            launch = self.launch("servo_actuator.launch", "rate:=0.25", "duration:=4")
            for name in names:
                self.wait_until(lambda: self.registered(0, f"/{RIG}/{name}"), launch)
            limit = time.monotonic() + 1
            while not self.heard_by("simulator", "kalman") and time.monotonic() < limit:
                time.sleep(0.02)
        finally:
            os.kill(pid, signal.SIGCONT)
        code, said = self.graph.wait(launch, 60)
        self.assertEqual(code, 0, said)
        self.graph.end(recorder)
        info = yaml.safe_load(
            subprocess.run(
                ["rosbag", "info", "--yaml", str(bag)], env=self.graph.environment, check=True, stdout=subprocess.PIPE
            ).stdout
        )
        count = {topic["topic"]: topic["messages"] for topic in info["topics"]}
        self.assertEqual(info["compression"], "lz4")
        self.assertEqual(count[f"/{RIG}/description"], 1)
        self.assertGreaterEqual(count[f"/{RIG}/alarms"], 5)
        for name in names:
            numbers = self.sequence_numbers(bag, f"/{RIG}/{name}")
            whole = list(range(4001))
            self.assertEqual(sorted(set(whole) - set(numbers)), [], name)
            self.assertEqual(numbers, whole, name)

    def wait_until(self, holds, process, seconds=30):
        limit = time.monotonic() + seconds
        while not holds():
            self.assertLess(time.monotonic(), limit, self.graph.said(process))
            time.sleep(0.02)

    def registered(self, side, topic):
        """Nodes that the master knows as publishers (0) or subscribers (1) of a topic."""
        return dict(self.graph.master.getSystemState("/test")[2][side]).get(topic, [])

    def node(self, name):
        return xmlrpc.client.ServerProxy(self.graph.master.lookupNode("/test", name)[2])

    def pid_of(self, name):
        return self.node(name).getPid("/test")[2]

    def heard_by(self, source, listener):
        connections = self.node(f"/{RIG}/{source}").getBusInfo("/test")[2]
        return any(c[1] == f"/{RIG}/{listener}" and c[4] == f"/{RIG}/sample" for c in connections)

    def sequence_numbers(self, bag, topic):
        # Without the stage that speaks only now and then.
        script = (
            "import rosbag, sys; print(*[m.sequence for _, m, _ in rosbag.Bag(sys.argv[1]).read_messages(sys.argv[2])"
            " if getattr(m, 'stage', '') != 'responses'])"
        )
        said = subprocess.run(
            ["python3", "-c", script, str(bag), topic],
            env=self.graph.environment,
            check=True,
            stdout=subprocess.PIPE,
            text=True,
        ).stdout
        return [int(word) for word in said.split()]

    def replay(self, bag, rate, rig):
        # It listens to the samples first, as a recorder would: the player waits for the others all the same.
        heard, listener = self.listen("sample", "alarms", "estimate", "hypotheses", "diagnostics", rig=rig)
        code, said = self.graph.wait(self.launch("replay.launch", f"bag:={bag}", f"rate:={rate}", f"rig:={rig}"), 90)
        self.graph.end(listener)
        self.assertEqual(code, 0, said)
        return read_lines(heard)

    def compare(self, bag, rate, rig=RIG):
        answer = self.graph.path / "offline.json"
        self.program("diagnose", bag, "--json", answer)
        offline = json.loads(answer.read_text())
        entries = self.replay(bag, rate, rig)
        first = min(entry["time"] for entry in entries if entry["topic"] == "estimate")
        numbers = [entry["sequence"] for entry in entries if entry["topic"] == "hypotheses"]
        self.assertEqual(numbers, list(range(numbers[0], numbers[0] + len(numbers))))
        self.assertEqual(len(numbers), offline["counts"]["used"])
        live = last_alarms(entries)["alarms"]
        self.assertEqual(len(live), len(offline["alarms"]), (live, offline["alarms"]))
        for told, same in zip(live, offline["alarms"]):
            for key in ("kind", "effect", "port", "active"):
                self.assertEqual(told[key] or "", same[key] or "")
            # The last report is of the last sample.
            for key in ("since", "raised", "until"):
                self.assertAlmostEqual((told[key] - first) / NANO, same[key], delta=2e-6)  # stamps as doubles: 0.24 us
        return entries, offline

    def test_replay_says_the_same_as_offline(self):
        bag = self.graph.path / "leak.bag"
        self.program(
            "simulate",
            RIG,
            "--duration",
            45,
            "--seed",
            3,
            "--effect",
            "orifice_leakage@flow.chamber_a_chamber_b:coefficient=1.5e-8,from=25",
            "-o",
            bag,
        )
        entries, offline = self.compare(bag, 3)
        self.assertIn("orifice_leakage", [alarm["effect"] for alarm in offline["alarms"]])
        estimates = [entry for entry in entries if entry["topic"] == "estimate"]
        self.assertEqual([entry["sequence"] for entry in estimates], list(range(len(estimates))))
        self.assertGreaterEqual(len(estimates), 45000)

    def test_a_recording_without_its_start_says_so_in_replay_as_offline(self):
        bag = self.graph.path / "late.bag"
        cut_start(ROOT / "bags" / f"{RIG}_step_leak.bag", bag, 196)
        entries, offline = self.compare(bag, 3)
        self.assertEqual(offline["counts"]["missed_at_start"], 196)
        self.assertIn("orifice_leakage", [alarm["effect"] for alarm in offline["alarms"]])
        told = [s for entry in entries if entry["topic"] == "diagnostics" for s in entry["status"]]
        own = [s for s in told if s["name"].startswith(f"{RIG}/kalman:")]
        self.assertEqual(own[-1]["values"]["missed at the start"], "196")
        said = [s["message"] for s in own if "196 samples missed at the start of the run" in s["message"]]
        self.assertEqual(len(said), 1, [s["message"] for s in own])

    def test_shipped_bags_say_the_same_as_offline(self):
        index = yaml.safe_load((ROOT / "bags/index.yaml").read_text())
        entries = index["bags"] if isinstance(index, dict) else index
        self.assertEqual(
            sorted(entry["file"] for entry in entries),
            sorted(os.path.basename(bag) for bag in glob.glob(f"{ROOT}/bags/*.bag")),
        )
        self.assertGreaterEqual(len(entries), 1)
        for entry in entries:
            with self.subTest(bag=entry["file"]):
                self.compare(ROOT / "bags" / entry["file"], 2, entry["rig"])


if __name__ == "__main__":
    unittest.main()
