"""view_node on recordings of all rigs, in simulated time: frames follow the estimate, a part has its alarm's colour
while the alarm lasts and no longer, and the layouts for plotting tools name topics that exist and speak."""

import ast
import json
import pathlib
import subprocess
import time
import unittest
import xml.etree.ElementTree as ElementTree

import yaml
from graph import ROOT, Graph, devel_space

WATCH, LISTEN = (str(pathlib.Path(__file__).resolve().parent / name) for name in ("watch_view.py", "listen.py"))
HEALTHY, ERROR = [0.48, 0.67, 0.82], [0.7, 0.08, 0.1]
# Rig: bag, times real time, a part that moves with a state of its estimate (on the last, with a channel: none of its
# estimates has such a state, and its valve stands still in this bag), and by how much at least. No shipped bag has an
# alarm that ends: the first is simulated, with a leak from 3 s to 8 s.
RUNS = {
    "servo_actuator": (None, 2, "piston", 0.05),
    "hydraulic_drive": ("hydraulic_drive_motor_efficiency", 3, "spool", 0.05),
    "control_valve": ("control_valve_healthy", 3, "piston", 0.3),
    "pump_cylinder": ("pump_cylinder_leak", 1.5, "piston", 0.1),
    "cooling_circuit": ("cooling_circuit_small_leak", 2, "valve_plug", 0),
}


class ViewNode(unittest.TestCase):
    def run_rig(self, rig):
        bag, rate = RUNS[rig][:2]
        with Graph() as graph:
            session = ROOT / "bags" / f"{bag}.bag" if bag else self.simulated(graph, rig)
            heard = graph.path / "heard"
            watcher = graph.start(["python3", WATCH, rig, "60", str(heard)])
            launch = graph.start(
                ["roslaunch", "faultline", "view.launch", "rviz:=false", "gap:=false", f"rig:={rig}", f"rate:={rate}"]
                + [f"bag:={session}"]
            )
            self.layouts(graph, rig, launch)
            limit = time.monotonic() + 120
            while "player" in self.nodes(graph) and time.monotonic() < limit:
                time.sleep(0.5)
            time.sleep(2)  # a further drawing
            for process in (watcher, launch):
                graph.end(process)
            return [json.loads(line) for line in heard.read_text().splitlines()], graph.said(launch)

    @staticmethod
    def simulated(graph, rig):
        session = graph.path / "session.bag"
        leak = "leak_valve_command:3=0,3.001=4,8=4,8.001=0"
        options = ["--duration", "26", "--seed", "102", "--profile", "square", "--command", leak]
        program = str(devel_space() / "lib/faultline/faultline")
        subprocess.run([program, "simulate", rig, *options, "-o", str(session)], stdout=subprocess.DEVNULL, check=True)
        return session

    @staticmethod
    def nodes(graph):
        state = graph.master.getSystemState("/test")[2]
        return {name.split("/")[-1] for part in state for _, who in part for name in who}

    def layouts(self, graph, rig, launch):
        """Written by the script while the rig runs; every topic in them exists."""
        stages = yaml.safe_load((ROOT / f"config/{rig}/stages.yaml").read_text())["estimators"]
        wanted = f"/{rig}/plot/{stages[0]['name']}/"
        limit = time.monotonic() + 60
        while True:
            topics = [name for name, _ in graph.master.getPublishedTopics("/test", f"/{rig}/plot")[2]]
            if any(name.startswith(wanted) for name in topics):
                break
            self.assertLess(time.monotonic(), limit, graph.said(launch))
            time.sleep(0.2)
        ran = subprocess.run(
            [str(ROOT / "scripts/plot_layouts.py"), "--rig", rig, "--folder", str(graph.path)],
            env=graph.environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=60,
        )
        self.assertEqual(ran.returncode, 0, ran.stdout)
        exist = {name for name, _ in graph.master.getPublishedTopics("/test", f"/{rig}/plot")[2]}
        xml = ElementTree.parse(graph.path / f"{rig}.plotjuggler.xml")
        curves = [curve.get("name") for curve in xml.iter("curve")]
        manager = json.loads((graph.path / f"{rig}.perspective").read_text())["groups"]["pluginmanager"]
        plots = [
            topic
            for group in manager["groups"].values()
            for topic in ast.literal_eval(group["groups"]["plugin"]["keys"]["topics"]["repr"])
        ]
        channels = [name for name in exist if "/plot/channel/" in name]
        for named in (curves, plots):
            self.assertEqual({name for name in named if not name.endswith("/value")}, set())
            named = {name[: -len("/value")] for name in named}
            self.assertEqual(named - exist, set())
            self.assertEqual(set(channels) - named, set())
            self.assertTrue(any("/residual/" in name for name in named))
        self.assertEqual(
            len(ast.literal_eval(manager["keys"]["running-plugins"]["repr"])["rqt_plot/Plot"]), len(manager["groups"])
        )

    def check(self, rig):
        entries, said = self.run_rig(rig)
        self.assertNotIn("ERROR", said)
        layout = yaml.safe_load((ROOT / f"config/{rig}/view.yaml").read_text())["parts"]
        part = {entry["name"]: entry for entry in layout}[RUNS[rig][2]]
        frames = [entry for entry in entries if entry["topic"] == "frame"]
        known = {entry["frame"] for entry in frames} | {rig}
        self.assertEqual({entry["parent"] for entry in frames} - known, set())
        drawn = [entry["markers"] for entry in entries if entry["topic"] == "markers"]
        self.assertEqual({marker["frame"] for markers in drawn for marker in markers} - known, set())
        moving = [entry for entry in frames if entry["frame"] == f"{rig}/{part['name']}"]
        self.follows(part, RUNS[rig][3], moving, [entry for entry in entries if entry["topic"] == "estimate"])
        return entries, drawn

    def follows(self, part, least, moving, estimates):
        """Where the estimate of the frame's stamp puts it."""
        values = {
            entry["time"]: entry["state"][part["moves"]["with"]]
            for entry in estimates
            if part["moves"]["with"] in entry["state"]
        }
        places = [(entry["time"], entry["at"]) for entry in moving if entry["time"] > 1e9]
        self.assertGreater(len(places), 50)
        stamps = [stamp for stamp, _ in places]
        self.assertEqual(stamps, sorted(stamps))
        x, y = part["moves"]["by"]
        along = [at[0] if x != 0 else at[1] for _, at in places]
        self.assertGreaterEqual(max(along) - min(along), least)
        if not values:
            return
        # Frames before the second estimate, and those made of a sample that came first, are not of an estimate.
        compared = [(values[stamp], at) for stamp, at in places if stamp in values]
        self.assertGreater(len(compared), 0.8 * len(places))
        right = [
            abs(part["at"][0] + x * value - at[0]) < 1e-9 and abs(part["at"][1] + y * value - at[1]) < 1e-9
            for value, at in compared
        ]
        self.assertGreater(sum(right), 0.9 * len(right))

    @staticmethod
    def colours(markers, rig, name):
        return {tuple(m["colour"]) for m in markers if m["ns"] == "parts" and m["frame"] == f"{rig}/{name}"}

    def test_a_leak_of_the_servo_actuator_comes_and_goes(self):
        rig = "servo_actuator"
        entries, drawn = self.check(rig)
        port = "flow.chamber_a_chamber_b"
        told = [entry["alarms"] for entry in entries if entry["topic"] == "alarms"]
        active = [any(alarm["active"] and alarm["port"] == port for alarm in alarms) for alarms in told]
        self.assertIn(True, active)
        self.assertFalse(active[-1], told[-1])
        seal = [self.colours(markers, rig, "seal") for markers in drawn]
        first = seal.index({tuple(ERROR)})
        self.assertIn({tuple(HEALTHY)}, seal[:first])
        self.assertEqual(seal[-1], {tuple(HEALTHY)})
        self.assertIn("orifice leakage", " ".join(m["text"] for m in drawn[first] if m["ns"] == "labels"))
        self.assertNotIn("orifice leakage", " ".join(m["text"] for m in drawn[-1] if m["ns"] == "labels"))
        verdict = [m["text"] for m in drawn[first] if m["ns"] == "head"][1]
        self.assertIn("internal leak", verdict.lower())

    def test_a_leak_of_the_cooling_circuit_colours_its_branch_alone(self):
        rig = "cooling_circuit"
        _, drawn = self.check(rig)
        cavity = [self.colours(markers, rig, "t_cavity2") for markers in drawn]
        self.assertIn({tuple(HEALTHY)}, cavity[: cavity.index({tuple(ERROR)})])
        self.assertEqual(cavity[-1], {tuple(ERROR)})
        self.assertNotIn({tuple(ERROR)}, [self.colours(markers, rig, "v1_cavity2") for markers in drawn])

    def test_the_hydraulic_drive(self):
        rig = "hydraulic_drive"
        entries, drawn = self.check(rig)
        self.assertEqual(self.colours(drawn[-1], rig, "motor"), {tuple(ERROR)})
        needle = [e["turn"] for e in entries if e["topic"] == "frame" and e["frame"] == f"{rig}/needle"]
        self.assertGreater(len({round(turn[0], 2) for turn in needle}), 10)

    def test_the_control_valve_stays_healthy(self):
        rig = "control_valve"
        _, drawn = self.check(rig)
        colours = {c for m in drawn[-1] if m["ns"] == "parts" for c in [tuple(m["colour"])]}
        self.assertEqual(colours, {tuple(HEALTHY), (0.72, 0.72, 0.72)})  # the latter of parts without a port

    def test_beside_a_live_rig(self):
        rig = "servo_actuator"
        part = {e["name"]: e for e in yaml.safe_load((ROOT / f"config/{rig}/view.yaml").read_text())["parts"]}["piston"]
        with Graph() as graph:
            heard, told = graph.path / "heard", graph.path / "told"
            watcher = graph.start(["python3", WATCH, rig, "60", str(heard)])
            listener = graph.start(["python3", LISTEN, rig, "60", str(told), "diagnostics"])
            live = graph.start(["roslaunch", "faultline", f"{rig}.launch", "seed:=3", "profile:=random"])
            view = graph.start(["roslaunch", "faultline", "view.launch", f"rig:={rig}", "rviz:=false"])
            limit = time.monotonic() + 30
            while self.samples_seen(told, rig) < 1000 or heard.read_text().count(f'"frame": "{rig}/piston"') < 150:
                self.assertLess(time.monotonic(), limit, graph.said(view) + graph.said(live))
                time.sleep(0.2)
            for process in (view, live, watcher, listener):
                graph.end(process)
            entries = [json.loads(line) for line in heard.read_text().splitlines()]
        moving = [e for e in entries if e["topic"] == "frame" and e["frame"] == f"{rig}/piston"]
        self.follows(part, 0.02, moving, [e for e in entries if e["topic"] == "estimate"])
        self.assertTrue([e for e in entries if e["topic"] == "markers"])

    @staticmethod
    def samples_seen(told, rig):
        """By the view node, as it says of itself."""
        lines = told.read_text().splitlines() if told.exists() else []
        statuses = [s for line in lines if line.endswith("}") for s in json.loads(line)["status"]]
        return max([int(s["values"]["received"]) for s in statuses if s["name"] == f"{rig}/view: view"], default=0)

    def test_the_pump_controlled_cylinder(self):
        rig = "pump_cylinder"
        _, drawn = self.check(rig)
        self.assertNotEqual(self.colours(drawn[-1], rig, "relief_b"), {tuple(HEALTHY)})


if __name__ == "__main__":
    unittest.main()
