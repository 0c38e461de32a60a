"""What the program writes: never over what it reads, whole or not at all, also when it is interrupted, the disk is full
or another run writes the same file."""
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from program import ROOT, ProgramTest, program  # noqa: E402

RIG = "servo_actuator"
SUBCOMMANDS = {  # as far as it must go to print something
    "rigs": ["rigs"],
    "simulate": ["simulate", RIG, "--duration", "1", "-o", "o.csv"],
    "import": ["import", "a.csv", "--rig", RIG, "-o", "o.bag"],
    "export": ["export", "a.bag", "-o", "o.csv"],
    "diagnose": ["diagnose", "a.bag"],
    "isolability": ["isolability", "a.bag"],
    "trace": ["isolability", "a.bag", "--trace"],
    "help": ["diagnose", "--help"],
    "all help": ["--help"],
    "json": ["rigs", "--json", "-"],
    "series": ["diagnose", "a.bag", "--series", "-"],
}


class InputsAreKept(ProgramTest):
    def setUp(self):
        super().setUp()
        self.simulate("a.bag", duration=1)
        self.simulate("a.csv", duration=1)
        (self.folder / "own.yaml").write_text(
            "\n".join((ROOT / "config" / RIG / part).read_text() for part in ("rig.yaml", "stages.yaml"))
        )
        (self.folder / "link.bag").symlink_to("a.bag")
        os.link(self.folder / "a.bag", self.folder / "hard.bag")
        (self.folder / "deep").mkdir()
        (self.folder / "around").symlink_to("deep/..")
        self.before = {name: (self.folder / name).read_bytes() for name in ("a.bag", "a.csv", "own.yaml")}

    def kept(self, arguments, *says):
        names = self.files()
        self.complains(arguments, *says)
        for name, content in self.before.items():
            self.assertEqual((self.folder / name).read_bytes(), content, arguments)
        self.assertEqual(self.files(), names)

    def test_an_output_that_is_an_input(self):
        for name in ("a.bag", "./a.bag", "link.bag", "hard.bag", "around/a.bag", self.folder / "a.bag"):
            for command in (
                ["diagnose", "a.bag", "--json", name],
                ["diagnose", "a.bag", "--series", name],
                ["gap", "a.bag", "--report", name],
                ["gap", "x.bag", "--holdout", "a.bag", "--json", name],
                ["gap", "a.bag", "--adopt", name],
                ["fit", RIG, "b.bag", "a.bag", "--json", name],
                ["fit", RIG, "a.bag", "--patch", name],
                ["tune", RIG, "a.bag", "--json", name],
                ["tune", RIG, "a.bag", "--patch", name],
                ["isolability", "a.bag", "--json", name],
            ):
                self.kept(command, str(name), "this file is read")
        self.kept(["diagnose", "link.bag", "--json", "a.bag"], "a.bag", "this file is read, as RECORDING")
        os.link(self.folder / "a.bag", self.folder / "a.bag.csv")
        self.kept(["export", "a.bag", "-o", "a.bag.csv"], "a.bag.csv", "this file is read")
        os.link(self.folder / "a.csv", self.folder / "a.csv.bag")
        self.kept(["import", "a.csv", "--rig", RIG, "-o", "a.csv.bag"], "a.csv.bag", "this file is read")

    def test_an_output_that_is_the_datasheet(self):
        for command in (
            ["rigs", "--json"],
            ["diagnose", "a.bag", "--json"],
            ["diagnose", "a.bag", "--series"],
            ["gap", "a.bag", "--adopt"],
            ["fit", RIG, "a.bag", "--patch"],
            ["tune", RIG, "a.bag", "--patch"],
        ):
            self.kept(command + ["own.yaml", "--config", "own.yaml"], "own.yaml", "this file is read, as --config")
        share = self.folder / "share"
        (share / "config").mkdir(parents=True)
        (share / "config" / f"{RIG}.yaml").write_bytes(self.before["own.yaml"])
        os.environ["FAULTLINE_SHARE"] = str(share)
        self.addCleanup(os.environ.pop, "FAULTLINE_SHARE")
        self.kept(["diagnose", "a.bag", "--json", f"share/config/{RIG}.yaml"], "own datasheets")
        self.assertEqual((share / "config" / f"{RIG}.yaml").read_bytes(), self.before["own.yaml"])

    def test_two_outputs_of_one_name(self):
        self.kept(
            ["diagnose", "a.bag", "--json", "b.txt", "--series", "./b.txt"],
            "b.txt",
            "--json is written to the same place",
        )
        self.kept(
            ["diagnose", "a.bag", "--json", "-", "--series", "-"],
            "--json - and --series -: standard output takes one of them",
        )
        (self.folder / "b.txt").symlink_to("c.txt")
        self.kept(["gap", "a.bag", "--json", "b.txt", "--adopt", "around/c.txt"], "same place")
        self.run_program("diagnose", "a.bag", "--json", "/dev/null", "--series", "/dev/null")

    def test_standard_output_that_is_an_input(self):
        with open(self.folder / "a.bag", "ab") as recording:
            done = subprocess.run(
                [program(), "diagnose", "a.bag"],
                cwd=self.folder,
                stdout=recording,
                stderr=subprocess.PIPE,
                text=True,
                timeout=60,
            )
        self.assertEqual(done.returncode, 2)
        self.assertIn("standard output goes into this file", done.stderr)
        self.assertEqual((self.folder / "a.bag").read_bytes(), self.before["a.bag"])

    def test_a_run_cannot_judge_what_was_learned_from_it(self):
        self.kept(["gap", "a.bag", "--holdout", "link.bag"], "given as RUN and as --holdout")

    def test_files_only(self):
        for command in (
            ["gap", "a.bag", "--report", "-"],
            ["gap", "a.bag", "--adopt", "-"],
            ["fit", RIG, "a.bag", "--patch", "-"],
        ):
            self.kept(command, "written to a file")

    def test_text_takes_the_place_of_no_recording(self):
        run, other = self.simulate("run.bag", duration=1), self.simulate("other.bag", duration=1)
        before = (self.folder / "other.bag").read_bytes()
        for option in ("--json", "--series"):
            self.complains(["diagnose", run, option, other], "other.bag", "this is a recording")
        self.complains(["export", run, "-o", "other.bag"], "other.bag")
        self.assertEqual((self.folder / "other.bag").read_bytes(), before)

    def test_what_nobody_may_write_is_not_replaced(self):
        if os.geteuid() == 0:
            return  # root may write everything
        (self.folder / "old.json").write_text("old")
        (self.folder / "old.json").chmod(0o444)
        self.kept(["diagnose", "a.bag", "--json", "old.json"], "old.json", "cannot be written")


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

    def test_file_that_may_not_grow(self):
        done = subprocess.run(
            [
                "bash",
                "-c",
                'ulimit -f 100; exec "$@"',
                "bash",
                program(),
                "simulate",
                RIG,
                "--duration",
                "20",
                "-o",
                "a.csv",
            ],
            cwd=self.folder,
            stderr=subprocess.PIPE,
            text=True,
            timeout=60,
        )
        self.assertEqual(done.returncode, 2, done.stderr)
        self.assertIn("a.csv: writing failed", done.stderr)
        self.assertEqual(self.files(), [])

    def test_standard_output_that_takes_nothing(self):
        self.simulate("a.bag")
        self.simulate("a.csv")
        for name, arguments in SUBCOMMANDS.items():
            for target in ("/dev/full", None):
                with self.subTest(name=name, target=target):
                    shell = [
                        "bash",
                        "-c",
                        '"$@" ' + (f"> {target}" if target else ">&-"),
                        "bash",
                        program(),
                        *arguments,
                    ]
                    done = subprocess.run(shell, cwd=self.folder, stderr=subprocess.PIPE, text=True, timeout=60)
                    self.assertEqual(done.returncode, 2, done.stderr)
                    self.assertEqual(len(done.stderr.splitlines()), 1, done.stderr)
                    self.assertIn("standard output", done.stderr)
        # Without a standard output the first file that is opened must not take its place.
        self.assertEqual((self.folder / "o.csv").read_text(), self.simulate("again.csv").read_text())

    def test_standard_output_that_goes_away(self):
        self.simulate("a.bag")
        done = subprocess.run(
            ["bash", "-o", "pipefail", "-c", '"$@" | head -1', "bash", program(), "diagnose", "a.bag", "--series", "-"],
            cwd=self.folder,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            timeout=60,
        )
        self.assertEqual((done.returncode, done.stderr, len(done.stdout.splitlines())), (128 + signal.SIGPIPE, "", 1))

    def test_standard_error_that_takes_nothing(self):
        for target in ("> /dev/full", ">&-"):
            done = subprocess.run(
                ["bash", "-c", '"$@" 2' + target, "bash", program(), "simulate", RIG, "--duration", "1", "-o", "a.csv"],
                cwd=self.folder,
                stdout=subprocess.PIPE,
                timeout=60,
            )
            self.assertEqual(done.returncode, 0)

    def test_device_is_not_replaced(self):
        link = self.folder / "null.csv"
        link.symlink_to("/dev/null")
        self.run_program("simulate", RIG, "--duration", "1", "-o", link)
        self.assertTrue(link.is_symlink())
        self.assertFalse(pathlib.Path("/dev/null").is_file())

    def test_links_and_rights_stay(self):
        link = self.folder / "link.csv"
        link.symlink_to("not_there_yet.csv")
        self.run_program("simulate", RIG, "--duration", "1", "-o", link)
        self.assertTrue(link.is_symlink())
        (self.folder / "not_there_yet.csv").chmod(0o600)
        self.run_program("simulate", RIG, "--duration", "1", "-o", link)
        self.assertEqual((self.folder / "not_there_yet.csv").stat().st_mode & 0o777, 0o600)
        self.assertEqual(self.files(), ["link.csv", "not_there_yet.csv"])

    def test_unwritable_place(self):
        self.complains(["simulate", RIG, "-o", "no/such/folder/a.bag"], "no/such/folder/a.bag", "cannot be written")
        self.complains(["simulate", RIG, "-o", "/proc/a.csv"], "/proc/a.csv", "cannot be written")
        (self.folder / "folder.bag").mkdir()
        self.complains(["simulate", RIG, "-o", "folder.bag"], "folder.bag", "folder")
        self.assertEqual(self.files(), ["folder.bag"])

    def test_both_files_of_a_datasheet_are_read(self):
        shutil.copytree(ROOT / "config" / RIG, self.folder / "own")
        before = (self.folder / "own/stages.yaml").read_bytes()
        for config in ("own", "own/rig.yaml"):
            self.complains(
                ["rigs", RIG, "--config", config, "--json", "own/stages.yaml"], "stages.yaml", "this file is read"
            )
        self.assertEqual((self.folder / "own/stages.yaml").read_bytes(), before)

    def test_longest_name(self):
        name = "n" * 251 + ".csv"
        self.run_program("simulate", RIG, "--duration", "1", "-o", name)
        self.assertEqual(self.files(), [name])

    def test_failure_keeps_the_old_file(self):
        (self.folder / "bad.csv").write_text("t\n")
        old = self.simulate("old.bag").read_bytes()
        self.complains(["import", "bad.csv", "--rig", RIG, "-o", "old.bag"], "bad.csv")
        self.assertEqual((self.folder / "old.bag").read_bytes(), old)

    def test_parts_are_nobody_elses(self):
        (self.folder / "a.bag.part").write_text("mine")
        self.simulate("a.bag")
        self.assertEqual((self.folder / "a.bag.part").read_text(), "mine")
        self.assertEqual(self.files(), ["a.bag", "a.bag.part"])

    def test_two_runs_with_one_output(self):
        command = [program(), "simulate", RIG, "--quiet", "-o", "a.bag", "--duration"]
        runs = [
            subprocess.Popen(command + [duration, "--seed", duration], cwd=self.folder)
            for duration in ("30", "20", "10")
        ]
        self.assertEqual([run.wait(60) for run in runs], [0, 0, 0])
        self.assertEqual(self.files(), ["a.bag"])
        self.run_program("export", "a.bag", "-o", "a.csv")
        rows = len((self.folder / "a.csv").read_text().splitlines()) - 1
        self.assertIn(rows, (30001, 20001, 10001))
        duration = str(rows // 1000)
        self.simulate("b.bag", "--seed", duration, duration=duration)
        self.assertEqual((self.folder / "a.bag").read_bytes(), (self.folder / "b.bag").read_bytes())


class Interrupt(ProgramTest):
    def interrupted(self, arguments, number, begun=None, after=0.2):
        process = subprocess.Popen(
            [program(), *arguments], cwd=self.folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        self.addCleanup(process.wait)
        self.addCleanup(process.kill)
        end = time.monotonic() + 20
        while begun and not list(self.folder.glob(begun)) and time.monotonic() < end:
            time.sleep(0.01)
        time.sleep(after)
        self.assertIsNone(process.poll(), "it ended by itself")
        process.send_signal(number)
        begin = time.monotonic()
        _, errors = process.communicate(timeout=20)
        self.assertLess(time.monotonic() - begin, 1)
        self.assertEqual(process.returncode, 128 + number)
        self.assertEqual(len(errors.splitlines()), 1, errors)
        self.assertIn("interrupted", errors)

    def test_simulate(self):
        for name, number in (
            ("a.bag", signal.SIGINT),
            ("a.csv", signal.SIGINT),
            ("b.bag", signal.SIGTERM),
            ("c.bag", signal.SIGHUP),
        ):
            self.interrupted(["simulate", RIG, "--duration", "100000", "-o", name], number, name + ".*.part")
        self.assertEqual(self.files(), [])

    def test_import_at_any_moment(self):
        lines = self.simulate("a.csv").read_text().splitlines()
        rows = [line.split(",", 1)[1] for line in lines[1:]]
        with open(self.folder / "long.csv", "w") as file:
            file.write(lines[0] + "\n")
            for k in range(600000):
                file.write(f"{k / 1000},{rows[k % len(rows)]}\n")
        for after in (0.1, 0.5, 1.5):  # while it reads, and later
            self.interrupted(["import", "long.csv", "--rig", RIG, "-o", "long.bag"], signal.SIGTERM, after=after)
        self.assertEqual(self.files(), ["a.csv", "long.csv"])

    def test_what_is_ignored_stays_ignored(self):
        process = subprocess.Popen(
            ["nohup", program(), "simulate", RIG, "--duration", "60", "-o", "a.csv"],
            cwd=self.folder,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        time.sleep(0.3)
        process.send_signal(signal.SIGHUP)
        self.assertEqual(process.wait(60), 0)
        self.assertEqual(self.files(), ["a.csv"])


if __name__ == "__main__":
    unittest.main()
