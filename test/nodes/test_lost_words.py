"""Words of the isolator that are lost on their way to the alarms, in simulated time: they are counted, and the alarms
are the same."""

import json
import pathlib
import subprocess
import unittest

from graph import Graph, devel_space

RIG = "hydraulic_drive"  # 100 Hz: a relay in Python keeps up
RELAY = str(pathlib.Path(__file__).resolve().parent / "lossy_relay.py")
LENGTH = 20  # s of the bag
OFF = 1000  # the sample from which a transducer is off
DETECTIONS = [*range(300, 310), *range(1400, 1420)]
HYPOTHESES = [*range(305, 315), *range(600, 605), 1500]


class LostWords(unittest.TestCase):
    def test_they_are_counted_and_the_alarms_are_the_same(self):
        with Graph() as graph:
            bag, heard = graph.path / "session.bag", graph.path / "heard"
            ran = subprocess.run(
                [
                    *(str(devel_space() / "lib/faultline/faultline"), "simulate", RIG, "--duration", str(LENGTH)),
                    *("--seed", "3", "-o", str(bag)),
                    *("--effect", f"offset@sensor.pump_pressure:value=5e5,from={OFF / 100}"),
                ],
                env=graph.environment,
                capture_output=True,
                text=True,
                timeout=60,
            )
            self.assertEqual(ran.returncode, 0, ran.stderr)
            graph.set("/use_sim_time", True)
            numbers = [",".join(map(str, some)) for some in (DETECTIONS, HYPOTHESES)]
            relay = graph.start(["python3", RELAY, RIG, str(heard), *numbers])
            graph.set(f"/{RIG}/lossy_alarms/rig", RIG)
            remapped = [f"{topic}:=lossy/{topic}" for topic in ("detections", "hypotheses", "alarms")]
            node = graph.start(
                [str(devel_space() / "lib/faultline/alarm_node"), "__name:=lossy_alarms", f"__ns:=/{RIG}", *remapped]
            )
            replay = ["replay.launch", f"rig:={RIG}", f"bag:={bag}", "rate:=2", "pause:=true"]
            launch = graph.start(["roslaunch", "faultline", *replay])
            code, told = graph.wait(launch, 90)
            self.assertEqual(code, 0, told)
            try:
                node.wait(2.5)  # its last report on /diagnostics
            except subprocess.TimeoutExpired:
                pass
            self.assertIsNone(node.poll(), graph.said(node))
            graph.end(relay)
            said = json.loads(heard.read_text())
        lost = len({*DETECTIONS, *HYPOTHESES})
        self.assertEqual(int(said["counts"]["lost"]), lost, said["counts"])
        self.assertEqual(int(said["counts"]["received"]), 100 * LENGTH + 1 - lost, said["counts"])
        self.assertTrue(said["alarms"])
        self.assertEqual(said["lossy/alarms"], said["alarms"])


if __name__ == "__main__":
    unittest.main()
