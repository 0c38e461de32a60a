// Where rigs outside this tree are found, and what is said of those that cannot be used. That their libraries run is
// tested in test/examples, on packages that are built there.
#include "faultline/rig/rig_library.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "config_folder.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

namespace fs = std::filesystem;

class RigLibrary : public testing::Test {
 protected:
  void SetUp() override {
    const fs::path own = fs::canonical(fs::temp_directory_path()) / ("faultline_rigs_" + std::to_string(::getpid()));
    fs::remove_all(own);
    // Libraries are looked for two folders above a package too: that is still a folder of the test's own.
    folder_ = own / "path";
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_.parent_path()); }

  void write(const std::string& name, const std::string& text) {
    fs::create_directories((folder_ / name).parent_path());
    std::ofstream(folder_ / name) << text;
  }
  // A package in `folder` that exports a rig, with its datasheet's file.
  void package(const std::string& folder, const std::string& rig) {
    write(folder + "/package.xml", "<package><name>p</name><export><other/><faultline rig=\"" + rig +
                                       "\" library=\"lib" + rig + ".so\"/></export></package>");
    write(folder + "/config/" + rig + "/rig.yaml", "rig: " + rig + "\n");
  }
  std::string path(const std::string& name) const { return (folder_ / name).string(); }
  RigPlace only(const std::vector<std::string>& names, const std::vector<std::string>& spaces = {}) const {
    std::vector<std::string> folders;
    for (const std::string& name : names) folders.push_back(path(name));
    const std::vector<RigPlace> places = find_rig_places(folders, spaces);
    EXPECT_EQ(places.size(), 1u);
    return places.empty() ? RigPlace{} : places.front();
  }

  fs::path folder_;
};

void expect_usable(const RigPlace& place, const std::string& config, const std::string& library) {
  EXPECT_EQ(place.trouble, "");
  EXPECT_EQ(place.rig, "pond");
  EXPECT_EQ(place.config, config);
  EXPECT_EQ(place.library, library);
}

std::string complaint(const std::function<void()>& job) {
  try {
    job();
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST_F(RigLibrary, APackageIsFoundWithWhatWasBuiltInIt) {
  package("src/pond", "pond");
  write("src/pond/build/devel/lib/libpond.so", "");
  expect_usable(only({"src/pond"}), path("src/pond/config/pond"), path("src/pond/build/devel/lib/libpond.so"));
}

TEST_F(RigLibrary, ASpaceThatIsNamedComesBeforeThoseAround) {
  package("src/pond", "pond");
  write("src/pond/devel/lib/libpond.so", "");
  write("space/lib/libpond.so", "");
  expect_usable(only({"src/pond"}, {path("space")}), path("src/pond/config/pond"), path("space/lib/libpond.so"));
}

TEST_F(RigLibrary, ADevelSpaceNamesItsSources) {
  package("ws/src/group/pond", "pond");
  write("ws/src/group/other/package.xml", "<package><name>other</name></package>");
  write("ws/src/ignored/CATKIN_IGNORE", "");
  package("ws/src/ignored/lake", "lake");
  write("ws/devel/.catkin", path("ws/src") + ";" + path("ws/nothing"));
  write("ws/devel/lib/libpond.so", "");
  expect_usable(only({"ws/devel"}), path("ws/src/group/pond/config/pond"), path("ws/devel/lib/libpond.so"));
}

TEST_F(RigLibrary, AnInstallSpaceIsRead) {
  package("space/share/pond", "pond");
  write("space/share/other/package.xml", "<package><name>other</name></package>");
  write("space/lib/libpond.so", "");
  expect_usable(only({"space"}), path("space/share/pond/config/pond"), path("space/lib/libpond.so"));
}

TEST_F(RigLibrary, APlainFolderIsRead) {
  write("plain/config/pond/rig.yaml", "rig: pond\n");
  write("plain/lib/libpond.so", "");
  expect_usable(only({"plain"}), path("plain/config/pond"), path("plain/lib/libpond.so"));
}

TEST_F(RigLibrary, OnePackageByTwoWaysIsOne) {
  package("ws/src/pond", "pond");
  write("ws/devel/.catkin", path("ws/src"));
  write("ws/devel/lib/libpond.so", "");
  expect_usable(only({"ws/src/pond", "ws/devel", "ws/src/../src/pond"}), path("ws/src/pond/config/pond"),
                path("ws/devel/lib/libpond.so"));
}

TEST_F(RigLibrary, WhatIsMissingIsToldWithItsPlace) {
  package("pond", "pond");
  fs::create_directories(folder_ / "pond/devel/lib");
  EXPECT_EQ(only({"pond"}).trouble, path("pond") + ": its library libpond.so is not in " + path("pond/devel/lib") +
                                        "; build the package, then source its setup.bash or name its devel space in "
                                        "FAULTLINE_RIG_PATH");
  fs::remove_all(folder_ / "pond/config");
  EXPECT_NE(only({"pond"}).trouble.find(path("pond/config/pond") + ": this folder of its datasheet holds no rig.yaml"),
            std::string::npos);
  write("pond/package.xml", "<package><export><faultline rig=\"pond\"/></export></package>");
  EXPECT_NE(only({"pond"}).trouble.find("needs the attributes rig and library"), std::string::npos);
  write("pond/package.xml", "<package>\n<export></package>");
  EXPECT_NE(only({"pond"}).trouble.find("package.xml:2: this is no XML"), std::string::npos);
  write("pond/package.xml", "<package><export/></package>");
  EXPECT_NE(only({"pond"}).trouble.find("no rig is in this folder"), std::string::npos);
  EXPECT_NE(only({"nowhere"}).trouble.find(path("nowhere") + ": there is no such folder"), std::string::npos);
}

TEST_F(RigLibrary, TroubleStopsWorkOnThatRigOnly) {
  package("a", "pond");
  package("b", "pond");
  package("c", "lake");
  write("b/devel/lib/libpond.so", "");
  const std::vector<RigPlace> places = find_rig_places({path("a"), path("b"), path("c"), path("d")}, {});
  EXPECT_NE(complaint([&] {
              find_datasheet(config_folder(), places, "pond");
            }).find("rig 'pond': two rigs have this name, in " + path("a") + " and in " + path("b")),
            std::string::npos);
  EXPECT_NE(complaint([&] { find_datasheet(config_folder(), places, "lake"); }).find("liblake.so is not in"),
            std::string::npos);
  EXPECT_EQ(find_datasheet(config_folder(), places, "servo_actuator").rig, "servo_actuator");
  const std::string unknown = complaint([&] { find_datasheet(config_folder(), places, "sea"); });
  EXPECT_NE(unknown.find("there is no rig 'sea'; there are"), std::string::npos);
  EXPECT_NE(unknown.find("hydraulic_drive, lake, pond, pump_cylinder"), std::string::npos);
}

TEST_F(RigLibrary, ANameOfThisBuildIsRefused) {
  package("servo", "servo_actuator");
  write("servo/devel/lib/libservo_actuator.so", "");
  const std::vector<RigPlace> places = find_rig_places({path("servo")}, {});
  const std::string said = complaint([&] { find_datasheet(config_folder(), places, "servo_actuator"); });
  EXPECT_NE(said.find("two rigs have this name"), std::string::npos) << said;
  EXPECT_NE(said.find(path("servo")), std::string::npos) << said;
}

TEST_F(RigLibrary, WhatIsNoLibraryIsRefusedEveryTime) {
  package("pond", "pond");
  write("pond/devel/lib/libpond.so", "no library");
  const std::vector<RigPlace> places = find_rig_places({path("pond")}, {});
  for (int i = 0; i < 2; ++i) {
    const std::string said = complaint([&] { find_datasheet(config_folder(), places, "pond"); });
    EXPECT_NE(said.find("rig 'pond': " + path("pond/devel/lib/libpond.so")), std::string::npos) << said;
    EXPECT_NE(said.find("build the package " + path("pond") + " again"), std::string::npos) << said;
    EXPECT_EQ(said.find('\n'), std::string::npos);
  }
  EXPECT_NE(complaint([&] { read_datasheet(path("pond/config/pond"), places); }).find("rig 'pond': "),
            std::string::npos);
}

}  // namespace
}  // namespace faultline
