"""Several graphs in one master: two rigs of one kind, launched again, with nodes that die, and what an aggregator makes
of their diagnostics."""

import json
import os
import pathlib
import re
import signal
import subprocess
import time
import unittest
import xmlrpc.client

from graph import Graph, devel_space

RIG = "servo_actuator"
LISTEN = str(pathlib.Path(__file__).resolve().parent / "listen.py")
# While the rig moves: at rest three transducers are candidates, and none is named.
OFFSET = "effects:=offset@sensor.load_pressure:value=2e5,from=6"


def read_lines(path):
    return [json.loads(line) for line in pathlib.Path(path).read_text().splitlines() if line.endswith("}")]


def ports(entry):
    return {alarm["port"] for alarm in entry["alarms"] if alarm["kind"] != "data"}


class ManyRigs(unittest.TestCase):
    def setUp(self):
        self.graph = Graph().__enter__()
        self.addCleanup(self.graph.__exit__)

    def listen(self, name, *topics):
        path = self.graph.path / f"heard{len(self.graph.processes)}"
        own = f"__name:=listener{len(self.graph.processes)}"
        return path, self.graph.start(["python3", LISTEN, name, "60", str(path), *topics, own])

    def launch(self, *arguments):
        return self.graph.start(["roslaunch", "faultline", *arguments])

    def wait_for(self, path, holds, launched, seconds=40):
        limit = time.monotonic() + seconds
        while time.monotonic() < limit:
            entries = read_lines(path) if path.exists() else []
            if holds(entries):
                return entries
            time.sleep(0.2)
        self.fail(json.dumps(entries[-2:]) + self.graph.said(launched)[-2000:])

    def test_two_of_one_kind_run_beside_each_other(self):
        first, first_listener = self.listen("press_1", "alarms", "sample", "diagnostics")
        second, second_listener = self.listen("hall/press_2", "alarms", "sample")
        common = ("servo_actuator.launch", "rate:=2", "duration:=12")
        one = self.launch(*common, "name:=press_1", "seed:=3", OFFSET)
        other = self.launch(*common, "name:=hall/press_2", "seed:=4")
        for launched in (one, other):
            code, said = self.graph.wait(launched, 60)
            self.assertEqual(code, 0, said)
        for listener in (first_listener, second_listener):
            self.graph.end(listener)
        first, second = read_lines(first), read_lines(second)
        for entries in (first, second):
            numbers = [entry["sequence"] for entry in entries if entry["topic"] == "sample"]
            self.assertEqual(numbers, list(range(len(numbers))))
            self.assertGreaterEqual(len(numbers), 12000)
        self.assertNotEqual(ports([e for e in first if e["topic"] == "alarms"][-1]), set(), self.graph.said(one))
        self.assertEqual(ports([e for e in second if e["topic"] == "alarms"][-1]), set())
        # Of a node that ends all is closed.
        told = [s for e in first if e["topic"] == "diagnostics" for s in e["status"]]
        statuses = {s["name"]: s for s in told if s["message"] != "over: no longer reported"}
        self.assertEqual(statuses["press_1: verdict"]["level"], 2)
        self.assertEqual(statuses["hall/press_2: verdict"]["level"], 0)
        for name in ("press_1/kalman", "hall/press_2/kalman"):
            told = [status for title, status in statuses.items() if title.startswith(name + ":")]
            self.assertEqual([status["values"]["restarts"] for status in told], ["0"], name)

    def test_a_parameter_that_stayed_does_not_stop_the_next_launch(self):
        self.graph.set(f"/{RIG}/alarms/log", "left over")
        self.graph.set(f"/{RIG}/simulator/fault", "gremlin")
        code, said = self.graph.wait(self.launch("servo_actuator.launch", "rate:=4", "duration:=1"), 40)
        self.assertEqual(code, 0, said)

    def test_a_restarted_alarm_node_knows_its_history(self):
        heard, listener = self.listen(RIG, "alarms", "diagnostics")
        launched = self.launch("servo_actuator.launch", "rate:=2", "seed:=3", "respawn:=true", OFFSET)
        entries = self.wait_for(heard, lambda found: any(ports(e) for e in found if e["topic"] == "alarms"), launched)
        raised = [e for e in entries if e["topic"] == "alarms" and ports(e)][-1]["alarms"][-1]
        limit = time.monotonic() + 30
        while self.graph.master.getParam("/test", f"/{RIG}/alarms/history")[0] != 1:
            self.assertLess(time.monotonic(), limit)
            time.sleep(0.1)
        time.sleep(2)  # the history is written once a second
        node = xmlrpc.client.ServerProxy(self.graph.master.lookupNode("/test", f"/{RIG}/alarms")[2])
        os.kill(node.getPid("/test")[2], signal.SIGKILL)
        count = len(read_lines(heard))

        def told_again(found):
            return any(
                alarm["raised"] == raised["raised"] and not alarm["active"]
                for entry in found[count:]
                if entry["topic"] == "alarms"
                for alarm in entry["alarms"]
            )

        self.wait_for(heard, told_again, launched)
        self.assertIsNone(launched.poll())
        self.graph.end(launched)
        self.graph.end(listener)

    def test_an_alarm_of_a_run_that_is_over_is_closed_for_an_aggregator(self):
        bag = self.graph.path / "session.bag"
        ran = subprocess.run(
            [
                *(str(devel_space() / "lib/faultline/faultline"), "simulate", RIG, "--duration", "14", "--seed", "3"),
                *("--effect", "offset@sensor.load_pressure:value=2e5,from=6", "-o", str(bag)),
            ],
            env=self.graph.environment,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            timeout=60,
        )
        self.assertEqual(ran.returncode, 0, ran.stderr)
        self.launch("diagnostics.launch")
        heard, _ = self.listen(RIG, "diagnostics_agg", "alarms")
        # A bag in the caller's folder, that begins anew.
        self.graph.environment["PWD"] = str(self.graph.path)
        launched = self.launch("replay.launch", f"rig:={RIG}", "bag:=session.bag", "loop:=true")

        def levels(entry, prefix):
            return {s["name"]: s["level"] for s in entry["status"] if s["name"].startswith(prefix)}

        def told(found):
            every = [entry for entry in found if entry["topic"] == "diagnostics_agg"]
            return [max(levels(entry, f"/Alarms/{RIG}: sensor").values(), default=0) for entry in every]

        # In the second round the alarm is not told yet, for longer than the 5 s after which silence is stale.
        def two_rounds(found):
            return re.match("0*[12]+0{4,}[12]+0{4}", "".join(map(str, told(found))))

        entries = self.wait_for(heard, two_rounds, launched, 90)
        last = [entry for entry in entries if entry["topic"] == "diagnostics_agg"][-1]
        self.assertIn(f"/Nodes/{RIG} kalman: leak_filter, responses", levels(last, "/Nodes/"))
        said = [s["message"] for s in last["status"] if s["name"].startswith(f"/Nodes/{RIG} alarms")]
        self.assertEqual(len(said), 1)
        self.assertNotIn("/clock stands still", said[0])


if __name__ == "__main__":
    unittest.main()
