"""Every bad input ends with exit status 2 and one line that says what is wrong and where; Ctrl-C and full disks leave nothing."""
import os
import pathlib
import signal
import struct
import subprocess
import sys
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from program import ProgramTest, program  # noqa: E402

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
            (good + ["--seed", "x"], "--seed"),
            (good + ["--effect", "nonsense"], "effect@port"),
            (good + ["--effect", "nonsense@force.piston:force=1"], "no effect 'nonsense'"),
            (good + ["--effect", "coulomb_friction@force.nowhere:force=1"], "no port 'force.nowhere'", "force.piston"),
            (good + ["--effect", "coulomb_friction@sensor.position:force=1"], "does not fit"),
            (good + ["--effect", "clogging@restriction.valve:fraction=1.5"], "fraction=1.5", "outside"),
            (good + ["--effect", "coulomb_friction@force.piston:force=ten"], "force=ten is not a number"),
            (good + ["--command", "valve_command"], "CHANNEL:time=value"),
            (good + ["--command", "position:1=2"], "position is no command"),
            (good + ["--command", "nowhere:1=2"], "'nowhere'", "valve_command"),
            (good + ["--command", "leak_valve_command:2=1,1=2"], "times must rise"),
            (good + ["--command", "leak_valve_command:1=99"], "99", "outside"),
            (good + ["--command", "leak_valve_command:1"], "time=value"),
            (good + ["--command", "leak_valve_command:1=1", "--fault", "internal_leak_ramp"], "already"),
            (good + ["--compression", "zip"], "'zip'", "lz4"),
            (good + ["--config", "nowhere.yaml"], "nowhere.yaml"),
            (["import", "a.csv", "--rig", RIG, "-o", "a.csv"], ".bag"),
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
        self.write([row[:column] + row[column + 1:] for row in self.rows])
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
                    self.refused(content[:int(len(content) * share)], "rosbag reindex bad.bag")

    def test_unfinished_recording_has_no_index(self):
        content = bytearray(self.good())
        at = content.index(b"index_pos=") + len(b"index_pos=")
        content[at:at + 8] = struct.pack("<Q", 0)
        self.refused(bytes(content), "rosbag reindex bad.bag")

    def test_damaged_chunk(self):
        for kind in ("lz4", "bz2"):
            content = bytearray(self.simulate(f"{kind}.bag", "--compression", kind, duration=5).read_bytes())
            middle = len(content) // 2
            content[middle:middle + 200] = bytes(200)
            self.refused(bytes(content), "damaged")

    def test_bag_without_messages(self):
        content = self.good()
        start = len(b"#ROSBAG V2.0\n")
        header = struct.unpack("<I", content[start:start + 4])[0]
        padding = struct.unpack("<I", content[start + 4 + header:start + 8 + header])[0]
        end = start + 8 + header + padding
        empty = bytearray(content[:end])
        for name, value in ((b"index_pos=", struct.pack("<Q", end)), (b"conn_count=", bytes(4)), (b"chunk_count=", bytes(4))):
            at = empty.index(name) + len(name)
            empty[at:at + len(value)] = value
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
        self.refused(self.good().replace(b"faultline/Sample", b"faultline/Simple"), "no topic of type faultline/Sample",
                     "/servo_actuator/sample (faultline/Simple)")

    def test_another_version_of_the_message(self):
        content = self.good()
        at = content.index(b"md5sum=") + len(b"md5sum=")
        content = content.replace(content[at:at + 32], b"0" * 32)
        self.refused(content, "another version of faultline/")

    def test_unit_that_differs(self):
        content = self.good()
        name = b"load_pressure" + struct.pack("<I", 2)
        self.assertIn(name + b"Pa", content)
        self.refused(content.replace(name + b"Pa", name + b"kP"), "load_pressure", "'kP'", "'Pa'")


class Output(ProgramTest):
    def test_full_disk(self):
        for ending in ("csv", "bag"):
            link = self.folder / f"full.{ending}"
            link.symlink_to("/dev/full")
            self.complains(["simulate", RIG, "--duration", "20", "-o", link], f"full.{ending}", "writing failed")
        self.simulate("a.bag")
        (self.folder / "full.json").symlink_to("/dev/full")
        self.complains(["diagnose", "a.bag", "--json", "full.json"], "full.json")
        self.assertEqual(self.files(), ["a.bag", "full.bag", "full.csv", "full.json"])
        with open("/dev/full", "w") as full:
            done = subprocess.run([program(), "rigs", "--json", "-"], stdout=full, stderr=subprocess.PIPE, text=True, timeout=60)
        self.assertEqual(done.returncode, 2)
        self.assertEqual(len(done.stderr.splitlines()), 1)

    def test_device_is_not_replaced(self):
        link = self.folder / "null.csv"
        link.symlink_to("/dev/null")
        self.run_program("simulate", RIG, "--duration", "1", "-o", link)
        self.assertTrue(link.is_symlink())
        self.assertFalse(pathlib.Path("/dev/null").is_file())

    def test_unwritable_place(self):
        self.complains(["simulate", RIG, "-o", "no/such/folder/a.bag"], "no/such/folder/a.bag", "cannot be written")
        self.complains(["simulate", RIG, "-o", "/proc/a.csv"], "/proc/a.csv", "cannot be written")
        (self.folder / "folder.bag").mkdir()
        self.complains(["simulate", RIG, "-o", "folder.bag"], "folder.bag", "folder")
        self.assertEqual(self.files(), ["folder.bag"])

    def test_failure_keeps_the_old_file(self):
        (self.folder / "bad.csv").write_text("t\n")
        old = self.simulate("old.bag").read_bytes()
        self.complains(["import", "bad.csv", "--rig", RIG, "-o", "old.bag"], "bad.csv")
        self.assertEqual((self.folder / "old.bag").read_bytes(), old)


class Interrupt(ProgramTest):
    def interrupted(self, arguments, number, wait_for):
        process = subprocess.Popen([program(), *arguments], cwd=self.folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.addCleanup(process.wait)
        self.addCleanup(process.kill)
        end = time.monotonic() + 20
        while wait_for and not (self.folder / wait_for).exists() and time.monotonic() < end:
            time.sleep(0.01)
        time.sleep(0.2)
        self.assertIsNone(process.poll(), "it ended by itself")
        process.send_signal(number)
        begin = time.monotonic()
        _, errors = process.communicate(timeout=20)
        self.assertLess(time.monotonic() - begin, 3)
        self.assertEqual(process.returncode, 128 + number)
        self.assertEqual(len(errors.splitlines()), 1, errors)
        self.assertIn("interrupted", errors)

    def test_simulate(self):
        for name, number in (("a.bag", signal.SIGINT), ("a.csv", signal.SIGINT), ("b.bag", signal.SIGTERM)):
            self.interrupted(["simulate", RIG, "--duration", "100000", "-o", name], number, name + ".part")
        self.assertEqual(self.files(), [])


if __name__ == "__main__":
    unittest.main()
