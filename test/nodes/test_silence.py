"""What is called a silent rig, live: not one whose samples come while the diagnosis pauses."""

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


class Silence(unittest.TestCase):
    def setUp(self):
        self.graph = Graph().__enter__()
        self.addCleanup(self.graph.__exit__)
        self.heard = self.graph.path / "heard"

    def entries(self):
        lines = self.heard.read_text().splitlines() if self.heard.exists() else []
        return [json.loads(line) for line in lines if line.endswith("}")]

    def verdicts(self):
        statuses = [s for entry in self.entries() if entry["topic"] == "diagnostics" for s in entry["status"]]
        return [status["message"] for status in statuses if status["name"] == f"{RIG}: verdict"]

    def wait_for(self, holds, seconds=90):
        limit = time.monotonic() + seconds
        while not holds():
            self.assertLess(time.monotonic(), limit, self.verdicts()[-5:])
            time.sleep(0.2)

    def pid(self, node):
        """None while it is not there."""
        try:
            uri = self.graph.master.lookupNode("/test", f"/{RIG}/{node}")[2]
            return xmlrpc.client.ServerProxy(uri).getPid("/test")[2]
        except OSError:
            return None

    def test_the_end_of_a_live_stream_after_a_replay_is_told(self):
        """The replay leaves its master in simulated time, in which nothing would go on."""
        bag = self.graph.path / "session.bag"
        command = [str(devel_space() / "lib/faultline/faultline"), "simulate", RIG, "--duration", "4", "-o", str(bag)]
        subprocess.run(command, env=self.graph.environment, stdout=subprocess.DEVNULL, check=True, timeout=120)
        replay = self.graph.start(["roslaunch", "faultline", "replay.launch", f"rig:={RIG}", f"bag:={bag}", "rate:=2"])
        code, said = self.graph.wait(replay, 120)
        self.assertEqual(code, 0, said)
        self.assertIs(self.graph.master.getParam("/test", "/use_sim_time")[2], True)
        listener = self.graph.start(["python3", LISTEN, RIG, "60", str(self.heard), "alarms", "diagnostics"])
        launch = self.graph.start(["roslaunch", "faultline", f"{RIG}.launch", "respawn:=true", "seed:=3"])
        self.wait_for(lambda: "No fault found." in self.verdicts())
        os.kill(self.pid("simulator"), signal.SIGKILL)
        self.wait_for(lambda: any("no sample for more than 0.1 s" in said for said in self.verdicts()))
        for process in (launch, listener):
            self.graph.end(process)
        last = [entry for entry in self.entries() if entry["topic"] == "alarms"][-1]
        self.assertEqual([alarm["level"] for alarm in last["alarms"] if alarm["active"]], [3], last)
        # From the last sample that the alarms heard. Who is killed may have sent it to them and not to the estimator.
        since = (last["alarms"][-1]["since"] - last["time"]) * 1e-9
        self.assertGreater(since, 0.099)
        self.assertLess(since, 0.2)

    def test_a_restart_of_the_isolator_is_no_silence_of_the_rig(self):
        listener = self.graph.start(["python3", LISTEN, RIG, "60", str(self.heard), "alarms", "diagnostics"])
        launch = self.graph.start(["roslaunch", "faultline", f"{RIG}.launch", "respawn:=true", "seed:=3"])
        self.wait_for(lambda: "No fault found." in self.verdicts())
        killed = self.pid("isolator")
        os.kill(killed, signal.SIGKILL)
        self.wait_for(lambda: self.pid("isolator") not in (None, killed))
        before = len(self.verdicts())
        self.wait_for(lambda: self.verdicts()[before:].count("No fault found.") > 2)
        for process in (launch, listener):
            self.graph.end(process)
        told = {alarm["text"] for e in self.entries() if e["topic"] == "alarms" for alarm in e["alarms"]}
        self.assertEqual(told, set())


if __name__ == "__main__":
    unittest.main()
