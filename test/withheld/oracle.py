"""Could anybody tell? A linear test on the truth itself, with every state and parameter known.

The signature of the labelled effect must not be explained
  (a) by parameters that move within their tolerances (else it is miscalibration), nor
  (b) by a near-equivalent effect together with such parameters, at a small or a large size of it.
What is left in the best such explanation is a chi^2 over all samples; it must exceed both a threshold and what the truth's
own nuisance effects leave behind. The test knows the true states, so it is an upper bound: "not identifiable" is firm,
"identifiable" means that the data hold the answer, not that it is easy.
"""
import numpy as np

import signature
import sizes
import twins

PARAMETERS_ALONE = 16.0   # four standard deviations
RIVAL = 30.0              # log likelihood lower by 15


def examine(runs, effects, sheet, random, others=True):
    """Facts for the label: lift, lift left after the refit, chi^2 left by parameters alone and by each rival."""
    repetition = runs[0].repetition()
    raw = [run.signature(effects) for run in runs]
    target = np.concatenate(raw).ravel()
    shape = np.concatenate(raw).shape
    columns = signature.parameter_signatures(runs)
    names = list(columns)
    matrix = [columns[n] for n in names]
    prior = [1.0] * len(names)
    alone, left = signature.explained(target, matrix, prior, repetition)
    after = float(np.sqrt(1 + np.max(np.mean(left.reshape(shape) ** 2, axis=0))))
    quiet = {name: 0.0 for name in runs[0].nuisance}
    nuisance = np.concatenate([run.signature(effects={}, nuisance=quiet) for run in runs]).ravel()
    floor, _ = signature.explained(nuisance, matrix, prior, repetition)
    facts = {"lift": signature.lift(raw), "lift_after_refit": after, "chi2_parameters_alone": alone,
             "chi2_nuisance": floor, "chi2_rivals": {}}
    if others:
        for key in effects:
            rest = {k: v for k, v in effects.items() if k != key}
            base = [run.outputs(rest) for run in runs] if rest else [run.plain() for run in runs]
            single = target if not rest else np.concatenate(
                [(run.outputs(effects) - b) / run.noise for run, b in zip(runs, base)]).ravel()
            for rival in twins.rivals(key, sheet.bounds):
                best = np.inf
                for q in (0.45, 0.8):
                    fixed = sizes.template(rival, sheet.bounds[rival], random)
                    change = {rival: sizes.value(rival, sheet.bounds[rival], fixed, q)}
                    column = np.concatenate([run.signature(change) for run in runs]).ravel()
                    if np.any(column):
                        best = min(best, signature.explained(single, matrix + [column], prior + [0.0], repetition)[0])
                facts["chi2_rivals"][f"{key} < {rival}"] = best
    return facts


def identifiable(facts):
    """(structure can be told from parameters, and from every near-equivalent)."""
    floor = facts["chi2_nuisance"]
    structure = facts["chi2_parameters_alone"] > max(PARAMETERS_ALONE, floor)
    rivals = facts["chi2_rivals"].values()
    return bool(structure), bool(structure and all(left > max(RIVAL, floor) for left in rivals))


def separate_set(facts, key):
    """Near-equivalents of an effect that these runs cannot tell from it."""
    limit = max(RIVAL, facts["chi2_nuisance"])
    return sorted(name.split(" < ")[1] for name, left in facts["chi2_rivals"].items()
                  if name.split(" < ")[0] == key and left <= limit)
