"""`faultline effects`: every effect with formula, units and kinds of ports."""

import json
import re
import unittest

from program import ROOT, ProgramTest


class Effects(ProgramTest):
    def test_every_effect_is_listed_whole(self):
        told = json.loads(self.run_program("effects", "--json", "-").stdout)["effects"]
        self.assertEqual(
            [effect["effect"] for effect in told],
            sorted(file.stem for file in ROOT.glob("src/faultline/effects/*.cpp")),
        )
        for effect in told:
            with self.subTest(effect=effect["effect"]):
                self.assertTrue(effect["family"] and effect["ports"] and effect["parameters"])
                for parameter in effect["parameters"]:
                    self.assertRegex(effect["formula"], rf"\b{parameter['name']}\b")
                    self.assertTrue(parameter["unit"])
                    self.assertEqual(set(parameter), {"name", "unit", "none", "usual", "minimum", "maximum"})
        clogging = [effect for effect in told if effect["effect"] == "clogging"][0]
        self.assertEqual(clogging["ports"], ["restriction"])
        self.assertEqual(
            clogging["parameters"],
            [{"name": "fraction", "unit": "1", "none": 0.0, "usual": None, "minimum": -0.15, "maximum": 1.0}],
        )
        usual = {
            f"{effect['effect']}.{parameter['name']}": parameter["usual"]
            for effect in told
            for parameter in effect["parameters"]
            if parameter["usual"] is not None
        }
        self.assertEqual(
            usual,
            {
                "displacement_ripple.phase": 0,
                "entrained_air.exponent": 1,
                "lag.second": 0,
                "ripple.phase": 0,
                "stribeck_friction.exponent": 2,
            },
        )

    def test_the_text_says_the_same(self):
        text = self.run_program("effects", "--json", "effects.json").stdout
        told = json.loads((self.folder / "effects.json").read_text())["effects"]
        self.assertIn(f"\n{len(told)} effects", text)
        for effect in told:
            self.assertTrue(re.search(rf"^{effect['effect']} +{effect['family']}$", text, re.M), effect["effect"])
            self.assertIn("    " + effect["formula"] + "\n", text)


if __name__ == "__main__":
    unittest.main()
