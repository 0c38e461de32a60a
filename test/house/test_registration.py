"""A stage is one registration: only its own file knows the name of a type, and each family of estimators is hosted by
one node."""

import pathlib
import re
import unittest

from sources import ROOT, sources_below

STAGE = re.compile(r"FAULTLINE_(?:ESTIMATOR|DETECTOR|ISOLATOR|STATE_ESTIMATOR)\((\w+),")
FAMILY = re.compile(r"FAULTLINE_ESTIMATOR\(\s*\w+,\s*\{[^,]+,\s*([^,]+),")
# Says what a datasheet would, where it says nothing: it names types as stages.yaml does.
FILLED_IN = pathlib.Path("src/faultline/rig/default_sheet.cpp")
HOSTED = re.compile(r'run_estimator_node\(argc, argv, "\w+", \{([^}]*)\}')


def text_of(name):
    return (ROOT / name).read_text()


class Registration(unittest.TestCase):
    def setUp(self):
        self.sources = [name for folder in ("src/faultline", "src/nodes", "src/cli") for name in sources_below(folder)]

    def test_only_its_own_file_knows_the_name_of_a_type(self):
        types = {
            type_name: name
            for name in self.sources
            if name.suffix == ".cpp"
            for type_name in STAGE.findall(text_of(name))
        }
        self.assertGreaterEqual(len(types), 17)
        # A plain word such as "response" has other uses too; it counts where something is compared with it.
        wrong = [
            '{}: "{}"'.format(name, type_name)
            for type_name, own in types.items()
            for name in self.sources
            if name not in (own, FILLED_IN)
            and re.search(("" if "_" in type_name else "[!=]= ") + '"{}"'.format(type_name), text_of(name))
        ]
        self.assertEqual(wrong, [])

    def test_every_family_has_one_node(self):
        families = set()
        for name in self.sources:
            for word in FAMILY.findall(text_of(name)):
                families.add(
                    word.strip('"') if '"' in word else re.search(word + r' = "(\w+)"', text_of(name)).group(1)
                )
        self.assertEqual(families & {"kalman", "parameter", "response"}, {"kalman", "parameter", "response"})
        hosted = [
            family
            for name in self.sources
            for found in HOSTED.findall(text_of(name))
            for family in re.findall(r'"(\w+)"', found)
        ]
        self.assertEqual(sorted(hosted), sorted(families))

    def test_no_other_lists_of_types(self):
        """signal/registry.h is the one that keeps them."""
        wrong = [str(name) for name in self.sources if re.search(r"static std::vector<\w+Type>", text_of(name))]
        self.assertEqual(wrong, [])


if __name__ == "__main__":
    unittest.main()
