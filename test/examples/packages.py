"""Rig packages outside the tree for the tests in this folder: copied into a temporary folder, built there against the
devel space of the build under test."""

import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / "test/nodes"))

from graph import built_environment, devel_space  # noqa: E402

# Of rigs that the tester's own shell may know.
FOREIGN = ("FAULTLINE_RIG_PATH", "FAULTLINE_SHARE")


def environment(**more):
    """That of a shell in which devel/setup.bash was sourced."""
    values = {key: value for key, value in built_environment().items() if key not in FOREIGN}
    values.update(more)
    return values


def plain_environment(**more):
    """That of a shell that knows nothing of ROS."""
    values = {
        key: value
        for key, value in os.environ.items()
        if not key.startswith(("ROS_", "CMAKE_", "FAULTLINE_")) and key not in ("LD_LIBRARY_PATH", "PYTHONPATH")
    }
    values["FAULTLINE_SUITE"] = os.environ.get("FAULTLINE_SUITE", "")
    values.update(more)
    return values


def run(*command, env=None, cwd=None, code=0):
    done = subprocess.run(
        [str(word) for word in command],
        env=env if env is not None else environment(),
        cwd=cwd,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        timeout=900,
    )
    if code is not None and done.returncode != code:
        raise AssertionError(
            f"{' '.join(map(str, command))} ended with {done.returncode}:\n{done.stdout[-3000:]}\n{done.stderr[-3000:]}"
        )
    return done


def build(folder, *options, env=None):
    """As a user does, but without optimisation, and through ccache where it is: returns the package's devel space."""
    env = env if env is not None else environment()
    env.setdefault("CCACHE_BASEDIR", str(folder.parent))
    env.setdefault("CCACHE_NOHASHDIR", "1")
    launcher = ["-DCMAKE_CXX_COMPILER_LAUNCHER=ccache"] if shutil.which("ccache") else []
    run(
        "cmake",
        "-S",
        folder,
        "-B",
        folder / "build",
        "-G",
        "Ninja",
        "-DPYTHON_EXECUTABLE=/usr/bin/python3",
        "-DCMAKE_CXX_FLAGS=-Wall -Wextra -Werror",
        *launcher,
        *options,
        env=env,
    )
    run("cmake", "--build", folder / "build", env=env)
    return folder / "build/devel"


def copied(example, target):
    shutil.copytree(ROOT / "examples" / example, target)
    return target


def program():
    return str(devel_space() / "lib/faultline/faultline")


class OutsideTest(unittest.TestCase):
    """With a folder of its own that vanishes afterwards, in which the program runs."""

    env = None  # what the program runs in

    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="faultline_outside_")
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name).resolve()

    def faultline(self, *words, env=None, code=0):
        return run(program(), *words, env=env or self.env or environment(), cwd=self.folder, code=code)

    def complains(self, words, *says, env=None):
        """Exit status 2 and one line on stderr that holds all of `says`."""
        done = self.faultline(*words, env=env, code=2)
        lines = done.stderr.splitlines()
        self.assertEqual(len(lines), 1, done.stderr)
        for text in says:
            self.assertIn(text, lines[0])
