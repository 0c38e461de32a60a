"""Dormand and Prince's pair of orders 5 and 4 with its step chosen by the error, compiled; for the truths that have one
rate function: rate(t, y, c, inputs, dy) writes dy/dt, `c` one record of constants, `inputs` what drives it. Where a
random truth asks for another integrator (by a negative tolerance), Cash and Karp's pair."""
import numpy as np
from numba import njit

CK_C = np.array([0.0, 0.2, 0.3, 0.6, 1.0, 0.875])
CK_A = np.array(
    [
        [0, 0, 0, 0, 0],
        [1 / 5, 0, 0, 0, 0],
        [3 / 40, 9 / 40, 0, 0, 0],
        [3 / 10, -9 / 10, 6 / 5, 0, 0],
        [-11 / 54, 5 / 2, -70 / 27, 35 / 27, 0],
        [1631 / 55296, 175 / 512, 575 / 13824, 44275 / 110592, 253 / 4096],
    ]
)
CK_B = np.array([37 / 378, 0, 250 / 621, 125 / 594, 0, 512 / 1771])
CK_E = CK_B - np.array([2825 / 27648, 0, 18575 / 48384, 13525 / 55296, 277 / 14336, 1 / 4])


@njit
def cash_karp(rate, y, start, end, step, n, c, inputs, tolerance, scale):
    """As integrate()."""
    k, mid, t, trials = np.zeros((6, len(y))), np.zeros(len(y)), start, 0
    while t < end - 1e-12:
        h = min(step, end - t)
        for s in range(6):
            for i in range(n):
                mid[i] = y[i]
                for r in range(s):
                    mid[i] += h * CK_A[s, r] * k[r, i]
            rate(t + CK_C[s] * h, mid, c, inputs, k[s])
        worst = 0.0
        for i in range(n):
            error, high = 0.0, y[i]
            for s in range(6):
                error += h * CK_E[s] * k[s, i]
                high += h * CK_B[s] * k[s, i]
            error = abs(error) / (tolerance * (scale[i] + 1e-3 * abs(high)))
            worst = max(worst, error if error < 1e12 else 1e12)
            mid[i] = high
        trials += 1
        if trials > 100000 or h < 1e-12:
            return -1.0
        if worst <= 1.0:
            t += h
            for i in range(n):
                y[i] = mid[i]
        step = h * min(4.0, max(0.2, 0.9 * max(worst, 1e-10) ** -0.2))
    return step


@njit
def integrate(rate, y, start, end, step, n, c, inputs, tolerance, scale):
    """Takes the first n states of y from start to end and returns the step to go on with; -1 if that failed. Error per
    step below tolerance times (scale + |y|/1000), each state by itself."""
    if tolerance < 0:
        return cash_karp(rate, y, start, end, step, n, c, inputs, -tolerance, scale)
    k = np.zeros((7, len(y)))
    mid, high = np.zeros(len(y)), np.zeros(len(y))
    t = start
    rate(t, y, c, inputs, k[0])
    trials = 0
    while t < end - 1e-12:
        h = min(step, end - t)
        for i in range(n):
            mid[i] = y[i] + h * k[0, i] / 5
        rate(t + h / 5, mid, c, inputs, k[1])
        for i in range(n):
            mid[i] = y[i] + h * (3 * k[0, i] + 9 * k[1, i]) / 40
        rate(t + 0.3 * h, mid, c, inputs, k[2])
        for i in range(n):
            mid[i] = y[i] + h * (44 * k[0, i] / 45 - 56 * k[1, i] / 15 + 32 * k[2, i] / 9)
        rate(t + 0.8 * h, mid, c, inputs, k[3])
        for i in range(n):
            mid[i] = y[i] + h * (
                19372 * k[0, i] / 6561 - 25360 * k[1, i] / 2187 + 64448 * k[2, i] / 6561 - 212 * k[3, i] / 729
            )
        rate(t + 8 * h / 9, mid, c, inputs, k[4])
        for i in range(n):
            mid[i] = y[i] + h * (
                9017 * k[0, i] / 3168
                - 355 * k[1, i] / 33
                + 46732 * k[2, i] / 5247
                + 49 * k[3, i] / 176
                - 5103 * k[4, i] / 18656
            )
        rate(t + h, mid, c, inputs, k[5])
        for i in range(n):
            high[i] = y[i] + h * (
                35 * k[0, i] / 384
                + 500 * k[2, i] / 1113
                + 125 * k[3, i] / 192
                - 2187 * k[4, i] / 6784
                + 11 * k[5, i] / 84
            )
        rate(t + h, high, c, inputs, k[6])
        worst = 0.0
        for i in range(n):
            error = h * (
                71 * k[0, i] / 57600
                - 71 * k[2, i] / 16695
                + 71 * k[3, i] / 1920
                - 17253 * k[4, i] / 339200
                + 22 * k[5, i] / 525
                - k[6, i] / 40
            )
            error = abs(error) / (tolerance * (scale[i] + 1e-3 * abs(high[i])))
            worst = max(worst, error if error < 1e12 else 1e12)  # not a number: far beyond where the method is stable
        trials += 1
        if trials > 100000 or h < 1e-12:
            return -1.0
        if worst <= 1.0:
            t += h
            for i in range(n):
                y[i] = high[i]
                k[0, i] = k[6, i]
        step = h * min(4.0, max(0.2, 0.9 * max(worst, 1e-10) ** -0.2))
    return step
