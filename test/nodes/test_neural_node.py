"""neural_node in the whole graph of a rig, as its launch file starts it: virtual sensors beside a transmitter that
dies, the same as offline; and what it refuses."""

import json
import pathlib
import shutil
import subprocess
import unittest

from graph import ROOT, Graph, devel_space

RIG = "pump_cylinder"
STAGE = "virtual_pressures"
LISTEN = str(pathlib.Path(__file__).resolve().parent / "listen.py")
DEAD = "scale@sensor.chamber_a_pressure:factor=0,from=3"


class NeuralNode(unittest.TestCase):
    def test_tells_the_pressure_of_a_dead_transmitter(self):
        with Graph() as graph:
            heard = graph.path / "heard"
            listener = graph.start(["python3", LISTEN, RIG, "90", str(heard), "estimate"])
            launch = graph.start(
                ["roslaunch", "faultline", f"{RIG}.launch", "rate:=0.5", "duration:=5", "seed:=3", f"effects:={DEAD}"]
            )
            code, said = graph.wait(launch, 90)
            self.assertEqual(code, 0, said)
            graph.end(listener)
            entries = [json.loads(line) for line in heard.read_text().splitlines()]
            told = [entry for entry in entries if entry["topic"] == "estimate" and entry["stage"] == STAGE]
            numbers = [entry["sequence"] for entry in told]
            self.assertEqual(numbers, list(range(numbers[0], numbers[0] + 5001)))
            last = told[-1]["quantities"]
            # The reading is 0 and noise; the estimate stays near the 4.1 MPa of this rig.
            self.assertLess(abs(last["chamber_a_pressure_network"] - 4.1e6), 0.7e6)
            reading = last["chamber_a_pressure_network_residual"] + last["chamber_a_pressure_network"]
            self.assertLess(abs(reading), 0.5e6)

            run = graph.path / "run.csv"
            program = str(devel_space() / "lib/faultline/faultline")
            options = ["--duration", "5", "--seed", "3", "--effect", DEAD, "--nuisance", "--quiet"]
            subprocess.run([program, "simulate", RIG, *options, "-o", str(run)], check=True, timeout=60)
            course = graph.path / "course.csv"
            asked = ["diagnose", str(run), "--rig", RIG, "--series", str(course), "--series-rows", "10000"]
            subprocess.run([program, *asked, "--json", "/dev/null"], check=True, timeout=60)
            lines = course.read_text().splitlines()
            column = lines[0].split(",").index("q.chamber_a_pressure_network")
            offline = [float(line.split(",")[column]) for line in lines[1:]]
            live = [entry["quantities"]["chamber_a_pressure_network"] for entry in told]
            self.assertEqual(len(offline), len(live))
            for a, b in zip(live, offline):
                self.assertAlmostEqual(a / b, 1, places=4)  # a course is written with a few digits

    def test_refuses_damaged_weights(self):
        with Graph() as graph:
            config = graph.path / "config"
            shutil.copytree(ROOT / "config" / RIG, config / RIG)
            weights = config / RIG / f"{STAGE}.txt"
            weights.write_text(weights.read_text()[:-30])
            node = graph.node("neural_node", "neural", rig=RIG, config=str(config))
            code, said = graph.wait(node, 15)
            self.assertEqual(code, 2, said)
            self.assertIn(f"{STAGE}.txt: the file is damaged or cut off", said)


if __name__ == "__main__":
    unittest.main()
