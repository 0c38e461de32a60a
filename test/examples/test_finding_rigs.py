"""How a rig outside the tree is found and loaded, and what is said of one that cannot be."""

import json
import pathlib
import shutil
import subprocess
import tempfile

from packages import OutsideTest, ROOT, build, copied, devel_space, environment, plain_environment, program, run

RIG = "cascaded_tanks"


def setUpModule():
    global space, package
    space = tempfile.TemporaryDirectory(prefix="faultline_finding_")
    package = copied(RIG, pathlib.Path(space.name).resolve() / "workspace/src" / RIG)
    build(package)


def tearDownModule():
    space.cleanup()


def library_of(text, target):
    """A shared library of a C source."""
    target.parent.mkdir(parents=True, exist_ok=True)
    subprocess.run(["cc", "-shared", "-fPIC", "-x", "c", "-", "-o", str(target)], input=text, text=True, check=True)


class Finding(OutsideTest):
    def names(self, env):
        told = json.loads(self.faultline("rigs", "--json", "-", env=env).stdout)
        return {rig["rig"]: rig for rig in told["rigs"]}

    def knows(self, env):
        rig = self.names(env)[RIG]
        self.assertTrue(rig["simulated"])
        self.faultline("simulate", RIG, "--duration", "40", "-o", "run.csv", env=env)
        return rig

    def path(self, *folders):
        return plain_environment(FAULTLINE_RIG_PATH=":".join(map(str, folders)))

    def test_not_without_being_told(self):
        self.assertNotIn(RIG, self.names(plain_environment()))
        self.assertNotIn(RIG, self.names(environment()))
        self.complains(["rigs", RIG], f"there is no rig '{RIG}'", "servo_actuator", env=plain_environment())

    def test_by_path_without_ros(self):
        for folder in (package, package / "build/devel"):
            with self.subTest(folder=str(folder)):
                rig = self.knows(self.path(self.folder, folder))
                self.assertEqual(rig["datasheet"], str(package / "config" / RIG / "rig.yaml"))

    def test_by_an_install_space(self):
        prefix = self.folder / "space"
        run("cmake", "--install", package / "build", "--prefix", prefix)
        rig = self.knows(self.path(prefix))
        self.assertEqual(rig["datasheet"], str(prefix / "share" / RIG / "config" / RIG / "rig.yaml"))

    def test_by_a_plain_folder(self):
        plain = self.folder / "plain"
        shutil.copytree(package / "config", plain / "config")
        (plain / "lib").mkdir()
        shutil.copy(package / f"build/devel/lib/lib{RIG}.so", plain / "lib")
        self.knows(self.path(plain))

    def test_by_ros_package(self):
        prefixes = environment()["CMAKE_PREFIX_PATH"]
        env = environment(
            ROS_PACKAGE_PATH=f"{package}:{environment()['ROS_PACKAGE_PATH']}",
            CMAKE_PREFIX_PATH=f"{package / 'build/devel'}:{prefixes}",
        )
        self.knows(env)
        env["FAULTLINE_RIG_PATH"] = str(package / "build/devel")  # by both ways it is still one
        self.knows(env)
        script = f"source {package}/build/devel/setup.bash && {program()} rigs {RIG}"
        sourced = run("bash", "-c", script, env=environment())
        self.assertIn("restriction.lower_outlet", sourced.stdout)

    def test_effects_of_a_package_are_listed(self):
        told = json.loads(self.faultline("effects", "--json", "-", env=self.path(package)).stdout)
        crack = [effect for effect in told["effects"] if effect["effect"] == "crack"]
        self.assertEqual(crack[0]["ports"], ["flow"])
        self.assertEqual(crack[0]["parameters"][1]["unit"], "Pa")

    def test_a_file_given_by_config_takes_the_library_too(self):
        sheet = self.folder / "mine.yaml"
        text = (package / "config" / RIG / "rig.yaml").read_text()
        sheet.write_text(text.replace("nominal: 0.042", "nominal: 0.043"))
        said = self.faultline("rigs", "--config", sheet, env=self.path(package)).stdout
        self.assertIn("crack", said)
        self.assertIn("rim 4..12.5 [V]", said)  # in the port's own unit
        self.assertIn("simulated", said)
        self.assertNotIn("not in this build", said)

    def test_its_datasheet_is_no_output(self):
        sheet = package / "config" / RIG / "rig.yaml"
        before = sheet.read_text()
        self.complains(["effects", "--json", sheet], "one of the program's own datasheets", env=self.path(package))
        self.assertEqual(sheet.read_text(), before)


class Broken(OutsideTest):
    """Each of these packages stops work on its own rig, and on no other."""

    def broken(self, name, rig="pond"):
        """A package with a datasheet, without a library."""
        folder = self.folder / name
        (folder / "config" / rig).mkdir(parents=True)
        text = (ROOT / "examples/my_rig/config/my_rig/rig.yaml").read_text()
        (folder / "config" / rig / "rig.yaml").write_text(text.replace("my_rig", rig))
        manifest = (ROOT / "examples/my_rig/package.xml").read_text()
        (folder / "package.xml").write_text(manifest.replace("my_rig", rig))
        return folder

    def judge(self, folders, *says, noted=True):
        env = plain_environment(FAULTLINE_RIG_PATH=":".join(map(str, folders)))
        self.complains(["simulate", "pond", "-o", "run.csv"], "rig 'pond': ", *says, env=env)
        other = self.faultline("simulate", "servo_actuator", "--duration", "0.1", "-o", "run.csv", env=env)
        if noted:  # what only loading shows is not looked for on behalf of another rig
            self.assertIn("faultline: note: rig 'pond' is left out: ", other.stderr)
            self.assertEqual(len(other.stderr.splitlines()), 1)
        listed = self.faultline("rigs", env=env)
        self.assertIn("servo_actuator", listed.stdout)
        self.assertNotIn("pond", listed.stdout)
        self.assertIn("rig 'pond': ", listed.stderr)

    def test_library_missing(self):
        folder = self.broken("pond")
        self.judge([folder], str(folder), "libpond.so is not in", "build the package")

    def test_no_library_at_all(self):
        folder = self.broken("pond")
        (folder / "devel/lib").mkdir(parents=True)
        (folder / "devel/lib/libpond.so").write_text("no library")
        self.judge([folder], "libpond.so", f"build the package {folder} again", noted=False)

    def test_undefined_symbol(self):
        folder = self.broken("pond")
        library_of("int gone(void); int pond(void) { return gone(); }", folder / "devel/lib/libpond.so")
        self.judge([folder], "undefined symbol: gone", "built against another version of faultline", noted=False)

    def test_other_headers(self):
        folder = self.broken("pond")
        library_of(
            "extern const int faultline_interface_0123; const int* f = &faultline_interface_0123;"
            "__attribute__((constructor)) void never(void) { __builtin_trap(); }",
            folder / "devel/lib/libpond.so",
        )
        self.judge(
            [folder], "faultline_interface_0123", "another version of faultline", str(folder) + " again", noted=False
        )

    def test_no_equations_in_the_library(self):
        folder = self.broken("pond")
        library_of("int pond;", folder / "devel/lib/libpond.so")
        self.judge([folder], "it brings no equations of this name", noted=False)

    def test_no_datasheet(self):
        folder = self.broken("pond")
        shutil.rmtree(folder / "config")
        self.judge([folder], str(folder / "config/pond"), "holds no rig.yaml")

    def test_two_of_one_name(self):
        first, second = self.broken("one"), self.broken("two")
        self.judge([first, second], "two rigs have this name", str(first), str(second))

    def test_the_name_of_a_rig_that_is_here(self):
        folder = self.broken("servo", rig="servo_actuator")
        env = plain_environment(FAULTLINE_RIG_PATH=str(folder))
        self.complains(["rigs", "servo_actuator"], "two rigs have this name", str(folder), env=env)

    def test_a_folder_without_a_rig(self):
        env = plain_environment(FAULTLINE_RIG_PATH=f"{self.folder}:{self.folder}/nowhere")
        said = self.faultline("rigs", "servo_actuator", env=env).stderr.splitlines()
        self.assertEqual(len(said), 2)
        self.assertIn("no rig is in this folder", said[0])
        self.assertIn("there is no such folder", said[1])

    def test_an_effect_whose_name_is_taken(self):
        folder = copied("my_rig", self.folder / "my_rig")
        source = folder / "src/my_rig.cpp"
        text = source.read_text()
        source.write_text(
            text.replace(
                "FAULTLINE_RIG(my_rig",
                'struct Clog : Effect {};\nFAULTLINE_EFFECT(clogging, {"clogging", "f", "u fraction", '
                '{PortKind::flow}, {{"fraction", "1", 0, 0, 1}}, &make_effect<Clog>});\nFAULTLINE_RIG(my_rig',
            )
        )
        build(folder)
        env = plain_environment(FAULTLINE_RIG_PATH=f"{folder}:{package}")
        self.complains(["rigs", "my_rig"], "two of the kind 'effect' are called 'clogging'", "rename", env=env)
        self.faultline("rigs", RIG, env=env)


if __name__ == "__main__":
    import unittest

    unittest.main()
