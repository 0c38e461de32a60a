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
            time.sleep(2.2)  # the worker's rest, and a report
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


if __name__ == "__main__":
    unittest.main()
