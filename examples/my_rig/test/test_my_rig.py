"""What my_rig must do whatever is changed in it: run, stay quiet while it is healthy, and name what is broken.

Run by ctest, or by hand where `faultline` is on PATH and FAULTLINE_RIG_PATH names this package."""

import json
import os
import subprocess
import tempfile
import unittest

PROGRAM = os.environ.get("FAULTLINE_PROGRAM", "faultline")


class MyRig(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = folder.name

    def faultline(self, *words):
        done = subprocess.run([PROGRAM, *words], cwd=self.folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                              universal_newlines=True)
        self.assertEqual(done.returncode, 0, done.stdout)

    def alarms(self, *effect):
        """What is found in a simulated run."""
        self.faultline("simulate", "my_rig", "--seed", "1", *effect, "-o", "run.bag")
        self.faultline("diagnose", "run.bag", "--json", "answer.json")
        with open(os.path.join(self.folder, "answer.json")) as file:
            return json.load(file)["alarms"]

    def test_a_healthy_run_is_quiet(self):
        self.assertEqual(self.alarms(), [])

    def test_a_clogged_outlet_is_named(self):
        found = self.alarms("--effect", "clogging@restriction.outlet:fraction=0.4,from=300")
        self.assertIn(("clogging", "restriction.outlet"), [(alarm["effect"], alarm["port"]) for alarm in found])


if __name__ == "__main__":
    unittest.main()
