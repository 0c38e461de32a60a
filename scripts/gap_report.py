#!/usr/bin/python3
"""The HTML report of a gap: one file that needs nothing else. `faultline gap RUN... --report OUT.html` calls this with
the answer and the series of the diagnosis; it can be called on files that were kept, too:

  gap_report.py --json ANSWER --series SERIES [--datasheet FILE] -o OUT.html [RUN...]

Exit: 0 when the report is written; 2 for bad usage or bad input.
"""
import os
import sys

HERE = os.path.dirname(os.path.realpath(__file__))
sys.path.insert(0, HERE)
sys.dont_write_bytecode = True
NAME = "faultline gap_report"

import report_signals

if __name__ == "__main__":
    report_signals.end_on_signals(NAME)

import argparse
import datetime

try:
    import jinja2
    import markupsafe
    import matplotlib
    import numpy
    import yaml  # noqa: F401
    import gap_pictures
    import report
    import rig_drawing
    from gap_report_data import GapSheet, read_gap
    from report_data import ReportError, datasheet_path, read_series
    from report_pictures import KIND_COLOURS
    from report_units import Scale, decimals_for, show, words
except ImportError as missing:
    print(
        "{}: {}; install python3-matplotlib, python3-jinja2, python3-numpy and python3-yaml".format(NAME, missing),
        file=sys.stderr,
    )
    sys.exit(2)
report_signals.loaded()

# Of a verdict: word, and class of its colour.
WORDS = {"none": "NO GAP", "miscalibrated": "PARAMETERS OFF", "named": "CAUSE FOUND", "unknown": "UNKNOWN CAUSE"}
RANKED = 8  # causes that the page shows
FAINT = 0.005  # probability below which a cause is told as "< 1 %"


def percent(share):
    return "{:.0f} %".format(100 * share)


def probability_text(p):
    return "< 1 %" if p < FAINT else "> 99 %" if p > 0.99 else percent(p)


# ---- Effects in words


def size_of(effect):
    """[(name, value with unit, interval)] of an effect's parameters."""
    rows = []
    for name, value in effect["parameters"].items():
        if value is None:
            continue
        unit = effect.get("units", {}).get(name, "")
        scale = Scale(
            "" if unit.startswith("port") else unit
        )  # a port whose quantity has no unit that the program knows
        # An effect's size is a difference or a factor: no shift of zero.
        number = scale.factor * value
        decimals = decimals_for(number) if number and 1e-4 <= abs(number) < 1e6 else None
        interval = effect.get("intervals", {}).get(name)
        bounds = ""
        if interval and None not in interval:
            bounds = "{} to {}".format(*(show(scale.factor * end, decimals=decimals) for end in sorted(interval)))
        if name in effect.get("at_bounds", []):
            bounds += ", at its bound" if bounds else "at its bound"
        rows.append((words(name), " ".join(filter(None, [show(number, decimals=decimals), scale.unit])), bounds))
    return rows


def size_text(effect):
    return ", ".join("{} {}".format(name, value) for name, value, _ in size_of(effect))


def effect_row(effect, sheet):
    p = effect.get("probability") or 0.0
    return {
        "what": words(effect["effect"]),
        "port": effect["port"],
        "component": sheet.component(effect["port"]),
        "sizes": size_of(effect),
        "sensor": effect["port"].startswith("sensor."),
        "share": 100 * min(max(p, 0.0), 1.0),
        "p": probability_text(p),
        "instead_of": effect.get("instead_of", ""),
        "gain": None
        if effect.get("gain") is None
        else ("" if effect.get("followed", True) else "< ") + show(round(effect["gain"]) + 0.0, decimals=0),
    }


def join(texts):
    return texts[0] if len(texts) == 1 else ", ".join(texts[:-1]) + " and " + texts[-1]


def moved_parameters(answer, sheet):
    """Parameters that the refit moved by more than a tenth of their tolerance, the furthest first."""
    rows, refit = [], answer["gap"]["refit"].get("parameter_factors", {})
    explained = answer["gap"]["explained"].get("parameter_factors", {}) if answer["cause"]["effects"] else {}
    for name in sorted(set(refit) | set(explained)):
        entry = sheet.parameters.get(name, {})
        tolerance, scale = entry.get("tolerance"), Scale(entry.get("unit", ""))
        after = [factors[name] - 1 if name in factors else None for factors in (refit, explained)]
        shift = [None if change is None or not tolerance else change / tolerance for change in after]
        size = max((abs(s) for s in shift if s is not None), default=0)
        if size < 0.1:
            continue
        nominal = entry.get("nominal")
        number = isinstance(nominal, (int, float))
        rows.append(
            {
                "name": words(name),
                "size": size,
                "beyond": size > 2,
                "nominal": " ".join(filter(None, [show(scale.factor * nominal), scale.unit])) if number else "–",
                "tolerance": "±{}".format("{:.3g} %".format(100 * tolerance)) if tolerance else "–",
                "changes": [
                    (
                        ("–", "")
                        if change is None
                        else (
                            "{:+.1f} %".format(100 * change).replace("-", "−"),
                            "" if s is None else "{:+.1f} tolerances".format(s).replace("-", "−"),
                        )
                    )
                    for change, s in zip(after, shift)
                ],
            }
        )
    return sorted(rows, key=lambda row: -row["size"])


def sentence_of(answer, sheet):
    """(the verdict in one sentence, what to add to it)."""
    cause, heldout, interval = answer["cause"], answer["shrink"]["heldout"] or 0.0, answer["shrink"]["interval"]
    verdict = cause["verdict"]
    after = "Measured on data that the fit did not see"
    if interval and None not in interval and interval[0] < interval[1]:
        after += "; 90 % interval {} to {}".format(percent(interval[0]), percent(interval[1]))
    if verdict == "none":
        return (
            (
                "The model matches the rig: measured and simulated differ by no more than the noise and the datasheet's"
                " tolerances."
            ),
            "",
        )
    if verdict == "miscalibrated":
        moved = [row["name"] for row in moved_parameters(answer, sheet)][:3]
        return (
            "The model has the right structure but its parameters are off{}; refitting them within tolerance is enough."
            .format(": " + join(moved) if moved else ""),
            "",
        )
    if verdict == "named":
        parts = []
        for effect in cause["effects"]:
            size = size_text(effect)
            parts.append(
                "{} at the {}{}".format(
                    words(effect["effect"]), sheet.component(effect["port"]), " ({})".format(size) if size else ""
                )
            )
        if all(
            effect["effect"] == "quantisation" for effect in cause["effects"]
        ):  # it is in the noise: nothing to close
            text = (
                "{} {} in the recording but not in the datasheet. It is part of the noise, which no model closes; the"
                " rest fits.".format(join(parts), "is" if len(parts) == 1 else "are")
            )
            return text[:1].upper() + text[1:], ""
        text = (
            "{} {} in the rig but not in the model; adding {} closes {} of the gap that refitted parameters leave."
            .format(
                join(parts), "is" if len(parts) == 1 else "are", "it" if len(parts) == 1 else "them", percent(heldout)
            )
        )
        since = cause.get("since")
        pronoun = "It" if len(parts) == 1 else "They"
        if since and since["time"] > 0:
            moments = ["{:.4g} s into {}".format(m["time"], os.path.basename(m["run"])) for m in since["moments"]]
            text += " {} began {}.".format(pronoun, join(moments))
            after += ", of what follows that moment (known to {:.2g} s)".format(since["within"])
            after += "; until then the model explains the recordings, calibrated there"
        elif since:
            runs = join([os.path.basename(m["run"]) for m in since["moments"]])
            text += " {} {} in {}.".format(pronoun, "is" if len(parts) == 1 else "are", runs)
            after += ", of that; the model explains what else was recorded without it"
        return text[:1].upper() + text[1:], after + "."
    place = answer["where"]["ranked"][0]["port"] if answer["where"]["ranked"] else ""
    part = " at or near the " + sheet.component(place) if place else ""
    if not cause["effects"] and not place:
        return "Rig and model differ much, and neither a single place nor an effect in the library explains it.", ""
    if not cause["effects"]:
        return (
            "Rig and model differ{}, and no effect in the library explains it well enough to be named.".format(part),
            "",
        )
    return (
        "Rig and model differ{}, and the library has no effect that explains it: the nearest, {}, {} only {} of the"
        " gap.".format(
            part,
            join(
                [
                    words(effect["effect"]) + " at the " + sheet.component(effect["port"])
                    for effect in cause["effects"]
                ]
            ),
            "closes" if len(cause["effects"]) == 1 else "close",
            percent(max(0.0, heldout)),
        ),
        after + ".",
    )


def state_of(answer):
    """Class of the page's colour."""
    verdict = answer["cause"]["verdict"]
    if verdict == "named":
        return "sensor" if answer["where"].get("kind") == "sensor" else "fault"
    return {"none": "healthy", "miscalibrated": "model", "unknown": "unknown"}[verdict]


# ---- Tables


def channel_rows(answer):
    rows = []
    for name, first in answer["gap"]["nominal"]["channels"].items():
        scale, levels = Scale(first["unit"]), []
        noise = scale.span(first["noise_floor"])
        for level in gap_pictures.shown_levels(answer):
            entry = answer["gap"][level]["channels"][name]
            rms, fit = entry["rms"]["segment"], entry["fit"]["segment"]
            levels.append(
                (
                    show(scale.span(rms)),
                    "{} × noise, fit {}, run freely {}".format(
                        show(scale.span(rms) / max(noise, 1e-300), 2),
                        "–" if fit is None else "{:.1f} %".format(max(fit, -999)).replace("-", "−"),
                        show(scale.span(entry["rms"]["free"])),
                    ),
                )
            )
        rows.append({"name": words(name), "unit": scale.unit, "noise": show(noise), "levels": levels})
    return rows


def region_rows(regions, has_effect, of_bands=False):
    rows = []
    for region in regions:
        before, after = region.get("refit"), region.get("explained")
        closed = None
        noise = region["share"] / region["enrichment"] if of_bands and region["enrichment"] > 0 else 1.0
        if has_effect and before is not None and after is not None and before > 1.1 * noise:
            closed = percent(1 - max(0.0, after - noise) / (before - noise))
        rows.append(
            {
                "name": words(region["name"]),
                "times": show(region["enrichment"], 2),
                "share": percent(region["share"]),
                "bar": 100 * min(1.0, region["enrichment"] / max(1e-9, max(r["enrichment"] for r in regions))),
                "closed": closed,
            }
        )
    return rows


def marks_of(answer):
    """Ports to highlight in the drawing. Nothing where there is no gap to place."""
    if answer["cause"]["verdict"] not in ("named", "unknown"):
        return {}
    marks, ranked = {}, answer["where"]["ranked"]
    shares = {place["port"]: place.get("share", 0.0) for place in ranked}
    for effect in answer["cause"]["equivalent"]:
        marks[effect["port"]] = ("rival", "or here")
    for place in ranked[:1]:
        for other in place.get("inseparable", []):
            marks[other] = ("rival", "or here")
    found, place = [effect["port"] for effect in answer["cause"]["effects"]], [p["port"] for p in ranked[:1]]
    if answer["cause"]["verdict"] == "unknown" and place:  # the effects are a part of the cause, at most
        marks.update({port: ("rival", "a part") for port in found})
        found = place
    found = found or place
    for port in found:
        share = shares.get(port, 0.0)
        marks[port] = (
            "found",
            percent(share) if share > 0.01 and port == (ranked[0]["port"] if ranked else "") else "here",
        )
    return marks


def missing_text(answer, sheet):
    """What the page says of the signal that is missing: (what it is, what a curve closes)."""
    found = answer.get("missing")
    if not found:
        return None
    unit = Scale(found["unit"], engineering=False).unit
    adoptable = found["adoptable"]
    return {
        "component": sheet.component(found["port"]),
        "port": found["port"],
        "size": " ".join(filter(None, [show(found["size"]), unit or "of what passes"])),
        "beside": "the effects found" if found["beside"] == "explained" else "the refitted model",
        "formula": found["formula"].replace("-", "−"),
        "unit": unit,
        "score": show(found["score"], decimals=2),
        "curve": adoptable and words(adoptable["variable"]),
        "closes": percent(found["adopted_shrink"]),
    }


def next_rows(answer, sheet):
    rows = []
    for run in answer["next"]:
        profile = sheet.profiles.get(run["excitation"], {})
        rows.append(
            {
                "excitation": words(run["excitation"]),
                "meaning": profile.get("meaning", ""),
                "between": run["between"],
                "duration": report.duration_text(run["duration"]),
                "gain": show(run["gain"], decimals=0),
            }
        )
    return rows


def render(answer, series, sheet, facts):
    sentence, under = sentence_of(answer, sheet)
    has_effect = bool(answer["cause"]["effects"])
    ports = dict(sheet.ports) or {place["port"]: place.get("component", "") for place in answer["where"]["ranked"]}
    drawing = rig_drawing.draw(ports, marks_of(answer))
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(os.path.join(HERE, "templates")),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    shrink = answer["shrink"]
    return environment.get_template("gap_report.html").render(
        state=state_of(answer),
        word=WORDS[answer["cause"]["verdict"]],
        verdict=answer["cause"]["verdict"],
        sentence=report.keep_together(sentence),
        under=under,
        title=sheet.title,
        rig=answer["rig"],
        runs=len(answer["runs"]),
        holdout=len(answer["holdout"]),
        deciding=os.path.basename(answer.get("deciding_run") or ""),
        where_kind=answer["where"].get("kind"),
        placed=bool(answer["where"]["ranked"]),
        has_effect=has_effect,
        level_names=[gap_pictures.level_name(answer, name) for name in gap_pictures.shown_levels(answer)],
        causes=[effect_row(effect, sheet) for effect in answer["cause"]["ranked"][:RANKED]],
        left_out=max(0, len(answer["cause"]["ranked"]) - RANKED),
        effects=[effect_row(effect, sheet) for effect in answer["cause"]["effects"]],
        equivalent=[effect_row(effect, sheet) for effect in answer["cause"]["equivalent"]],
        why=answer["cause"].get("why_equivalent") or "",
        channels=channel_rows(answer),
        regions=region_rows(answer["where"]["regions"], has_effect),
        bands=region_rows(answer["where"]["bands"], has_effect, True),
        moved=moved_parameters(answer, sheet),
        heldout=percent(shrink["heldout"] or 0.0),
        against_nominal=percent(shrink["against_nominal"] or 0.0),
        began=gap_pictures.began(answer),
        interval=[percent(end or 0.0) for end in shrink["interval"]],
        closable=percent(shrink["closable"] or 0.0),
        missing=missing_text(answer, sheet),
        next=next_rows(answer, sheet),
        remarks=answer.get("remarks", []),
        drawing=markupsafe.Markup(drawing) if drawing else None,
        pictures={
            name: markupsafe.Markup(svg) if svg else None
            for name, svg in gap_pictures.draw_all(answer, series, sheet).items()
        },
        colours=KIND_COLOURS,
        facts=facts,
    )


def parse(arguments):
    parser = report.Parser(prog=NAME, description="Writes the answer of `faultline gap` as one HTML file.")
    parser.add_argument("runs", metavar="RUN", nargs="*", help="the recordings, for their size and checksum")
    parser.add_argument("--json", metavar="FILE", help="answer of `faultline gap RUN... --json FILE`")
    parser.add_argument("--series", metavar="FILE", help="series of `faultline gap RUN... --series FILE`")
    parser.add_argument("--datasheet", metavar="FILE", help="datasheet to read instead of the rig's own")
    parser.add_argument("--command", default="", help="the command that made answer and series")
    parser.add_argument(
        "-o", "--output", metavar="OUT.html", default="gap_report.html", help="file to write (default: %(default)s)"
    )
    parser.add_argument("--check", action="store_true", help="only say whether a report can be made on this machine")
    chosen = parser.parse_args(arguments)
    if not chosen.check and not (chosen.json and chosen.series):
        parser.error("--json and --series are needed")
    return chosen


def main(arguments):
    chosen = parse(arguments)
    if chosen.check:
        return 0
    try:
        report.check_output(chosen.output, [chosen.json, chosen.series, chosen.datasheet] + chosen.runs)
        answer, series = read_gap(chosen.json), read_series(chosen.series)
        facts = [
            ("Recording", "{} ({})".format(os.path.basename(run), report.file_facts(run)))
            for run in chosen.runs
            if os.path.isfile(run)
        ]
        if chosen.command:
            facts.append(("Diagnosis", chosen.command))
        if answer.get("seconds") is not None:
            facts.append(("It took", report.duration_text(answer["seconds"])))
        facts += [
            (
                "Versions",
                "faultline {}, Python {}, matplotlib {}, jinja2 {}, numpy {}".format(
                    report.program_version(),
                    sys.version.split()[0],
                    matplotlib.__version__,
                    jinja2.__version__,
                    numpy.__version__,
                ),
            ),
            ("Written", datetime.datetime.now().astimezone().strftime("%Y-%m-%d %H:%M %Z")),
        ]
        sheet = GapSheet(answer["rig"], chosen.datasheet or datasheet_path(answer["rig"], HERE))
        report.write_file(chosen.output, render(answer, series, sheet, facts))
        return 0
    except ReportError as error:
        return report.complain(NAME, error)
    except Exception as error:
        return report.complain(NAME, *report.of_unforeseen_form(error, chosen.json))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
