"""What may lie in the repository: sizes, words, and files that must parse."""

import os
import re
import subprocess
import unittest
import xml.etree.ElementTree as ElementTree

import yaml
from sources import ROOT, repository_files

MEGABYTE = 1000000
TEXT = {
    ".h",
    ".cpp",
    ".py",
    ".md",
    ".rst",
    ".txt",
    ".yaml",
    ".xml",
    ".launch",
    ".test",
    ".msg",
    ".lcm",
    ".sh",
    ".json",
    ".cmake",
    ".rviz",
    ".perspective",
    ".html",
    ".css",
    ".js",
    "",
}
# Put together from pieces, so that this file passes its own test.
UNFINISHED = re.compile(
    r"\b("
    + "|".join(
        [
            "TO" + "DO",
            "FIX" + "ME",
            "XX" + "X",
            "WI" + "P",
            "HA" + "CK",
            "TB" + "D",
            "[Pp]lace" + "holder",
            "[Nn]ot yet impl" + "emented",
            "[Uu]nimpl" + "emented",
            "NotImpl" + "emented",
            "lorem ip" + "sum",
            "coming so" + "on",
        ]
    )
    + r")\b"
)
MACHINE_PATH = re.compile(
    "(?<![A-Za-z0-9_$}.])/(" + "|".join(["root", "work", "home/[a-z]+", "Users", "mnt"]) + r")(/|\b)"
)


def text_files():
    for name in repository_files():
        if name.suffix in TEXT:
            yield name, (ROOT / name).read_text(errors="replace")


class Sizes(unittest.TestCase):
    def test_no_file_is_large(self):
        large = [str(name) for name in repository_files() if (ROOT / name).stat().st_size > 2 * MEGABYTE]
        self.assertEqual(large, [])

    def test_bags_stay_small_together(self):
        total = sum((ROOT / name).stat().st_size for name in repository_files() if name.parts[0] == "bags")
        self.assertLess(total, 20 * MEGABYTE)

    def test_no_source_is_long(self):
        long = [
            f"{name}: {text.count(chr(10))} lines"
            for name, text in text_files()
            if name.parts[0] in ("src", "test", "scripts", "examples")
            and name.suffix in (".h", ".cpp", ".py")
            and text.count("\n") > 600
        ]
        self.assertEqual(long, [])

    def test_no_type_has_the_name_of_another(self):
        # Two of one name in one namespace are one to the linker: which constructor runs then depends on optimisation.
        declared = re.compile(r"^(?:struct|class) (\w+)(?: final)?(?: : [^;{]*)? \{", re.M)
        found = {}
        for name, text in text_files():
            if name.parts[0] == "src" and name.suffix == ".h":
                for word in declared.findall(text):
                    found.setdefault(word, set()).add(str(name))
        self.assertGreater(len(found), 100)
        self.assertEqual({word: names for word, names in found.items() if len(names) > 1}, {})

    def test_no_line_is_long(self):
        # What a test quotes as it stands (a datasheet in a raw string) keeps its lines.
        quoted = re.compile(r'R"\((.*?)\)"', re.S)
        long = [
            f"{name}:{number}"
            for name, text in text_files()
            if name.suffix in (".h", ".cpp", ".py", ".launch")
            for number, line in enumerate(quoted.sub(lambda m: "\n" * m.group().count("\n"), text).splitlines(), 1)
            if len(line) > 120
        ]
        self.assertEqual(long, [])


class Words(unittest.TestCase):
    def test_nothing_is_unfinished(self):
        found = [
            f"{name}:{number}: {line.strip()}"
            for name, text in text_files()
            for number, line in enumerate(text.splitlines(), 1)
            if UNFINISHED.search(line)
        ]
        self.assertEqual(found, [])

    def test_no_path_of_a_machine(self):
        found = [
            f"{name}:{number}: {line.strip()}"
            for name, text in text_files()
            for number, line in enumerate(text.splitlines(), 1)
            if MACHINE_PATH.search(line)
        ]
        self.assertEqual(found, [])

    def test_patterns_bite(self):
        for line in (
            "// TO" + "DO: more",
            "a place" + "holder",
            'open("/ro' + 'ot/x")',
            "see /wo" + "rk/main/x",
            "/ho" + "me/someone",
        ):
            self.assertTrue(UNFINISHED.search(line) or MACHINE_PATH.search(line), line)
        for line in (
            "#!/usr/bin/python3",
            "$root/work/x",
            "https://example.org/home/a",
            "a hackathon",
            "net/media-types",
        ):
            self.assertFalse(UNFINISHED.search(line) or MACHINE_PATH.search(line), line)


class Parsing(unittest.TestCase):
    def test_xml(self):
        for name in repository_files():
            if name.suffix in (".launch", ".test", ".xml"):
                with self.subTest(file=str(name)):
                    ElementTree.parse(ROOT / name)

    def test_yaml(self):
        for name in repository_files():
            if name.suffix in (".yaml", ".rviz") and "corpus" not in name.parts:  # a fuzz corpus is broken on purpose
                with self.subTest(file=str(name)):
                    self.assertIsNotNone(yaml.safe_load((ROOT / name).read_text()))

    def test_python_compiles(self):
        for name in repository_files():
            if name.suffix == ".py":
                with self.subTest(file=str(name)):
                    compile((ROOT / name).read_text(), str(name), "exec")

    def test_shell_parses(self):
        scripts = [
            name
            for name in repository_files()
            if name.suffix == ".sh" or (ROOT / name).read_bytes()[:11] == b"#!/bin/bash"
        ]
        self.assertIn("faultline", [str(name) for name in scripts])
        for name in scripts:
            with self.subTest(file=str(name)):
                self.assertEqual(subprocess.run(["bash", "-n", str(ROOT / name)], capture_output=True).stderr, b"")

    def test_scripts_can_be_executed(self):
        wrong = [
            str(name)
            for name in repository_files()
            if (ROOT / name).read_bytes()[:2] == b"#!" and not os.access(ROOT / name, os.X_OK)
        ]
        self.assertEqual(wrong, [])


class Package(unittest.TestCase):
    def test_one_package_at_the_root_and_examples_of_rigs_outside(self):
        found = [name.parent.parts for name in repository_files() if name.name == "package.xml"]
        self.assertIn((), found)
        self.assertEqual([parts for parts in found if parts and (parts[0] != "examples" or len(parts) != 2)], [])

    def test_versions_agree(self):
        version = ElementTree.parse(ROOT / "package.xml").findtext("version")
        self.assertIn(f"\n{version} (", (ROOT / "CHANGELOG.rst").read_text())

    def test_found_packages_are_declared(self):
        """What CMake asks of catkin is in package.xml, and the other way round for ROS packages."""
        wanted = re.search(r"find_package\(catkin REQUIRED COMPONENTS([^)]*)\)", (ROOT / "CMakeLists.txt").read_text())
        tree = ElementTree.parse(ROOT / "package.xml").getroot()
        declared = {node.text for node in tree if node.tag in ("depend", "build_depend")}
        self.assertEqual(set(wanted.group(1).split()) - declared, set())


class Format(unittest.TestCase):
    maxDiff = None

    def test_cpp_is_formatted(self):
        names = [
            str(name)
            for name in repository_files()
            if name.suffix in (".h", ".cpp") and name.parts[0] in ("src", "test", "examples", "cmake")
        ]
        run = subprocess.run(
            ["clang-format", "--dry-run", *names], cwd=ROOT, capture_output=True, text=True, check=False
        )
        self.assertEqual(run.returncode, 0, run.stderr[:2000])
        wrong = sorted(set(re.findall(r"^(\S+?):\d+:\d+: (?:warning|error)", run.stderr, re.M)))
        self.assertEqual(wrong, [], "run: clang-format -i " + " ".join(wrong))


if __name__ == "__main__":
    unittest.main()
