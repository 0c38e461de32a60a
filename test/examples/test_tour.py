"""docs/tour.md: every command in it, one after the other in one shell, as a newcomer types them; rviz stays shut."""

import os
import pathlib
import re
import subprocess
import tempfile
import unittest

from packages import ROOT

from graph import devel_space, free_port  # packages makes it known


class Tour(unittest.TestCase):
    def test_its_commands_run(self):
        text = (ROOT / "docs/tour.md").read_text()
        told = [line.strip() for line in re.findall(r"^    (\S.*)$", text, re.M)]
        self.assertGreater(len(told), 12)
        for picture in re.findall(r"\]\((\S+)\.png\)", text):
            self.assertTrue((ROOT / "docs" / f"{picture}.png").exists(), picture)
        port = free_port()
        with tempfile.TemporaryDirectory(prefix="faultline_tour_") as folder:
            script = ["set -eo pipefail"]
            for command in told:
                command = command.replace("/path/to/faultline/catkin_ws/devel", str(devel_space()))
                command = command.replace("/path/to/faultline", str(ROOT))
                command = command.replace("roscore", f"roscore -p {port}")
                command = command.replace("view.launch", "view.launch rviz:=false")
                # Of launches that were told to end, wait says that they did not end by themselves.
                command = command + " || true" if command == "wait %2 %3 %4" else command
                script += [f"echo '@@@ {command}'", command]
            env = dict(
                os.environ,
                PATH="/usr/bin:/bin:/usr/sbin:/sbin",
                ROS_MASTER_URI=f"http://127.0.0.1:{port}",
                ROS_IP="127.0.0.1",
                ROS_HOME=folder,
                ROS_LOG_DIR=str(pathlib.Path(folder) / "log"),
                PWD=folder,
            )
            done = subprocess.run(
                ["bash", "-c", "\n".join(script)],
                cwd=folder,
                env=env,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                timeout=600,
            )
            said = done.stdout.decode(errors="replace")
            said = "\n".join(line for line in re.split(r"[\r\n]+", said) if "RUNNING" not in line)
            print(said)
            self.assertEqual(done.returncode, 0, said[-3000:])
            parts = {part.split("\n", 1)[0]: part for part in said.split("@@@ ")}
            self.assertEqual(len(parts), len(told) + 1, sorted(parts))
            self.assertIn("eak", parts["rostopic echo -n 1 /servo_actuator/alarms/verdict"])
            self.assertIn("gap has left normal", parts["rostopic echo -n 1 /servo_actuator/gap/text"])
            self.assertIn("orifice_leakage@flow.chamber_a_chamber_b", parts["faultline diagnose session.bag"])
            gap = [part for command, part in parts.items() if command.startswith("faultline gap ")]
            self.assertIn("deadband at restriction.valve closes", gap[0])
            written = ["session.bag", "session.html", "gap.html"]
            for name in written + ["servo_actuator.perspective", "servo_actuator.plotjuggler.xml"]:
                self.assertGreater(os.path.getsize(os.path.join(folder, name)), 1000, name)


if __name__ == "__main__":
    unittest.main()
