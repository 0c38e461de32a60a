"""./faultline bench in short: every benchmark runs once without an error, and its tables show all of them."""
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "scripts"))
import bench  # noqa: E402


def programs():
    if os.environ.get("FAULTLINE_BUILD"):
        beside = pathlib.Path(os.environ["FAULTLINE_BUILD"]).parent / "devel/lib/faultline"
        if beside.is_dir():
            return beside
    return ROOT / "catkin_ws/devel/lib/faultline"


def run_bench(folder):
    command = [sys.executable, str(ROOT / "scripts/bench.py"), "--quick", "--programs", str(folder)]
    return subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, timeout=300)


class Bench(unittest.TestCase):
    def test_latency_over_ros_is_measured(self):
        """That it runs and hears the nodes; a busy machine may be late, so no number is asserted."""
        with tempfile.TemporaryDirectory() as folder:
            samples = os.path.join(folder, "samples.csv")
            make = ["simulate", "servo_actuator", "--profile", "random", "--duration", "4", "--quiet", "-o", samples]
            subprocess.run([str(programs() / "faultline"), *make], check=True)
            command = [sys.executable, str(ROOT / "test/bench/latency.py"), "--programs", str(programs())]
            command += ["--csv", samples, "--sheet", bench.SHEET, "--duration", "6"]
            done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, timeout=120)
        self.assertRegex(done.stdout, r"sample -> estimate +p50 +[0-9.]+ ms", done.stderr[-500:])
        self.assertRegex(done.stdout, r"bad sample -> data alarm +p50 +[0-9.]+ ms")

    def test_every_benchmark_runs_and_is_shown(self):
        done = run_bench(programs())
        self.assertEqual(done.returncode, 0, done.stderr[-500:])
        times = re.findall(r" ([0-9.]+) us ", done.stdout)
        listed = subprocess.run(
            [str(programs() / "faultline_bench"), "--benchmark_list_tests"],
            cwd=ROOT,
            check=True,
            stdout=subprocess.PIPE,
            text=True,
        ).stdout.split()
        groups = tuple(f"{group}/" for group, _, _ in bench.NUMERICS)
        named = {name for name, _, _ in bench.ROWS + bench.HISTOGRAMS}
        named |= {name for name in listed if name.startswith(groups)}
        self.assertEqual(set(listed), named, "a benchmark that no table shows, or a row without one")
        self.assertEqual(len(times), len(listed))
        for time in times:
            self.assertGreater(float(time), 0)

    def test_a_broken_benchmark_is_told_in_one_line(self):
        folder = pathlib.Path(tempfile.mkdtemp(prefix="faultline_bench_"))
        self.addCleanup(shutil.rmtree, folder, ignore_errors=True)
        program = folder / "faultline_bench"
        run = {"run_name": "a/b", "error_occurred": True, "error_message": "wrong answer"}
        wrong = json.dumps({"benchmarks": [run]})
        for script, says in (
            ("echo servo: alarms are missing >&2; exit 3", "ended with 3: servo: alarms are missing"),
            (f"echo '{wrong}'", "a/b: wrong answer"),
        ):
            program.write_text(f"#!/bin/sh\n{script}\n")
            program.chmod(0o755)
            done = run_bench(folder)
            self.assertEqual(done.returncode, 1)
            self.assertIn(says, done.stderr)
            self.assertEqual(len(done.stderr.splitlines()), 1)


if __name__ == "__main__":
    unittest.main()
