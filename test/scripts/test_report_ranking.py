"""The ranking of causes over time, as the report draws it."""
import pathlib
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from test_report import DURATION, make_rankings, np  # noqa: E402

import report_ranking  # noqa: E402


class Rankings(unittest.TestCase):
    LEAK, LAMINAR = "orifice_leakage@flow.chamber_a_chamber_b", "laminar_leakage@flow.chamber_a_chamber_b"

    def test_causes_in_the_order_of_their_evidence(self):
        self.assertEqual(report_ranking.leading(make_rankings(), "first"), ([self.LEAK, self.LAMINAR], 0))
        self.assertEqual(
            report_ranking.leading(make_rankings(), "first", [self.LAMINAR]), ([self.LAMINAR, self.LEAK], 0)
        )
        self.assertEqual(report_ranking.leading(make_rankings(), "first", most=1), ([self.LEAK], 1))

    def test_what_alarms_name_and_cannot_tell_from_it(self):
        alarm = {
            "effect": "laminar_leakage",
            "port": "flow.chamber_a_chamber_b",
            "since": 10,
            "until": 20,
            "equivalent": [self.LEAK],
        }
        other = {"effect": "", "port": "sensor.position", "since": 0, "until": 30}
        self.assertEqual(report_ranking.named(make_rankings(), [other, alarm], "first"), [self.LAMINAR, self.LEAK])
        self.assertEqual(report_ranking.named(make_rankings(), [other, alarm], "second"), [])
        self.assertEqual(report_ranking.named(make_rankings()[:3], [alarm], "first"), [])

    def test_a_short_fault_of_a_long_run_is_kept(self):
        long = [dict(make_rankings()[0], time=2.0 * k, evidence=1.0) for k in range(5000)]
        long[1234] = dict(make_rankings()[-1], time=2468.0)
        kept = report_ranking.fewer(long, 10000.0)
        self.assertLessEqual(len(kept), report_ranking.MOST)
        self.assertIn(long[1234], kept)
        self.assertEqual([judgement["time"] for judgement in kept], sorted(judgement["time"] for judgement in kept))
        self.assertIs(report_ranking.fewer(long[:300], 600.0)[0], long[0])

    def test_a_judgement_stands_until_the_next(self):
        rows, name, unit = report_ranking.sizes_of(
            make_rankings(), "orifice_leakage@flow.chamber_a_chamber_b", DURATION
        )
        self.assertEqual((name, unit), ("coefficient", "m^3/(s sqrt(Pa))"))
        self.assertEqual([tuple(row[:2]) for row in rows[:2]], [(11.5, 13.5), (13.5, 15.5)])
        self.assertEqual(rows[-1][1], DURATION)
        np.testing.assert_allclose(rows[0][2:], [1.5e-8, 1.2e-8, 1.8e-8])


if __name__ == "__main__":
    unittest.main()
