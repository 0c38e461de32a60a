#!/usr/bin/python3
"""Whether an answer of `faultline gap` hangs on nominal values: the same recordings, asked with datasheets whose
nominal values are drawn within their tolerances (one standard deviation, cut at two).

    scripts/studies/gap_draws.py RUN [RUN ...] --rig RIG [--sheet FILE] [--holdout RUN ...] [--draws 20] [--first 1]

RIG is a rig of this repository, or FILE its datasheet where it is not (the rig's library is found as ever). Told are
the answer with the datasheet as it is, and of the draws how many say the same (verdict and effects), what the others
say, how often its first effect is named or among those that cannot be told apart, and the range of sizes."""

import argparse
import collections
import json
import pathlib
import tempfile

import numpy as np
import yaml
from rig_runs import datasheet, drawn, faultline, on_all_cores, write_datasheet


def ask(sheet, given):
    with tempfile.TemporaryDirectory() as folder:
        file = write_datasheet(sheet, pathlib.Path(folder) / "drawn.yaml")
        more = [part for run in given.holdout for part in ("--holdout", run)]
        answer = json.loads(
            faultline("gap", *given.runs, "--rig", given.rig, "--config", file, *more, "--jobs", 1, "--json", "-")
        )
    cause = answer["cause"]
    return {
        "said": (cause["verdict"], tuple(f"{e['effect']}@{e['port']}" for e in cause["effects"])),
        "alike": [f"{e['effect']}@{e['port']}" for e in cause["effects"] + cause["equivalent"]],
        "sizes": {f"{e['effect']}@{e['port']}": e["parameters"] for e in cause["effects"]},
        "explained": max(g["explained"]["nrmse"]["segment"] for g in channels_of(answer)),
        "shrink": answer["shrink"]["heldout"],
    }


def channels_of(answer):
    """[{level: channel's numbers}] of an answer's gap"""
    levels = answer["gap"]
    return [{level: levels[level]["channels"][name] for level in levels} for name in levels["refit"]["channels"]]


def words(said):
    verdict, effects = said
    return verdict + (f" ({', '.join(effects)})" if effects else "")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", nargs="+")
    parser.add_argument("--rig", required=True)
    parser.add_argument("--sheet", help="of a rig outside this repository")
    parser.add_argument("--holdout", nargs="+", default=[])
    parser.add_argument("--draws", type=int, default=20)
    parser.add_argument("--first", type=int, default=1, help="the first seed")
    given = parser.parse_args()
    sheet = yaml.safe_load(pathlib.Path(given.sheet).read_text()) if given.sheet else datasheet(given.rig)
    stated = ask(sheet, given)
    print(f"the datasheet as it is: {words(stated['said'])}, closes {100 * stated['shrink']:.0f} %")
    seeds = range(given.first, given.first + given.draws)
    answers = list(on_all_cores(lambda seed: ask(drawn(sheet, seed), given), [(seed,) for seed in seeds]))
    same = [a for a in answers if a["said"] == stated["said"]]
    print(f"the same in {len(same)} of {len(answers)} draws")
    for said, count in collections.Counter(a["said"] for a in answers if a["said"] != stated["said"]).most_common():
        print(f"  {count} x {words(said)}")
    if stated["said"][1]:
        first = stated["said"][1][0]
        print(f"{first}: named or alike in {sum(first in a['alike'] for a in answers)} of {len(answers)}")
        for name in stated["sizes"].get(first, {}):
            sizes = [a["sizes"][first][name] for a in answers if first in a["sizes"]]
            if sizes:
                told = f"{min(sizes):.4g} to {max(sizes):.4g}, median {np.median(sizes):.4g}"
                print(f"  {name}: {stated['sizes'][first][name]:.4g}; {told}")


if __name__ == "__main__":
    main()
