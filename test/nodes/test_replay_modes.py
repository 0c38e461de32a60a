"""replay.launch that loops and that is paused: a loop begins anew with the same alarms each time, a pause is no
silence."""

import json
import os
import pathlib
import signal
import subprocess
import time
import unittest
import xmlrpc.client

from graph import Graph, devel_space

RIG = "servo_actuator"
LISTEN = str(pathlib.Path(__file__).resolve().parent / "listen.py")
LENGTH = 14  # s of the bag
# One client for several calls: rosservice takes a second or more to start, in which the replay would go on.
PAUSER = """
import sys, rospy
from std_srvs.srv import SetBool
rospy.init_node("pauser", disable_signals=True)
call = rospy.ServiceProxy("/servo_actuator/player/pause_playback", SetBool, persistent=True)
call.wait_for_service(20)
print("ready", flush=True)
for line in sys.stdin:
    print(call(line.strip() == "true").success, flush=True)
"""


class ReplayModes(unittest.TestCase):
    def setUp(self):
        self.graph = Graph().__enter__()
        self.addCleanup(self.graph.__exit__)
        self.bag = self.graph.path / "session.bag"
        # A transducer that goes off is an alarm within a second or two, and one that ends with a loop.
        ran = subprocess.run(
            [
                str(devel_space() / "lib/faultline/faultline"),
                "simulate",
                RIG,
                "--duration",
                str(LENGTH),
                "--seed",
                "3",
                "--effect",
                "offset@sensor.load_pressure:value=2e5,from=6",
                "-o",
                str(self.bag),
            ],
            env=self.graph.environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            timeout=60,
        )
        self.assertEqual(ran.returncode, 0, ran.stderr)
        self.heard = self.graph.path / "heard"

    def play(self, rate, *options):
        self.listener = self.graph.start(
            ["python3", LISTEN, RIG, "60", str(self.heard), "alarms", "estimate", "diagnostics"]
        )
        self.player = self.graph.start(
            ["roslaunch", "faultline", "replay.launch", f"rig:={RIG}", f"bag:={self.bag}", f"rate:={rate}", *options]
        )

    def entries(self):
        self.graph.end(self.player)
        self.graph.end(self.listener)
        return [json.loads(line) for line in self.heard.read_text().splitlines()]

    def wait_for_estimates(self, least, seconds):
        limit = time.monotonic() + seconds
        while time.monotonic() < limit:
            if self.heard.exists() and self.heard.read_text(errors="replace").count('"topic": "estimate"') >= least:
                return
            time.sleep(0.2)
        self.fail(f"no {least} estimates within {seconds} s: {self.graph.said(self.player)}")

    def test_each_round_of_a_loop_gives_the_same_alarms(self):
        self.play(2, "loop:=true")
        self.wait_for_estimates(int(2.8 * 1000 * LENGTH), 50)
        entries = self.entries()
        rounds, alarms, last = [], [], None
        for entry in entries:
            if entry["topic"] == "estimate":
                if last is None or entry["time"] < last - 1_000_000_000:
                    self.assertTrue(entry["restarted"], entry)
                    rounds.append([])
                last = entry["time"]
                rounds[-1].append(entry["sequence"])
        self.assertGreaterEqual(len(rounds), 2)
        for whole in rounds[:2]:
            off = [(k, number) for k, number in enumerate(whole) if k != number]
            self.assertEqual(off[:5], [])
            self.assertGreaterEqual(len(whole), 1000 * LENGTH)
        # Reports of a round: those in which the report's time runs up.
        last = None
        for entry in entries:
            if entry["topic"] != "alarms" or entry["time"] == 0:
                continue
            if last is None or entry["time"] < last - 1_000_000_000:
                alarms.append(set())
            last = entry["time"]
            alarms[-1] |= {(alarm["kind"], alarm["port"], alarm["since"], alarm["raised"]) for alarm in entry["alarms"]}
        self.assertGreaterEqual(len(alarms), 2)
        self.assertIn("sensor.load_pressure", [port for _, port, _, _ in alarms[0]])
        self.assertEqual(alarms[0], alarms[1])

    def test_a_judgement_that_comes_late_says_so_and_changes_nothing(self):
        self.play(2)
        self.wait_for_estimates(3000, 40)
        node = xmlrpc.client.ServerProxy(self.graph.master.lookupNode("/test", f"/{RIG}/kalman")[2])
        process = node.getPid("/test")[2]
        os.kill(process, signal.SIGSTOP)
        try:
            limit = time.monotonic() + 30
            while "Not judged yet" not in self.heard.read_text(errors="replace"):
                self.assertLess(time.monotonic(), limit)
                time.sleep(0.1)
        finally:
            os.kill(process, signal.SIGCONT)
        code, said = self.graph.wait(self.player, 60)
        self.assertEqual(code, 0, said)
        entries = self.entries()
        numbers = [entry["sequence"] for entry in entries if entry["topic"] == "estimate"]
        self.assertEqual(numbers, list(range(1000 * LENGTH + 1)))
        last = [entry for entry in entries if entry["topic"] == "alarms"][-1]
        ran = subprocess.run(
            [str(devel_space() / "lib/faultline/faultline"), "diagnose", str(self.bag), "--json", "-"],
            env=self.graph.environment,
            stdout=subprocess.PIPE,
            check=True,
            timeout=60,
        )
        wanted = json.loads(ran.stdout)["alarms"]
        start = min(entry["time"] for entry in entries if entry["topic"] == "estimate")
        self.assertEqual(
            [(a["kind"], a["effect"], a["port"], a["active"]) for a in last["alarms"]],
            [(a["kind"], a["effect"], a["port"], a["active"]) for a in wanted],
        )
        for told, same in zip(last["alarms"], wanted):
            for key in ("since", "raised", "until"):
                self.assertAlmostEqual((told[key] - start) * 1e-9, same[key], delta=2e-6)

    def test_a_pause_is_no_silence(self):
        self.play(2, "pause:=true")
        limit = time.monotonic() + 20
        service = "/servo_actuator/player/pause_playback"
        while service not in [name for name, _ in self.graph.master.getSystemState("/test")[2][2]]:
            self.assertLess(time.monotonic(), limit, self.graph.said(self.player))
            time.sleep(0.1)
        pauser = subprocess.Popen(
            ["python3", "-c", PAUSER],
            env=self.graph.environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        self.addCleanup(self.stop, pauser)
        self.assertEqual(pauser.stdout.readline(), "ready\n")
        time.sleep(1)
        self.assertNotIn('"topic": "estimate"', self.heard.read_text())
        self.pause(pauser, False)
        self.wait_for_estimates(2000, 20)
        self.pause(pauser, True)
        time.sleep(0.5)
        before = self.heard.read_text().count('"topic": "estimate"')
        time.sleep(2.5)
        # The listener writes in blocks; without the pause it would be 5000 more.
        self.assertLess(self.heard.read_text().count('"topic": "estimate"'), before + 200)
        self.assertLess(before, 1000 * LENGTH)
        # As the launch file says to go on.
        ran = subprocess.run(
            ["rosservice", "call", "/servo_actuator/player/pause_playback", "false"],
            env=self.graph.environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=20,
        )
        self.assertEqual(ran.returncode, 0, ran.stdout)
        code, said = self.graph.wait(self.player, 30)
        self.assertEqual(code, 0, said)
        entries = self.entries()
        estimates = [entry["sequence"] for entry in entries if entry["topic"] == "estimate"]
        off = [(k, number) for k, number in enumerate(estimates) if k != number]
        self.assertEqual(off[:5], [])
        self.assertGreaterEqual(len(estimates), 1000 * LENGTH)
        last = [entry for entry in entries if entry["topic"] == "alarms"][-1]
        self.assertEqual([alarm["kind"] for alarm in last["alarms"] if alarm["kind"] == "data"], [], last)
        told = [status["message"] for entry in entries if entry["topic"] == "diagnostics" for status in entry["status"]]
        self.assertTrue(any("/clock stands still" in message for message in told))

    def pause(self, pauser, paused):
        pauser.stdin.write("true\n" if paused else "false\n")
        pauser.stdin.flush()
        self.assertEqual(pauser.stdout.readline(), "True\n")

    @staticmethod
    def stop(process):
        process.kill()
        process.communicate()


if __name__ == "__main__":
    unittest.main()
