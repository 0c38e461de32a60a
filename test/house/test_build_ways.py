"""The two other ways in which people build faultline: catkin_make in a workspace of their own, and an install space.

The workspace is another one, but seen from its build folder the sources lie where they do in ./faultline's own, and the
flags are the same: ccache knows nearly every object again, which saves compiling everything once more.
"""

import fcntl
import os
import pathlib
import re
import shutil
import subprocess
import tempfile
import unittest

from sources import ROOT, repository_files

BUILD = pathlib.Path(os.environ.get("FAULTLINE_BUILD", ROOT / "catkin_ws" / "build"))


def clean_environment(**more):
    """As in a shell that knows nothing of this source tree."""
    kept = {
        key: value
        for key, value in os.environ.items()
        if not key.startswith(("ROS_", "CMAKE_", "FAULTLINE_"))
        and key not in ("LD_LIBRARY_PATH", "PYTHONPATH", "PKG_CONFIG_PATH", "ROSLISP_PACKAGE_DIRECTORIES")
    }
    kept["FAULTLINE_SUITE"] = os.environ.get("FAULTLINE_SUITE", "")
    kept.update(more)
    if pathlib.Path("/opt/ros/noetic/setup.bash").exists():
        said = subprocess.run(
            ["bash", "-c", "source /opt/ros/noetic/setup.bash && env -0"], env=kept, capture_output=True, check=True
        ).stdout.decode()
        kept = dict(pair.split("=", 1) for pair in said.split("\0") if "=" in pair)
    return kept


def run(command, **options):
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False, **options)
    if done.returncode != 0:
        raise AssertionError(f"{' '.join(map(str, command))} ended with {done.returncode}:\n{done.stdout[-4000:]}")
    return done.stdout


def rig_names():
    return [name.parts[1] for name in repository_files() if name.parts[0] == "config" and name.name == "rig.yaml"]


class BuildWays(unittest.TestCase):
    def check_program(self, prefix, program, folder, environment):
        said = run([program, "rigs"], cwd=folder, env=environment)
        for rig in rig_names():
            self.assertIn(rig, said)
        self.assertTrue((prefix / "share/faultline").is_dir())

    def test_catkin_make_in_a_foreign_workspace(self):
        workspace = pathlib.Path(tempfile.gettempdir()) / f"faultline_foreign_workspace_{os.getuid()}"
        # The lock stands beside the workspace and stays: whoever waits for it must wait for the same file.
        with open(workspace.with_suffix(".lock"), "w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            try:
                # A run that was cut off (a CI that kills it at its time limit) leaves its workspace behind.
                if workspace.exists():
                    self.assertEqual(workspace.stat().st_uid, os.getuid())
                    shutil.rmtree(workspace)
                workspace.mkdir(mode=0o700)
                for name in repository_files():
                    target = workspace / "src/faultline" / name
                    target.parent.mkdir(parents=True, exist_ok=True)
                    shutil.copy2(ROOT / name, target)
                # A rig's package beside faultline: built by the same CMake, found by ROS.
                shutil.copytree(ROOT / "examples/cascaded_tanks", workspace / "src/cascaded_tanks")
                environment = clean_environment()
                inside = workspace / "src/faultline/catkin_ws"
                devel = inside / "devel"
                said = run(
                    [
                        "catkin_make",
                        "-C",
                        str(workspace),
                        "--use-ninja",
                        "--build",
                        str(inside / "build"),
                        "-j1",
                        f"-DCATKIN_DEVEL_PREFIX={devel}",
                        "-DPYTHON_EXECUTABLE=/usr/bin/python3",
                    ],
                    cwd=workspace,
                    env=environment,
                )
                self.assertNotIn("warning:", said)
                self.check_program(devel, devel / "lib/faultline/faultline", workspace, environment)
                # rosrun's way to it, and the messages'
                setup = f"source {devel}/setup.bash"
                shown = run(
                    ["bash", "-c", f"{setup} && rospack find faultline && rosmsg show faultline/Sample"],
                    cwd=workspace,
                    env=environment,
                )
                self.assertIn(str(workspace / "src/faultline"), shown)
                self.assertIn("float64[] values", shown)
                rig = run(
                    ["bash", "-c", f"{setup} && {devel}/lib/faultline/faultline rigs cascaded_tanks"],
                    cwd=workspace,
                    env=environment,
                )
                self.assertIn("simulated", rig)
            finally:
                shutil.rmtree(workspace, ignore_errors=True)

    def test_install_space(self):
        with tempfile.TemporaryDirectory(prefix="faultline_install_") as folder:
            prefix = pathlib.Path(folder) / "space"
            run(["cmake", "--install", str(BUILD), "--prefix", str(prefix)])
            program = prefix / "lib/faultline/faultline"
            self.assertTrue((prefix / "lib/libfaultline.so").exists())
            self.assertTrue((prefix / "include/faultline/signal/sample.h").exists())
            self.assertTrue((prefix / "include/faultline/Sample.h").exists())
            self.assertTrue((prefix / "share/faultline/package.xml").exists())
            for name in repository_files():
                if name.parts[0] in ("launch", "config", "bags", "examples"):
                    self.assertTrue((prefix / "share/faultline" / name).exists(), name)
                if re.fullmatch(r"src/nodes/\w+_node\.cpp", str(name)):
                    self.assertTrue(os.access(prefix / "lib/faultline" / name.stem, os.X_OK), name)
            environment = clean_environment()
            # Nothing of the build may be needed: the loader must find the installed library.
            linked = run(["ldd", str(program)], env=environment)
            self.assertIn(
                str(prefix / "lib/libfaultline.so"),
                os.path.realpath(re.search(r"libfaultline\.so => (\S+)", linked).group(1)),
            )
            self.check_program(prefix, program, folder, environment)


if __name__ == "__main__":
    unittest.main()
