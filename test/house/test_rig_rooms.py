"""A rig is one room: what knows it lies under its name, and no general room names it, its channels, parameters or
ports."""

import re
import unittest

import yaml
from sources import ROOT, repository_files

# Terms of the field that a rig's datasheet happens to use as well.
TERMS = {"bulk_modulus", "cylinder", "leak_flow", "shaft_speed"}
GENERAL = ("src/faultline/", "src/nodes/", "src/cli/", "scripts/")
# The demo and the default of a bench are of one rig: each names it once, in a variable or a default of its own.
EXCUSED = {"scripts/demo.sh", "scripts/bench.py"}
WORD = re.compile(r"[a-z][a-z0-9_]*(?:\.[a-z0-9_]+)?")


def rigs():
    return sorted(name.parts[1] for name in repository_files() if name.parts[0] == "config" and name.name == "rig.yaml")


def datasheets():
    """Those of rigs outside the tree, which are examples, too; but the template is for everybody to fill in."""
    return [
        name
        for name in repository_files()
        if name.name == "rig.yaml" and name.parts[0] in ("config", "examples") and name.parts[-2] != "my_rig"
    ]


def names_in(datasheet):
    """Names of the rig, its channels, states, parameters and ports, branches written out."""
    sheet = yaml.safe_load((ROOT / datasheet).read_text())
    names = [entry["name"] for key in ("channels", "states", "parameters") for entry in sheet[key]] + list(
        sheet["ports"]
    )
    branches = sheet.get("branches", [])
    written = {name.replace("{b}", branch) for name in names for branch in branches or [""]}
    return {sheet["rig"]} | written


def library_words():
    """Names of effects and of their parameters: a rig may call a parameter as an effect is called."""
    words = set()
    for name in repository_files():
        if name.parts[:3] == ("src", "faultline", "effects"):
            words.add(name.stem)
            words |= set(re.findall(r'\{"([a-z_]+)", *"', (ROOT / name).read_text()))
    return words


def spoken(text, names):
    """Names that occur: those of several words anywhere, plain words only as a whole string."""
    compound = {word for word in WORD.findall(text) if "_" in word or "." in word}
    quoted = set(re.findall(r'"([a-z0-9_]+)"', text))
    return (compound | quoted) & names


class RigRooms(unittest.TestCase):
    maxDiff = None

    def general_files(self):
        found = [
            name
            for name in repository_files()
            if str(name).startswith(GENERAL)
            and name.suffix in (".h", ".cpp", ".py", ".sh")
            and not str(name).startswith("scripts/studies/")
            and str(name) not in EXCUSED
        ]
        self.assertGreater(len(found), 100)
        return found

    def test_general_rooms_name_no_rig_and_nothing_of_one(self):
        own = (
            library_words()
            | TERMS
            | {
                kind
                for kind in (
                    "command",
                    "sensor",
                    "force",
                    "flow",
                    "restriction",
                    "compliance",
                    "source",
                    "transmission",
                    "line",
                    "heat",
                )
            }
        )
        names = set().union(*map(names_in, datasheets())) - own
        self.assertGreater(len(names), 200)
        wrong = [
            f"{name}: {', '.join(sorted(said))}"
            for name in self.general_files()
            if (said := spoken((ROOT / name).read_text(), names))
        ]
        self.assertEqual(wrong, [])

    def test_the_rule_bites(self):
        names = {"servo_actuator", "position", "force.piston"}
        self.assertEqual(spoken('find("position"); // of servo_actuator at force.piston', names), names)
        self.assertEqual(spoken("double position = 0; servo_actuators", names), set())

    def test_every_rig_has_its_rooms(self):
        """Each folder that bears a rig's name belongs to a rig with a datasheet; a rig with equations has all of
        them."""
        files = [str(name) for name in repository_files()]
        self.assertEqual(len(rigs()), 5)
        for folder in ("src/rigs", "test/rigs", "scripts/studies"):
            rooms = {file.split("/")[len(folder.split("/"))] for file in files if file.startswith(folder + "/")}
            rooms = {room for room in rooms if "." not in room}
            self.assertEqual(rooms - set(rigs()), set(), folder)
        for rig in {file.split("/")[2] for file in files if file.startswith("src/rigs/")}:
            with self.subTest(rig=rig):
                for need in (
                    f"config/{rig}/rig.yaml",
                    f"config/{rig}/stages.yaml",
                    f"launch/{rig}.launch",
                    f"docs/{rig}.md",
                    f"test/rigs/{rig}/",
                    f"scripts/studies/{rig}/",
                    f"bags/{rig}_",
                ):
                    self.assertTrue(any(file.startswith(need) for file in files), need)

    def test_bags_bear_a_rigs_name(self):
        bags = [name.name for name in repository_files() if name.suffix == ".bag" and name.parts[0] == "bags"]
        self.assertGreater(len(bags), 3)
        self.assertEqual([bag for bag in bags if not bag.startswith(tuple(rig + "_" for rig in rigs()))], [])


if __name__ == "__main__":
    unittest.main()
