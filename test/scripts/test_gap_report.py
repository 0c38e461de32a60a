"""What the report of a gap says in its first sentence, and of a signal that is missing."""

import pathlib
import sys
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "scripts"))
sys.dont_write_bytecode = True

import gap_pictures  # noqa: E402
import gap_report  # noqa: E402


class Sheet:
    @staticmethod
    def component(port):
        return {"sensor.position": "position transducer", "restriction.valve": "valve lands"}[port]


def answer(*effects, heldout=0.96):
    return {
        "cause": {"verdict": "named", "effects": [dict(e, intervals={}, family="") for e in effects]},
        "shrink": {"heldout": heldout, "interval": [0.94, 0.98]},
    }


ROUNDED = {"effect": "quantisation", "port": "sensor.position", "parameters": {"step": 2.55e-4}, "units": {"step": "m"}}
CLOGGED = {
    "effect": "clogging",
    "port": "restriction.valve",
    "parameters": {"fraction": 0.2},
    "units": {"fraction": "1"},
}


class Drawing(unittest.TestCase):
    def test_an_unknown_cause_is_where_the_sentence_says_and_what_was_found_is_a_part(self):
        unknown = answer(CLOGGED)
        unknown["cause"].update(verdict="unknown", equivalent=[])
        unknown["where"] = {"ranked": [{"port": "sensor.position", "share": 1.0}]}
        marks = gap_report.marks_of(unknown)
        self.assertEqual(marks["sensor.position"][0], "found")
        self.assertEqual(marks["restriction.valve"], ("rival", "a part"))
        unknown["where"]["ranked"] = [{"port": "restriction.valve", "share": 1.0}]
        self.assertEqual({k: m[0] for k, m in gap_report.marks_of(unknown).items()}, {"restriction.valve": "found"})
        unknown["cause"]["verdict"] = "named"
        self.assertEqual(gap_report.marks_of(unknown)["restriction.valve"][0], "found")


class FirstSentence(unittest.TestCase):
    def test_an_effect_closes_its_share(self):
        text, after = gap_report.sentence_of(answer(CLOGGED), Sheet)
        self.assertIn("valve lands", text)
        self.assertIn("closes 96 %", text)
        self.assertIn("94 % to 98 %", after)

    def test_says_since_when(self):
        began = answer(CLOGGED)
        moments = [{"run": "runs/second.bag", "time": 9.125}, {"run": "runs/third.bag", "time": 4.5}]
        began["cause"]["since"] = {"run": "runs/second.bag", "time": 9.125, "within": 0.25, "moments": moments}
        text, after = gap_report.sentence_of(began, Sheet)
        self.assertTrue(text.endswith("It began 9.125 s into second.bag and 4.5 s into third.bag."), text)
        self.assertIn("0.25 s", after)
        began["cause"]["since"].update({"time": 0, "moments": [{"run": "runs/second.bag", "time": 0}]})
        text, after = gap_report.sentence_of(began, Sheet)
        self.assertTrue(text.endswith("It is in second.bag."), text)
        self.assertIn("what else was recorded", after)
        self.assertNotIn("began", gap_report.sentence_of(answer(CLOGGED), Sheet)[0])

    def test_where_no_place_is_known(self):
        unknown = answer(heldout=0.0)
        unknown["cause"]["verdict"] = "unknown"
        unknown["where"] = {"ranked": []}
        self.assertIn("neither a single place nor", gap_report.sentence_of(unknown, Sheet)[0])

    def test_rounding_closes_nothing_and_says_why(self):
        text, after = gap_report.sentence_of(answer(ROUNDED, heldout=0.0), Sheet)
        self.assertIn("position transducer", text)
        self.assertIn("part of the noise", text)
        self.assertNotIn("closes 0 %", text)
        self.assertEqual(after, "")

    def test_beside_an_effect_rounding_is_named_too(self):
        text, _ = gap_report.sentence_of(answer(CLOGGED, ROUNDED), Sheet)
        self.assertIn("valve lands", text)
        self.assertIn("position transducer", text)
        self.assertIn("closes 96 %", text)


def missing(formula, curve):
    times = [0.01 * k for k in range(50)]
    found = {
        "port": "restriction.valve",
        "unit": "1",
        "beside": "refit",
        "size": 0.12,
        "formula": formula,
        "score": 0.87,
        "curve": curve,
        "adoptable": curve,
        "adopted_shrink": 0.75,
        "points": {"at": [-1.0, 0.5], "value": [0.1, 0.2]},
        "course": {
            "run": "a.bag",
            "time": times,
            "value": times,
            "standard_error": [0.1] * 50,
            "formula": times if formula else [],
        },
    }
    return {"missing": found}


CURVE = {"variable": "opening", "unit": "V", "at": [-1, 0, 1], "value": [0.1, 0, 0.3], "standard_error": [0.01] * 3}


class Missing(unittest.TestCase):
    def test_says_what_it_depends_on_and_what_a_curve_closes(self):
        said = gap_report.missing_text(missing("-0.3 opening", CURVE), Sheet)
        self.assertEqual((said["formula"], said["score"], said["closes"]), ("−0.3 opening", "0.87", "75 %"))
        self.assertEqual((said["component"], said["curve"]), ("valve lands", "opening"))
        self.assertEqual(said["size"], "0.120 of what passes")

    def test_draws_with_a_curve_and_without(self):
        for answer, axes in ((missing("-0.3 opening", CURVE), 2), (missing("", None), 1)):
            picture = gap_pictures.missing(answer)
            self.assertEqual(picture.count('id="missing-axes_'), axes)

    def test_nothing_where_nothing_is_missing(self):
        self.assertIsNone(gap_report.missing_text({"missing": None}, Sheet))
        self.assertIsNone(gap_pictures.missing({"missing": None}))


if __name__ == "__main__":
    unittest.main()
