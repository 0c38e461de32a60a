"""Dormand and Prince's pair of orders 5 and 4 with its own step control, compiled, for the truths of all rigs that are
not stiff."""
import numpy as np
from numba import njit


def dormand_prince(rate, most_states):
    """integrate(y, start, end, step, c, drive, given, tolerance, scale) for a compiled rate(t, y, c, drive, given,
    since, dy): takes y from start to end and returns the step to go on with, below 0 if it failed. `since` is start;
    the first c.size states count."""

    @njit
    def integrate(y, start, end, step, c, drive, given, tolerance, scale):
        """Error per step below tolerance times (scale + |y|/1000), each state by itself."""
        n = int(c.size)
        since = start
        k = np.zeros((7, most_states))
        mid, high = np.zeros(most_states), np.zeros(most_states)
        t = start
        rate(t, y, c, drive, given, since, k[0])
        trials = 0
        while t < end - 1e-12:
            h = min(step, end - t)
            for i in range(n):
                mid[i] = y[i] + h * k[0, i] / 5
            rate(t + h / 5, mid, c, drive, given, since, k[1])
            for i in range(n):
                mid[i] = y[i] + h * (3 * k[0, i] + 9 * k[1, i]) / 40
            rate(t + 0.3 * h, mid, c, drive, given, since, k[2])
            for i in range(n):
                mid[i] = y[i] + h * (44 * k[0, i] / 45 - 56 * k[1, i] / 15 + 32 * k[2, i] / 9)
            rate(t + 0.8 * h, mid, c, drive, given, since, k[3])
            for i in range(n):
                mid[i] = y[i] + h * (
                    19372 * k[0, i] / 6561 - 25360 * k[1, i] / 2187 + 64448 * k[2, i] / 6561 - 212 * k[3, i] / 729
                )
            rate(t + 8 * h / 9, mid, c, drive, given, since, k[4])
            for i in range(n):
                mid[i] = y[i] + h * (
                    9017 * k[0, i] / 3168
                    - 355 * k[1, i] / 33
                    + 46732 * k[2, i] / 5247
                    + 49 * k[3, i] / 176
                    - 5103 * k[4, i] / 18656
                )
            rate(t + h, mid, c, drive, given, since, k[5])
            for i in range(n):
                high[i] = y[i] + h * (
                    35 * k[0, i] / 384
                    + 500 * k[2, i] / 1113
                    + 125 * k[3, i] / 192
                    - 2187 * k[4, i] / 6784
                    + 11 * k[5, i] / 84
                )
            rate(t + h, high, c, drive, given, since, k[6])
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
                worst = max(worst, error if error < 1e12 else 1e12)  # or none: far from stable
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

    return integrate
