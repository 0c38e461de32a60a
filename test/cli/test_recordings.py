"""simulate, import, export, rigs: what goes in comes out, the same every time."""
import json
import pathlib
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from program import ProgramTest  # noqa: E402


def table(path):
    lines = path.read_text().splitlines()
    return lines[0].split(","), [line.split(",") for line in lines[1:]]


class Rigs(ProgramTest):
    def test_list_and_json_name_every_rig(self):
        text = self.run_program("rigs").stdout
        everything = json.loads(self.run_program("rigs", "--json", "-").stdout)
        self.assertGreaterEqual(len(everything["rigs"]), 1)
        for rig in everything["rigs"]:
            self.assertIn(rig["rig"], text)

    def test_one_rig_in_full(self):
        self.run_program("rigs", "servo_actuator", "--json", "rig.json")
        (rig,) = json.loads((self.folder / "rig.json").read_text())["rigs"]
        self.assertTrue(rig["simulated"])
        self.assertEqual(len(rig["channels"]), 12)
        self.assertEqual(len(rig["states"]), 7)
        self.assertEqual(len(rig["ports"]), 16)
        units = {channel["name"]: channel["unit"] for channel in rig["channels"]}
        self.assertEqual(units["load_pressure"], "Pa")
        area = [p for p in rig["parameters"] if p["name"] == "ram_area"][0]
        self.assertEqual((area["nominal"], area["unit"], area["tolerance"]), (6.33e-4, "m^2", 0.005))
        seal = [p for p in rig["ports"] if p["name"] == "flow.chamber_a_chamber_b"][0]
        leak = [e for e in seal["effects"] if e["effect"] == "orifice_leakage"][0]
        self.assertTrue(leak["known"])
        self.assertEqual((leak["parameters"][0]["minimum"], leak["parameters"][0]["maximum"]), (1e-10, 5e-8))
        deadband = [
            e
            for p in rig["ports"]
            if p["name"] == "command.valve_command"
            for e in p["effects"]
            if e["effect"] == "deadband"
        ][0]
        self.assertEqual(deadband["parameters"][0]["unit"], "V")

    def test_help_everywhere_with_an_example(self):
        for name in ("rigs", "simulate", "import", "export", "diagnose"):
            text = self.run_program(name, "--help").stdout
            self.assertIn(f"Example: faultline {name}", text)


class Simulate(ProgramTest):
    def test_same_seed_same_bytes(self):
        effect = ("--effect", "lag@sensor.velocity:time_constant=0.01", "--nuisance", "--off-nominal")
        a = self.simulate("a.bag", "--seed", 5, *effect).read_bytes()
        b = self.simulate("b.bag", "--seed", 5, *effect).read_bytes()
        c = self.simulate("c.bag", "--seed", 6, *effect).read_bytes()
        self.assertEqual(a, b)
        self.assertNotEqual(a, c)

    def test_the_rig_has_a_seed_of_its_own(self):
        """--rig-seed is --seed where it is not given, keeps the rig while the run changes, and changes the rig while
        the run stays."""
        drawn = ("--off-nominal", "--profile", "square")
        plain = table(self.simulate("a.csv", "--seed", 5, *drawn))[1]
        same = table(self.simulate("b.csv", "--seed", 5, "--rig-seed", 5, *drawn))[1]
        other_run = table(self.simulate("c.csv", "--seed", 6, "--rig-seed", 5, *drawn))[1]
        other_rig = table(self.simulate("d.csv", "--seed", 5, "--rig-seed", 6, *drawn))[1]
        self.assertEqual(plain, same)
        # Noise is of the run: where the rig's parameters do not show yet, in the first row, the rows are those of the
        # same seed.
        self.assertEqual(plain[0], other_rig[0])
        self.assertNotEqual(plain[0], other_run[0])
        # The drawn spool gain shows in volts over the whole run, far above noise: the same for the same rig, another
        # for another.
        header = table(self.folder / "a.csv")[0]
        command, spool = header.index("valve_command"), header.index("spool_position")

        def gain(rows):
            pairs = [(float(row[command]), float(row[spool])) for row in rows]
            return sum(u * x for u, x in pairs) / sum(u * u for u, x in pairs)

        self.assertAlmostEqual(gain(other_run), gain(plain), delta=1e-4)
        self.assertGreater(abs(gain(other_rig) - gain(plain)), 1e-3)
        self.complains(("simulate", "servo_actuator", "--rig-seed", 5, "-o", "e.csv"), "--rig-seed", "--off-nominal")

    def test_rows_and_times(self):
        header, rows = table(self.simulate("a.csv", duration=1.5))
        self.assertEqual(header[:2], ["t", "position_reference"])
        self.assertEqual(len(header), 13)
        self.assertEqual(len(rows), 1501)
        self.assertEqual([row[0] for row in rows[:4]], ["0", "0.001", "0.002", "0.003"])
        self.assertEqual(rows[-1][0], "1.5")

    def test_command_table_and_fault(self):
        header, rows = table(self.simulate("a.csv", "--command", "leak_valve_command:0.5=0,1.5=5"))
        column = header.index("leak_valve_command")
        self.assertEqual(float(rows[400][column]), 0)
        self.assertAlmostEqual(float(rows[1000][column]), 2.5, places=9)
        self.assertEqual(float(rows[2000][column]), 5)
        header, rows = table(self.simulate("b.csv", "--fault", "internal_leak_steps", duration=21))
        self.assertEqual(float(rows[-1][column]), 1)

    def test_effect_acts(self):
        header, plain = table(self.simulate("a.csv", "--profile", "triangle"))
        _, biased = table(
            self.simulate("b.csv", "--profile", "triangle", "--effect", "offset@sensor.chamber_a_pressure:value=200000")
        )
        column = header.index("chamber_a_pressure")
        difference = [float(b[column]) - float(a[column]) for a, b in zip(plain, biased)]
        self.assertAlmostEqual(sum(difference) / len(difference), 2e5, delta=500)

    def test_compressions_hold_the_same(self):
        texts = []
        for kind in ("none", "lz4", "bz2"):
            bag = self.simulate(f"{kind}.bag", "--compression", kind, duration=5)
            self.run_program("export", bag, "-o", f"{kind}.csv")
            texts.append((self.folder / f"{kind}.csv").read_text())
        self.assertEqual(texts[0], texts[1])
        self.assertEqual(texts[0], texts[2])
        self.assertLess((self.folder / "bz2.bag").stat().st_size, (self.folder / "lz4.bag").stat().st_size)


class RoundTrip(ProgramTest):
    def test_csv_bag_csv_is_exact(self):
        source = self.simulate("a.csv", "--profile", "random")
        self.run_program("import", source, "--rig", "servo_actuator", "-o", "a.bag")
        self.run_program("export", "a.bag", "-o", "b.csv")
        self.assertEqual(source.read_text(), (self.folder / "b.csv").read_text())

    def test_bag_csv_bag_is_exact(self):
        bag = self.simulate("a.bag")
        self.run_program("export", bag, "-o", "a.csv")
        self.run_program("import", "a.csv", "--rig", "servo_actuator", "-o", "b.bag")
        self.run_program("export", "b.bag", "-o", "b.csv")
        self.assertEqual((self.folder / "a.csv").read_text(), (self.folder / "b.csv").read_text())

    def test_a_bag_of_another_period_leads_on(self):
        """What refuses it says how it is brought to the rig's period, and that works."""
        run = self.simulate("run.bag", duration=2)
        self.run_program("export", run, "-o", "run.csv")
        self.run_program("import", "run.csv", "--rig", "servo_actuator", "--resample", 0.004, "-o", "slow.bag")
        said = self.complains(["diagnose", "slow.bag"], "slow.bag", "every 0.004 s")
        self.assertIn("faultline export, then faultline import --resample rig", said)
        done = self.run_program("export", "slow.bag", "-o", "slow.csv")
        self.assertIn("the run keeps its own", done.stderr)
        self.run_program("import", "slow.csv", "--rig", "servo_actuator", "--resample", "rig", "-o", "back.bag")
        self.run_program("diagnose", "back.bag")

    def test_sequence_and_late_start_survive(self):
        header, rows = table(self.simulate("a.csv"))
        lines = [",".join(["t", "sequence"] + header[1:])]
        for row in rows[100:]:
            lines.append(",".join([row[0], str(int(float(row[0]) * 1000 + 0.5) + 7)] + row[1:]))
        (self.folder / "late.csv").write_text("\n".join(lines) + "\n")
        self.run_program("import", "late.csv", "--rig", "servo_actuator", "-o", "late.bag")
        self.run_program("export", "late.bag", "-o", "back.csv")
        self.assertEqual((self.folder / "back.csv").read_text(), (self.folder / "late.csv").read_text())

    def test_units_are_converted(self):
        header, rows = table(self.simulate("a.csv", duration=0.2))
        named = list(header)
        scales = {
            "position": ("mm", 1e3),
            "load_pressure": ("bar", 1e-5),
            "t": ("ms", 1e3),
            "leak_flow": ("l/min", 6e4),
        }
        for name, (unit, scale) in scales.items():
            column = header.index(name)
            named[column] = f"{name}[{unit}]"
            for row in rows:
                row[column] = repr(float(row[column]) * scale)
        (self.folder / "b.csv").write_text("\n".join(",".join(line) for line in [named] + rows) + "\n")
        done = self.run_program("import", "b.csv", "--rig", "servo_actuator", "-o", "b.bag")
        self.assertIn("'load_pressure[bar]' is converted", done.stderr)
        self.run_program("export", "b.bag", "-o", "c.csv")
        _, original = table(self.folder / "a.csv")
        _, back = table(self.folder / "c.csv")
        self.assertEqual(len(original), len(back))
        for a, b in zip(original, back):
            for x, y in zip(a, b):
                self.assertAlmostEqual(float(x), float(y), delta=1e-12 * max(1.0, abs(float(x))))

    def test_optional_columns_missing_numbers_and_gaps_are_told(self):
        header, rows = table(self.simulate("a.csv", duration=0.5))
        keep = [
            i for i, name in enumerate(header) if name not in ("position_reference", "leak_flow", "leak_valve_command")
        ]
        rows[10][header.index("position")] = ""
        rows[11][header.index("velocity")] = "nan"
        lines = [[header[i] for i in keep]] + [[row[i] for i in keep] for row in rows[:200] + rows[300:]]
        (self.folder / "b.csv").write_text("\n".join(",".join(line) for line in lines) + "\n")
        done = self.run_program("import", "b.csv", "--rig", "servo_actuator", "-o", "b.bag")
        self.assertIn("no column 'leak_flow'; it is written as 0", done.stderr)
        self.assertIn("2 numbers missing", done.stderr)
        self.assertIn("1 gap in time, the first after 0.199 s, the longest 0.101 s", done.stderr)


if __name__ == "__main__":
    unittest.main()
