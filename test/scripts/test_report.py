"""The report: what it shows of a known answer and series, and what it says to bad input."""
import json
import os
import pathlib
import re
import signal
import subprocess
import sys
import tempfile
import time
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
SCRIPTS = ROOT / "scripts"
sys.path.insert(0, str(SCRIPTS))
sys.dont_write_bytecode = True

import numpy as np  # noqa: E402

import report_data  # noqa: E402
import report_pictures  # noqa: E402
import report_units  # noqa: E402

RATE, DURATION, LEAK = 100, 30.0, 3.2e-5  # Hz, s, m^3/s


def make_columns():
    """A leak from 10 s on, with the channels' own noise."""
    random = np.random.default_rng(7)
    t = np.arange(0, DURATION, 1 / RATE)
    square = np.sign(np.sin(2 * np.pi * t / 10))
    leak = np.where(t >= 10, LEAK, 0.0)
    columns = {
        "t": t,
        "position_reference": 0.09 + 0.005 * square,
        "valve_command": 0.6 * square,
        "position": 0.09 + 0.005 * square + 5e-5 * random.normal(size=t.size),
        "velocity": 3e-3 * random.normal(size=t.size),
        "load_pressure": 6.5e5 * square + 1e4 * random.normal(size=t.size),
        "leak_flow": leak,
        "supply_pressure": 6.89e6 + 1e4 * random.normal(size=t.size),
        "q.leak_flow": leak * (1 + 0.02 * random.normal(size=t.size)),
        "q.leak_flow.std": np.full(t.size, 1e-6),
        "q.friction_force": 20 * np.sin(t),
        "q.friction_force.std": np.full(t.size, 12.0),
        "q.pressure_parity": 1e4 * random.normal(size=t.size),
        "q.pressure_parity.std": np.zeros(t.size),
    }
    for channel in ("position", "velocity"):
        columns["i." + channel] = 0.5 * random.normal(size=t.size)
        columns["i." + channel + ".std"] = np.full(t.size, 0.5)
    columns["normalised_innovation"] = random.chisquare(2, size=t.size)
    return columns


def make_answer():
    return {
        "rig": "servo_actuator",
        "duration": DURATION - 1 / RATE,
        "verdict": "fault",
        "sentence": "Internal leak between the chambers, 3.21e-05 m^3/s, since 10.1 s.",
        "alarms": [
            {
                "kind": "fault",
                "effect": "orifice_leakage",
                "port": "flow.chamber_a_chamber_b",
                "since": 10.12,
                "until": 29.99,
                "raised": 12.5,
                "active": True,
                "confidence": 0.984,
                "text": "Internal leak between the chambers",
                "size": {"name": "leak_flow", "value": 3.212e-5, "unit": "m^3/s", "low": 2.904e-5, "high": 3.52e-5},
            },
            {
                "kind": "data",
                "effect": "",
                "port": "sensor.velocity",
                "since": 20.0,
                "until": 21.5,
                "raised": 20.0,
                "active": False,
                "confidence": 1.0,
                "text": "velocity: <no number> comes from this channel",
            },
        ],
        "counts": {"samples": 3000, "lost": 12, "missing": {"velocity": 4}},
    }


def cause(effect, port, value, evidence, kind="fault"):
    return {
        "effect": effect,
        "port": port,
        "kind": kind,
        "evidence": evidence,
        "size": {
            "name": "coefficient",
            "value": value,
            "unit": "m^3/(s sqrt(Pa))",
            "low": 0.8 * value,
            "high": 1.2 * value,
        },
    }


def make_rankings():
    """A leak from 10 s on: nothing before, then the leak at the seal with a rival that falls behind, then friction
    beside it."""
    rankings = []
    for time in np.arange(1.5, DURATION, 2):
        wrong = time > 11
        evidence = 20 * time if wrong else 3.0
        first = [
            cause("orifice_leakage", "flow.chamber_a_chamber_b", 1.5e-8, evidence),
            cause(
                "laminar_leakage", "flow.chamber_a_chamber_b", 1e-11, 0.99 * evidence if time < 15 else 0.5 * evidence
            ),
        ]
        second = [cause("viscous_friction", "force.piston", 50.0, 40.0)]
        rankings.append(
            {
                "stage": "responses",
                "time": time,
                "judged_until": time - 1,
                "since": 10.0 if wrong else None,
                "threshold": 15,
                "evidence": evidence,
                "first": first if wrong else [],
                "second": second if time > 20 else [],
            }
        )
    return rankings


class ReportCase(unittest.TestCase):
    def setUp(self):
        self.scratch = tempfile.TemporaryDirectory()
        self.addCleanup(self.scratch.cleanup)
        self.folder = pathlib.Path(self.scratch.name)
        self.bag, self.out = self.folder / "run.bag", self.folder / "out.html"
        self.bag.write_bytes(b"recorded")

    def write(self, answer=None, columns=None):
        answer = make_answer() if answer is None else answer
        columns = make_columns() if columns is None else columns
        (self.folder / "j.json").write_text(json.dumps(answer))
        np.savetxt(
            self.folder / "s.csv",
            np.column_stack(list(columns.values())),
            delimiter=",",
            header=",".join(columns),
            comments="",
            fmt="%.9g",
        )

    def run_report(self, *arguments, given=True, environment=None):
        command = [sys.executable, str(SCRIPTS / "report.py"), "diagnose"]
        command += [str(self.bag), "-o", str(self.out)] if not arguments else list(arguments)
        command += ["--json", str(self.folder / "j.json"), "--series", str(self.folder / "s.csv")] if given else []
        return subprocess.run(
            command,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            universal_newlines=True,
            timeout=120,
            env=dict(os.environ, **(environment or {})),
        )

    def assert_one_line(self, done, *parts):
        self.assertEqual(done.returncode, 2, done.stderr)
        self.assertEqual(len(done.stderr.strip().splitlines()), 1, done.stderr)
        for part in parts:
            self.assertIn(part, done.stderr)
        self.assertFalse(self.out.exists())
        self.assertEqual(list(self.folder.glob(".faultline_report_*")), [])


class WholeReport(ReportCase):
    usual = None  # the page of the usual answer and series; drawing takes seconds

    def usual_page(self):
        if WholeReport.usual is None:
            WholeReport.usual = self.page()
        return WholeReport.usual

    def page(self, answer=None, columns=None):
        self.write(answer, columns)
        done = self.run_report()
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        self.assertIn(str(self.out), done.stdout)
        return self.out.read_text(encoding="utf-8")

    def test_says_verdict_alarms_and_counts(self):
        page = self.usual_page()
        words = re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", page.replace("\u00a0", " ")))
        self.assertIn('<body class="fault">', page)
        self.assertIn("FAULT Internal leak between the chambers, 3.21e-05 m^3/s, since 10.1 s.", words)
        for part in (
            "orifice leakage",
            "piston seal (internal leak)",
            "flow.chamber_a_chamber_b",
            "10.12 s",
            "2.38 s",
            "3.21·10⁻⁵ m³/s",
            "2.90·10⁻⁵ to 3.52·10⁻⁵",
            "98 %",
            "20.00 s",
            "21.50 s",
            "end of run",
            "3 000",
            "100 Hz",
        ):
            self.assertIn(part, words)
        self.assertRegex(words, r"12 lost samples")
        self.assertRegex(words, r"4 missing: velocity")

    def test_needs_nothing_else(self):
        page = self.usual_page()
        for outside in (r'src\s*=\s*"?http', r'href\s*=\s*"(?!#)', r"url\((?!#)", r"@import", r"<script", r"<link"):
            self.assertIsNone(re.search(outside, page), outside)
        self.assertEqual(page.count("<svg "), 5)
        names = re.findall(r'\bid="([^"]+)"', page)
        self.assertEqual(len(names), len(set(names)))
        self.assertTrue(set(re.findall(r'(?:url\(#|xlink:href="#)([^)"]+)', page)) <= set(names))
        self.assertLess(len(page), 3e6)

    def test_escapes_what_an_alarm_says(self):
        page = self.usual_page()
        self.assertIn("&lt;no number&gt;", page)
        self.assertNotIn("<no number>", page)

    def test_healthy_is_green_without_alarms(self):
        answer = dict(make_answer(), alarms=[], verdict="healthy", sentence="No fault found.")
        page = self.page(answer)
        self.assertIn('<body class="healthy">', page)
        self.assertIn("No fault found.", page)
        self.assertEqual(page.count("<svg "), 4)

    def test_takes_series_without_estimates_and_with_missing_numbers(self):
        columns = {
            name: values
            for name, values in make_columns().items()
            if "." not in name and name != "normalised_innovation"
        }
        columns["velocity"][500:600] = np.nan
        columns["position"][:] = np.nan
        page = self.page(columns=columns)
        self.assertEqual(page.count("<svg "), 2)
        self.assertNotIn("nan", re.sub(r"<[^>]+>", " ", page).lower().split())

    def test_shows_largest_residual_in_its_own_sigma(self):
        columns = make_columns()
        columns["i.velocity"][1234] = -8.15
        self.assertIn("largest: 16 σ", self.page(columns=columns))

    def test_ranking_of_causes_over_time(self):
        page = self.page(dict(make_answer(), rankings=make_rankings()))
        self.assertEqual(page.count("<svg "), 6)
        self.assertIn("Ranking of causes", page)
        drawn = page[page.index("Ranking of causes") : page.index("<h2>Estimates")]
        shown = re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", drawn))
        for part in (
            "threshold 15",
            "orifice_leakage@flow.chamber_a_chamber_b",
            "laminar_leakage@flow.chamber_a_chamber_b",
            "What else is wrong",
            "named",
            "viscous_friction@force.piston",
            "How much?",
            "last: 1.50 (1.20 to 1.80) 10⁻⁸ m³/(s √Pa)",
        ):
            self.assertIn(part, shown)
        names = re.findall(r'\bid="([^"]+)"', page)
        self.assertEqual(len(names), len(set(names)))

    def test_ranking_while_nothing_is_wrong(self):
        quiet = [judgement for judgement in make_rankings() if not judgement["first"]]
        page = self.page(dict(make_answer(), alarms=[], verdict="healthy", sentence="No fault found.", rankings=quiet))
        self.assertEqual(page.count("<svg "), 5)
        self.assertIn("threshold 15", page)
        self.assertNotIn("How much?", page)

    def test_what_is_told_instead_of_all_causes_has_no_size_of_theirs(self):
        rankings = make_rankings()
        rankings[-1]["doubt"] = "position: this transducer is stuck"
        page = self.page(dict(make_answer(), rankings=rankings))
        self.assertIn("None of these causes: position: this transducer is stuck", page)
        self.assertNotIn("How much?", page)

    def test_unknown_rig_stands_for_itself(self):
        page = self.page(dict(make_answer(), rig="no_such_rig"))
        self.assertIn("no_such_rig", page)


class BadInput(ReportCase):
    def test_config_that_is_no_datasheet(self):
        self.write()
        for text in ("- 1\n- 2\n", "channels: [{unit: m}]\n", "title: [\n"):
            (self.folder / "own.yaml").write_text(text)
            done = self.run_report(str(self.bag), "-o", str(self.out), "--config", str(self.folder / "own.yaml"))
            self.assert_one_line(done, "own.yaml", "no datasheet")

    def test_missing_bag(self):
        self.write()
        self.assert_one_line(
            self.run_report(str(self.folder / "none.bag"), "-o", str(self.out)), "none.bag", "no such file"
        )

    def test_answer_without_key(self):
        for key in ("rig", "duration", "verdict", "alarms"):
            answer = make_answer()
            del answer[key]
            self.write(answer)
            self.assert_one_line(self.run_report(), "j.json", "'" + key + "'")

    def test_alarm_without_key(self):
        answer = make_answer()
        del answer["alarms"][1]["since"]
        self.write(answer)
        self.assert_one_line(self.run_report(), "alarm 1", "'since'")

    def test_values_of_the_wrong_kind(self):
        for key, value in (("duration", "long"), ("rig", 7)):
            self.write(dict(make_answer(), **{key: value}))
            self.assert_one_line(self.run_report(), "j.json", "'" + key + "'")
        answer = make_answer()
        answer["alarms"][0]["until"] = "late"
        self.write(answer)
        self.assert_one_line(self.run_report(), "alarm 0", "'until'")

    def test_ranking_of_the_wrong_kind(self):
        for spoil in (
            lambda r: r.pop("time"),
            lambda r: r.update(first=3),
            lambda r: r.update(evidence="much"),
            lambda r: r["first"][0].pop("port"),
            lambda r: r["first"][0].update(size=None),
        ):
            rankings = make_rankings()
            spoil(rankings[7])
            self.write(dict(make_answer(), rankings=rankings))
            self.assert_one_line(self.run_report(), "j.json", "ranking 7")
        self.write(dict(make_answer(), rankings={}))
        self.assert_one_line(self.run_report(), "'rankings'")

    def test_values_that_cannot_be_drawn(self):
        alarm = make_answer()["alarms"][0]
        for change in ({"effect": 1.5}, {"size": dict(alarm["size"], low="x")}):
            self.write(dict(make_answer(), alarms=[dict(alarm, **change)]))
            self.assert_one_line(self.run_report(), "j.json", "cannot be drawn")

    def test_not_json(self):
        self.write()
        (self.folder / "j.json").write_text('{"rig": ')
        self.assert_one_line(self.run_report(), "j.json", "not JSON")

    def test_bad_series(self):
        for text, part in (
            ("", "no column t"),
            ("time,x\n0,1\n1,2\n", "no column t"),
            ("t,x\n0,1\n", "1 samples"),
            ("t,x\n0,1\n1\n", "line 3"),
            ("t,x\n0,1\n1,high\n", "line 3"),
            ("t,x\n,1\n1,2\n", "time"),
        ):
            self.write()
            (self.folder / "s.csv").write_text(text)
            self.assert_one_line(self.run_report(), "s.csv", part)

    def test_output_that_cannot_be_written(self):
        self.write()
        done = self.run_report(str(self.bag), "-o", str(self.folder / "none" / "out.html"))
        self.assert_one_line(done, "cannot be written")
        self.assert_one_line(self.run_report(str(self.bag), "-o", str(self.folder)), "is a folder")
        other = self.folder / "other.bag"
        other.write_bytes(b"#ROSBAG V2.0\n")
        self.assert_one_line(self.run_report(str(self.bag), "-o", str(other)), "this is a recording")
        self.assertEqual(other.read_bytes(), b"#ROSBAG V2.0\n")

    def test_json_without_series(self):
        done = self.run_report(str(self.bag), "--json", "j.json", given=False)
        self.assertEqual(done.returncode, 2)
        self.assertIn("--json and --series go together", done.stderr)

    def test_program_that_refuses(self):
        program = self.folder / "faultline"
        program.write_text("#!/bin/sh\necho 'faultline diagnose: run.bag: not a bag; record it again' >&2\nexit 2\n")
        program.chmod(0o755)
        done = self.run_report(
            str(self.bag), "-o", str(self.out), given=False, environment={"FAULTLINE_PROGRAM": str(program)}
        )
        self.assert_one_line(done, "faultline diagnose: run.bag: not a bag; record it again")

    def test_no_program(self):
        done = self.run_report(
            str(self.bag), "-o", str(self.out), given=False, environment={"FAULTLINE_PROGRAM": "/none"}
        )
        self.assert_one_line(done, "FAULTLINE_PROGRAM=/none")

    def test_without_matplotlib(self):
        (self.folder / "matplotlib.py").write_text("raise ImportError('No module named matplotlib')\n")
        self.write()
        done = self.run_report(environment={"PYTHONPATH": str(self.folder)})
        self.assert_one_line(done, "install python3-matplotlib")


def caught(pid, number):
    """Whether the process has a handler for the signal yet: proc(5), SigCgt."""
    status = pathlib.Path(f"/proc/{pid}/status").read_text()
    return int(re.search(r"SigCgt:\s*(\w+)", status).group(1), 16) >> (number - 1) & 1


class Files(ReportCase):
    def test_the_report_takes_the_place_of_nothing_that_is_read(self):
        self.write()
        (self.folder / "own.yaml").write_text("title: own\n")
        (self.folder / "link").symlink_to(self.bag)
        os.link(self.bag, self.folder / "hard")
        before = {path: path.read_bytes() for path in self.folder.iterdir()}
        for name in ("run.bag", "link", "hard", "j.json", "s.csv", "own.yaml"):
            done = self.run_report(
                str(self.bag), "-o", str(self.folder / name), "--config", str(self.folder / "own.yaml")
            )
            self.assert_one_line(done, name, "this file is read")
        self.assert_one_line(
            self.run_report(str(self.bag), "-o", str(ROOT / "config" / "servo_actuator" / "rig.yaml")), "own datasheets"
        )
        self.assertEqual({path: path.read_bytes() for path in self.folder.iterdir()}, before)

    def test_a_link_stays_a_link_and_a_device_a_device(self):
        self.write()
        (self.folder / "link.html").symlink_to(self.out)
        self.assertEqual(self.run_report(str(self.bag), "-o", str(self.folder / "link.html")).returncode, 0)
        self.assertTrue((self.folder / "link.html").is_symlink())
        self.assertTrue(self.out.is_file())
        self.assertEqual(self.run_report(str(self.bag), "-o", "/dev/null").returncode, 0)
        self.assertTrue(pathlib.Path("/dev/null").is_char_device())

    def test_names_that_are_no_text(self):
        self.write()
        bag = self.folder / os.fsdecode(b"run\xff.bag")
        self.bag.rename(bag)
        out = self.folder / os.fsdecode(b"out\xff.html")
        done = self.run_report(str(bag), "-o", str(out), environment={"LC_ALL": "C.UTF-8"})
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        self.assertIn("run?.bag", out.read_text(encoding="utf-8"))
        self.assert_one_line(
            self.run_report(str(self.folder / os.fsdecode(b"no\xff.bag")), environment={"LC_ALL": "C.UTF-8"}),
            "no such file",
        )

    def test_standard_output_that_takes_nothing(self):
        self.write()
        command = [
            sys.executable,
            str(SCRIPTS / "report.py"),
            str(self.bag),
            "-o",
            str(self.out),
            "--json",
            str(self.folder / "j.json"),
            "--series",
            str(self.folder / "s.csv"),
        ]
        for target in ("> /dev/full", ">&-"):
            done = subprocess.run(
                ["bash", "-c", '"$@" ' + target, "bash", *command], stderr=subprocess.PIPE, text=True, timeout=120
            )
            self.assertEqual(done.returncode, 2, done.stderr)
            self.assertEqual(len(done.stderr.splitlines()), 1, done.stderr)
            self.assertIn("standard output", done.stderr)

    def test_interrupted_at_any_moment(self):
        program = self.folder / "faultline"
        program.write_text("#!/bin/sh\nexec sleep 60\n")
        program.chmod(0o755)
        before = sorted(self.folder.iterdir())
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            for after in (0.0, 0.3, 3.0):  # while libraries are loaded, and while the diagnosis runs
                with self.subTest(number=number, after=after):
                    process = subprocess.Popen(
                        [sys.executable, str(SCRIPTS / "report.py"), str(self.bag), "-o", str(self.out)],
                        env=dict(os.environ, FAULTLINE_PROGRAM=str(program), TMPDIR=str(self.folder)),
                        stdout=subprocess.PIPE,
                        stderr=subprocess.PIPE,
                        text=True,
                    )
                    while not caught(process.pid, signal.SIGHUP):  # the last that is set
                        time.sleep(0.01)
                    time.sleep(after)
                    process.send_signal(number)
                    said, errors = process.communicate(timeout=20)
                    self.assertEqual((process.returncode, said), (128 + number, ""), errors)
                    self.assertEqual(errors, "faultline report: interrupted; nothing unfinished is left behind\n")
                    self.assertEqual(sorted(self.folder.iterdir()), before)

    def test_interrupted_where_exceptions_are_lost(self):
        # As libraries do while they are loaded: an exception in __del__ is printed and forgotten.
        done = subprocess.run(
            [
                sys.executable,
                "-c",
                "import os, signal, sys\n"
                "import report_signals\n"
                "report_signals.end_on_signals('loading')\n"
                "class Part:\n"
                "    def __del__(self): os.kill(os.getpid(), signal.SIGTERM)\n"
                "part = Part()\n"
                "del part\n"
                "print('went on')\n",
            ],
            env=dict(os.environ, PYTHONPATH=str(SCRIPTS)),
            capture_output=True,
            text=True,
            timeout=20,
        )
        self.assertEqual((done.returncode, done.stdout), (128 + signal.SIGTERM, ""), done.stderr)


class Parts(unittest.TestCase):
    def test_engineering_units(self):
        for unit, value, shown, name in (
            ("Pa", 6.89e6, 68.9, "bar"),
            ("m^3/s", 3.2e-5, 0.032, "l/s"),
            ("m", 0.09, 90, "mm"),
            ("K", 300.0, 26.85, "°C"),
            ("rad/s", 10.0, 95.4929658551372, "1/min"),
            ("V", 2, 2, "V"),
        ):
            scale = report_units.Scale(unit)
            self.assertAlmostEqual(scale.value(value), shown)
            self.assertEqual(scale.unit, name)
        self.assertEqual(report_units.Scale("K").span(2.0), 2.0)

    def test_numbers(self):
        self.assertEqual(report_units.show(0.032118), "0.0321")
        self.assertEqual(report_units.show(-412.7), "−413")
        self.assertEqual(report_units.show(7.82e-9), "7.82·10⁻⁹")
        self.assertEqual(report_units.show(float("nan")), "–")

    def test_envelope_keeps_a_spike(self):
        values = np.zeros(60000)
        values[41234] = 5.0
        values[100:300] = np.nan
        starts, low, high = report_pictures.envelope(values)
        self.assertLess(len(starts), 1500)
        self.assertEqual(np.nanmax(high), 5.0)
        self.assertEqual(np.nanmin(low), 0.0)
        at = starts[int(np.nanargmax(high))]
        self.assertTrue(at <= 41234 < at + 60)
        self.assertTrue(np.isnan(high[3]))

    def test_pairs_stay_together(self):
        for rows in (3999, 4000, 60000):
            starts = report_pictures.stretches(rows)
            self.assertTrue(np.all(starts % 2 == 0))
            self.assertLessEqual(len(starts), 1100)
        self.assertEqual(len(report_pictures.stretches(900)), 900)

    def test_chi_square(self):
        for degrees, quantile in ((1, 6.635), (2, 9.210), (4, 13.277), (10, 23.209)):  # tables of the distribution
            self.assertAlmostEqual(report_pictures.chi_square_99(degrees) / quantile, 1.0, delta=0.01)

    def test_no_line_over_a_gap(self):
        for rows in (300, 4000, 30000):
            time = np.arange(rows) * 0.01
            time[rows // 2 :] += 50.0
            table = report_data.open_gaps(np.column_stack([time, np.ones(rows)]), 0)
            starts, low, _ = report_pictures.envelope(table[:, 1])
            inside = np.isnan(low)
            self.assertTrue(inside.any())
            at = table[starts, 0][inside]
            self.assertTrue(np.all((at >= time[rows // 2 - 1]) & (at <= time[rows // 2])))
            self.assertTrue(np.all(np.diff(table[:, 0]) > 0))
        even = np.column_stack([np.arange(300.0), np.ones(300)])
        self.assertIs(report_data.open_gaps(even, 0), even)

    def test_series_with_units_and_empty_cells(self):
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "s.csv")
            with open(path, "w", encoding="utf-8") as file:
                file.write("t,x,q.leak_flow[m^3/s]\n5,1,\n6,,2e-5\n")
            series = report_data.read_series(path)
        self.assertEqual(list(series.time), [5, 6])
        self.assertEqual(series.units, {"q.leak_flow": "m^3/s"})
        self.assertTrue(np.isnan(series.get("x")[1]))
        self.assertEqual(series.get("q.leak_flow")[1], 2e-5)


if __name__ == "__main__":
    unittest.main()
