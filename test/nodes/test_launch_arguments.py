"""Arguments of all launch files: each says what it is, there and in docs/nodes.md, and only what must be given is
required."""

import pathlib
import subprocess
import unittest
import xml.etree.ElementTree as ElementTree

from graph import ROOT, Graph

FILES = sorted((ROOT / "launch").glob("*.launch")) + sorted((ROOT / "examples").glob("*/launch/*.launch"))
INNER = "known_arguments.launch"  # for other launch files, not for people
VALUES = {"rig": "servo_actuator", "bag": "session.bag"}  # of what must be given


def arguments(path):
    """(name, default or None, meaning or None) of what can be given."""
    found = ElementTree.parse(path).getroot().findall("arg")
    return [(arg.get("name"), arg.get("default"), arg.get("doc")) for arg in found if arg.get("value") is None]


def table(paths):
    """As docs/nodes.md shows them; several files may share an argument."""
    lines, seen = [], {}
    for path in paths:
        for name, default, meaning in arguments(path):
            shown = "must be given" if default is None else "computed" if default.startswith("$(") else f"`{default}`"
            seen.setdefault((name, shown, meaning), []).append(path.stem)
    for (name, shown, meaning), files in seen.items():
        lines.append(f"| {', '.join(files)} | `{name}` | {shown} | {meaning} |")
    return lines


class Arguments(unittest.TestCase):
    def test_each_says_what_it_is(self):
        self.assertGreaterEqual(len(FILES), 13)
        for path in FILES:
            for name, _, meaning in arguments(path):
                self.assertTrue(meaning, f"{path}: {name}")

    def test_the_documentation_lists_them_all(self):
        text = (ROOT / "docs/nodes.md").read_text()
        shown = text.split("| launch file | argument |", 1)[1].split("\n\n", 1)[0].splitlines()[2:]
        self.assertEqual(shown, table([path for path in FILES if path.name != INNER]))

    def test_launch_files_of_rigs_hand_everything_on(self):
        rigs = [path for path in FILES if (path.parents[1] / "config" / path.stem).exists()]
        self.assertEqual(len(rigs), 7)
        for path in rigs:
            self.assertEqual(arguments(path), [], path)
            self.assertIn('pass_all_args="true"', path.read_text(), path)

    def test_what_is_required_is_needed_and_is_enough(self):
        with Graph() as graph:

            def roslaunch(*words):
                ran = subprocess.run(
                    ["roslaunch", *map(str, words)],
                    env=graph.environment,
                    stdout=subprocess.PIPE,
                    stderr=subprocess.STDOUT,
                    text=True,
                    timeout=30,
                )
                return ran.returncode, ran.stdout

            for path in FILES:
                if path.name == INNER:
                    continue
                with self.subTest(path.name):
                    code, said = roslaunch("--ros-args", path)
                    self.assertEqual(code, 0, said)
                    self.assertNotIn("undocumented", said)
                    parts = said.split("Optional")[0].split("Required Arguments:")
                    listed = {line.split(":")[0].strip() for line in parts[-1].splitlines() if ":" in line}
                    needed = {name for name, default, _ in arguments(path) if default is None}
                    self.assertEqual(listed, needed, said)
                    given = [f"{name}:={VALUES[name]}" for name in sorted(needed)]
                    code, said = roslaunch("--nodes", path, *given)
                    self.assertEqual(code, 0, said)
                    self.assertIn("/", said)
                    for left_out in given:
                        code, said = roslaunch("--nodes", path, *[word for word in given if word != left_out])
                        self.assertNotEqual(code, 0, said)
                        self.assertIn(left_out.split(":=")[0], said)


if __name__ == "__main__":
    unittest.main()
