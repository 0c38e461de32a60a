#!/usr/bin/python3
"""The floor of Table 3 of Kilic et al. (2014): pressures one sample ahead by linear regressors of the NARX lags.

The paper's networks take w_1, w_2, x, v (first difference of the position after a 15 Hz low pass) and P_A, P_B of one
to three samples. Here the same regressors enter linearly, by least squares, on the run that stands for the paper's
training; with raw pressures, and with pressures smoothed without phase (Butterworth of second order forwards and
backwards), which is what the printed errors ask for.

    scripts/studies/pump_cylinder/one_step.py [--cut-off 50]
"""

import argparse
import json
import tempfile

import numpy as np
import scipy.signal

from paper_runs import paper_run, published

PERIOD = 1e-3  # s


def regressors(run, pressures, lags):
    """phi(k) and P(k) in the sizes of the signals."""
    low_pass = scipy.signal.butter(2, 15, fs=1 / PERIOD)
    position = scipy.signal.lfilter(*low_pass, run["position"] - run["position"][0])
    velocity = np.diff(position, prepend=0) / PERIOD
    inputs = [run["pump1_speed"] / 60, run["pump2_speed"] / 60, position / 1e-2, velocity / 0.1]
    columns = [np.roll(x, lag) for x in inputs for lag in range(lags)]
    columns += [np.roll(p, lag) for p in pressures for lag in range(1, lags + 1)]
    columns.append(np.ones(len(position)))
    keep = slice(100, len(position) - 100)
    return np.column_stack(columns)[keep], np.column_stack(pressures)[keep]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cut-off", type=float, default=50, help="Hz, of the smoothing")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        _, run = paper_run(folder, "training")
    raw = [run["chamber_a_pressure"] / 1e6, run["chamber_b_pressure"] / 1e6]
    sections = scipy.signal.butter(2, options.cut_off, fs=1 / PERIOD, output="sos")
    smooth = [scipy.signal.sosfiltfilt(sections, p) for p in raw]
    result = {"paper, MPa": published()["table3_narx_rms"]}
    for name, pressures in (("raw", raw), ("smoothed", smooth)):
        for lags in (1, 2, 3):
            phi, p = regressors(run, pressures, lags)
            weights, *_ = np.linalg.lstsq(phi, p, rcond=None)
            result[f"{name}, {lags} lags, MPa"] = float(np.sqrt(np.mean((phi @ weights - p) ** 2)))
    print(json.dumps(result, indent=1))


if __name__ == "__main__":
    main()
