#!/usr/bin/python3
"""What `faultline diagnose` answers to recordings that are not what they say, over all rigs.

    scripts/studies/garbage.py [--rigs RIG ...] [--profiles RIG=PROFILE ...] [--channels 2] [--seconds RIG=SECONDS ...]
        [--seeds 1 ...] [--work FOLDER] [--before FOLDER] [--print]

A healthy run of each rig and seed (off nominal, with its small effects; 60 s) is spoilt in one way and diagnosed, on
all cores. Of each way that takes a channel or a pair, --channels are taken, spread over the rig's. What starts half
way through says so. Prints the answers of the first seed, a table a rig, as Markdown, and a summary of all seeds.
What is done stays in FOLDER; --before names that of another build, whose answers stand beside (FAULTLINE_PROGRAM says
which build is measured).

named: what was done is said, with its channel. warned: an alarm that is no false name, "not observable", or that
something may be wrong which the run is too short to confirm. false name: a fault, or another transducer. hidden:
nothing is said, and the readings have moved by less than their noise. healthy: nothing is said, though they have
moved by more."""

import argparse
import collections
import pathlib
import tempfile

import numpy as np
from rig_runs import (
    RIGS,
    ROOT,
    Results,
    datasheet,
    diagnose,
    faultline,
    on_all_cores,
    read_table,
    write_datasheet,
)

LATE = 0.05  # s
HELD = 10  # samples
SCALE = 1.5
UNITS = {"bar": 1e5, "kPa": 1e3, "psi": 6894.757293168361}
SIZES = ("m^2", "m^3/rad")  # of a parameter that another build has half as large again
KINDS = ("named", "warned", "false name", "hidden", "healthy")
# What names it: words that the headline's effect, port or text has, or the effects of the library that it is.
WORDS = {
    "frozen": ("stuck", "same value", "repeat"),
    "noisy": ("noise", "noisy"),
    "spiky": ("spike", "noisy"),
    "late": ("delay", "lag", "late"),
    "sign turned": ("sign",),
    "exchanged": ("exchanged",),
    "out of range": ("outside",),
    "dead": ("end of its range", "outside", "stuck"),
    "scale": ("scale", "another build"),
    "all zero": ("stuck", "same value", "repeat", "zero"),
    "in": ("unit", "as if in"),
    "held": ("repeat", "held", "same value", "stuck"),
    "command": ("stuck", "command"),
    "all transducers": ("stuck", "same value", "repeat"),
    "one row": ("not observable",),
    "nothing moves": ("not observable", "stuck", "repeat"),
    "another build": ("parameter", "another build", "datasheet"),
}


def measured(sheet):
    channels = [c for c in all_channels(sheet) if c["role"] in ("output", "input") and not c.get("ground_truth")]
    return [c for c in channels if c["noise_std"] > 0]


def all_channels(sheet):
    channels = []
    for c in sheet["channels"]:
        names = [c["name"].replace("{b}", b) for b in sheet["branches"]] if "{b}" in c["name"] else [c["name"]]
        channels += [{**c, "name": name} for name in names]
    return channels


def spread(items, count):
    if len(items) <= count:
        return items
    return [items[int(round(i))] for i in np.linspace(0, len(items) - 1, count)]


def injections(sheet, count):
    """(name, channels, change of a table in place, or None), the last with the run's generator."""
    period = sheet["sample_period"]
    names = [c["name"] for c in measured(sheet)]
    noise = {c["name"]: c["noise_std"] for c in measured(sheet)}
    span = {c["name"]: (c["range"][0], c["range"][1]) for c in measured(sheet)}
    few = spread(names, count)

    def half(table):
        return len(table["t"]) // 2

    def freeze(channels):
        def change(table, _):
            for name in channels:
                table[name][half(table) :] = table[name][half(table)]

        return change

    def noisy(name):
        def change(table, random):
            tail = table[name][half(table) :]
            tail += random.normal(0, 20 * noise[name], len(tail))

        return change

    def spiky(name):
        def change(table, random):
            tail = table[name][half(table) :]
            at = random.random(len(tail)) < 0.01
            low, high = span[name]
            tail[at] = low + (high - low) * random.uniform(0.05, 0.95, at.sum())

        return change

    def late(name):
        def change(table, _):
            rows = max(1, int(round(LATE / period)))
            start = half(table)
            table[name][start:] = table[name][start - rows : -rows].copy()

        return change

    def turn(name):
        def change(table, _):
            table[name] *= -1

        return change

    def exchange(one, other):
        def change(table, _):
            table[one], table[other] = table[other], table[one]

        return change

    def outside(name):
        def change(table, _):
            low, high = span[name]
            table[name][half(table) :] = high + 0.1 * (high - low)

        return change

    def dead(name):
        def change(table, _):
            table[name][half(table) :] = span[name][0]

        return change

    def scaled(name):
        def change(table, _):
            table[name] *= SCALE

        return change

    def zero(table, _):
        for name in table:
            if name != "t":
                table[name][:] = 0

    def in_unit(factor):
        def change(table, _):
            for c in all_channels(sheet):
                if c["unit"] == "Pa" and c["name"] in table:
                    table[c["name"]] /= factor

        return change

    def hold(table, _):
        rows = np.arange(len(table["t"])) // HELD * HELD
        for name in table:
            if name != "t":
                table[name] = table[name][rows]

    def stand_still(table, random):
        for name in table:
            if name != "t":
                table[name][:] = table[name][0]
                if name in noise:
                    table[name] += random.normal(0, noise[name], len(table[name]))

    def one_row(table, _):
        for name in table:
            table[name] = table[name][:1]

    for way, make in (("frozen", lambda n: freeze([n])), ("noisy x 20", noisy), ("spiky", spiky), ("late 50 ms", late)):
        for name in few:
            yield f"{way}, half way", [name], make(name)
    for name in few:
        yield "sign turned", [name], turn(name)
        yield "out of range, half way", [name], outside(name)
        yield "dead: the low end, half way", [name], dead(name)
        yield f"scale x {SCALE}", [name], scaled(name)
    units = collections.defaultdict(list)
    for c in measured(sheet):
        units[c["unit"]].append(c["name"])
    pairs = [pair for same in units.values() for pair in zip(same, same[1:])]
    for pair in spread(pairs, count):
        yield "exchanged", list(pair), exchange(*pair)
    yield "all zero", [], zero
    for unit, factor in UNITS.items():
        yield f"in {unit}: all pressures", [], in_unit(factor)
    yield f"held: every {HELD}th sample", [], hold
    yield "one row", [], one_row
    yield "nothing moves: the first row, with noise", [], stand_still
    commands = [c["name"] for c in all_channels(sheet) if c["role"] == "command" and not c.get("ground_truth")]
    for name in commands[:count]:
        yield "command does not move, half way", [name], freeze([name])
    yield "all transducers stuck, half way", [], freeze(names)
    yield "another build", [], None


def verdict_on(way, channels, report):
    alarms = report["alarms"]
    if report["verdict"] == "healthy":
        return "healthy" if report["undecided_since"] is None else "warned"
    if report["verdict"] == "not_observable":
        return "named" if way.startswith(("one row", "nothing moves")) else "warned"
    told = report["sentence"].lower()
    words = next(w for start, w in WORDS.items() if way.startswith(start))
    first = next((a for a in alarms if a["text"].lower().rstrip(".") in told), None)
    where = told.replace(" ", "_") + (first["port"] if first else "")
    if any(word in told for word in words) and (not channels or any(c in where for c in channels)):
        return "named"
    on_channel = first and any(c in first["port"] or c in first["text"] for c in channels)
    if report["verdict"] in ("data", "unknown") or (report["verdict"] == "sensor" and (on_channel or not channels)):
        return "warned"
    return "false name"


def moved(table, before, sheet):
    """Root mean square change of the readings, in sigmas of their channel, of a command in hundredths of its range; the
    largest of all channels."""
    sigmas = {c["name"]: np.hypot(c["noise_std"], c.get("resolution", 0) / np.sqrt(12)) for c in measured(sheet)}
    for c in all_channels(sheet):
        if c["role"] == "command" and not c.get("ground_truth"):
            sigmas[c["name"]] = 0.01 * (c["range"][1] - c["range"][0])
    most = 0.0
    for name, sigma in sigmas.items():
        if name not in table or len(table[name]) != len(before[name]):
            continue
        change = table[name] - before[name]
        if np.any(change):
            most = max(most, float(np.sqrt(np.mean(change[change != 0] ** 2)) / sigma / np.sqrt(2)))
    return most


def answer(way, channels, change, rig, sheet, profile, seed, seconds):
    sigmas = None
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / "run.csv"
        more = ["--profile", profile, "--duration", seconds, "--seed", seed]
        more += ["--off-nominal", "--nuisance"]
        if way == "another build":
            parameter = next((p for p in sheet["parameters"] if p["unit"] in SIZES), None)
            if not parameter:
                parameter = next(p for p in sheet["parameters"] if p.get("identify"))
            other = [{**p, "nominal": p["nominal"] * 1.5} if p is parameter else p for p in sheet["parameters"]]
            channels = [parameter["name"]]
            more += ["--config", write_datasheet({**sheet, "parameters": other}, pathlib.Path(folder) / "other.yaml")]
        faultline("simulate", rig, *more, "--quiet", "-o", file)
        if change:
            with open(file) as text:
                header = text.readline().strip()
            table = read_table(file)
            before = {name: column.copy() for name, column in table.items()}
            change(table, np.random.default_rng(seed))
            sigmas = moved(table, before, sheet)
            rows = np.column_stack(list(table.values()))
            np.savetxt(file, rows, delimiter=",", header=header, comments="", fmt="%.10g")
        try:
            report = diagnose(file, "--rig", rig)
        except SystemExit as refused:
            line = str(refused).splitlines()[-1]
            return {"class": "named", "answer": "refused: " + line[-120:], "channels": channels}
    kind = verdict_on(way, [] if way == "another build" else channels, report)
    text = f"{report['verdict']}: {report['sentence']}"
    if kind == "healthy" and sigmas:
        text += f" The readings have moved by {sigmas:.2g} sigma."
        if sigmas < 1.5:  # a shifted channel has other noise
            kind = "hidden"
    return {"class": kind, "answer": text, "channels": channels}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rigs", nargs="+", default=RIGS)
    parser.add_argument("--profiles", nargs="+", default=[], help="RIG=PROFILE; else the rig's first")
    parser.add_argument("--channels", type=int, default=2)
    parser.add_argument("--seconds", nargs="+", default=[], help="RIG=SECONDS of a run; else 60")
    parser.add_argument("--seeds", type=int, nargs="+", default=[1])
    parser.add_argument("--work", default=str(ROOT / "catkin_ws/reliability/garbage"))
    parser.add_argument("--before", help="FOLDER of another build")
    parser.add_argument("--print", action="store_true", help="run nothing")
    options = parser.parse_args()
    options.profiles = dict(item.split("=") for item in options.profiles)
    lengths = {rig: float(seconds) for rig, seconds in (item.split("=") for item in options.seconds)}
    folder, earlier = pathlib.Path(options.work), options.before and pathlib.Path(options.before)
    counts = collections.defaultdict(lambda: collections.defaultdict(collections.Counter))
    for rig in options.rigs:
        sheet = datasheet(rig)
        profile = options.profiles.get(rig, sheet["profiles"][0]["name"])
        seconds = lengths.get(rig, 60)
        more = (" before |", "---|") if earlier else ("", "")
        print(f"\n`{rig}`, {profile}, seed {options.seeds[0]}:\n\n| injected |{more[0]} answer |\n|---|---|{more[1]}")
        for seed in options.seeds:
            file = f"{rig}_{profile}_{seed}_{seconds:g}.jsonl"
            results = Results(folder / file)
            before = Results(earlier / file).all if earlier else {}

            def measure(way, channels, change):
                name = " ".join([way, *channels])
                if options.print and name not in results.all:
                    return None
                made = (way, channels, change, rig, sheet, profile, seed, seconds)
                return way, before.get(name), results.once(name, lambda: answer(*made))

            for row in filter(None, on_all_cores(measure, list(injections(sheet, options.channels)))):
                way, then, now = row
                cells = [then or {"class": "", "answer": ""}, now] if earlier else [now]
                for when, cell in (("before", then), ("now", now)):
                    if cell:
                        counts[way][when][cell["class"]] += 1
                if seed == options.seeds[0]:
                    text = " | ".join(f"**{cell['class']}**: {cell['answer'][:160]}" for cell in cells)
                    print(f"| {way} {', '.join(f'`{c}`' for c in now['channels'])} | {text} |", flush=True)
    print(f"\nAll rigs: {' / '.join(KINDS)}.\n\n| injected | before | now |\n|---|---|---|")
    for way, of in counts.items():
        cells = [" / ".join(str(of[when][kind]) for kind in KINDS) for when in ("before", "now")]
        print(f"| {way} | {cells[0]} | {cells[1]} |")


if __name__ == "__main__":
    main()
