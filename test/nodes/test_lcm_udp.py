"""Simulator -> UDP multicast -> driver -> ROS, in a network namespace of its own, so that no packet leaves the machine.

The test starts itself again inside `unshare`; there it sets the loopback up and adds the multicast route.
"""

import json
import os
import pathlib
import subprocess
import sys
import time
import unittest

from graph import BUILD, Graph

RIGS = ("servo_actuator", "cooling_circuit")  # 11 channels, and 28
URL = "udpm://239.255.76.67:7667?ttl=0"
HERE = pathlib.Path(__file__).resolve()
SECONDS = 6
NAMES = ("press_1", "hall/press_2")


def network():
    for command in (["ip", "link", "set", "lo", "up"], ["ip", "route", "add", "224.0.0.0/4", "dev", "lo"]):
        subprocess.run(command, check=True)


def inside(rig):
    """In the namespace: runs the chain of a rig and prints one line of JSON."""
    network()
    with Graph() as graph:
        heard = graph.path / "heard"
        listener = graph.start(
            ["python3", str(HERE.parent / "listen.py"), rig, "30", str(heard), "sample", "diagnostics"]
        )
        driver = graph.node("rig_driver_node", "driver", rig=rig, lcm_url=URL, wait_for="/listener")
        simulator = graph.node(
            "rig_simulator_node", "simulator", rig=rig, output="lcm", lcm_url=URL, start=2000.0, duration=SECONDS
        )
        # LCM keeps nothing for a listener that comes late: the driver must be there first.
        code, said = graph.wait(simulator, SECONDS + 20)
        for process in (driver, listener):
            graph.end(process)
        entries = [json.loads(line) for line in heard.read_text().splitlines()]
        samples = [entry for entry in entries if entry["topic"] == "sample"]
        status = [
            status
            for entry in entries
            if entry["topic"] == "diagnostics"
            for status in entry["status"]
            if status["name"] == f"{rig}/driver: driver"
        ]
        print(
            json.dumps(
                {
                    "code": code,
                    "said": said,
                    "driver": driver.returncode,
                    "driver_said": graph.said(driver),
                    "sequence": [sample["sequence"] for sample in samples],
                    "time": [sample["time"] for sample in samples],
                    "status": status[-1] if status else None,
                }
            )
        )


def inside_launch():
    """The same through servo_actuator.launch: what a user types."""
    network()
    with Graph() as graph:
        heard = graph.path / "heard"
        listener = graph.start(
            ["python3", str(HERE.parent / "listen.py"), RIGS[0], "30", str(heard), "sample", "estimate", "alarms"]
        )
        launch = graph.start(
            ["roslaunch", "faultline", "servo_actuator.launch", "link:=lcm", f"duration:={SECONDS}", f"lcm_url:={URL}"]
        )
        code, said = graph.wait(launch, SECONDS + 30)
        graph.end(listener)
        entries = [json.loads(line) for line in heard.read_text().splitlines()]
        sequence = {
            topic: [entry["sequence"] for entry in entries if entry["topic"] == topic]
            for topic in ("sample", "estimate")
        }
        reports = [entry for entry in entries if entry["topic"] == "alarms"]
        print(
            json.dumps(
                {"code": code, "said": said, "sequence": sequence, "alarms": reports[-1]["alarms"] if reports else None}
            )
        )


def inside_two():
    """Two rigs of one kind in one master, as a user starts them."""
    network()
    with Graph() as graph:
        heard, listeners, launches = [], [], []
        for name in NAMES:
            heard.append(graph.path / f"heard_{len(heard)}")
            words = ["python3", str(HERE.parent / "listen.py"), name, "40", str(heard[-1]), "sample", "diagnostics"]
            listeners.append(graph.start([*words, f"__name:=listener_{len(heard)}"]))
        for seed, name in enumerate(NAMES, 1):
            words = ["roslaunch", "faultline", "servo_actuator.launch", "link:=lcm", f"lcm_url:={URL}"]
            launches.append(graph.start([*words, f"duration:={SECONDS}", f"name:={name}", f"seed:={seed}"]))
        ends = [graph.wait(launch, SECONDS + 40) for launch in launches]
        for listener in listeners:
            graph.end(listener)
        answer = {}
        for name, path, (code, said) in zip(NAMES, heard, ends):
            entries = [json.loads(line) for line in path.read_text().splitlines()]
            samples = [entry for entry in entries if entry["topic"] == "sample"]
            told = [s for e in entries if e["topic"] == "diagnostics" for s in e["status"]]
            answer[name] = {
                "code": code,
                "said": said,
                "sequence": [sample["sequence"] for sample in samples],
                "values": [sample["values"] for sample in samples if sample["sequence"] == 5000],
                "status": [status for status in told if status["name"] == f"{name}/driver: driver"][-1],
            }
        print(json.dumps(answer))


def inside_mixed():
    """A second sender on the channel of the first, which goes on alone for 6 s more."""
    network()
    rig = RIGS[0]
    with Graph() as graph:
        heard = graph.path / "heard"
        words = ["python3", str(HERE.parent / "listen.py"), rig, "30", str(heard), "sample", "diagnostics"]
        listener = graph.start(words)
        driver = graph.node("rig_driver_node", "driver", rig=rig, lcm_url=URL, wait_for="/listener")
        for k, seconds in enumerate((20, 8), 1):
            more = {"output": "lcm", "lcm_url": URL, "start": 1000.0 * k, "duration": seconds, "seed": k}
            last = graph.node("rig_simulator_node", f"simulator_{k}", rig=rig, **more)
            if k == 1:
                first = last
                late = time.monotonic() + 20
                while not (heard.exists() and heard.stat().st_size > 0) and time.monotonic() < late:
                    time.sleep(0.05)  # until it is heard: the first counts
        graph.wait(first, 40)
        for process in (driver, listener):
            graph.end(process)
        entries = [json.loads(line) for line in heard.read_text().splitlines()]
        told = [s for e in entries if e["topic"] == "diagnostics" for s in e["status"]]
        told = [(s["level"], s["message"], s["values"]) for s in told if s["name"] == f"{rig}/driver: driver"]
        times = [entry["time"] for entry in entries if entry["topic"] == "sample"]
        print(json.dumps({"told": told, "second": [t >= 2_000_000_000_000 for t in times]}))


class Udp(unittest.TestCase):
    def run_inside(self, *what):
        unshare = ["unshare", "-n"] if os.geteuid() == 0 else ["unshare", "-rn"]
        environment = dict(os.environ, FAULTLINE_BUILD=str(BUILD))
        ran = subprocess.run(
            [*unshare, sys.executable, str(HERE), *what],
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            timeout=90,
        )
        self.assertEqual(ran.returncode, 0, ran.stderr)
        return json.loads(ran.stdout.splitlines()[-1])

    def test_the_launch_file_joins_the_nodes_over_lcm(self):
        answer = self.run_inside("inside_launch")
        self.assertEqual(answer["code"], 0, answer["said"])
        for topic, sequence in answer["sequence"].items():
            # roslaunch starts all nodes at once: what the simulator sends before the driver listens is unheard, not
            # lost.
            self.assertTrue(sequence, topic)
            self.assertLess(sequence[0], 4000, topic)
            self.assertEqual(sequence, list(range(sequence[0], sequence[-1] + 1)), topic)
            self.assertGreaterEqual(sequence[-1], 1000 * SECONDS - 200, topic)
        # The listener was there first, as a recorder may be: the diagnosis has no other beginning.
        self.assertEqual(answer["sequence"]["sample"][0], answer["sequence"]["estimate"][0])
        self.assertEqual([alarm for alarm in answer["alarms"] if alarm["kind"] == "fault"], [])

    def test_two_rigs_of_one_kind_hear_only_their_own(self):
        answer = self.run_inside("inside_two")
        for name in NAMES:
            one = answer[name]
            self.assertEqual(one["code"], 0, one["said"])
            first = one["sequence"][0]
            self.assertLess(first, 4000, name)
            self.assertEqual(one["sequence"], list(range(first, 1000 * SECONDS + 1)), name)
            values = one["status"]["values"]
            self.assertEqual([values[key] for key in ("lost", "duplicate", "restarts")], ["0"] * 3, name)
        self.assertNotEqual(*(answer[name]["values"] for name in NAMES))

    def test_two_senders_on_one_channel_are_told_and_the_first_counts(self):
        answer = self.run_inside("inside_mixed")
        messages = [message for _, message, _ in answer["told"]]
        words = "two senders on LCM channel servo_actuator.sample"
        mixed = [k for k, message in enumerate(messages) if words in message]
        self.assertGreaterEqual(len(mixed), 5, messages)
        self.assertIn("give each a name of its own (lcm_name)", messages[mixed[0]])
        self.assertIn([0, "the DAQ sends"], [[level, message] for level, message, _ in answer["told"][mixed[-1] + 1 :]])
        self.assertLess(int(answer["told"][-1][2]["restarts"]), 50)
        # Until it was sure, some of the second one passed.
        self.assertLess(sum(answer["second"]), 50)
        self.assertFalse(any(answer["second"][-9000:]))

    def test_a_second_process_hears_every_sample(self):
        for rig in RIGS:
            with self.subTest(rig=rig):
                answer = self.run_inside("inside", rig)
                self.assertEqual(answer["code"], 0, answer["said"])
                self.assertEqual(answer["driver"], 0, answer["driver_said"])
                first = answer["sequence"][0]
                # Whatever was sent while the driver still started is not lost but unheard.
                self.assertLess(first, 2000)
                self.assertEqual(answer["sequence"], list(range(first, 1000 * SECONDS + 1)))
                self.assertEqual(answer["time"], [2_000_000_000_000 + 1_000_000 * k for k in answer["sequence"]])
                values = answer["status"]["values"]
                self.assertEqual((values["lost"], values["duplicate"], values["out of order"]), ("0", "0", "0"))


if __name__ == "__main__":
    if sys.argv[1:2] == ["inside"]:
        inside(sys.argv[2])
    elif sys.argv[1:] == ["inside_launch"]:
        inside_launch()
    elif sys.argv[1:] == ["inside_two"]:
        inside_two()
    elif sys.argv[1:] == ["inside_mixed"]:
        inside_mixed()
    else:
        unittest.main()
