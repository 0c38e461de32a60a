#!/usr/bin/python3
"""How wrong the datasheet's model is about each variant of a random truth, after a refit within tolerance.

    levels.py RIG [CLASS ...] [--draws 2]

For each variant: RMS of the model's own error over the datasheet's noise, in the typical output (geometric mean) and in
the worst one, for each draw; and seconds of computing that 10 s of the truth take. Two runs of 10 s, seed 5.
"""
import argparse
import sys
import time

import numpy as np

import generate
import truth_classes


def one(rig, name, variant, draw):
    """(RMS of the error over the noise in each output, seconds of 10 s)."""
    world = generate.World([], noise=1.0, runs=2, length=10.0)
    case = generate.Case(generate.datasheet_of(rig), 5, "none", 2 * draw, world)
    random = np.random.default_rng([7, draw])
    ranges = truth_classes.variants(case.rig, name)[variant]
    values = {n: truth_classes.number(bounds, random) for n, bounds in ranges.items()}
    case.drawn = {name: {"variant": variant, "values": values, "seed": draw}}
    case.nuisance.update(truth_classes.nuisance(case.drawn))
    gap = case.measure_level()[1]
    began = time.process_time()
    case.simulate(0, {})
    return gap, time.process_time() - began


def main():
    reader = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    reader.add_argument("rig", choices=generate.RIGS)
    reader.add_argument("classes", nargs="*", default=[], metavar="CLASS", help="default: all")
    reader.add_argument("--draws", type=int, default=2)
    given = reader.parse_args()
    print("| class | variant | typical | worst | s |\n|---|---|---|---|---|", flush=True)
    for name in given.classes or truth_classes.CLASSES:
        for variant in sorted(truth_classes.variants(generate.truth_of(given.rig), name)):
            found = [one(given.rig, name, variant, draw) for draw in range(given.draws)]
            typical = ", ".join(f"{np.exp(np.mean(np.log(np.maximum(gap, 1e-3)))):.2f}" for gap, _ in found)
            worst = ", ".join(f"{gap.max():.1f}" for gap, _ in found)
            print(f"| {name} | {variant} | {typical} | {worst} | {max(s for _, s in found):.2f} |", flush=True)


if __name__ == "__main__":
    generate.end_on_signals()
    try:
        main()
    except KeyboardInterrupt:
        sys.exit("\nstopped")
