"""What the report of a gap says in its first sentence."""

import pathlib
import sys
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "scripts"))
sys.dont_write_bytecode = True

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


class FirstSentence(unittest.TestCase):
    def test_an_effect_closes_its_share(self):
        text, after = gap_report.sentence_of(answer(CLOGGED), Sheet)
        self.assertIn("valve lands", text)
        self.assertIn("closes 96 %", text)
        self.assertIn("94 % to 98 %", after)

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


if __name__ == "__main__":
    unittest.main()
