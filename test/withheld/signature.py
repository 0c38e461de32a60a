"""What an effect, a parameter or a nuisance does to the outputs, in units of the noise.

Windows (of Truth.WINDOW samples), spread over a run, are simulated again without noise under the recorded commands,
each started from the true state, once with and once without the change. Their difference over the channel's noise is
the signature: what a model without the effect leaves as residual when it is restarted that often, before any refit.
"""
import numpy as np
from scipy.optimize import lsq_linear

COUNT = 6  # windows in a run


def windows(samples, length, shift, count=COUNT):
    """Evenly spread; shifted from run to run so that cycles are met at other phases."""
    lead, spread = min(60, samples // 6), min(37, samples // 12 + 1)  # the lesser ones: runs of a slow recorder
    stride = (samples - length - min(100, lead + spread + 3)) // count
    first = lead + shift % spread
    return [(first + n * stride, first + n * stride + length) for n in range(count)]


class Run:
    """Commands, boundary values and true states of one run, for replays."""

    def __init__(self, output, noise_scale, shift, parameters, nuisance, count=COUNT):
        truth = output["truth"]
        self.truth, self.sheet = truth, truth.sheet
        self.commands = output["record"][truth.COMMAND].tolist()
        self.windows = windows(len(self.commands), truth.WINDOW, shift, count)
        self.starts = [truth.base(output["states"][first]) for first, _ in self.windows]
        self.noise = np.array([self.sheet.noise[c] for c in truth.OUTPUTS]) * noise_scale
        self.noise[[c in self.sheet.empty for c in truth.OUTPUTS]] = np.inf  # nothing is seen in them
        self.parameters, self.nuisance = parameters, nuisance
        self.samples = len(self.commands)
        self._plain = None

    def outputs(self, effects=None, parameters=None, nuisance=None):
        p = dict(self.parameters)
        p.update(parameters or {})
        truth = self.truth.again(p, effects or {}, self.nuisance if nuisance is None else nuisance)
        return truth.replay(self.commands, self.windows, self.starts)

    def plain(self):
        if self._plain is None:
            self._plain = self.outputs()
        return self._plain

    def signature(self, effects=None, parameters=None, nuisance=None):
        return (self.outputs(effects, parameters, nuisance) - self.plain()) / self.noise

    def repetition(self):
        """How many samples of the run one sample of the windows stands for."""
        return self.samples / (self.truth.WINDOW * len(self.windows))


def lift(signatures):
    """How far the residual rises over the noise floor, in the channel where it rises most (1: not at all)."""
    together = np.concatenate(signatures)
    return float(np.sqrt(1 + np.max(np.mean(together**2, axis=0))))


def parameter_signatures(runs):
    """One column per parameter: signature of one tolerance, from a step of half a tolerance."""
    columns = {}
    for name in runs[0].truth.PARAMETERS:
        step = 0.5 * runs[0].sheet.tolerance[name]
        if step <= 0:
            continue
        parts = [run.signature(parameters={name: run.parameters[name] * (1 + step)}) / 0.5 for run in runs]
        columns[name] = np.concatenate(parts).ravel()
    return columns


def explained(target, columns, prior, repetition, shift=None):
    """Least squares of a target on columns; those with prior 1 are parameters, in tolerances: unit prior, at most +-3.

    `shift` is where the columns' coefficients count from (the prior still counts from zero).
    Returns (chi^2 left, prior included, over all samples of the runs; residual on the windows; coefficients from zero).
    """
    scale = np.sqrt(repetition)
    matrix = np.column_stack(columns)
    size = np.linalg.norm(matrix, axis=0) * scale
    size[size == 0] = 1.0
    prior = np.asarray(prior, dtype=float)
    shift = np.zeros(len(prior)) if shift is None else shift
    # 12 unknowns against some 10000 rows: the triangular factor carries all that the bounded problem needs
    orthogonal, triangle = np.linalg.qr(np.vstack([matrix * scale, np.diag(prior)]) / size)
    wanted = orthogonal.T @ np.concatenate([target * scale, -prior * shift])
    free = np.where(prior > 0, 3.0, np.inf)
    solution = lsq_linear(triangle, wanted, ((-free - shift) * size, (free - shift) * size), method="bvls").x / size
    left = target - matrix @ solution
    return float(repetition * (left @ left) + np.sum((prior * (shift + solution)) ** 2)), left, shift + solution
