"""Every bad input ends with exit status 2 and one line that says what is wrong and where."""
import json
import os
import pathlib
import re
import shutil
import struct
import subprocess
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from program import ROOT, ProgramTest, program  # noqa: E402

RIG = "servo_actuator"


class Usage(ProgramTest):
    def test_bad_usage(self):
        good = ["simulate", RIG, "-o", "a.bag"]
        table = [
            ([], "subcommand is missing", "diagnose"),
            (["frobnicate"], "no subcommand 'frobnicate'", "rigs"),
            (["rigs", "--frob"], "--frob", "--help"),
            (["rigs", "no_such_rig"], "no rig 'no_such_rig'", RIG),
            (["simulate"], "RIG", "required"),
            (["simulate", RIG], "--output"),
            (["simulate", "no_such_rig", "-o", "a.bag"], "no rig 'no_such_rig'"),
            (["simulate", RIG, "-o", "a.xyz"], "a.xyz", ".bag or .csv"),
            (good + ["--profile", "nope"], "profile 'nope'", "square"),
            (good + ["--fault", "nope"], "fault 'nope'", "internal_leak_steps"),
            (good + ["--duration", "-1"], "--duration"),
            (good + ["--duration", "soon"], "--duration"),
            (good + ["--duration", "nan"], "--duration", "'nan'"),
            (good + ["--duration", "inf"], "--duration", "'inf'"),
            (good + ["--duration", ""], "--duration", "''"),
            (good + ["--substep", "nan"], "--substep", "'nan'"),
            (good + ["--seed", "x"], "--seed"),
            (good + ["--seed", "-1"], "--seed", "'-1'"),
            (good + ["--seed", "1.5"], "--seed", "'1.5'"),
            (good + ["--seed", "18446744073709551616"], "--seed", "18446744073709551615"),
            (good + ["--seed", "9" * 40], "--seed", "9" * 40),
            (["gap", "a.bag", "--seed", "-1"], "--seed", "'-1'"),
            (["gap", "a.bag", "--jobs", "0"], "--jobs", "1 to 256"),
            (["tune", RIG, "a.bag", "--rate", "nan"], "--rate", "'nan'"),
            (["tune", RIG, "a.bag", "--block", "nan"], "--block", "'nan'"),
            (["tune", RIG, "a.bag", "--faulty-runs", "nan"], "--faulty-runs", "'nan'"),
            (["isolability", "a.bag", "--alike", "nan"], "--alike", "'nan'"),
            (["rigs", ""], "RIG", "empty"),
            (["diagnose", "a.bag", "--json", ""], "--json", "empty"),
            (good + ["--effect", "nonsense"], "effect@port"),
            (good + ["--effect", "nonsense@force.piston:force=1"], "no effect 'nonsense'"),
            (good + ["--effect", "coulomb_friction@force.nowhere:force=1"], "no port 'force.nowhere'", "force.piston"),
            (good + ["--effect", "coulomb_friction@sensor.position:force=1"], "does not fit"),
            (good + ["--effect", "clogging@restriction.valve:fraction=1.5"], "fraction=1.5", "outside"),
            (good + ["--effect", "coulomb_friction@force.piston:force=ten"], "force=ten is not a number"),
            (good + ["--effect", "coulomb_friction@force.piston:force=nan"], "force=nan is not a number"),
            (good + ["--effect", "coulomb_friction@force.piston:force=9,force=8"], "force is given twice"),
            (good + ["--effect", "coulomb_friction@force.piston:force=9,from=1,from=2"], "from is given twice"),
            (good + ["--effect", "coulomb_friction@force.piston:force=9,from=2,to=1"], "to=1 is before from=2"),
            (good + ["--effect", "coulomb_friction@force.piston:force=9,to=-1"], "to=-1 is before from=0"),
            (good + ["--effect", "coulomb_friction@force.piston:force=9,from=inf"], "from=inf is not a time"),
            (good + ["--effect", "coulomb_friction@force.piston:force=9,from=nan"], "from=nan is not a number"),
            (good + ["--command", "leak_valve_command:0=nan"], "'nan' is not a number"),
            (good + ["--command", "valve_command"], "CHANNEL:time=value"),
            (good + ["--command", "position:1=2"], "position is no command"),
            (good + ["--command", "nowhere:1=2"], "'nowhere'", "valve_command"),
            (good + ["--command", "leak_valve_command:2=1,1=2"], "times must rise"),
            (good + ["--command", "leak_valve_command:1=99"], "99", "outside"),
            (good + ["--command", "leak_valve_command:1"], "time=value"),
            (good + ["--command", "leak_valve_command:1=1", "--fault", "internal_leak_ramp"], "already"),
            (good + ["--compression", "zip"], "'zip'", "lz4"),
            (good + ["--config", "nowhere.yaml"], "nowhere.yaml"),
            (["import", "a.csv", "--rig", RIG, "-o", "b.txt"], ".bag or .csv"),
            (["import", "nowhere.csv", "--rig", RIG, "-o", "a.bag"], "nowhere.csv", "cannot be read"),
            (["export", "nowhere.bag", "-o", "a.csv"], "nowhere.bag", "cannot be read"),
            (["diagnose", "nowhere.bag"], "nowhere.bag"),
            (["diagnose", "a.txt"], "a.txt", ".bag or a .csv"),
        ]
        for arguments, *says in table:
            with self.subTest(arguments=arguments):
                self.complains(arguments, *says)
        self.assertEqual(self.files(), [])


class Csv(ProgramTest):
    def setUp(self):
        super().setUp()
        lines = self.simulate("good.csv", duration=0.1).read_text().splitlines()
        self.rows = [line.split(",") for line in lines]

    def write(self, rows):
        (self.folder / "bad.csv").write_text("".join(",".join(row) + "\n" for row in rows))

    def refused(self, *says):
        self.complains(["import", "bad.csv", "--rig", RIG, "-o", "bad.bag"], "bad.csv", *says)
        self.complains(["diagnose", "bad.csv", "--rig", RIG], "bad.csv", *says)
        self.assertEqual(self.files(), ["bad.csv", "good.csv"])

    def changed(self, row, column, text):
        rows = [list(r) for r in self.rows]
        rows[row][rows[0].index(column)] = text
        return rows

    def test_empty_file(self):
        self.write([])
        self.refused("empty")

    def test_header_only(self):
        self.write(self.rows[:1])
        self.refused("no sample")

    def test_missing_channel(self):
        column = self.rows[0].index("load_pressure")
        self.write([row[:column] + row[column + 1 :] for row in self.rows])
        self.refused("load_pressure", "not here")

    def test_unknown_channel(self):
        self.write(self.changed(0, "velocity", "speed"))
        self.refused("'speed' is not a channel")

    def test_wrong_unit(self):
        self.write(self.changed(0, "position", "position[bar]"))
        self.refused("'bar' cannot be converted to 'm'", "position")

    def test_text_in_a_number(self):
        self.write(self.changed(5, "velocity", "fast"))
        self.refused("bad.csv:6:", "'velocity'", "'fast' is not a number")

    def test_backward_time(self):
        self.write(self.changed(5, "t", "0.001"))
        self.refused("bad.csv:6:", "time runs backwards or stands still")

    def test_wrong_period(self):
        self.write([self.rows[0]] + self.rows[1::10])
        self.refused("every 0.01 s", "0.001 s")

    def test_cell_too_few(self):
        self.write(self.rows[:5] + [self.rows[5][:-1]])
        self.refused("bad.csv:6:", "12 cells", "13")

    def test_binary(self):
        (self.folder / "bad.csv").write_bytes(bytes(range(256)) * 10)
        self.refused()

    def test_csv_without_rig(self):
        self.complains(["diagnose", "good.csv"], "good.csv", "--rig")


class Bag(ProgramTest):
    def good(self):
        return self.simulate("good.bag", "--compression", "none", duration=0.5).read_bytes()

    def refused(self, content, *says):
        (self.folder / "bad.bag").write_bytes(content)
        self.complains(["diagnose", "bad.bag"], "bad.bag", *says)
        self.complains(["export", "bad.bag", "-o", "bad.csv"], "bad.bag", *says)
        self.assertNotIn("bad.csv", self.files())

    def test_cut_off_bags_say_how_to_reindex(self):
        for kind in ("none", "lz4", "bz2"):
            content = self.simulate(f"{kind}.bag", "--compression", kind, duration=20).read_bytes()
            for share in (0.002, 0.1, 0.5, 0.9, 0.999):
                with self.subTest(kind=kind, share=share):
                    self.refused(content[: int(len(content) * share)], "rosbag reindex bad.bag")

    def test_unfinished_recording_has_no_index(self):
        content = bytearray(self.good())
        at = content.index(b"index_pos=") + len(b"index_pos=")
        content[at : at + 8] = struct.pack("<Q", 0)
        self.refused(bytes(content), "rosbag reindex bad.bag")

    def test_damaged_chunk(self):
        for kind in ("lz4", "bz2"):
            content = bytearray(self.simulate(f"{kind}.bag", "--compression", kind, duration=5).read_bytes())
            middle = len(content) // 2
            content[middle : middle + 200] = bytes(200)
            self.refused(bytes(content), "damaged")

    def test_bag_without_messages(self):
        content = self.good()
        start = len(b"#ROSBAG V2.0\n")
        header = struct.unpack("<I", content[start : start + 4])[0]
        padding = struct.unpack("<I", content[start + 4 + header : start + 8 + header])[0]
        end = start + 8 + header + padding
        empty = bytearray(content[:end])
        for name, value in (
            (b"index_pos=", struct.pack("<Q", end)),
            (b"conn_count=", bytes(4)),
            (b"chunk_count=", bytes(4)),
        ):
            at = empty.index(name) + len(name)
            empty[at : at + len(value)] = value
        self.refused(bytes(empty), "no messages")

    def test_no_bag_at_all(self):
        self.refused(b"", "empty")
        self.refused(b"t,position\n0,1\n", "not a ROS bag")
        (self.folder / "folder.bag").mkdir()
        self.complains(["diagnose", "folder.bag"], "folder.bag", "folder")

    def test_bag_of_another_rig(self):
        content = self.good()
        (self.folder / "bad.bag").write_bytes(content.replace(b"servo_actuator", b"servo_actuatox"))
        self.complains(["diagnose", "bad.bag"], "no rig 'servo_actuatox'", RIG)
        (self.folder / "good.bag").write_bytes(content)
        self.complains(["diagnose", "good.bag", "--rig", "hydraulic_drive"], "good.bag", "servo_actuator")

    def test_wrong_topic_type(self):
        self.refused(
            self.good().replace(b"faultline/Sample", b"faultline/Simple"),
            "no topic of type faultline/Sample",
            "/servo_actuator/sample (faultline/Simple)",
        )

    def test_another_version_of_the_message(self):
        content = self.good()
        at = content.index(b"md5sum=") + len(b"md5sum=")
        content = content.replace(content[at : at + 32], b"0" * 32)
        self.refused(content, "another version of faultline/")

    def test_unit_that_differs(self):
        content = self.good()
        name = b"load_pressure" + struct.pack("<I", 2)
        self.assertIn(name + b"Pa", content)
        self.refused(content.replace(name + b"Pa", name + b"kP"), "load_pressure", "'kP'", "'Pa'")


class BagLengths(ProgramTest):
    """Lengths that a bag tells are not believed before the bytes are there."""

    def refused(self, content, *says):
        (self.folder / "bad.bag").write_bytes(content)
        with open(self.folder / "said", "w") as said:
            process = subprocess.Popen(
                [program(), "diagnose", "bad.bag"], cwd=self.folder, stdout=subprocess.DEVNULL, stderr=said
            )
            _, status, usage = os.wait4(process.pid, 0)
            process.returncode = os.WEXITSTATUS(status)
        self.assertEqual((os.WIFEXITED(status), process.returncode), (True, 2))
        self.assertLess(usage.ru_maxrss, 200000, "kB")
        lines = (self.folder / "said").read_text().splitlines()
        self.assertEqual(len(lines), 1, lines)
        for text in ("bad.bag", *says):
            self.assertIn(text, lines[0])

    def test_arrays_and_strings(self):
        content = self.simulate("good.bag", "--compression", "none", duration=0.05).read_bytes()
        values = (
            struct.pack("<I", len(RIG)) + RIG.encode() + struct.pack("<QI", 0, 12)
        )  # frame_id, sequence, length of the values
        self.assertIn(values, content)
        for length in (
            13,
            1 << 28,
            (1 << 29) + 12,
            0xFFFFFFFF,
        ):  # the third is 12 values if counted in 32 bits of bytes
            self.refused(content.replace(values, values[:-4] + struct.pack("<I", length)), "longer than its", "damaged")
        channels = content.index(struct.pack("<d", 0.001) + struct.pack("<I", 12)) + 8
        for length in (1 << 24, 0xFFFFFFFF):
            self.refused(content[:channels] + struct.pack("<I", length) + content[channels + 4 :], "longer than its")

    def test_chunks(self):
        for kind in ("lz4", "bz2"):
            content = self.simulate(f"{kind}.bag", "--compression", kind, duration=0.05).read_bytes()
            at = content.index(b"size=") + 5
            for size in (0, 1 << 27, (1 << 28) + 1, 0xFFFFFFFF):
                self.refused(content[:at] + struct.pack("<I", size) + content[at + 4 :], "damaged")

    def test_receive_time(self):
        content = self.simulate("good.bag", "--compression", "none", duration=0.05).read_bytes()
        at = content.rindex(b"time=", 0, content.rindex(RIG.encode() + struct.pack("<Q", 50))) + 5
        self.refused(content[:at] + b"\xff" * 8 + content[at + 8 :], "damaged")


class Bytes(ProgramTest):
    """Bytes that are not UTF-8 are refused or shown as what they are; no answer and no message is lost by them."""

    NAME = os.fsdecode(b"a\xff\x1b.bag")

    def test_in_a_bag(self):
        content = self.simulate("good.bag", "--compression", "none", duration=0.5).read_bytes()
        made_by = b"faultline simulate"
        self.assertEqual(content.count(made_by), 1)
        (self.folder / "a.bag").write_bytes(content.replace(made_by, b"fault\xff\xfene simulate"))
        answer = json.loads(self.run_program("diagnose", "a.bag", "--json", "-").stdout)
        self.assertTrue(answer["made_by"].startswith("fault\ufffd\ufffdne simulate"), answer["made_by"])
        (self.folder / "b.bag").write_bytes(content.replace(b"velocity", b"\xff\x1b[31mty"))
        self.complains(["diagnose", "b.bag"], "b.bag", "'velocity' [m/s] is missing")
        (self.folder / "c.bag").write_bytes(content.replace(RIG.encode(), RIG.encode()[:-2] + b"\xff\n"))
        self.complains(["diagnose", "c.bag"], "no rig 'servo_actuat??'")

    def test_in_a_csv_header(self):
        (self.folder / "a.csv").write_bytes(b"t,speed\xff\x1b[31m\n0,1\n")
        self.complains(["diagnose", "a.csv", "--rig", RIG], "a.csv:1:", "'speed??[31m'")

    def test_in_a_datasheet(self):
        (self.folder / "a.yaml").write_bytes(b"rig: toy\ntitle: caf\xe9\n")
        self.complains(["rigs", "--config", "a.yaml", "--json", "-"], "a.yaml:2:", "UTF-8")

    def test_in_a_file_name(self):
        os.rename(self.simulate("a.bag", duration=1), self.folder / self.NAME)
        self.run_program("diagnose", self.NAME)
        answer = json.loads(self.run_program("isolability", self.NAME, "--json", "-").stdout)
        self.assertEqual(answer["run"], "a\ufffd\x1b.bag")
        self.complains(["diagnose", self.NAME, "--rig", "nowhere"], "a??.bag")


class Yaml(ProgramTest):
    def refused(self, content, *says):
        (self.folder / "x.yaml").write_text(content)
        self.complains(["rigs", "--config", "x.yaml"], "x.yaml", *says)

    def test_what_begins_no_document(self):
        """yaml-cpp stays in front of a comma for ever when asked for all documents."""
        self.refused(",", "x.yaml:1:", "not valid YAML")
        self.refused('"t","position"\n0,1\n', "x.yaml:1:", "not valid YAML")
        self.refused(",t,position\n0,0.1,2\n", "x.yaml:1:", "not valid YAML")  # the index of a pandas table
        self.refused("rig: toy\n--- {a: b}\n,\n", "x.yaml:2:", "second document")

    def test_what_is_no_datasheet_at_all(self):
        self.refused("t,position\n0,1\n", "mapping of keys")
        self.refused("a: b\n" * 1000000, "larger than 4 MB")

    def test_sample_period(self):
        text = (ROOT / "config" / RIG / "rig.yaml").read_text()
        self.assertIn("\nsample_period: 0.001", text)
        for period in ("1e-300", "0", "-1", "101", "1e300"):
            (self.folder / "x.yaml").write_text(text.replace("\nsample_period: 0.001", f"\nsample_period: {period}"))
            self.complains(
                ["simulate", RIG, "--config", "x.yaml", "-o", "a.csv"], "x.yaml:", "sample_period", "0.0001 to 100"
            )

    def test_types_of_stages(self):
        """Whatever names a stage's kind: file and line of the stage."""
        shutil.copytree(ROOT / "config" / RIG, self.folder / "own")
        lines = (self.folder / "own/stages.yaml").read_text().splitlines(keepends=True)
        recording = self.simulate("a.bag")
        places = [i for i, line in enumerate(lines) if re.match(r"( +|  - name: .*, )type: ", line)]
        self.assertGreater(len(places), 3)
        for i in places:
            changed = re.sub(r"type: \w+", "type: nonsense", lines[i])
            (self.folder / "own/stages.yaml").write_text("".join(lines[:i] + [changed] + lines[i + 1 :]))
            said = self.complains(["diagnose", recording, "--config", "own"], "stages.yaml:", "'nonsense'")
            self.assertLessEqual(abs(int(re.search(r"stages\.yaml:(\d+):", said).group(1)) - i - 1), 1, said)


if __name__ == "__main__":
    unittest.main()
