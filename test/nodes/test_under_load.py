"""Shipped bags replayed faster than real time while other processes keep every core busy three times over: a judgement
may come late or be lost, which is then said; what is told is what `faultline diagnose` tells, never another name."""

import json
import os
import pathlib
import subprocess
import unittest

from graph import ROOT, Graph, devel_space

LISTEN = str(pathlib.Path(__file__).resolve().parent / "listen.py")
BUSY = 3  # processes a core
BAGS = (  # rig, session, times real time
    ("servo_actuator", "step_leak", 12),
    ("cooling_circuit", "sensor_offset", 4),
)
LOST = ("lost", "missed at the start", "without their other half", "not understood")  # on /diagnostics
WARNED = ("samples lost since the last report", "samples missed at the start", "do not fit this rig")


def named(alarms):
    return {(a["kind"], a["effect"], a["port"]) for a in alarms if a["kind"] in ("fault", "sensor")}


def unlike(told, offline, first):
    """How the last report differs from the program's; empty where it does not."""
    texts = [(a["kind"], a["effect"], a["port"], a["active"]) for a in told]
    wanted = [(a["kind"], a["effect"], a["port"], a["active"]) for a in offline]
    if texts != wanted:
        return f"{texts} instead of {wanted}"
    for alarm, same in zip(told, offline):
        for key in ("since", "raised", "until"):
            if abs((alarm[key] - first) * 1e-9 - same[key]) > 2e-6:
                return f"{key} of {alarm} instead of {same[key]}"
    return ""


class UnderLoad(unittest.TestCase):
    def offline(self, graph, bag):
        ran = subprocess.run(
            [str(devel_space() / "lib/faultline/faultline"), "diagnose", str(bag), "--json", "-"],
            env=graph.environment,
            stdout=subprocess.PIPE,
            check=True,
            timeout=120,
        )
        return json.loads(ran.stdout)

    def replay(self, graph, rig, bag, rate):
        heard = graph.path / "heard"
        listener = graph.start(["python3", LISTEN, rig, "120", str(heard), "alarms", "diagnostics"])
        busy = [graph.start(["python3", "-c", "while True: pass"]) for _ in range(BUSY * os.cpu_count())]
        launch = graph.start(["roslaunch", "faultline", "replay.launch", f"rig:={rig}", f"bag:={bag}", f"rate:={rate}"])
        code, said = graph.wait(launch, 150)
        for process in busy:
            self.assertIsNone(process.poll())
            graph.end(process)
        graph.end(listener)
        self.assertEqual(code, 0, said)
        return [json.loads(line) for line in heard.read_text().splitlines()]

    def test_a_verdict_is_late_or_incomplete_but_never_another(self):
        for rig, session, rate in BAGS:
            with self.subTest(rig), Graph() as graph:
                bag = ROOT / "bags" / f"{rig}_{session}.bag"
                offline = self.offline(graph, bag)
                entries = self.replay(graph, rig, bag, rate)
                reports = [entry for entry in entries if entry["topic"] == "alarms"]
                statuses = [s for entry in entries if entry["topic"] == "diagnostics" for s in entry["status"]]
                self.assertTrue(named(offline["alarms"]))
                told = set().union(*(named(report["alarms"]) for report in reports))
                self.assertLessEqual(told, named(offline["alarms"]))
                # Stamps of shipped bags begin in 2000.
                difference = unlike(reports[-1]["alarms"], offline["alarms"], 946684800 * 10**9)
                counts = [int(s["values"].get(key, 0)) for s in statuses for key in LOST]
                lost = max(counts) > 0
                said = any(words in s["message"] for s in statuses for words in WARNED)
                self.assertEqual(lost, said)
                self.assertFalse(difference and not lost, difference)
                behind = [float(s["values"].get("behind the samples [s]", 0)) for s in statuses]
                if sum(late > 1 for late in behind) > 2:
                    self.assertTrue([s for s in statuses if s["message"].startswith("Not judged yet")], behind)


if __name__ == "__main__":
    unittest.main()
