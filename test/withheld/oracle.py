"""Could anybody tell? A local test on the truth itself, with every state and parameter known.

The signature of the labelled effect must not be explained
  (a) by parameters that move within their tolerances (else it is miscalibration), nor
  (b) by a near-equivalent effect together with such parameters, at a small or a large size of it.
What is left in the best such explanation is a chi^2 over all samples; it must exceed both a threshold and what the
truth's own nuisance effects and bristles leave behind. The test knows the true states, so it is an upper bound: "not
identifiable" is firm, "identifiable" means that the data hold the answer, not that it is easy.
"""
import numpy as np

import signature
import sizes
import twins

PARAMETERS_ALONE = 60.0  # above the solver's own error, which is a chi^2 of about 10
RIVAL = 60.0  # log likelihood lower by 30
ALIKE = 0.8  # cosine from which an effect is tried as a rival


def refit(runs, target, columns, effect=None, steps=5, enough=np.inf, there=False):
    """Smallest chi^2 that parameters within tolerance (and one effect) leave of a target, by Gauss-Newton. there:
    begins at the effect's values instead of at none.

    Starts linear, then simulates what it found and corrects, for thresholds are small beside the chi^2 of a plain
    effect; not where the linear answer is far beyond `enough`. `effect`: (key, values, main parameter, bounds, its
    signature). """
    names = list(columns)
    repetition = runs[0].repetition()
    matrix, prior = [columns[n] for n in names], [1.0] * len(names)
    if effect:
        matrix, prior = matrix + [effect[4]], prior + [0.0]
    if there:
        begin = np.array([0.0] * len(names) + [1.0])
        linear, best_left, solution = signature.explained(target - effect[4], matrix, prior, repetition, begin)
    else:
        linear, best_left, solution = signature.explained(target, matrix, prior, repetition)
    best = np.inf
    for _ in range(steps):
        moved = {n: runs[0].parameters[n] * (1 + solution[i] * runs[0].sheet.tolerance[n]) for i, n in enumerate(names)}
        change = {}
        if effect:
            key, values, main, bounds, _ = effect
            change = {key: sizes.scaled(key, bounds, values, main, solution[-1])}
        reached = np.concatenate([run.signature(change, moved) for run in runs]).ravel()
        rest = target - reached
        cost = float(repetition * (rest @ rest) + np.sum((np.asarray(prior) * solution) ** 2))
        settled = cost > 0.8 * best or cost < 0.5 * RIVAL
        if cost < best:
            best, best_left = cost, rest
        if settled or linear > 50 * enough:
            break
        _, _, solution = signature.explained(rest, matrix, prior, repetition, solution)
    return best, best_left


def alike(runs, key, target, columns, sheet, random):
    """Effects whose signature points where the target does once parameters have taken their share: near-equivalents
    that no table lists, since they depend on what is measured."""
    basis = np.linalg.qr(np.column_stack([c for c in columns.values() if np.any(c)]))[0]

    def direction(vector):
        left = vector - basis @ (basis.T @ vector)
        size = np.linalg.norm(left)
        return left / size if size > 1e-6 * np.linalg.norm(vector) else np.zeros_like(left)

    wanted, found = direction(target), []
    for other in sheet.effects():
        if other == key or other.startswith("stuck"):
            continue
        bounds = sheet.bounds[other]
        values = sizes.value(other, bounds, sizes.template(other, bounds, random), 0.6)
        column = np.concatenate([run.signature({other: values}) for run in runs]).ravel()
        if np.any(column) and abs(direction(column) @ wanted) > ALIKE:
            found.append(other)
    return found


def examine(runs, effects, sheet, random, level=1.0, search=False):
    """Facts for the label: lift, lift left after the refit, chi^2 left by parameters alone and by each rival. level: of
    the model's own error in each output, over the noise, above which the effect must lift the residual. search: look
    for rivals beside those of the table."""
    raw = [run.signature(effects) for run in runs]
    target = np.concatenate(raw).ravel()
    columns = signature.parameter_signatures(runs)
    alone, left = refit(runs, target, columns)
    if len(effects) == 1:
        ((key, values),) = effects.items()
        alone, left = as_twin(runs[0], key, values, alone, left)
    share = np.mean(left.reshape(-1, raw[0].shape[1]) ** 2, axis=0) / np.square(level)
    after = float(np.sqrt(1 + np.max(share)))
    quiet = dict.fromkeys(runs[0].nuisance, 0.0)
    quiet.update(runs[0].truth.QUIET)
    nuisance = np.concatenate([run.signature(effects={}, nuisance=quiet) for run in runs]).ravel()
    floor = signature.explained(nuisance, list(columns.values()), [1.0] * len(columns), runs[0].repetition())[0]
    facts = {
        "lift": signature.lift(raw),
        "lift_after_refit": after,
        "chi2_parameters_alone": alone,
        "chi2_nuisance": floor,
        "chi2_rivals": {},
        "beside": beside(runs, effects, sheet, target, columns, level) if len(effects) == 2 else {},
    }
    for key in effects:
        rest = {k: v for k, v in effects.items() if k != key}
        single = target
        if rest:
            single = np.concatenate([(run.outputs(effects) - run.outputs(rest)) / run.noise for run in runs]).ravel()
        rivals = twins.rivals(key, sheet.effects())
        if search:
            rivals += [r for r in alike(runs, key, single, columns, sheet, random) if r not in rivals]
        for rival in rivals:
            best = np.inf
            for q in (0.45, 0.8):
                fixed = sizes.template(rival, sheet.bounds[rival], random)
                values = sizes.value(rival, sheet.bounds[rival], fixed, q)
                column = np.concatenate([run.signature({rival: values}) for run in runs]).ravel()
                if np.any(column):
                    trial = (rival, values, fixed["main"], sheet.bounds[rival], column)
                    best = min(best, refit(runs, single, columns, trial, 3, max(RIVAL, floor))[0])
            facts["chi2_rivals"][f"{key} < {rival}"] = best if rest else min(best, alone)
    return facts


def as_twin(run, key, values, cost, left):
    """(chi^2, what is left) where the effect is a parameter exactly; a search need not be sharp enough to see it."""
    off = twins.twin_tolerances(key, values, run.parameters, run.sheet.tolerance)
    return (off**2, np.zeros_like(left)) if off <= 3 and off**2 < cost else (cost, left)


def beside(runs, effects, sheet, target, columns, level):
    """{key: (chi^2, lift)} of two effects: what is left of both in the best explanation by parameters within tolerance
    and the other one at a size of its own. An effect that leaves nothing there is not to be told beside the other,
    however large it is alone: what it does to the outputs goes into a parameter that the other one leaves free."""
    found = {}
    for key, other in (tuple(effects), tuple(effects)[::-1]):
        main = sizes.main_parameter(other.split("@")[0]) or next(iter(sheet.bounds[other]))
        column = np.concatenate([run.signature({other: effects[other]}) for run in runs]).ravel()
        trial = (other, effects[other], main, sheet.bounds[other], column)
        cost, left = as_twin(runs[0], key, effects[key], *refit(runs, target, columns, trial, there=True))
        share = np.mean(left.reshape(-1, len(runs[0].truth.OUTPUTS)) ** 2, axis=0) / np.square(level)
        found[key] = (cost, float(np.sqrt(1 + np.max(share))))
    return found


def hidden(facts):
    """Of two effects those that nobody could tell beside the others, or that are too small there to count."""
    limit = max(PARAMETERS_ALONE, facts["chi2_nuisance"])
    return sorted(key for key, (cost, lift) in facts["beside"].items() if cost <= limit or lift <= 2)


def identifiable(facts):
    """(structure can be told from parameters, and from every near-equivalent)."""
    floor = facts["chi2_nuisance"]
    structure = facts["chi2_parameters_alone"] > max(PARAMETERS_ALONE, floor)
    rivals = facts["chi2_rivals"].values()
    return bool(structure), bool(structure and all(left > max(RIVAL, floor) for left in rivals))


def separate_set(facts, key):
    """Near-equivalents of an effect that these runs cannot tell from it."""
    limit = max(RIVAL, facts["chi2_nuisance"])
    return sorted(
        name.split(" < ")[1]
        for name, left in facts["chi2_rivals"].items()
        if name.split(" < ")[0] == key and left <= limit
    )
