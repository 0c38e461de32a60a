"""view_node on recordings of all rigs, in simulated time: frames follow the estimate, a part has its alarm's colour
while the alarm lasts and no longer, bars are as tall as the residuals; every channel, state, quantity and residual over
sigma has its plot topic with the numbers of the messages, and the layouts for plotting tools name topics that speak."""

import ast
import json
import pathlib
import signal
import subprocess
import time
import unittest
import xml.etree.ElementTree as ElementTree

import yaml
from graph import ROOT, Graph, devel_space

WATCH, LISTEN = (str(pathlib.Path(__file__).resolve().parent / name) for name in ("watch_view.py", "listen.py"))
HEALTHY, ERROR, GAP, CANDIDATE = [0.48, 0.67, 0.82], [0.7, 0.08, 0.1], [0.72, 0.4, 0.78], [0.98, 0.91, 0.35]
PLOT_RATE = 2  # points a second: all topics of all rigs within what a listener in Python hears
# Rig: bag, times real time, a part that moves with a state of its estimate (on the last, with a channel: none of its
# estimates has such a state, and its valve stands still in this bag), and by how much at least. No shipped bag has an
# alarm that ends: the first is simulated, with a leak from 3 s to 8 s.
RUNS = {
    "servo_actuator": (None, 2, "piston", 0.05),
    "hydraulic_drive": ("hydraulic_drive_motor_efficiency", 3, "spool", 0.05),
    "control_valve": ("control_valve_healthy", 3, "piston", 0.3),
    "pump_cylinder": ("pump_cylinder_leak", 1.5, "piston", 0.1),
    "cooling_circuit": ("cooling_circuit_small_leak", 1, "valve_plug", 0),
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
                + [f"bag:={session}", f"plot_rate:={PLOT_RATE}"]
            )
            drawn, exist = self.layouts(graph, rig, launch)
            limit = time.monotonic() + 120
            while "player" in self.nodes(graph) and time.monotonic() < limit:
                time.sleep(0.5)
            time.sleep(2)  # a further drawing
            watcher.send_signal(signal.SIGINT)
            watcher.wait(120)  # it takes apart what it heard
            graph.end(launch)
            entries, said = [json.loads(line) for line in heard.read_text().splitlines()], graph.said(launch)
        self.plots(rig, entries, drawn, exist)
        return entries, said

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

    def plots(self, rig, entries, drawn, exist):
        """What the messages hold has its topic, which has the messages' numbers; and of the topics that the layouts
        draw and the master knew then, all of them spoke."""
        plots = {entry["name"]: entry for entry in entries if entry["topic"] == "plot"}
        sheet = json.loads(
            subprocess.run(
                [str(devel_space() / "lib/faultline/faultline"), "rigs", rig, "--json", "-"],
                stdout=subprocess.PIPE,
                check=True,
            ).stdout
        )
        for channel in sheet["rigs"][0]["channels"]:
            self.assertIn(f"channel/{channel['name']}", plots)
        for entry in entries:
            if entry["topic"] == "estimate":
                self.assertEqual({f"{entry['stage']}/state/{name}" for name in entry["state"]} - set(plots), set())
        self.assertTrue([name for name in plots if "/residual/" in name])
        known = {f"/{rig}/plot/{name}" for name in plots}
        self.assertEqual(exist - known, set())
        self.assertEqual(drawn - known, set())
        silent = []
        for name, plot in plots.items():
            points = plot["points"]
            compared = [(value, told) for _, value, told in points if told is not None]
            # What was sent before the watcher knew the topic, or when the machine was busy, it did not hear.
            self.assertGreaterEqual(len(compared), 0.7 * len(points), name)
            wrong = [pair for pair in compared if not (pair[0] == pair[1] or pair[0] != pair[0] and pair[1] != pair[1])]
            self.assertEqual(wrong, [], name)
            stamps = [stamp for stamp, _, _ in points]
            apart = [(b - a) * 1e-6 for a, b in zip(stamps, stamps[1:])]
            self.assertGreaterEqual(min(apart, default=1), 0.89 / PLOT_RATE, name)
            if len(points) < min(20, plot["told"] // 2):
                silent.append(name)
        # Only of what a stage does not observe there is no residual over sigma.
        self.assertEqual([name for name in silent if "/residual/" not in name], [])
        measured = {
            f"{entry['stage']}/residual/{name}"
            for entry in entries
            if entry["topic"] == "residuals"
            for name in entry["ratio"]
        }
        self.assertEqual(measured & set(silent), set())

    def bars(self, rig, entries, markers):
        """As tall as the residuals of the last second, of every stage's channels that no earlier stage has."""
        ratios = {entry["stage"]: entry["ratio"] for entry in entries if entry["topic"] == "residuals"}
        stages = yaml.safe_load((ROOT / f"config/{rig}/stages.yaml").read_text())["estimators"]
        wanted = {}
        for stage in stages:
            for name, ratio in ratios.get(stage["name"], {}).items():
                if ratio > 0:
                    wanted.setdefault(name, ratio)
        drawn = {marker["id"]: marker for marker in markers if marker["ns"] == "residuals"}
        foot, unit = drawn[1]["at"][1], (drawn[2]["at"][1] - drawn[1]["at"][1]) / 3  # the line across is at 3
        bars = [drawn[i] for i in sorted(drawn) if 100 <= i < 200]
        self.assertEqual(len(bars), len(wanted))
        self.assertGreater(len(bars), 0)
        for bar, (name, ratio) in zip(bars, wanted.items()):
            self.assertAlmostEqual(bar["at"][1] - 0.5 * bar["size"][1], foot, places=6)
            self.assertAlmostEqual(bar["size"][1] / unit, min(5, max(0.05, ratio)), delta=0.02 + 0.02 * ratio, msg=name)

    def layouts(self, graph, rig, launch):
        """Written by the script while the rig runs; every topic in them exists. What they draw, and what exists."""
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
        self.form(xml.getroot(), exist)
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
        # rqt restores the plugins that it finds running, each from the group of its name and number.
        running = ast.literal_eval(manager["keys"]["running-plugins"]["repr"])
        self.assertEqual(set(running), {"rqt_plot/Plot"})
        groups = {f"plugin__rqt_plot__Plot__{number}" for number in running["rqt_plot/Plot"]}
        self.assertEqual(groups, set(manager["groups"]))
        return named, exist

    def form(self, root, exist):
        """What PlotJuggler 3 reads of a layout: a splitter with as many sizes as plots in it, curves with names and
        colours, and its plugin's settings."""
        self.assertEqual(root.tag, "root")
        window = root.find("tabbed_widget")
        self.assertEqual((window.get("name"), window.get("parent")), ("Main Window", "main_window"))
        tabs = window.findall("Tab")
        self.assertLess(int(window.find("currentTabIndex").get("index")), len(tabs))
        for tab in tabs:
            self.assertTrue(tab.get("tab_name"))
            (splitter,) = tab.findall("Container/DockSplitter")
            sizes = [float(size) for size in splitter.get("sizes").split(";")]
            self.assertEqual([area.tag for area in splitter], ["DockArea"] * int(splitter.get("count")))
            self.assertEqual(len(sizes), len(splitter))
            self.assertAlmostEqual(sum(sizes), 1, places=4)
            for area in splitter:
                (plot,) = area.findall("plot")
                self.assertEqual(plot.get("mode"), "TimeSeries")
                names = [curve.get("name") for curve in plot.findall("curve")]
                self.assertTrue(names)
                self.assertEqual(len(names), len(set(names)))
                for curve in plot.findall("curve"):
                    self.assertRegex(curve.get("color"), "^#[0-9a-f]{6}$")
        (plugin,) = root.findall("Plugins/plugin")
        self.assertEqual(plugin.get("ID"), root.find("previouslyLoaded_Streamer").get("name"))
        self.assertEqual(plugin.find("use_header_stamp").get("value"), "true")
        self.assertEqual(set(plugin.find("selected_topics").get("value").split(";")) - exist, set())

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
        self.bars(rig, entries, drawn[-1])
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
            while self.samples_seen(told, rig) < 1000 or self.placed(heard, f"{rig}/piston") < 100:
                self.assertLess(time.monotonic(), limit, graph.said(view) + graph.said(live))
                time.sleep(0.2)
            for process in (view, live, listener):
                graph.end(process)
            watcher.send_signal(signal.SIGINT)
            watcher.wait(120)
            entries = [json.loads(line) for line in heard.read_text().splitlines()]
        moving = [e for e in entries if e["topic"] == "frame" and e["frame"] == f"{rig}/piston"]
        self.follows(part, 0.02, moving, [e for e in entries if e["topic"] == "estimate"])
        self.assertTrue([e for e in entries if e["topic"] == "markers"])

    @staticmethod
    def placed(heard, frame):
        """Places of the frame that were heard and carry a sample's time: before the first sample it stands at 0."""
        lines = heard.read_text().splitlines() if heard.exists() else []
        entries = [json.loads(line) for line in lines if line.endswith("}")]
        return sum(e["topic"] == "frame" and e["frame"] == frame and e["time"] > 1e9 for e in entries)

    @staticmethod
    def samples_seen(told, rig):
        """By the view node, as it says of itself."""
        lines = told.read_text().splitlines() if told.exists() else []
        statuses = [s for line in lines if line.endswith("}") for s in json.loads(line)["status"]]
        return max([int(s["values"]["received"]) for s in statuses if s["name"] == f"{rig}/view: view"], default=0)

    def test_colours_come_and_go_with_alarms_and_gap(self):
        """Of a node that hears verdicts alone, as the alarm node and the gap node tell them."""
        rig, now = "servo_actuator", "{stamp: now, frame_id: servo_actuator}"
        seal, valve = "flow.chamber_a_chamber_b", "restriction.valve"
        alarm = "{kind: fault, effect: orifice_leakage, port: %s, level: 2, confidence: 1, active: true}" % seal
        with Graph() as graph:
            heard = graph.path / "heard"
            graph.start(["python3", WATCH, rig, "60", str(heard)])
            view = graph.node("view_node", "view", rig=rig)
            pub = ["rostopic", "pub", "-s"]
            graph.start([*pub, "-r", "4", f"/{rig}/estimate", "faultline/Estimate", "{header: %s, stage: none}" % now])

            def tell(topic, kind, text):
                return graph.start([*pub, "-r", "4", f"/{rig}/{topic}", f"faultline/{kind}", text])

            def lines():
                return heard.read_text().split("\n")[:-1] if heard.exists() else []

            def wait_for(**wanted):
                """A drawing that comes from now on has these colours."""
                begin, limit = len(lines()), time.monotonic() + 30
                while True:
                    entries = [json.loads(line) for line in lines()[begin:]]
                    drawn = [entry["markers"] for entry in entries if entry["topic"] == "markers"]
                    found = [{name: self.colours(markers, rig, name) for name in wanted} for markers in drawn]
                    if {name: {tuple(colour)} for name, colour in wanted.items()} in found:
                        return drawn[-1]
                    self.assertLess(time.monotonic(), limit, f"{wanted}: {found[-1:]}\n{graph.said(view)}")
                    time.sleep(0.1)

            def instead(of, topic, kind, text):
                graph.end(of)
                return tell(topic, kind, text)

            gap = "{left_normal: %s, port: %s, effect: clogging, worst: 1.5, inseparable: [%s]}"
            alarms = tell("alarms", "AlarmArray", "{judged: true, alarms: []}")
            wait_for(seal=HEALTHY, valve=HEALTHY)
            gaps = tell("gap", "Gap", gap % ("true", valve, "line.valve_cylinder"))
            told = wait_for(seal=HEALTHY, valve=GAP, hoses=CANDIDATE)
            self.assertIn("gap: clogging", [marker["text"] for marker in told])
            alarms = instead(alarms, "alarms", "AlarmArray", "{judged: true, alarms: [%s]}" % alarm)
            wait_for(seal=ERROR, valve=GAP, hoses=CANDIDATE)
            instead(gaps, "gap", "Gap", gap % ("false", "''", ""))
            wait_for(seal=ERROR, valve=HEALTHY, hoses=HEALTHY)
            over = alarm.replace("active: true", "active: false")
            instead(alarms, "alarms", "AlarmArray", "{judged: true, alarms: [%s]}" % over)
            told = wait_for(seal=HEALTHY, valve=HEALTHY, hoses=HEALTHY)
            self.assertNotIn("gap: clogging", [marker["text"] for marker in told])

    def test_the_pump_controlled_cylinder(self):
        rig = "pump_cylinder"
        _, drawn = self.check(rig)
        self.assertNotEqual(self.colours(drawn[-1], rig, "relief_b"), {tuple(HEALTHY)})


if __name__ == "__main__":
    unittest.main()
