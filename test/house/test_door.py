"""The script `faultline` at the root: what it must not do."""
import os
import pathlib
import shutil
import subprocess
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]


class Door(unittest.TestCase):
    """In a tree that holds nothing but the door and the list of suites, so that whatever else it tries fails."""

    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="faultline_door_"))
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)
        shutil.copy(ROOT / "faultline", self.folder)
        (self.folder / "test/fuzz/corpus/toy_fuzz").mkdir(parents=True)
        (self.folder / "test/cli").mkdir()
        shutil.copy(ROOT / "test/run_suites.py", self.folder / "test")
        (self.folder / "test/cli/test_toy.py").write_text("")
        (self.folder / "catkin_ws/build").mkdir(parents=True)
        (self.folder / "catkin_ws/build/suites.txt").write_text("gtest rig_test /nowhere/rig_test\n")

    def door(self, *arguments):
        return subprocess.run(
            [self.folder / "faultline", *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            timeout=120,
            env=dict(os.environ, PYTHONDONTWRITEBYTECODE="1"),
        )

    def test_list_compiles_nothing(self):
        done = self.door("test", "--list")
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        self.assertEqual(done.stdout.split(), ["gtest", "rig_test", "python", "cli_toy"])
        self.assertEqual(sorted(path.name for path in (self.folder / "catkin_ws").rglob("*")), ["build", "suites.txt"])

    def test_fuzz_names_its_targets(self):
        for arguments in (["fuzz"], ["fuzz", "nothing"], ["fuzz", "*"]):
            done = self.door(*arguments)
            self.assertEqual(done.returncode, 2)
            self.assertEqual(len(done.stderr.splitlines()), 1)
            self.assertIn("toy_fuzz", done.stderr)


if __name__ == "__main__":
    unittest.main()
