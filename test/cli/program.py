"""Runs the built program `faultline` for the tests in this folder. Found by FAULTLINE_PROGRAM, else in the build's
devel space."""
import os
import pathlib
import shutil
import subprocess
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]


def program():
    candidates = [os.environ.get("FAULTLINE_PROGRAM")]
    if os.environ.get("FAULTLINE_BUILD"):
        build = pathlib.Path(os.environ["FAULTLINE_BUILD"])
        candidates += [build.parent / "devel/lib/faultline/faultline", build / "devel/lib/faultline/faultline"]
    candidates.append(ROOT / "catkin_ws/devel/lib/faultline/faultline")
    for candidate in candidates:
        if candidate and os.access(candidate, os.X_OK):
            return str(candidate)
    raise FileNotFoundError("the program faultline is not built: run ./faultline build, or set FAULTLINE_PROGRAM")


class ProgramTest(unittest.TestCase):
    """A test with a folder of its own that vanishes afterwards."""

    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="faultline_cli_"))
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)

    def run_program(self, *arguments, check=0, **options):
        done = subprocess.run(
            [program(), *map(str, arguments)],
            cwd=self.folder,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            timeout=120,
            **options,
        )
        if check is not None:
            self.assertEqual(done.returncode, check, f"{arguments}: {done.stdout[-500:]}{done.stderr[-500:]}")
        return done

    def complains(self, arguments, *says):
        """Exit status 2 and one line on stderr that names the subcommand and holds all of `says`."""
        done = self.run_program(*arguments, check=None)
        lines = done.stderr.splitlines()
        self.assertEqual(done.returncode, 2, f"{arguments}: {done.stdout[-300:]}{done.stderr[-300:]}")
        self.assertEqual(len(lines), 1, done.stderr)
        self.assertTrue(lines[0].startswith("faultline"), lines[0])
        for text in says:
            self.assertIn(text, lines[0])
        return lines[0]

    def simulate(self, name, *arguments, duration=2):
        self.run_program("simulate", "servo_actuator", "--duration", duration, "--quiet", *arguments, "-o", name)
        return self.folder / name

    def files(self):
        return sorted(path.name for path in self.folder.iterdir())


def check_schema(value, schema, place="$"):
    """The part of JSON Schema that docs/*.schema.json use; returns what does not fit, one text each."""
    types = {"object": dict, "array": list, "string": str, "boolean": bool, "null": type(None)}
    known = {
        "$schema",
        "title",
        "description",
        "type",
        "properties",
        "required",
        "additionalProperties",
        "items",
        "enum",
        "minimum",
        "maximum",
        "minLength",
    }
    wrong = [f"{place}: keyword {key} is not checked here" for key in schema if key not in known]

    def is_type(name):
        if name in ("number", "integer"):
            return isinstance(value, int if name == "integer" else (int, float)) and not isinstance(value, bool)
        return isinstance(value, types[name])

    allowed = schema.get("type", [])
    allowed = [allowed] if isinstance(allowed, str) else allowed
    if allowed and not any(is_type(name) for name in allowed):
        return wrong + [f"{place}: {value!r} is not {allowed}"]
    if "enum" in schema and value not in schema["enum"]:
        wrong.append(f"{place}: {value!r} is not one of {schema['enum']}")
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        if value < schema.get("minimum", value) or value > schema.get("maximum", value):
            wrong.append(f"{place}: {value!r} is out of range")
    if isinstance(value, str) and len(value) < schema.get("minLength", 0):
        wrong.append(f"{place}: text is too short")
    if isinstance(value, dict):
        wrong += [f"{place}: {key} is missing" for key in schema.get("required", []) if key not in value]
        for key, item in value.items():
            if key in schema.get("properties", {}):
                wrong += check_schema(item, schema["properties"][key], f"{place}.{key}")
            elif schema.get("additionalProperties") is False:
                wrong.append(f"{place}: {key} is not expected")
            elif isinstance(schema.get("additionalProperties"), dict):
                wrong += check_schema(item, schema["additionalProperties"], f"{place}.{key}")
    if isinstance(value, list) and "items" in schema:
        for i, item in enumerate(value):
            wrong += check_schema(item, schema["items"], f"{place}[{i}]")
    return wrong
