"""`faultline new-rig`: what it writes builds, passes its own test, simulates and is diagnosed; what it refuses."""

import json
import os
import unittest

from packages import OutsideTest, ROOT, build, environment, plain_environment, run

from graph import BUILD  # packages makes it known


class NewRig(OutsideTest):
    env = plain_environment()

    def files(self):
        return sorted(path.name for path in self.folder.iterdir())

    def test_it_builds_and_passes_its_own_test(self):
        said = self.faultline("new-rig", "pump_stand", "-o", "stand").stdout
        folder = self.folder / "stand"
        self.assertIn(str(folder), said)
        made = sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())
        self.assertEqual(
            made,
            [
                "CMakeLists.txt",
                "config/pump_stand/rig.yaml",
                "launch/pump_stand.launch",
                "package.xml",
                "src/pump_stand.cpp",
                "test/test_pump_stand.py",
            ],
        )
        for name in made:
            text = (folder / name).read_text()
            self.assertNotRegex(text, "(?i)my_?rig")
            self.assertIn(name, said)
        self.assertIn("class PumpStand : public Rig", (folder / "src/pump_stand.cpp").read_text())

        build(folder)
        # Nothing of the environment is needed to run its test: it names the program and the package itself.
        tested = run("ctest", "--test-dir", folder / "build", "--output-on-failure", env=plain_environment())
        self.assertIn("100% tests passed", tested.stdout)
        run("cmake", "--build", folder / "build", "--target", "run_tests", env=environment())

        rigs = self.faultline("rigs", "--json", "-", env=plain_environment(FAULTLINE_RIG_PATH=str(folder)))
        rig = [rig for rig in json.loads(rigs.stdout)["rigs"] if rig["rig"] == "pump_stand"][0]
        self.assertTrue(rig["simulated"] and rig["diagnosed"])

        # Its own test fails where the rig is wrong.
        source = folder / "src/pump_stand.cpp"
        source.write_text(source.read_text().replace("outlet_.opening(outlet_coefficient_)", "outlet_coefficient_"))
        run("cmake", "--build", folder / "build", env=environment())
        broken = run("ctest", "--test-dir", folder / "build", env=plain_environment(), code=None)
        self.assertNotEqual(broken.returncode, 0)

    def test_it_builds_against_an_install_space(self):
        prefix = self.folder / "space"
        run("cmake", "--install", BUILD, "--prefix", prefix)
        installed = [prefix / "lib/faultline/faultline"]
        run(*installed, "new-rig", "pump_stand", cwd=self.folder, env=self.env)
        env = plain_environment(CMAKE_PREFIX_PATH=str(prefix), PYTHONPATH=str(prefix / "lib/python3/dist-packages"))
        folder = self.folder / "pump_stand"
        build(folder, env=env)
        run("ctest", "--test-dir", folder / "build", "--output-on-failure", env=env)
        run("cmake", "--install", folder / "build", "--prefix", prefix)
        said = run(*installed, "rigs", "pump_stand", env=plain_environment(FAULTLINE_RIG_PATH=str(prefix))).stdout
        self.assertIn("restriction.outlet", said)

    def test_nothing_is_overwritten(self):
        (self.folder / "there").mkdir()
        (self.folder / "file").write_text("mine")
        os.symlink(self.folder / "nowhere", self.folder / "link")
        for name in ("there", "file", "link"):
            self.complains(["new-rig", "pond", "-o", name], name, "nothing is overwritten")
        self.assertEqual((self.folder / "file").read_text(), "mine")
        self.faultline("new-rig", "pond")
        self.complains(["new-rig", "pond"], "nothing is overwritten")
        self.assertEqual(self.files(), ["file", "link", "pond", "there"])

    def test_names_and_folders_that_are_refused(self):
        for name in ("Pond", "2nd", "pump-stand", "_pond", "a b", "../pond", "a" * 61, "ü"):
            self.complains(["new-rig", name], "is no name for a rig")
        for name in ("test", "install", "faultline"):
            self.complains(["new-rig", name], f"'{name}' is a target of CMake")
        self.complains(["new-rig", "servo_actuator"], "there is a rig 'servo_actuator' already")
        self.complains(["new-rig", "pond", "-o", "no/such/folder"], "no/such/folder", "cannot be written")
        self.complains(["new-rig", "pond", "-o", ""], "the value is empty")
        self.assertEqual(self.files(), [])

    def test_a_name_of_a_package_on_the_path_is_refused(self):
        env = plain_environment(FAULTLINE_RIG_PATH=str(ROOT / "examples/cascaded_tanks"))
        self.complains(["new-rig", "cascaded_tanks"], "there is a rig 'cascaded_tanks' already", env=env)


if __name__ == "__main__":
    unittest.main()
