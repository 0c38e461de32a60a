"""gap_node beside a simulated rig: normal while the rig is healthy, left when the valve gets a dead band, the place
named."""

import json
import pathlib
import time
import unittest

from graph import Graph

RIG = "servo_actuator"
LISTEN = str(pathlib.Path(__file__).resolve().parent / "listen.py")


class GapNode(unittest.TestCase):
    def run_rig(self, **parameters):
        with Graph() as graph:
            heard = graph.path / "heard"
            listener = graph.start(["python3", LISTEN, RIG, "60", str(heard), "gap", "diagnostics"])
            gap = graph.node("gap_node", "gap", rig=RIG)
            simulator = graph.node(
                "rig_simulator_node",
                "simulator",
                rig=RIG,
                profile="random",
                nuisance=True,
                off_nominal=True,
                start=2000.0,
                wait_for="gap",
                rate=3.0,
                **parameters
            )
            code, said = graph.wait(simulator, 60)
            self.assertEqual(code, 0, said)
            limit = time.monotonic() + 40  # the worker's rest, and two reports: it is not waited for by the source
            while not self.told_to_the_end(heard, 2000 + parameters["duration"]):
                self.assertLess(time.monotonic(), limit)
                time.sleep(0.2)
            for process in (gap, listener):
                graph.end(process)
            self.assertEqual(gap.returncode, 0, graph.said(gap))
            entries = [json.loads(line) for line in heard.read_text().splitlines()]
        gaps = [entry for entry in entries if entry["topic"] == "gap"]
        statuses = [status for entry in entries if entry["topic"] == "diagnostics" for status in entry["status"]]
        return (
            gaps,
            [status for status in statuses if status["name"] == f"{RIG}/gap: gap"],
            [s for s in statuses if s["name"] == f"{RIG}/gap: input"],
        )

    @staticmethod
    def told_to_the_end(heard, end):
        lines = heard.read_text().splitlines() if heard.exists() else []
        entries = [json.loads(line) for line in lines if line.endswith("}")]
        last = [i for i, entry in enumerate(entries) if entry["topic"] == "gap" and entry["time"] > (end - 0.1) * 1e9]
        after = entries[last[0] :] if last else []
        reports = [s for e in after if e["topic"] == "diagnostics" for s in e["status"]]
        return sum(status["name"] == f"{RIG}/gap: gap" for status in reports) > 1

    def test_a_healthy_rig_stays_normal(self):
        gaps, states, inputs = self.run_rig(seed=12, duration=10.0)
        self.assertEqual([entry["left_normal"] for entry in gaps], [False] * len(gaps))
        # 20 segments of 0.5 s, of which the first only gives the second its past.
        self.assertEqual([round(entry["time"] / 1e9 - 2000, 3) for entry in gaps], [0.999 + 0.5 * i for i in range(19)])
        self.assertEqual(set(entry["channels"][0] for entry in gaps), {"position"})
        self.assertTrue(gaps[-1]["judged"])
        self.assertEqual(states[-1]["level"], 0, states[-1])
        self.assertIn("normal", states[-1]["message"])
        self.assertEqual(
            (
                inputs[-1]["values"]["lost"],
                inputs[-1]["values"]["cuts"],
                inputs[-1]["values"]["dropped before the worker"],
            ),
            ("0", "0", "0"),
        )

    def test_a_dead_band_is_seen_and_located(self):
        gaps, states, inputs = self.run_rig(
            seed=12, duration=18.0, effects="deadband@restriction.valve:width=0.6,from=8"
        )
        left = [entry["time"] / 1e9 - 2000 for entry in gaps if entry["left_normal"]]
        self.assertGreater(left[0], 8)
        self.assertLess(left[0], 12)
        last = gaps[-1]
        self.assertTrue(last["left_normal"])
        self.assertAlmostEqual(last["since"] / 1e9 - 2000, left[0], places=3)
        self.assertEqual(last["port"], "restriction.valve", last)
        self.assertGreater(last["share"], 0.3)
        self.assertIn(states[-1]["level"], (1, 2))
        self.assertEqual(states[-1]["values"]["place"], "restriction.valve")
        # At most one second of processor time for ten of the rig's.
        self.assertLess(float(inputs[-1]["values"]["processor seconds of the worker"]), 2.4)


class NormalGap(unittest.TestCase):
    """Of a rig whose datasheet does not say which gap is normal."""

    RIG = "cooling_circuit"  # it takes longer than the first report

    def setUp(self):
        self.graph = Graph().__enter__()
        self.addCleanup(self.graph.__exit__)
        self.heard = self.graph.path / "heard"
        self.graph.start(["python3", LISTEN, self.RIG, "60", str(self.heard), "gap", "diagnostics"])

    def entries(self):
        lines = self.heard.read_text().splitlines() if self.heard.exists() else []
        return [json.loads(line) for line in lines if line.endswith("}")]

    def told(self, name):
        statuses = [s for entry in self.entries() if entry["topic"] == "diagnostics" for s in entry["status"]]
        return [status for status in statuses if status["name"] == f"{self.RIG}/gap: {name}"]

    def wait_for(self, holds, seconds):
        limit = time.monotonic() + seconds
        while not holds():
            self.assertLess(time.monotonic(), limit, self.told("gap")[-3:])
            time.sleep(0.1)

    def test_it_is_learnt_beside_the_rig_whose_samples_wait(self):
        self.graph.node("gap_node", "gap", rig=self.RIG)
        simulator = self.graph.node("rig_simulator_node", "simulator", rig=self.RIG, start=2000.0, wait_for="gap")
        self.wait_for(lambda: any(entry["topic"] == "gap" for entry in self.entries()), 120)
        self.assertNotIn("does not listen", self.graph.said(simulator))
        learning = [s["message"] for s in self.told("gap") if "learning" in s["message"]]
        self.assertRegex(learning[0], r"^learning the normal gap from 24 simulations, \d+ done$")
        first = next(entry for entry in self.entries() if entry["topic"] == "gap")
        self.assertTrue(all(normal >= 1 for normal in first["normal"]), first)
        # Of the first samples: they waited.
        self.assertEqual(self.told("input")[-1]["values"]["missed at the start"], "0")
        self.assertEqual(self.told("input")[-1]["values"]["dropped before the worker"], "0")
        self.assertLess(first["time"] * 1e-9, 2010)

    def test_the_node_can_be_ended_while_it_learns(self):
        gap = self.graph.node("gap_node", "gap", rig=self.RIG)
        self.wait_for(lambda: any("learning" in status["message"] for status in self.told("gap")), 20)
        begun = time.monotonic()
        self.graph.end(gap)
        self.assertEqual(gap.returncode, 0, self.graph.said(gap))
        self.assertLess(time.monotonic() - begun, 5)


if __name__ == "__main__":
    unittest.main()
