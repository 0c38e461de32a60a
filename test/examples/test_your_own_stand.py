"""docs/your_own_stand.md: every command in it, one after the other in one shell, as a newcomer types them."""

import os
import pathlib
import re
import subprocess
import tempfile
import time
import unittest

from packages import ROOT, plain_environment

from graph import free_port  # packages makes it known


def commands(text):
    return [line.strip() for line in re.findall(r"^    (\S.*)$", text, re.M)]


class YourOwnStand(unittest.TestCase):
    def test_its_commands_run(self):
        told = commands((ROOT / "docs/your_own_stand.md").read_text())
        words = " ".join(told)
        for wanted in ("new-rig", "cmake --build", "ctest", "rigs", "simulate", "diagnose", "report", "import", "fit",
                       "gap", "roslaunch"):
            self.assertIn(wanted, words)
        with tempfile.TemporaryDirectory(prefix="faultline_stand_") as folder:
            script = ["set -eo pipefail"]
            for command in told:
                command = command.replace("/path/to/faultline", str(ROOT))
                script += [f"echo '@@@ {command}'", command]
            env = plain_environment(
                PATH="/usr/bin:/bin:/usr/sbin:/sbin",
                ROS_MASTER_URI=f"http://127.0.0.1:{free_port()}",
                ROS_IP="127.0.0.1",
                ROS_HOME=folder,
                ROS_LOG_DIR=str(pathlib.Path(folder) / "log"),
            )
            start = time.monotonic()
            done = subprocess.run(
                ["bash", "-c", "\n".join(script)],
                cwd=folder,
                env=env,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
                timeout=1200,
            )
            print(done.stdout)
            print(f"{len(told)} commands in {time.monotonic() - start:.0f} s")
            last = done.stdout.rsplit("@@@ ", 1)[-1]
            self.assertEqual(done.returncode, 0, f"{last[-2000:]}")
            self.assertEqual(done.stdout.count("@@@ "), len(told))
            said = {part.split("\n", 1)[0]: part for part in done.stdout.split("@@@ ")}
            found = said["faultline diagnose clogged.bag"]
            self.assertIn("clogging@restriction.outlet", found)
            self.assertIn("No fault found", said["faultline diagnose mine.bag --config fitted.yaml"])
            gap = said["faultline gap run1.bag run2.bag --report gap.html"]
            self.assertIn("deadband at command.pump_voltage closes", gap)
            for name in ("clogged.html", "gap.html", "fitted.yaml", "mine.bag"):
                self.assertTrue(os.path.getsize(os.path.join(folder, name)) > 1000, name)


if __name__ == "__main__":
    unittest.main()
