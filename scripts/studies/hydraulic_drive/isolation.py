#!/usr/bin/python3
"""Observers, signature table and response isolator of the hydraulic drive, on the same recordings.

Every rig is off its datasheet by its tolerances and carries the nuisance effects; the first 25 s or more are healthy.

    isolation.py singles [--count 500] [--seed 1000]   confusion matrices over random single faults of 2 to 15 %
    isolation.py pairs [--count 40] [--seed 3000]      two shaft faults at the same time, 5 to 15 %
    isolation.py paper [--rigs 10]                     the paper's nine faults of 10 %, its runs begun 20 s earlier
    isolation.py smallest [--rigs 10]                  2, 3, 5 and 10 %: found and isolated, and after which time
    isolation.py healthy [--hours 10] [--profile paper]   false alarms
        [--stages signature,response,shipped] [--json FILE] [--read FILE] [--jobs N]

Stages: `signature` are the observers with the signature table, `response` the stages that every rig has, `shipped` all
of config/hydraulic_drive/stages.yaml. A run's answer is what its alarms name at its end, or named before they ended.
"""

import argparse
import collections
import concurrent.futures
import itertools
import json
import pathlib
import random
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))
from rig_runs import datasheet, diagnose, drawn, record, write_datasheet

RIG = "hydraulic_drive"
ONSET, AFTER = 30, 30  # s
SHAFT = ["eta_m", "eta_p", "C_r", "I", "D"]
OUTSIDE = ["K_0", "K_l", "V_t", "B"]
SIGNATURE = {"shaft", "line_observer", "shaft_observer", "line_balance", "shaft_balance"}
SIGNATURE |= {"shaft_fault", "second_shaft_fault", "line_fault"}
NAMES = {
    "scale@transmission.motor": "eta_m",
    "scale@transmission.pump": "eta_p",
    "scale@transmission.displacement": "C_r",
    "added_mass@force.shaft": "I",
    "viscous_friction@force.shaft": "D",
    "clogging@restriction.valve": "K_0",
    "scale@command.valve": "K_0",
    "laminar_leakage@flow.motor_in_motor_out": "K_l",
    "compliance_factor@compliance.motor_line": "V_t/B",
}


def effect(kind, change, start, sheet):
    """The datasheet's effect that changes the parameter by this fraction from `start` s on."""
    nominal = {p["name"]: p["nominal"] for p in sheet["parameters"]}
    body = {
        "eta_m": f"scale@transmission.motor:factor={1 + change}",
        "eta_p": f"scale@transmission.pump:factor={1 / (1 + change)}",
        "C_r": f"scale@transmission.displacement:factor={1 + change}",
        "I": f"added_mass@force.shaft:mass={change * nominal['inertia']}",
        "D": f"viscous_friction@force.shaft:coefficient={change * nominal['viscous_friction']}",
        "K_0": f"clogging@restriction.valve:fraction={-change}",
        "K_l": f"laminar_leakage@flow.motor_in_motor_out:coefficient={change * nominal['leakage_coefficient']}",
        "V_t": f"compliance_factor@compliance.motor_line:factor={1 / (1 + change)}",
        "B": f"compliance_factor@compliance.motor_line:factor={1 + change}",
    }[kind]
    return f"{body},from={start}"


def size_in(kind, value, sheet):
    """The alarm's size as a change of the parameter."""
    nominal = {p["name"]: p["nominal"] for p in sheet["parameters"]}
    if kind in ("eta_p", "V_t"):
        return 1 / value - 1
    if kind == "K_l":
        return value / nominal["leakage_coefficient"]
    if kind == "K_0" and value < 0.5:  # clogging's fraction, else a factor on the command
        return -value
    if kind == "I":
        return value / nominal["inertia"]
    if kind == "D":
        return value / nominal["viscous_friction"]
    return value - 1


def with_stages(sheet, which):
    if which == "shipped":
        return sheet
    keep = lambda entry: (entry["name"] in SIGNATURE) == (which == "signature")
    return {**sheet, **{key: [e for e in sheet[key] if keep(e)] for key in ("estimators", "detectors", "isolators")}}


def run(folder, sheet, seed, effects, duration, stages, profile, off_nominal=True):
    """The reports of one recording, by stages."""
    name = f"{seed}_{abs(hash(tuple(effects)))}"
    rig = write_datasheet(drawn(sheet, seed) if off_nominal else sheet, folder / f"{name}.yaml")
    extra = [word for e in effects for word in ("--effect", e)]
    bag = folder / f"{name}.bag"
    record(
        RIG, bag, "--config", rig, "--profile", profile, "--seed", seed, "--nuisance", "--duration", duration, *extra
    )
    reports = {}
    for which in stages:
        config = write_datasheet(with_stages(sheet, which), folder / f"{name}_{which}.yaml")
        reports[which] = diagnose(bag, "--config", config)
        config.unlink()
    bag.unlink()
    rig.unlink()
    return reports


def judge(report, onset):
    """What a run says at its end, when it was first alarmed and first said so, and wrong names on the way."""
    answer = {"early": any(a["raised"] < onset for a in report["alarms"])}
    late = [a for a in report["alarms"] if a["raised"] >= onset]
    answer["alarm"] = min((a["raised"] for a in late), default=None)
    active = [a for a in late if a["active"]] or late
    named = [a for a in active if a["effect"]]
    answer["named"] = [NAMES.get(f"{a['effect']}@{a['port']}", f"{a['effect']}@{a['port']}") for a in named]
    answer["alike"] = [[NAMES.get(e, e) for e in a["equivalent"]] for a in named]
    answer["sizes"] = [a["size"] for a in named]
    answer["raised"] = [a["raised"] for a in named]
    answer["unnamed"] = [a["text"].split(":")[0].split(",")[0] for a in active if not a["effect"]]
    answer["on_the_way"] = sorted(
        {NAMES.get(f"{a['effect']}@{a['port']}", a["effect"]) for a in late if a["effect"] and not a["active"]}
    )
    return answer


def verdict(answer):
    if answer["named"]:
        first = answer["named"][0]
        return first if first in NAMES.values() else "another"
    if any("outside" in t or t.startswith("Valve") for t in answer["unnamed"]):
        return "line"
    if any(t.startswith("Shaft") for t in answer["unnamed"]):
        return "shaft"
    return "unknown" if answer["unnamed"] else "nothing"


def right(kind, answer):
    """named, among what is told as alike, outside (of a fault outside the shaft, without a name), or how it fails."""
    wanted = "V_t/B" if kind in ("V_t", "B") else kind
    said = verdict(answer)
    if said == wanted:
        return "named"
    if answer["named"]:
        return "among" if wanted in answer["alike"][0] else "wrong"
    if said == "nothing":
        return "missed"
    return "outside" if kind in OUTSIDE and said == "line" else "unnamed"


def parallel(jobs, work, job):
    with tempfile.TemporaryDirectory() as folder, concurrent.futures.ThreadPoolExecutor(jobs) as pool:
        return list(pool.map(lambda item: job(pathlib.Path(folder), *item), work))


def median(values):
    values = sorted(values)
    return values[len(values) // 2] if values else float("nan")


def by_size(rows, which):
    print(f"\n{which}: alarmed and right at the end, of all, by size")
    ends = [0.02, 0.04, 0.07, 0.1, 0.15]
    print(f"{'':<6}" + "".join(f"{f'{100 * low:g} to {100 * high:g} %':>16}" for low, high in zip(ends, ends[1:])))
    for kind in SHAFT + OUTSIDE:
        cells = []
        for low, high in zip(ends, ends[1:]):
            mine = [r for r in rows if r["kind"] == kind and low <= abs(r["size"]) < high]
            good = sum(right(kind, r["answers"][which]) in ("named", "outside") for r in mine)
            cells.append(f"{sum(bool(r['answers'][which]['alarm']) for r in mine)}, {good} of {len(mine)}")
        print(f"{kind:<6}" + "".join(f"{c:>16}" for c in cells))


def singles(options, sheet):
    draw = random.Random(options.seed)
    work = []
    for k in range(options.count):
        kind = draw.choice(SHAFT + OUTSIDE)
        size = draw.uniform(0.02, 0.15)
        if kind not in ("I", "D", "K_l") and draw.random() < 0.5:
            size = -size
        onset = round(draw.uniform(ONSET - 5, ONSET + 5), 2)
        work.append((options.seed + k, kind, size, onset))

    def job(folder, seed, kind, size, onset):
        effects = [effect(kind, size, onset, sheet)]
        reports = run(folder, sheet, seed, effects, ONSET + AFTER, options.stages, options.profile)
        return {
            "kind": kind,
            "size": size,
            "onset": onset,
            "answers": {s: judge(r, onset) for s, r in reports.items()},
        }

    rows = json.loads(pathlib.Path(options.read).read_text()) if options.read else parallel(options.jobs, work, job)
    for which in options.stages:
        by_size(rows, which)
    for which in options.stages:
        tables = {kind: collections.Counter() for kind in SHAFT + OUTSIDE}
        outcome = {kind: collections.Counter() for kind in SHAFT + OUTSIDE}
        for row in rows:
            tables[row["kind"]][verdict(row["answers"][which])] += 1
            outcome[row["kind"]][right(row["kind"], row["answers"][which])] += 1
        columns = SHAFT + ["K_0", "K_l", "V_t/B", "another", "line", "shaft", "unknown", "nothing"]
        print(f"\n{which}: {len(rows)} single faults; columns: what the run names at its end")
        more = ["right", "alarm", "name", "size", "inside"]
        print(f"{'':<6}" + "".join(f"{c:>8}" for c in columns + more))
        for kind, table in tables.items():
            mine = [r for r in rows if r["kind"] == kind]
            good = [r for r in mine if right(kind, r["answers"][which]) in ("named", "outside")]
            delays = [r["answers"][which]["alarm"] - r["onset"] for r in mine if r["answers"][which]["alarm"]]
            names = [r["answers"][which]["raised"][0] - r["onset"] for r in good if r["answers"][which]["raised"]]
            errors, inside = [], []
            for r in good:
                a = r["answers"][which]
                if a["named"] and a["sizes"][0]:
                    s = a["sizes"][0]
                    errors.append(abs(size_in(kind, s["value"], sheet) - r["size"]))
                    ends = sorted(size_in(kind, s[end], sheet) for end in ("low", "high"))
                    inside.append(ends[0] <= r["size"] <= ends[1])
            print(
                f"{kind:<6}" + "".join(f"{table[c] or '':>8}" for c in columns) + f"{len(good)}/{len(mine):<4}".rjust(8)
                + f"{median(delays):>8.2f}{median(names):>8.2f}{median(errors):>8.4f}"
                + (f"{sum(inside)}/{len(inside)}".rjust(8) if inside else "")
            )
        total = collections.Counter()
        for counter in outcome.values():
            total.update(counter)
        early = sum(r["answers"][which]["early"] for r in rows)
        others = sum(bool(r["answers"][which]["on_the_way"]) for r in rows)
        print(f"  {dict(total)}; early alarms {early}; another name on the way {others}")
    return rows


def pairs(options, sheet):
    draw = random.Random(options.seed)
    work = []
    for k in range(options.count):
        one, two = draw.choice(list(itertools.combinations(SHAFT, 2)))
        sizes = [draw.uniform(0.05, 0.15) * (1 if kind in ("I", "D") else draw.choice([-1, 1])) for kind in (one, two)]
        work.append((options.seed + k, (one, two), sizes))

    def job(folder, seed, kinds, sizes):
        effects = [effect(kind, size, ONSET, sheet) for kind, size in zip(kinds, sizes)]
        reports = run(folder, sheet, seed, effects, ONSET + AFTER, options.stages, options.profile)
        return {"kinds": kinds, "sizes": sizes, "answers": {s: judge(r, ONSET) for s, r in reports.items()}}

    rows = parallel(options.jobs, work, job)
    for which in options.stages:
        print(f"\n{which}: two faults at the same time; alike: both are among what is named or told as alike")
        print(f"{'pair':<14}{'runs':>5}{'both':>6}{'alike':>6}{'one':>6}{'unknown':>8}{'none':>6}")
        table = collections.defaultdict(collections.Counter)
        for row in rows:
            a, wanted = row["answers"][which], set(row["kinds"])
            alike = set(a["named"]).union(*a["alike"]) if a["named"] else set()
            named = set(a["named"])
            if wanted == named:
                told = "both"
            elif wanted <= alike and len(named) > 1:
                told = "alike"
            elif wanted & alike:
                told = "one"
            elif a["unnamed"]:
                told = "unknown"
            else:
                told = "none"
            table[row["kinds"]][told] += 1
        for kinds, c in sorted(table.items()):
            cells = "".join(f"{c[k] or '':>6}" for k in ("both", "alike", "one"))
            print(f"{' + '.join(kinds):<14}{sum(c.values()):>5}{cells}{c['unknown'] or '':>8}{c['none'] or '':>6}")
        total = sum(table.values(), collections.Counter())
        print(f"  {dict(total)}")
    return rows


def paper(options, sheet):
    before = 20  # s of healthy operation ahead of the paper's first sample
    sets = {
        "set_1": [("eta_m", 0.1, 2), ("eta_p", 0.1, 16)],
        "set_2": [("I", 0.1, 2), ("D", 0.1, 16)],
        "set_3": [("C_r", 0.1, 2), ("K_0", 0.1, 14), ("K_l", 0.1, 18), ("V_t", 0.1, 22), ("B", 0.1, 26)],
    }
    rows = []
    for off_nominal in (False, True):
        for name, faults in sets.items():
            work = [(seed,) for seed in range(options.seed, options.seed + (options.rigs if off_nominal else 1))]

            def job(folder, seed):
                effects = [effect(kind, size, before + at, sheet) for kind, size, at in faults]
                return run(folder, sheet, seed, effects, before + 30, ["signature"], "paper", off_nominal)["signature"]

            for report in parallel(options.jobs, work, job):
                rows.append({"set": name, "off_nominal": off_nominal, "alarms": report["alarms"]})
    for off_nominal in (False, True):
        print(f"\n{'rigs off nominal' if off_nominal else 'nominal rig'}, with nuisance and noise")
        for name, faults in sets.items():
            mine = [r for r in rows if r["set"] == name and r["off_nominal"] == off_nominal]
            known = {kind for kind, _, _ in faults}
            for kind, size, at in faults:
                if kind in OUTSIDE:
                    continue
                found = [[a for a in r["alarms"] if NAMES.get(f"{a['effect']}@{a['port']}") == kind] for r in mine]
                delays = [round(f[0]["raised"] - before - at, 2) for f in found if f]
                sizes = [size_in(kind, f[-1]["size"]["value"], sheet) for f in found if f]
                longest = max(delays, default=float("nan"))
                print(
                    f"  {name} {kind:<6} named in {len(delays)} of {len(mine)}, delay [s] median {median(delays):.2f}, "
                    f"longest {longest:.2f}; change {median(sizes):+.4f} (true {size:+.2f})"
                )
            wrong = collections.Counter(
                NAMES.get(f"{a['effect']}@{a['port']}", a["effect"])
                for r in mine for a in r["alarms"] if a["effect"]
                and NAMES.get(f"{a['effect']}@{a['port']}") not in known | {"V_t/B"}
            )
            print(f"  {name} other names: {dict(wrong) or 'none'}")
    # The four outside faults, each alone.
    work = [(seed, kind) for kind in OUTSIDE for seed in range(options.seed, options.seed + options.rigs)]

    def alone(folder, seed, kind):
        return kind, run(folder, sheet, seed, [effect(kind, 0.1, ONSET, sheet)], ONSET + AFTER, ["signature"], "paper")

    outcome = collections.defaultdict(list)
    for kind, reports in parallel(options.jobs, work, alone):
        outcome[kind].append(judge(reports["signature"], ONSET))
    print("\noutside faults of 10 %, each alone")
    for kind, answers in outcome.items():
        delays = [a["alarm"] - ONSET for a in answers if a["alarm"]]
        longest = max(delays, default=float("nan"))
        named = [a["raised"][0] - ONSET for a in answers if right(kind, a) == "named"]
        wrong = sum(bool(set(a["named"] + a["on_the_way"]) & set(SHAFT)) for a in answers)
        print(
            f"  {kind:<4} alarm in {len(delays)} of {len(answers)}, delay [s] median {median(delays):.2f}, longest "
            f"{longest:.2f}; named at the end in {len(named)}, delay median {median(named):.2f}, longest "
            f"{max(named, default=float('nan')):.2f}; shaft faults named {wrong}"
        )
    return rows


def smallest(options, sheet):
    sizes = [0.02, 0.03, 0.05, 0.1]
    kinds = SHAFT + OUTSIDE
    work = [
        (options.seed + k, kind, size) for kind in kinds for size in sizes for k in range(options.rigs)
    ]

    def job(folder, seed, kind, size):
        reports = run(folder, sheet, seed, [effect(kind, size, ONSET, sheet)], ONSET + 60, options.stages, "paper")
        return {"kind": kind, "size": size, "answers": {s: judge(r, ONSET) for s, r in reports.items()}}

    rows = parallel(options.jobs, work, job)
    for which in options.stages:
        print(f"\n{which}: of {options.rigs} rigs alarmed/right after 60 s (median s to the alarm/to the name)")
        print(f"{'':<6}" + "".join(f"{f'{100 * s:g} %':>22}" for s in sizes))
        for kind in kinds:
            cells = []
            for size in sizes:
                a = [r["answers"][which] for r in rows if r["kind"] == kind and r["size"] == size]
                good = [x for x in a if right(kind, x) in ("named", "outside")]
                alarm = median([x["alarm"] - ONSET for x in a if x["alarm"]])
                name = median([x["raised"][0] - ONSET for x in good if x["raised"]])
                cells.append(f"{sum(bool(x['alarm']) for x in a)}/{len(good)} ({alarm:.1f}/{name:.1f})")
            print(f"{kind:<6}" + "".join(f"{c:>22}" for c in cells))
    return rows


def healthy(options, sheet):
    each = 600  # s
    count = int(round(options.hours * 3600 / each))

    def job(folder, seed):
        return run(folder, sheet, seed, [], each, options.stages, options.profile)

    rows = parallel(options.jobs, [(seed,) for seed in range(options.seed, options.seed + count)], job)
    hours = count * each / 3600
    for which in options.stages:
        alarms = [a for reports in rows for a in reports[which]["alarms"]]
        said = collections.Counter(f"{a['effect']}@{a['port']}" if a["effect"] else a["text"][:30] for a in alarms)
        bound = f"below {3 / hours:.2g} an hour at 95 %" if not alarms else f"{len(alarms) / hours:.2g} an hour"
        runs = sum(bool(r[which]["alarms"]) for r in rows)
        print(
            f"{which}, profile {options.profile}, {hours:g} h on {count} rigs: {len(alarms)} false alarms ({bound}) in "
            f"{runs} runs {dict(said)}"
        )
    return [{w: r[w]["alarms"] for w in options.stages} for r in rows]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["singles", "pairs", "paper", "smallest", "healthy"])
    parser.add_argument("--count", type=int)
    parser.add_argument("--seed", type=int)
    parser.add_argument("--rigs", type=int, default=10)
    parser.add_argument("--hours", type=float, default=10)
    parser.add_argument("--profile", default="paper")
    parser.add_argument("--stages", type=lambda text: text.split(","), default=["signature", "response"])
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--json")
    parser.add_argument("--read", help="singles: print the tables of such a file")
    options = parser.parse_args()
    defaults = {"singles": (500, 1000), "pairs": (40, 3000), "paper": (0, 5000), "smallest": (0, 6000)}
    count, seed = defaults.get(options.what, (0, 7000))
    options.count = options.count or count
    options.seed = seed if options.seed is None else options.seed
    rows = globals()[options.what](options, datasheet(RIG))
    if options.json:
        pathlib.Path(options.json).write_text(json.dumps(rows, indent=1) + "\n")


if __name__ == "__main__":
    main()
