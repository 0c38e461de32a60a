"""What every truth's test asks of the cases that are made of it."""

import os
import tempfile

import generate


def check_case(test, truth, sheet, part, duration, rows):
    """A case of `duration` s has `rows` samples in the sheet's channels, and its label is not among its data."""
    before = truth.DURATION
    truth.DURATION = duration
    try:
        with tempfile.TemporaryDirectory() as folder:
            generate.generate(folder, [part], 1, 7, 1, rig=sheet.rig)
            test.assertEqual(sorted(os.listdir(folder)), ["asked", "data", "sealed"])
            with open(os.path.join(folder, "data", "case_0001", "run_1.csv"), encoding="ascii") as stream:
                test.assertEqual(stream.readline().strip(), ",".join(["t"] + sheet.channels))
                test.assertEqual(len(stream.read().splitlines()), rows)
    finally:
        truth.DURATION = before
