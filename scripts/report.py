#!/usr/bin/python3
"""faultline report: diagnoses a recorded session and writes what was found as one HTML file that needs nothing else.

  ./faultline report BAG [-o OUT.html]            diagnose BAG, then write the report
  ./faultline report BAG --json J --series S      take what `faultline diagnose BAG --json J --series S` wrote before

Exit: 0 when the report is written, whatever the diagnosis says; 2 for bad usage or bad input.
"""
import os
import sys

HERE = os.path.dirname(os.path.realpath(__file__))
sys.path.insert(0, HERE)
sys.dont_write_bytecode = True

import report_signals

if __name__ == "__main__":
    report_signals.end_on_signals("faultline report")

import argparse
import datetime
import hashlib
import json
import re
import shutil
import subprocess
import tempfile

try:
    import jinja2
    import markupsafe
    import matplotlib
    import numpy
    import report_pictures as pictures
    import report_ranking
    from report_data import (
        Datasheet,
        ReportError,
        config_folders,
        datasheet_path,
        flatten,
        read_answer,
        read_series,
        text_of,
    )
    from report_units import decimals_for, pretty_unit, show, words
except ImportError as missing:
    print(
        "faultline report: {}; install python3-matplotlib, python3-jinja2, python3-numpy and python3-yaml".format(
            missing
        ),
        file=sys.stderr,
    )
    sys.exit(2)
report_signals.loaded()

# Of a whole run: word, and class of its colour. Worst first.
VERDICTS = [
    ("fault", "FAULT"),
    ("sensor", "SENSOR FAULT"),
    ("data", "BAD DATA"),
    ("model", "MODEL GAP"),
    ("unknown", "UNKNOWN"),
    ("not_observable", "NOT OBSERVABLE"),
]
# What an alarm is called that names no effect.
KIND_NAMES = {
    "fault": "fault",
    "sensor": "sensor fault",
    "data": "bad data",
    "model": "model gap",
    "unknown": "unknown cause",
}


def find_program():
    """The faultline program: named by the environment, beside this script (installed), or in the build of this tree."""
    given = os.environ.get("FAULTLINE_PROGRAM")
    candidates = (
        [given]
        if given
        else [
            os.path.join(HERE, "faultline"),
            os.path.join(HERE, "..", "catkin_ws", "devel", "lib", "faultline", "faultline"),
        ]
    )
    for path in candidates:
        if os.path.isfile(path) and os.access(path, os.X_OK):
            return os.path.realpath(path)
    if given:
        raise ReportError("FAULTLINE_PROGRAM={}: no program is there; set it right, or unset it".format(given))
    raise ReportError("the faultline program is not built; run ./faultline build first")


def diagnose(program, chosen, folder):
    """Runs the diagnosis; returns where its answer and its series are, and the command."""
    answer, series = os.path.join(folder, "answer.json"), os.path.join(folder, "series.csv")
    bag = chosen.bag
    options = (["--rig", chosen.rig] if chosen.rig else []) + (["--config", chosen.config] if chosen.config else [])
    command = [program, "diagnose", bag] + options + ["--json", answer, "--series", series]
    done = subprocess.run(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        encoding="utf-8",
        errors="replace",
    )
    if done.returncode != 0:
        said = [line for line in done.stderr.splitlines() if line.strip()]
        raise ReportError(
            said[-1] if said else "{}: the diagnosis ended with code {} and said nothing".format(bag, done.returncode)
        )
    for path in (answer, series):
        if not os.path.isfile(path):
            raise ReportError(
                "{}: the diagnosis wrote no {}; is the program older than this script? run ./faultline build".format(
                    bag, os.path.basename(path)
                )
            )
    shown = ["faultline", "diagnose", bag] + options + ["--json", "ANSWER", "--series", "SERIES"]
    return answer, series, " ".join(shown)


def outside_datasheet(rig):
    """Of a rig outside this tree, which the program finds; None where it knows none either."""
    try:
        said = subprocess.run(
            [find_program(), "rigs", rig, "--json", "-"],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        ).stdout
        return json.loads(said.decode("utf-8", "replace"))["rigs"][0]["datasheet"]
    except (ReportError, OSError, ValueError, LookupError):
        return None


def program_version():
    """Of package.xml, in the source tree or in share/faultline."""
    for folder in (os.path.dirname(HERE), os.path.join(HERE, "..", "..", "share", "faultline")):
        try:
            with open(os.path.join(folder, "package.xml"), encoding="utf-8") as file:
                return re.search(r"<version>([^<]+)</version>", file.read()).group(1)
        except (OSError, AttributeError):
            continue
    return "unknown"


def file_facts(path):
    digest = hashlib.sha256()
    try:
        with open(path, "rb") as file:
            for block in iter(lambda: file.read(1 << 20), b""):
                digest.update(block)
    except OSError as error:
        raise ReportError("{}: cannot be read: {}".format(path, error.strerror))
    size = os.path.getsize(path)
    return "{:.2f} MB, SHA-256 {}…".format(size / 1e6, digest.hexdigest()[:16])


# ---- What the page shows, in words and short numbers


def size_text(size):
    """`3.21·10⁻⁵ m³/s` and `2.90·10⁻⁵ to 3.52·10⁻⁵`; empty where an alarm has no size. In the unit of
    the answer, so that table, sentence, terminal and messages say the same number."""
    if not size or size.get("value") is None:
        return "", ""
    numbers = [size.get(key) for key in ("value", "low", "high")]
    decimals = decimals_for(numbers[0]) if numbers[0] and 1e-4 <= abs(numbers[0]) < 1e6 else None
    value = " ".join(filter(None, [show(numbers[0], decimals=decimals), pretty_unit(size.get("unit", ""))]))
    if numbers[1] is None or numbers[2] is None or numbers[1] == numbers[2]:
        return value, ""
    return value, "{} to {}".format(show(numbers[1], decimals=decimals), show(numbers[2], decimals=decimals))


def alarm_row(alarm, number, sheet):
    size, bounds = size_text(alarm.get("size"))
    raised, since, until = alarm.get("raised"), alarm["since"], alarm["until"]
    confidence = alarm.get("confidence")
    if alarm["kind"] == "data" and not confidence:  # that a number is missing is not a matter of belief
        confidence = None
    return {
        "number": number,
        "kind": alarm["kind"],
        "what": alarm["what"],
        "port": alarm.get("port") or "",
        "component": sheet.component(alarm.get("port") or ""),
        "since": "{:.2f} s".format(since),
        "until": "end of run" if alarm.get("active") else "{:.2f} s".format(until),
        "delay": "{:.2f} s".format(raised - since) if raised is not None else "–",
        "size_name": words((alarm.get("size") or {}).get("name") or ""),
        "size": size,
        "bounds": bounds,
        "confidence": None if confidence is None else int(100 * min(max(confidence, 0.0), 1.0)),
        "sure": "–" if confidence is None else "> 99 %" if confidence > 0.99 else "{:.0f} %".format(100 * confidence),
        "text": alarm.get("text") or "",
    }


def verdict_of(answer):
    """(class of the colour, word, sentence)."""
    words_of = dict(VERDICTS)
    kinds = {alarm["kind"] for alarm in answer["alarms"]}
    said = str(answer["verdict"]).lower()
    sentence = answer.get("sentence") or answer["verdict"]
    chosen = said if said in words_of else next((kind for kind, _ in VERDICTS if kind in kinds), None)
    if chosen is None:
        return ("healthy", "HEALTHY", sentence) if not kinds else ("unknown", "UNKNOWN", sentence)
    return chosen, words_of[chosen], sentence


def as_sentence(text):
    """With a capital, unless it begins with the name of a channel."""
    return text if re.match(r"\w+:", text) else text[:1].upper() + text[1:]


def keep_together(text):
    """A number and its unit stay on one line."""
    return re.sub(r"(?<=\d) (?=(?:m\^3/s|l/min|bar|Pa|mm|m|N|V|K|s|min|%|to)\b|%|°C)", "\u00a0", text)


def duration_text(seconds):
    return "{:.1f} s".format(seconds) if seconds < 600 else "{:.1f} min".format(seconds / 60)


def render(answer, series, sheet, facts):
    end = max(float(answer["duration"]), float(series.time[-1]), 1e-9)
    for number, alarm in enumerate(answer["alarms"], start=1):
        alarm["number"] = number
        if alarm["until"] is None:
            alarm["until"] = end
        alarm["what"] = words(alarm.get("effect") or "") or KIND_NAMES.get(alarm["kind"], words(alarm["kind"]))
    state, word, sentence = verdict_of(answer)
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(os.path.join(HERE, "templates")),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    samples = (answer.get("counts") or {}).get("samples", series.rows)
    return environment.get_template("report.html").render(
        state=state,
        word=word,
        sentence=keep_together(as_sentence(sentence)),
        title=sheet.title,
        rig=answer["rig"],
        duration=duration_text(end),
        rate="{:.4g} Hz".format((samples - 1) / end),
        samples="{:,}".format(samples).replace(",", " "),
        alarms=[alarm_row(alarm, i, sheet) for i, alarm in enumerate(answer["alarms"], start=1)],
        counts=[
            (name, "{:,}".format(value).replace(",", " ") if isinstance(value, int) else value)
            for name, value in flatten(answer.get("counts") or {})
        ],
        pictures={
            name: markupsafe.Markup(svg) if svg else None
            for name, svg in pictures.draw_all(answer, series, sheet, end).items()
        },
        rankings=[(stage, markupsafe.Markup(svg)) for stage, svg in report_ranking.draw_all(answer, sheet, end)],
        colours=pictures.KIND_COLOURS,
        has_truth=any(sheet.ground_truth(name) for name in series.channels()),
        facts=facts,
    )


def write_file(path, text):
    """All of it or nothing: a reader never meets half a report. A link stays a link, a device a device."""
    path, unfinished = os.path.realpath(path), None
    try:
        if os.path.exists(path) and not os.path.isfile(path):
            with open(path, "w", encoding="utf-8") as file:
                file.write(text_of(text))
            return
        mask = os.umask(0)
        os.umask(mask)
        mode = os.stat(path).st_mode & 0o777 if os.path.exists(path) else 0o666 & ~mask
        handle, unfinished = tempfile.mkstemp(prefix=".faultline_report_", dir=os.path.dirname(path))
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text_of(text))
        os.chmod(unfinished, mode)
        os.replace(unfinished, path)
        unfinished = None
    except OSError as error:
        raise ReportError("{}: cannot be written: {}".format(path, error.strerror))
    finally:
        if unfinished and os.path.exists(unfinished):
            os.unlink(unfinished)


def is_bag(path):
    if not os.path.isfile(path):  # a pipe gives its bytes once
        return False
    with open(path, "rb") as file:
        return file.read(7) == b"#ROSBAG"


def check_output(path, inputs):
    """That the report can be written, and takes the place of nothing that it is made from, nor of a datasheet of the
    program."""
    for file in filter(None, inputs):
        if os.path.realpath(file) == os.path.realpath(path) or (
            os.path.isfile(path) and os.path.exists(file) and os.path.samefile(file, path)
        ):
            raise ReportError("{}: this file is read, as {}; choose another name with -o".format(path, file))
    if os.path.isfile(path) and any(
        os.path.realpath(path).startswith(os.path.realpath(own) + os.sep) for own in config_folders(HERE)
    ):
        raise ReportError("{}: this is one of the program's own datasheets; choose another name with -o".format(path))
    if is_bag(path):
        raise ReportError("{}: this is a recording; choose another name with -o".format(path))
    folder = os.path.dirname(os.path.realpath(path))
    if not os.path.isdir(folder):
        raise ReportError("{}: cannot be written: there is no folder {}".format(path, folder))
    if os.path.isdir(path):
        raise ReportError("{}: is a folder; name a file".format(path))
    if not os.access(folder, os.W_OK) or (os.path.exists(path) and not os.access(path, os.W_OK)):
        raise ReportError("{}: cannot be written: no right to write there".format(path))


def say(text):
    """On standard output, whose failure is told like any other. A file's name may hold bytes that are no text."""
    if sys.stdout is None:
        raise ReportError("standard output cannot be written: it is closed")
    try:
        print(text_of(text), flush=True)
    except OSError as error:
        sys.stdout = open(os.devnull, "w")  # what is left in the buffer would fail once more at the end
        raise ReportError("standard output cannot be written: {}".format(error.strerror))


def complain(name, error, status=2):
    text = " ".join(text_of(str(error)).split())
    print(text if text.startswith("faultline") else "{}: {}".format(name, text), file=sys.stderr)
    return status


def of_unforeseen_form(error, answer):
    """Text and exit status where drawing failed: `answer` is the file that was given, None where the program made
    it."""
    what = "{}: {}".format(type(error).__name__, error)
    if answer:
        return "{}: holds what cannot be drawn ({}); let the program write the file again".format(answer, what), 2
    return "unexpected: " + what, 1


class Parser(argparse.ArgumentParser):
    def error(self, message):
        self.exit(complain(self.prog, "{}; see --help".format(message)))


def parse(arguments):
    parser = Parser(
        prog="faultline report",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        description="Diagnoses a recorded session and writes what was found as one HTML file.",
        epilog="example: ./faultline report bags/servo_actuator_step_leak.bag -o step_leak.html",
    )
    parser.add_argument("bag", metavar="BAG", help="recorded session: a .bag, or a .csv with --rig")
    parser.add_argument(
        "-o",
        "--output",
        metavar="OUT.html",
        default="faultline_report.html",
        help="file to write (default: %(default)s in this folder)",
    )
    parser.add_argument("--rig", help="rig, where the recording does not name it")
    parser.add_argument("--config", metavar="FILE", help="datasheet to read instead of the rig's own")
    parser.add_argument("--json", metavar="FILE", help="answer of an earlier `faultline diagnose BAG --json FILE`")
    parser.add_argument("--series", metavar="FILE", help="series of an earlier `faultline diagnose BAG --series FILE`")
    chosen = parser.parse_args(arguments)
    if bool(chosen.json) != bool(chosen.series):
        parser.error("--json and --series go together")
    return chosen


def main(arguments):
    if arguments[:1] == ["diagnose"]:
        arguments = arguments[1:]
    chosen = parse(arguments)
    folder = None
    try:
        check_output(chosen.output, [chosen.bag, chosen.config, chosen.json, chosen.series])
        if not os.path.isfile(chosen.bag):
            raise ReportError(
                "{}: no such file; give a recorded session, for example bags/servo_actuator_step_leak.bag".format(
                    chosen.bag
                )
            )
        if chosen.json:
            answer_path, series_path = chosen.json, chosen.series
            command = "faultline diagnose {} --json {} --series {}".format(chosen.bag, chosen.json, chosen.series)
        else:
            folder = tempfile.mkdtemp(prefix="faultline_report_")
            answer_path, series_path, command = diagnose(find_program(), chosen, folder)
        answer, series = read_answer(answer_path), read_series(series_path)
        facts = [("Recording", "{} ({})".format(os.path.basename(chosen.bag), file_facts(chosen.bag)))]
        if answer.get("made_by"):
            facts.append(("Recorded with", str(answer["made_by"])))
        facts += [
            ("Diagnosis", command),
            ("Report", "faultline report {}".format(chosen.bag)),
            (
                "Versions",
                "faultline {}, Python {}, matplotlib {}, jinja2 {}, numpy {}".format(
                    program_version(),
                    sys.version.split()[0],
                    matplotlib.__version__,
                    jinja2.__version__,
                    numpy.__version__,
                ),
            ),
            ("Written", datetime.datetime.now().astimezone().strftime("%Y-%m-%d %H:%M %Z")),
        ]
        rig = answer["rig"]
        sheet = Datasheet(rig, chosen.config or datasheet_path(rig, HERE) or outside_datasheet(rig))
        write_file(chosen.output, render(answer, series, sheet, facts))
        say("faultline: report written to {}".format(chosen.output))
        return 0
    except ReportError as error:
        return complain("faultline report", error)
    except Exception as error:
        return complain("faultline report", *of_unforeseen_form(error, chosen.json))
    finally:
        if folder:
            shutil.rmtree(folder, ignore_errors=True)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
