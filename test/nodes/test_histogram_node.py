"""histogram_node beside a simulated rig: what it publishes, keeps in its file, goes on from, and refuses."""

import json
import pathlib
import re
import shutil
import time
import unittest

from graph import ROOT, Graph

RIG = "control_valve"
LISTEN = str(pathlib.Path(__file__).resolve().parent / "listen.py")
DRAW = str(ROOT / "scripts/draw_histograms.py")
VARIABLES = 11
QUICKER = {"minimum": 2, "memory": 100, "learn": 20, "window": 25.6}  # s, than the datasheet's hours


def quicker_config(folder):
    """The rig's datasheet, with histograms that are learnt within the test."""
    shutil.copytree(ROOT / "config" / RIG, folder / RIG)
    stages = folder / RIG / "stages.yaml"
    before, name, text = stages.read_text().partition("  - name: operating_points\n")
    text, detectors, after = text.partition("detectors:")
    for key, value in QUICKER.items():
        text, found = re.subn(rf"^    {key}: \S+", f"    {key}: {value}", text, flags=re.M)
        assert found == 1, key
    stages.write_text(before + name + text + detectors + after)
    return str(folder)


class HistogramNode(unittest.TestCase):
    def run_rig(self, graph, config, kept, seed, duration):
        """Node and simulator until the simulator ends; what was heard of /RIG/histogram."""
        heard = graph.path / f"heard{seed}"
        listener = graph.start(["python3", LISTEN, RIG, "60", str(heard), "histogram"])
        picture = graph.path / f"drawn{seed}.png"
        drawer = graph.start([DRAW, "--rig", RIG, "--out", str(picture), "--wait", "90"])
        node = graph.node("histogram_node", "histogram", rig=RIG, config=config, reference=str(kept))
        simulator = graph.node(
            "rig_simulator_node",
            "simulator",
            rig=RIG,
            profile="steps",
            nuisance=True,
            seed=seed,
            duration=duration,
            rate=10.0,
            wait_for="histogram",
        )
        code, said = graph.wait(simulator, 90)
        self.assertEqual(code, 0, said)
        code, said = graph.wait(drawer, 60)
        self.assertEqual(code, 0, said)
        self.assertIn(f"{VARIABLES} variables", said)
        self.assertEqual(picture.read_bytes()[:4], b"\x89PNG")
        # They are told once a second: until the same is told twice, all samples are in.
        limit = time.monotonic() + 40
        while True:
            lines = heard.read_text().splitlines() if heard.exists() else []
            times = [json.loads(line)["time"] for line in lines if line.endswith("}")]
            if len(times) >= 2 * VARIABLES and len(set(times[-2 * VARIABLES :])) == 1:
                break
            self.assertLess(time.monotonic(), limit, times[-2 * VARIABLES :])
            time.sleep(0.2)
        for process in (node, listener):
            graph.end(process)
        self.assertEqual(node.returncode, 0, graph.said(node))
        return [json.loads(line) for line in heard.read_text().splitlines()]

    def test_learns_keeps_and_goes_on(self):
        with Graph() as graph:
            config = quicker_config(graph.path / "config")
            kept = graph.path / "valve.histograms"
            heard = self.run_rig(graph, config, kept, seed=1, duration=60.0)
            last = {entry["variable"]: entry for entry in heard}
            self.assertEqual(len(last), VARIABLES)
            spool = last["spool_position"]
            self.assertEqual((spool["axes"], spool["axis_bins"], spool["sections"]), (["valve_setpoint"], [32], 32))
            self.assertEqual(len(spool["counts"]), 32 * 32)
            self.assertEqual(sum(spool["population"]), sum(spool["counts"]))
            self.assertGreater(sum(spool["population"]), 400)
            judged = [i for i, mean in enumerate(spool["mean"]) if mean is not None]
            self.assertGreaterEqual(len(judged), 3)
            for i in judged:
                self.assertTrue(0 < spool["low"][i] < spool["mean"][i] < spool["high"][i] < 1)
            self.assertEqual(last["coil_voltage"]["axes"], ["ambient_temperature", "valve_setpoint"])
            self.assertEqual(last["supply_pressure"]["axes"], ["valve_setpoint"])
            self.assertEqual({entry["judging"] for entry in last.values()}, {True})
            # By the samples judged since, not the 0.5 at which it begins; none is cut off at an end for all of them.
            for entry in last.values():
                self.assertTrue(0 < entry["level"] < 1 and entry["level"] != 0.5, entry["level"])
            self.assertFalse(heard[0]["judging"], heard[0]["time"])
            self.assertEqual(heard[0]["level"], 0.5)

            text = kept.read_text()
            self.assertTrue(
                text.startswith("faultline references 1\nrig control_valve\nstage operating_points histogram 1 ")
            )
            again = self.run_rig(graph, config, kept, seed=2, duration=20.0)
            more = {entry["variable"]: entry for entry in again}["spool_position"]
            self.assertGreater(sum(more["population"]), sum(spool["population"]))
            self.assertNotEqual(kept.read_text(), text)

            kept.write_text(text.replace("32", "33", 1))
            code, said = graph.wait(
                graph.node("histogram_node", "histogram", rig=RIG, config=config, reference=str(kept)), 15
            )
            self.assertEqual(code, 2, said)
            self.assertIn("valve.histograms: the file is damaged or cut off", said)
            self.assertEqual(kept.read_text(), text.replace("32", "33", 1))


if __name__ == "__main__":
    unittest.main()
