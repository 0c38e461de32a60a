"""Every shipped session, diagnosed offline: verdict, kind, place, delay, size and no false alarm, as bags/index.yaml
promises; and each is the very file that its command makes."""

import csv
import io
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

import yaml

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "test/cli"))
import program  # noqa: E402

SESSIONS = yaml.safe_load((ROOT / "bags/index.yaml").read_text())["bags"]


def run(*arguments):
    done = subprocess.run([program.program(), *map(str, arguments)], capture_output=True, text=True, timeout=120)
    if done.returncode:
        raise AssertionError(done.stderr)
    return done.stdout


def true_flow(bag, seconds):
    """Mean of the leak's flow meter over the last seconds, in m^3/s."""
    with tempfile.TemporaryDirectory() as folder:
        table = pathlib.Path(folder) / "session.csv"
        run("export", bag, "-o", table)
        rows = list(csv.DictReader(io.StringIO(table.read_text())))
    end = float(rows[-1]["t"])
    values = [float(row["leak_flow"]) for row in rows if float(row["t"]) > end - seconds]
    return sum(values) / len(values)


class Sessions(unittest.TestCase):
    def test_index_names_every_bag_and_no_other(self):
        self.assertEqual(sorted(s["file"] for s in SESSIONS), sorted(p.name for p in (ROOT / "bags").glob("*.bag")))
        self.assertGreaterEqual(len(SESSIONS), 3)

    def test_each_says_what_the_index_promises(self):
        for session in SESSIONS:
            with self.subTest(session["file"]):
                bag = ROOT / "bags" / session["file"]
                report = json.loads(run("diagnose", bag, "--json", "-"))
                self.assertEqual(report["verdict"], session["expect"]["verdict"])
                wanted = session["expect"]["alarms"]
                self.assertEqual(len(report["alarms"]), len(wanted), report["alarms"])
                for alarm, expected in zip(report["alarms"], wanted):
                    for key in ("kind", "effect", "port"):
                        self.assertEqual(alarm[key], expected[key])
                    for key in ("since", "raised"):
                        low, high = expected[key]
                        self.assertTrue(low <= alarm[key] <= high, f"{key} {alarm[key]} is not within {low}..{high}")
                    self.assertTrue(alarm["active"])
                    if "size" not in expected:
                        continue
                    size = alarm["size"]
                    self.assertEqual(size["unit"], expected["size"]["unit"])
                    told = expected["size"]
                    truth = told["truth"] if "truth" in told else true_flow(bag, told["window"])
                    self.assertLess(
                        abs(size["value"] / truth - 1), expected["size"]["relative_error"], f"truth {truth}"
                    )
                    self.assertTrue(size["low"] <= truth <= size["high"], f"{truth} outside the 90 % bounds {size}")

    def test_each_is_what_its_command_makes(self):
        for session in SESSIONS:
            with self.subTest(session["file"]), tempfile.TemporaryDirectory() as folder:
                again = pathlib.Path(folder) / session["file"]
                run(*session["command"].split(), "-o", again)
                report = json.loads(run("diagnose", again, "--json", "-"))
                shipped = json.loads(run("diagnose", ROOT / "bags" / session["file"], "--json", "-"))
                report.pop("made_by"), shipped.pop("made_by")
                self.assertEqual(report, shipped)


if __name__ == "__main__":
    unittest.main()
