"""import with a mapping: bags with standard messages, tables of any layout, the common grid, and what is refused."""

import datetime
import math
import os
import pathlib
import re
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import stand_bag  # noqa: E402
from program import ROOT, ProgramTest  # noqa: E402

TANKS = ROOT.parent / "shared/data/cascaded_tanks/tanque.csv"
TANKS_SHEET = """
rig: tanks
title: Two tanks
source: a test
sample_period: 4
channels:
  - {name: pump, symbol: u, unit: V, role: command, range: [0, 10], noise_std: 0, resolution: 0, meaning: u}
  - {name: level, symbol: y, unit: V, role: output, range: [0, 10], noise_std: 0.01, resolution: 0, meaning: y}
states:
  - {name: h, symbol: h, unit: m}
parameters:
  - {name: area, symbol: A, unit: m^2, nominal: 1, tolerance: 0.1, from: guess}
ports:
  sensor.level: {component: transducer, meaning: level, effects: {offset: {value: [-1, 1]}}}
"""


class MappingTest(ProgramTest):
    def setUp(self):
        super().setUp()
        self.write("stand.yaml", stand_bag.SHEET)
        self.write("map.yaml", stand_bag.MAPPING)

    def write(self, name, text):
        data = text if isinstance(text, bytes) else text.encode()
        (self.folder / name).write_bytes(data)
        return name

    def arguments(self, files, *more, mapping="map.yaml", output="out.csv"):
        files = files if isinstance(files, list) else [files]
        common = ["--rig", "stand", "--config", "stand.yaml", "--mapping", mapping, "-o", output]
        return ["import", *files, *common, *more]

    def bring_in(self, files, *more, **options):
        done = self.run_program(*self.arguments(files, *more, **options))
        if options.get("output", "out.csv").endswith(".csv"):
            rows = self.table("out.csv")
            begun = re.search(r"t counts from (\S+)Z", done.stderr)  # s since 1970 in rows["time"]
            zero = datetime.datetime.fromisoformat(begun.group(1) + "+00:00").timestamp() if begun else 946684800
            rows["time"] = [zero + t for t in rows["t"]]
            return done, rows
        return done, None

    def table(self, name):
        lines = (self.folder / name).read_text().splitlines()
        names = lines[0].split(",")
        rows = [[float(cell) for cell in line.split(",")] for line in lines[1:]]
        return {name: [row[i] for row in rows] for i, name in enumerate(names)}

    def bag(self, name="stand.bag", change=None, **options):
        stand_bag.write(self.folder / name, change, **options)
        return name


class Bags(MappingTest):
    def check_values(self, rows, first=0.0, last=4.0, load_within=0.05):
        times = [round(time - stand_bag.START, 6) for time in rows["time"]]
        self.assertAlmostEqual(times[0], first, delta=0.011)
        self.assertAlmostEqual(times[-1], last, delta=0.011)
        for k, t in enumerate(times):
            self.assertAlmostEqual(rows["stroke"][k], stand_bag.stroke(t), delta=2e-4)
            self.assertAlmostEqual(rows["load"][k], stand_bag.load(t), delta=load_within)
            self.assertAlmostEqual(rows["supply"][k], stand_bag.supply(t), delta=1)
            self.assertEqual(rows["voltage"][k], stand_bag.voltage(t + 1e-6), t)
            self.assertEqual(rows["stroke_wanted"][k], 0)

    def test_messages_with_headers_make_rows_by_their_stamps(self):
        done, rows = self.bring_in(self.bag())
        self.assertEqual(len(rows["t"]), 401)
        self.check_values(rows)
        self.assertIn("out.csv: 401 samples, 4 s of stand", done.stdout)
        for said in (
            "no header stamp in /motor/voltage",
            "topics not used: /note",
            "period found 0.01 s, the rig's is 0.01 s",
            "not mapped, written as 0: stroke_wanted",
        ):
            self.assertIn(said, done.stderr)

    def test_the_bag_that_comes_out_is_one_of_the_rig(self):
        self.bring_in(self.bag(), "--resample", "rig", output="out.bag")
        import rosbag

        with rosbag.Bag(str(self.folder / "out.bag")) as bag:
            (description,) = [message for _, message, _ in bag.read_messages("/stand/description")]
            stamps = [message.header.stamp.to_sec() for _, message, _ in bag.read_messages("/stand/sample")]
        self.assertIn("faultline import --mapping map.yaml, resampled to 0.01 s", description.made_by)
        self.assertAlmostEqual(stamps[0], stand_bag.START, delta=0.011)

    def test_topics_beside_each_other_are_put_on_a_line(self):
        _, rows = self.bring_in(self.bag(offset=0.004))
        self.check_values(rows)

    def test_receipt_can_be_the_clock(self):
        self.write("receipt.yaml", stand_bag.MAPPING + "time: receipt\n")
        _, rows = self.bring_in(self.bag(), mapping="receipt.yaml")
        self.assertAlmostEqual(rows["time"][0] % 1, 0.0103, delta=1e-6)
        done, _ = self.bring_in(self.bag("bare.bag", stamps=False))
        self.assertIn("no header stamp in /joints, /load, /motor/voltage, /supply", done.stderr)

    def test_other_rates_need_the_grid_and_the_filter_is_named(self):
        bag = self.bag(joints_every=0.001, load_every=0.04, tone=0.05)
        self.complains(self.arguments(bag), bag, "every 0.001 s", "--resample")
        done, rows = self.bring_in(bag, "--resample", 0.01)
        self.check_values(rows, 0.08, 3.92, 0.1)  # the tone of 50 mm at 97 Hz is gone
        for said in ("resampled to 0.01 s", "anti-alias filter: windowed-sinc FIR", "order 160", "40 Hz", "on stroke"):
            self.assertIn(said, done.stdout)
        self.assertIn("load every 0.04 s", done.stderr)
        self.write("grid.yaml", stand_bag.MAPPING + "resample: true\n")
        same, again = self.bring_in(bag, mapping="grid.yaml")
        self.assertEqual(rows, again)
        self.assertEqual(same.stdout, done.stdout)

    def test_several_bags_follow_each_other(self):
        whole = self.bring_in(self.bag())[1]
        half = stand_bag.START * 10**9 + 2 * 10**9
        self.bag("a.bag", lambda made: [entry for entry in made if entry[2] < half])
        self.bag("b.bag", lambda made: [entry for entry in made if entry[2] >= half])
        self.assertEqual(self.bring_in(["b.bag", "a.bag"])[1], whole)

    def test_a_silent_topic_is_missing_and_not_invented(self):
        gone = range(stand_bag.START * 10**9 + 10**9, stand_bag.START * 10**9 + 2 * 10**9)
        bag = self.bag(change=lambda made: [e for e in made if e[0] != "/load" or e[2] not in gone])
        for more in ((), ("--resample", "rig")):
            done, rows = self.bring_in(bag, *more)
            missing = sum(math.isnan(value) for value in rows["load"])
            self.assertAlmostEqual(missing, 99, delta=2)
            self.assertIn("rows without a value: load", done.stderr)

    def test_numbers_that_are_none_are_missing(self):
        def change(made):
            for topic, message, received in made:
                if topic == "/load" and received // 10**7 % 100 == 50:  # one a second
                    message.wrench.force.z = math.nan
            return made

        done, rows = self.bring_in(self.bag(change=change))
        self.assertEqual(sum(math.isnan(value) for value in rows["load"]), 4)
        self.assertIn("rows without a value: load 4", done.stderr)
        _, rows = self.bring_in("stand.bag", "--resample", "rig")  # one is bridged on the grid
        self.assertEqual(sum(math.isnan(value) for value in rows["load"]), 0)

    def test_any_message_even_one_nobody_installed(self):
        """rosbag's types come from the bag: a type of a package that is nowhere."""
        from genpy.dynamic import generate_dynamic

        definition = "std_msgs/Header header\nvalve/State[] valves\n" + "=" * 80
        definition += "\nMSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n" + "=" * 80
        definition += "\nMSG: valve/State\nstring name\nfloat32[2] opening\nbool on"
        types = generate_dynamic("valve/States", definition)
        kind, state = types["valve/States"], types["valve/State"]

        def change(made):
            for _, _, received in [entry for entry in made if entry[0] == "/supply"]:
                message = kind(valves=[state("a", [1.0, 2.0], False), state("b", [3.0, 0.25], True)])
                message.header.stamp.secs, message.header.stamp.nsecs = divmod(received - 100000, 10**9)
                made.append(("/valves", message, received))
            return made

        self.write(
            "valves.yaml",
            stand_bag.MAPPING.replace("/supply/fluid_pressure", '"/valves/valves[b].opening[1]", unit: bar').replace(
                "/load/wrench/force/z, sign: -1", '"/valves/valves[1]/on"'
            ),
        )
        _, rows = self.bring_in(self.bag(change=change), mapping="valves.yaml")
        self.assertEqual(set(rows["supply"]), {25000.0})
        self.assertEqual(set(rows["load"]), {1.0})

    def test_readings_out_of_range_are_kept_and_counted(self):
        self.write("map2.yaml", stand_bag.MAPPING.replace("sign: -1", "scale: 100"))
        done, rows = self.bring_in(self.bag(), mapping="map2.yaml")
        outside = sum(abs(value) > 500 for value in rows["load"])
        self.assertGreater(outside, 300)
        self.assertIn(f"readings out of range, kept: load {outside} (-500 to 500 N)", done.stderr)

    def test_what_is_wrong_is_one_line(self):
        bag = self.bag()
        raw = (self.folder / bag).read_bytes()
        self.write("cut.bag", raw[: len(raw) // 2])
        self.write("noise.bag", b"not a bag at all\n" * 20)
        self.write("empty.bag", b"")
        good = {
            "voltage": "{from: /motor/voltage/data, hold: .inf}",
            "stroke": '{from: "/joints/position[lift]", unit: mm}',
            "load": "/load/wrench/force/z",
            "supply": "/supply/fluid_pressure",
        }
        cases = [
            ("cut.bag", {}, ("cut.bag", "cut off", "rosbag reindex")),
            ("noise.bag", {}, ("noise.bag", "no bag")),
            ("empty.bag", {}, ("empty.bag",)),
            ("nowhere.bag", {}, ("nowhere.bag", "No such file")),
            (bag, {"load": "/laod/wrench/force/z"}, ("no such topic", "did you mean '/load'?")),
            (bag, {"load": "/load"}, ("name the field behind it",)),
            (bag, {"load": "/load/wrench/forces/z"}, ("has no field 'forces'", "did you mean 'force'?")),
            (bag, {"load": "/load/wrench/force"}, ("geometry_msgs/Vector3", "x, y, z")),
            (bag, {"load": "/load/header/frame_id"}, ("string, not a number",)),
            (bag, {"load": "/note/data"}, ("string, not a number",)),
            (bag, {"load": "/joints/position"}, ("is an array (float64[])", "position[0]", "position[swing]")),
            (bag, {"load": "/joints/position[left]"}, ("no element is called 'left'", "swing, lift")),
            (bag, {"load": "/joints/position[7]"}, ("'position' has 2 elements",)),
            (bag, {"load": "/load/wrench/force/z/x"}, ("nothing stands behind",)),
            (bag, {"load": "/load/wrench//z"}, ("is no field",)),
            (bag, {"load": "wrench_z"}, ("map2.yaml:4", "no /topic/field")),
            (bag, {"load": "/supply/fluid_pressure"}, ("and so does",)),
            (bag, {"load": "{from: /load/wrench/force/z, unit: bar}"}, ("'bar' cannot be converted to 'N'",)),
            (bag, {"loads": "/load/wrench/force/z"}, ("'channels.loads'", "did you mean 'load'?")),
            (bag, {"load": None}, ("lacks channels that stand needs: load",)),
        ]
        for file, changed, says in cases:
            entries = {key: value for key, value in {**good, **changed}.items() if value is not None}
            self.write("map2.yaml", "channels:\n" + "".join(f"  {key}: {value}\n" for key, value in entries.items()))
            with self.subTest(file=file, changed=changed):
                self.complains(self.arguments(file, mapping="map2.yaml"), *says)
                self.assertNotIn("out.csv", self.files())
        self.complains(["import", bag, "--rig", "stand", "--config", "stand.yaml", "-o", "o.bag"], "--mapping")
        self.complains(self.arguments([bag, self.write("x.csv", "t\n0\n")]), "cannot be imported together")
        self.complains(self.arguments(bag, "--resample", "often"), "--resample", "'often' is no number")

    def test_stamps_that_run_back_are_refused(self):
        def back(made):
            for topic, message, _ in made[400:]:
                if topic == "/load":
                    message.header.stamp.secs -= 1
            return made

        bag = self.bag(change=back)
        self.complains(self.arguments(bag), bag, "/load", "runs backwards", "1700000000.3")

    def test_a_signal_without_a_value_is_refused(self):
        bag = self.bag(change=lambda made: [entry for entry in made if entry[0] != "/motor/voltage"])
        self.complains(self.arguments(bag), "/motor/voltage/data", "no such topic")
        first = stand_bag.START * 10**9 + 10**6
        bag = self.bag(change=lambda made: [entry for entry in made if entry[0] != "/load" or entry[2] < first])
        self.complains(self.arguments(bag), "/load/wrench/force/z has one value only")

    def test_python_that_fails_is_one_line(self):
        done = self.run_program(
            *self.arguments(self.bag()), check=2, env={**os.environ, "FAULTLINE_PYTHON": "/bin/false"}
        )
        self.assertEqual(len(done.stderr.splitlines()), 1)
        self.assertIn("ended without an answer", done.stderr)


class Tables(MappingTest):
    MAP = "channels:\n  voltage: Spannung\n  stroke: Weg [mm]\n  load: {from: Kraft, unit: kN}\n  supply: Druck [bar]\n"

    def rows(self, count=5):
        return [(0.01 * k, 1.0, 10.0 * k, 0.25 + 0.01 * k, 50.0 + k) for k in range(count)]

    def german(self, rows=None, time=lambda t: f"{t:.2f}".replace(".", ",")):
        lines = ["Zeit [s];Spannung;Weg [mm];Kraft;Druck [bar];Bemerkung"]
        for t, *values in rows or self.rows():
            lines.append(";".join([time(t)] + [f"{value:.3f}".replace(".", ",") for value in values] + ["gut"]))
        return "\r\n".join(lines) + "\r\n"

    def check_values(self, table, rows=None):
        expected = rows or self.rows()
        self.assertEqual(len(table["t"]), len(expected))
        for k, (t, voltage, stroke, load, supply) in enumerate(expected):
            self.assertAlmostEqual(table["t"][k] - table["t"][0], t, delta=1e-6)
            self.assertAlmostEqual(table["voltage"][k], voltage)
            self.assertAlmostEqual(table["stroke"][k], stroke / 1000)
            self.assertAlmostEqual(table["load"][k], load * 1000)
            self.assertAlmostEqual(table["supply"][k], supply * 1e5, delta=1e-3)

    def test_semicolons_decimal_commas_and_other_names(self):
        self.write("log.csv", "\ufeff" + self.german())
        self.write("map.yaml", self.MAP + "time: Zeit\n")
        done, table = self.bring_in("log.csv")
        self.check_values(table)
        for said in ("columns not used: Bemerkung", "decimal commas", "'Weg [mm]' is converted to m"):
            self.assertIn(said, done.stderr)

    def test_times_of_day_and_dates(self):
        self.write("map.yaml", self.MAP + 'time: {column: "Zeit [s]", format: "%d.%m.%Y %H:%M:%S"}\n')
        self.write("log.csv", self.german(time=lambda t: "01.03.2024 12:00:0" + f"{t:.2f}".replace(".", ",")))
        self.check_values(self.bring_in("log.csv")[1])
        self.write("map.yaml", self.MAP + "time: Zeit\n")
        self.write("log.csv", self.german(time=lambda t: f"2024-03-01T12:00:0{t:.2f}"))
        self.check_values(self.bring_in("log.csv")[1])
        self.write("log.csv", self.german(time=lambda t: f"{1709294400 + t:.2f}".replace(".", ",")))
        done, table = self.bring_in("log.csv")
        self.check_values(table)
        self.assertIn("seconds since 1970", done.stderr)
        self.assertAlmostEqual(table["time"][0], 1709294400, delta=1e-5)

    def test_a_constant_period_and_header_lines(self):
        self.write("map.yaml", self.MAP + "time: {period: 10, unit: ms}\ncsv: {names_line: 3, data_line: 5}\n")
        lines = self.german().splitlines()
        self.write("log.csv", "\n".join(["Logger 7;serial;4711", "", lines[0], "s;V;mm;kN;bar;-", *lines[1:]]) + "\n")
        self.check_values(self.bring_in("log.csv")[1])

    def test_empty_cells_are_missing_and_others_can_be_held(self):
        lines = self.german().splitlines()
        cells = lines[3].split(";")
        lines[3] = ";".join([cells[0], "", "", *cells[3:]])
        self.write("log.csv", "\n".join(lines) + "\n")
        self.write("map.yaml", self.MAP + "time: Zeit\n")
        done, table = self.bring_in("log.csv")
        self.assertTrue(math.isnan(table["voltage"][2]) and math.isnan(table["stroke"][2]))
        self.assertIn("rows without a value: voltage 1, stroke 1", done.stderr)
        self.write("map.yaml", self.MAP.replace("Spannung", "{from: Spannung, hold: 0.02}") + "time: Zeit\n")
        _, table = self.bring_in("log.csv")
        self.assertEqual(table["voltage"][2], 1.0)
        self.assertTrue(math.isnan(table["stroke"][2]))

    def test_columns_of_different_rates_go_on_the_grid(self):
        lines = self.german(self.rows(101)).splitlines()
        for k in range(1, 102):
            cells = lines[k].split(";")
            lines[k] = ";".join([*cells[:2], cells[2] if (k - 1) % 5 == 0 else "", *cells[3:]])
        self.write("log.csv", "\n".join(lines) + "\n")
        self.write("map.yaml", self.MAP + "time: Zeit\n")
        self.complains(self.arguments("log.csv"), "Weg [mm] comes every 0.05 s", "--resample")
        done, table = self.bring_in("log.csv", "--resample", "rig")
        self.check_values(table, self.rows(101))
        self.assertIn("anti-alias filter: none needed", done.stdout)

    def test_the_public_tanks_data(self):
        """As it was published: uEst, yEst for estimation and uVal, yVal after them, no time, 4 s apart."""
        self.write("tanks.yaml", TANKS_SHEET)
        rows = [(3.2567, 0.97619, 5.205, 4.9728), (3.2466, 0.99921, 5.2154, 4.9722), (3.2309, 1.0172, 5.2215, 4.9703)]
        text = '"uEst","uVal","yEst","yVal","Ts",\n'
        for k, row in enumerate(rows):
            text += ",".join(map(str, row)) + (",4,\n" if k == 0 else ",,\n")
        files = [(self.write("published.csv", text), 3)]
        if TANKS.is_file():
            files.append((TANKS, 1024))
        for file, count in files:
            for run, (u, y) in {"Est": (0, 2), "Val": (1, 3)}.items():
                self.write("map.yaml", f"time: {{period: 4}}\nchannels:\n  pump: u{run}\n  level: y{run}\n")
                options = ("--rig", "tanks", "--config", "tanks.yaml", "--mapping", "map.yaml", "-o", "out.csv")
                done = self.run_program("import", file, *options)
                table = self.table("out.csv")
                self.assertEqual(len(table["t"]), count)
                self.assertEqual(table["t"][:3], [0, 4, 8])
                self.assertEqual(table["pump"][:3], [row[u] for row in rows])
                self.assertEqual(table["level"][:3], [row[y] for row in rows])
                other = "Val" if run == "Est" else "Est"
                self.assertIn(f"columns not used: u{other}, y{other}, Ts", done.stderr)

    def test_what_is_wrong_is_one_line(self):
        good = self.german()
        time = "time: Zeit\n"
        cases = [
            (good, self.MAP, "names no column of time"),
            (good, self.MAP + "time: Zeitt\n", "did you mean"),
            (good, self.MAP.replace("Kraft", "Krafd") + time, "did you mean 'Kraft'?"),
            (good, self.MAP.replace("Kraft, unit: kN", "Bemerkung") + time, "'gut' is not a number"),
            (good, self.MAP.replace("unit: kN", "unit: bar") + time, "cannot be converted"),
            (good.replace("Druck [bar", "Druck [ell"), self.MAP.replace("bar", "ell") + time, "'ell' is not known"),
            (good.replace("Bemerkung", "Kraft"), self.MAP + time, "there are 2 columns 'Kraft'"),
            (good.replace("0,02;", "0,01;"), self.MAP + time, "log.csv:4: time runs backwards or stands still"),
            (good.replace("0,02;", ";"), self.MAP + time, "log.csv:4: column 'Zeit [s]': '' is no time"),
            (good, self.MAP + 'time: {column: "Zeit [s]", format: "%H:%M"}\n', "is no time of the mapping's format"),
            (good.replace("0,02;", "12:00:00;"), self.MAP + time, "say how it is written"),
            (good, self.MAP + "time: {column: Zeit, unit: ms}\n", "comes every 1e-05 s"),
            (good, self.MAP + "time: receipt\n", "is for bags"),
            (good, self.MAP + time + "csv: {separator: \",\"}\n", "there is no column"),
            (good.replace("1,000", "1.000"), self.MAP + time, "which sign is the decimal one"),
            ("", self.MAP + time, "the file is empty"),
            (good.splitlines()[0] + "\n", self.MAP + time, "no value"),
        ]
        for text, mapping, says in cases:
            self.write("log.csv", text)
            self.write("map.yaml", mapping)
            with self.subTest(says=says):
                self.complains(self.arguments("log.csv"), says)
                self.assertNotIn("out.csv", self.files())
        self.write("log.csv", good)
        self.write("map.yaml", self.MAP + time)
        self.complains(self.arguments("log.csv", output="log.csv"), "this file is read")
        self.complains(self.arguments("log.csv", output="map.yaml"), "this file is read")
        self.complains(self.arguments("log.csv", output="out.txt"), ".bag or .csv")
        self.write("map.yaml", self.MAP + "time: {period: 0.01}\n")
        self.write("second.csv", good)
        self.complains(self.arguments(["log.csv", "second.csv"]), "second.csv", "without a column of time")


class Documentation(MappingTest):
    def test_every_command_of_the_page_runs(self):
        page = (ROOT / "docs/import.md").read_text()
        for name, text in re.findall(r"```yaml\n# (\S+)\n(.*?)```", page, re.S):
            self.write(name, text)
        self.bag("run.bag")
        lines = ["a logger", "of a stand", "Zeit;Spannung;Weg [mm];Kraft;Druck", "-;V;mm;kN;mA"]
        lines += [f"01.03.2024 12:00:0{k // 100},{k % 100:02d};1,5;{k};0,25;12,0" for k in range(300)]
        self.write("log.csv", "\r\n".join(lines) + "\r\n")
        self.write("values.csv", "uEst,yEst,fEst,pEst\n" + "1.5,0.2,3,5e6\n" * 20)
        commands = re.findall(r"^    faultline (.*)$", page, re.M)
        self.assertEqual(len(commands), 4)
        for command in commands:
            with self.subTest(command=command):
                self.run_program(*command.split())
                if "table.yaml" in command:
                    self.run_program("export", "mine.bag", "--config", "stand.yaml", "-o", "log_back.csv")
                    table = self.table("log_back.csv")
                    self.assertEqual((table["voltage"][7], table["load"][7]), (1.5, 250.0))
                    self.assertAlmostEqual(table["stroke"][7], 0.007)
                    self.assertAlmostEqual(table["supply"][7], 50e5)

    def test_every_key_is_told(self):
        page = (ROOT / "docs/import.md").read_text()
        source = (ROOT / "src/faultline/rig/mapping.cpp").read_text()
        keys = {key for group in re.findall(r"allow\((.*?)\);", source) for key in re.findall(r'"(\w+)"', group)}
        self.assertGreater(len(keys), 10)
        self.assertEqual([key for key in sorted(keys) if not re.search(rf"[`{{ ]{key}[:`]", page)], [])


if __name__ == "__main__":
    unittest.main()
