"""The chain of internal variables live, in simulated time: bag_player_node -> histogram_node -> isolator_node ->
alarm_node. It says what `faultline diagnose` says of the same recording, both by what a healthy recording taught
them."""

import json
import pathlib
import shutil
import subprocess
import sys
import unittest

import yaml
from graph import ROOT, Graph, devel_space

sys.path.insert(0, str(ROOT / "test/rigs/control_valve"))
import test_chain  # noqa: E402

RIG = test_chain.RIG
LISTEN = str(pathlib.Path(__file__).resolve().parent / "listen.py")
BEGIN, LENGTH, HEALTHY = 100, 340, 240  # s: of a fault, of its recording, of the one without
RATE = 25  # times real time: 2500 samples a second
STAGES = ("estimators", "detectors", "isolators")


class ChainLive(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.graph = Graph().__enter__()
        cls.addClassCleanup(cls.graph.__exit__)
        cls.graph.set("/use_sim_time", True)
        cls.config = cls.graph.path / "config"
        folder = cls.config / RIG
        folder.mkdir(parents=True)
        sheet = test_chain.datasheet()
        for name, stages in (("rig.yaml", False), ("stages.yaml", True)):
            part = {key: value for key, value in sheet.items() if (key in STAGES) == stages}
            (folder / name).write_text(yaml.safe_dump(part, sort_keys=False, width=10000))
        cls.learnt = cls.graph.path / "learnt"
        cls.run_program("diagnose", cls.record(1, test_chain.LEARN), "--keep-reference", cls.learnt)

    @classmethod
    def run_program(cls, *arguments):
        ran = subprocess.run(
            [str(devel_space() / "lib/faultline/faultline"), *map(str, arguments), "--config", str(cls.config / RIG)],
            env=cls.graph.environment,
            capture_output=True,
            text=True,
            timeout=300,
        )
        assert ran.returncode == 0, ran.stderr
        return ran.stdout

    @classmethod
    def record(cls, seed, seconds, *effects):
        bag = cls.graph.path / "session.bag"
        words = ["--profile", "steps", "--off-nominal", "--rig-seed", 7, "--nuisance", "--substep", 0.001]
        words += [word for effect in effects for word in ("--effect", f"{effect},from={BEGIN}")]
        cls.run_program("simulate", RIG, *words, "--seed", seed, "--duration", seconds, "--quiet", "-o", bag)
        return bag

    def offline(self, bag):
        return json.loads(self.run_program("diagnose", bag, "--reference", self.learnt, "--json", "-"))["alarms"]

    def live(self, bag):
        """Alarms as the last message on /RIG/alarms has them, times in s of the recording, and the time of that."""
        graph, heard = self.graph, self.graph.path / "heard"
        # The nodes go on learning into their file; the next recording is judged by the same.
        own = {"rig": RIG, "config": str(self.config)}
        kept = {"reference": str(shutil.copy(self.learnt, graph.path / "kept")), **own}
        nodes = [
            graph.start(["python3", LISTEN, RIG, "60", str(heard), "alarms", "sample"]),
            graph.node("alarm_node", "alarms", **own),
            graph.node("isolator_node", "isolator", wait_for="alarms", **kept),
            graph.node("histogram_node", "histogram", wait_for="isolator", **kept),
        ]
        program = str(devel_space() / "lib/faultline/bag_player_node")
        words = [f"_bag:={bag}", f"_recorded:={RIG}", f"_rate:={RATE}", "_wait_for:=histogram alarms /listener"]
        player = graph.start([program, "__name:=player", f"__ns:=/{RIG}", *words])
        # It ends when its last sample is judged.
        code, said = graph.wait(player, 120)
        self.assertEqual((code, said), (0, ""))
        for node in reversed(nodes):
            graph.end(node)
            self.assertEqual(node.returncode, 0, graph.said(node))
        entries = [json.loads(line) for line in heard.read_text().splitlines()]
        stamps = [entry["time"] for entry in entries if entry["topic"] == "sample"]
        last = [entry for entry in entries if entry["topic"] == "alarms"][-1]
        self.assertEqual(last["time"], stamps[-1])
        for alarm in last["alarms"]:
            for key in ("since", "raised"):
                alarm[key] = (alarm[key] - stamps[0]) * 1e-9
        return last["alarms"]

    def compare(self, told, wanted):
        for key in ("kind", "effect", "port", "text", "active"):
            self.assertEqual([alarm[key] for alarm in told], [alarm[key] for alarm in wanted])
        for alarm, same in zip(told, wanted):
            for key in ("since", "raised"):
                self.assertAlmostEqual(alarm[key], same[key], delta=2e-6)

    def test_a_fault_is_told_live_as_offline(self):
        for effect, module in ((test_chain.PRESTAGE_LEAK, "Nozzle-flapper"), (test_chain.CYLINDER_LEAK, "Actuator")):
            with self.subTest(module):
                bag = self.record(3, LENGTH, effect)
                wanted, told = self.offline(bag), self.live(bag)
                self.assertEqual([alarm["text"].partition(":")[0] for alarm in told], [module])
                self.assertGreater(told[0]["since"], BEGIN)
                self.compare(told, wanted)

    def test_a_healthy_rig_is_told_nothing(self):
        bag = self.record(2, HEALTHY)
        self.assertEqual(self.offline(bag), [])
        self.assertEqual(self.live(bag), [])


if __name__ == "__main__":
    unittest.main()
