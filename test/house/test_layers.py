"""Who may include whom. Data flows one way through the rooms of src/faultline, and so do the includes."""

import pathlib
import re
import unittest

from sources import ROOT, sources_below

# Data flow from each room to the next; a room may include those before it.
ORDER = (
    "signal",
    "numerics",
    "rig",
    "effects",
    "segments",
    "attribution",
    "fit",
    "networks",
    "estimators",
    "detectors",
    "isolation",
    "alarms",
    "tuning",
)
ALLOWED = {room: set(ORDER[:place]) for place, room in enumerate(ORDER)}
ALLOWED["gap"] = {"signal", "numerics", "rig", "effects", "segments", "attribution", "fit"}
# Transport and what belongs to it stay at the rim.
RIM_ONLY = re.compile(
    r"^(ros|rosbag|roscpp|rosgraph|lcm|faultline_lcm|tf2|tf2_ros|diagnostic_updater|topic_tools)/"
    r"|^[a-z0-9_]*_msgs/|^faultline/[A-Z][A-Za-z]*\.h$"
)
INCLUDE = re.compile(r'^\s*#\s*include\s*[<"]([^>"]+)[>"]', re.M)


def includes(name):
    return INCLUDE.findall((ROOT / name).read_text())


def room(path):
    """Room of an include path or file name such as faultline/rig/port.h; None for what is no room's."""
    parts = pathlib.PurePath(path).parts
    return parts[1] if len(parts) > 2 and parts[0] == "faultline" else None


class Layers(unittest.TestCase):
    def core(self):
        found = sources_below("src/faultline")
        self.assertGreater(len(found), 10)
        return found

    def test_every_room_is_known(self):
        self.assertEqual(
            {room(name.relative_to("src")) for name in self.core()} - set(ALLOWED),
            set(),
            "a new room: give it its place in ALLOWED, and in the docs",
        )

    def test_rules_have_no_circle(self):
        for start, reachable in ALLOWED.items():
            todo, seen = list(reachable), set()
            while todo:
                here = todo.pop()
                self.assertNotEqual(here, start)
                if here not in seen:
                    seen.add(here)
                    todo.extend(ALLOWED[here])

    def test_rooms_include_earlier_rooms_only(self):
        wrong = []
        for name in self.core():
            mine = room(name.relative_to("src"))
            for path in includes(name):
                other = room(path)
                if other is not None and other != mine and other not in ALLOWED.get(mine, set()):
                    wrong.append(f"{name} includes {path}")
        self.assertEqual(wrong, [])

    def test_core_knows_no_transport(self):
        wrong = [f"{name} includes {path}" for name in self.core() for path in includes(name) if RIM_ONLY.search(path)]
        self.assertEqual(wrong, [])

    def test_core_does_not_include_the_rim(self):
        wrong = [
            f"{name} includes {path}"
            for name in self.core()
            for path in includes(name)
            if path.startswith(("nodes/", "cli/"))
        ]
        self.assertEqual(wrong, [])

    def test_nothing_but_a_rig_and_tests_includes_a_rig(self):
        wrong = [
            f"{name} includes {path}"
            for folder in ("src/faultline", "src/nodes", "src/cli", "src/rigs")
            for name in sources_below(folder)
            for path in includes(name)
            if path.startswith("rigs/") and path.split("/")[1] != (name.parts + ("",) * 3)[2]
        ]
        self.assertEqual(wrong, [])

    def test_rigs_know_general_rooms_only(self):
        found = sources_below("src/rigs")
        self.assertGreater(len(found), 5)
        wrong = [
            f"{name} includes {path}"
            for name in found
            for path in includes(name)
            if RIM_ONLY.search(path) or path.startswith(("nodes/", "cli/"))
        ]
        self.assertEqual(wrong, [])

    def test_nodes_do_not_include_the_program(self):
        wrong = [
            f"{name} includes {path}"
            for name in sources_below("src/nodes")
            for path in includes(name)
            if path.startswith("cli/")
        ]
        self.assertEqual(wrong, [])

    def test_no_circles_between_files(self):
        names = [
            name for folder in ("src/faultline", "src/rigs", "src/nodes", "src/cli") for name in sources_below(folder)
        ]
        known = {str(name.relative_to("src")): name for name in names}
        arrows = {path: [other for other in includes(name) if other in known] for path, name in known.items()}
        done = set()

        def visit(path, trail):
            self.assertNotIn(path, trail, " -> ".join([*trail, path]))
            if path not in done:
                for other in arrows[path]:
                    visit(other, [*trail, path])
                done.add(path)

        for path in arrows:
            visit(path, [])

    def test_includes_start_at_the_root(self):
        wrong = [
            f"{name} includes {path}"
            for name in sources_below("src")
            for path in includes(name)
            if path.startswith(".")
            or re.search(r'#\s*include\s*"' + re.escape(path), (ROOT / name).read_text())
            and not (ROOT / "src" / path).is_file()
        ]
        self.assertEqual(wrong, [])


class RulesThemselves(unittest.TestCase):
    def test_rim_pattern(self):
        for path in (
            "ros/ros.h",
            "rosbag/bag.h",
            "lcm/lcm-cpp.hpp",
            "std_msgs/Header.h",
            "faultline/Sample.h",
            "tf2_ros/buffer.h",
            "faultline_lcm/sample_t.hpp",
        ):
            self.assertRegex(path, RIM_ONLY)
        for path in ("faultline/signal/sample.h", "Eigen/Core", "boost/numeric/odeint.hpp", "vector"):
            self.assertNotRegex(path, RIM_ONLY)


if __name__ == "__main__":
    unittest.main()
