"""What a recording needs of memory does not grow with its length, and the table of its course stays as short."""
import os
import pathlib
import subprocess
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from program import ProgramTest, program  # noqa: E402


class LongRecordings(ProgramTest):
    def memory(self, *words):
        """Peak of the program's memory, MB."""
        process = subprocess.Popen([program(), *map(str, words)], cwd=self.folder, stdout=subprocess.DEVNULL)
        status, used = os.wait4(process.pid, 0)[1:]
        process.returncode = status
        self.assertEqual(status, 0)
        return used.ru_maxrss / 1024

    def test_memory_of_diagnose_and_simulate_is_that_of_a_short_one(self):
        peaks = {}
        for seconds in (60, 360):
            words = ["simulate", "servo_actuator", "--duration", seconds, "--compression", "none", "--quiet"]
            simulated = self.memory(*words, "-o", "run.bag")
            diagnosed = self.memory("diagnose", "run.bag", "--json", "run.json", "--series", "run.csv")
            rows = (self.folder / "run.csv").read_text().count("\n") - 1
            self.assertTrue(2000 <= rows <= 4000, rows)
            peaks[seconds] = (simulated, diagnosed)
        # Kept, the samples of five minutes alone would be 35 MB.
        for short, long in zip(*peaks.values()):
            self.assertLess(long, short + 12, peaks)


if __name__ == "__main__":
    unittest.main()
