// References as files: what is kept comes back to the last bit; what is damaged, cut off, of another form or of another
// rig is refused with one line, and what was there stays.
#include "faultline/rig/reference.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>

#include <filesystem>
#include <fstream>
#include <iterator>

#include "faultline/signal/error.h"

namespace faultline {
namespace {

namespace fs = std::filesystem;

class ReferenceFile : public ::testing::Test {
 protected:
  void SetUp() override { fs::create_directory(folder_); }
  void TearDown() override { fs::remove_all(folder_); }

  static References some() {
    References references;
    references.rig = "mill";
    references.stages = {{"drift", {"cusum", 1, {"torque"}, {0.1}}},
                         {"balance", {"signatures", 3, {"a", "b", "c"}, {-1.0 / 3, 2.2250738585072014e-308, 1.8e6}}},
                         {"empty", {"histogram", 1, {}, {}}}};
    return references;
  }
  std::string content() const {
    std::ifstream stream(file_, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), {}};
  }
  void put(const std::string& text) const { std::ofstream(file_, std::ios::binary) << text; }

  static std::string refusal(const std::string& text, const std::string& rig = "mill") {
    try {
      parse_references(text, rig, "F");
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }

  const fs::path folder_ = fs::temp_directory_path() / ("faultline_reference_" + std::to_string(::getpid()));
  const std::string file_ = (folder_ / "mill.reference").string();
};

TEST_F(ReferenceFile, ComesBackToTheLastBit) {
  write_references(some(), file_);
  const References back = read_references(file_, "mill");
  EXPECT_EQ(back.rig, "mill");
  EXPECT_EQ(back.file, file_);
  ASSERT_EQ(back.stages.size(), 3u);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(back.stages[i].stage, some().stages[i].stage);
    EXPECT_EQ(back.stages[i].reference.type, some().stages[i].reference.type);
    EXPECT_EQ(back.stages[i].reference.version, some().stages[i].reference.version);
    EXPECT_EQ(back.stages[i].reference.names, some().stages[i].reference.names);
    EXPECT_EQ(back.stages[i].reference.numbers, some().stages[i].reference.numbers);
  }
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()), 1);  // nothing else is left there
}

TEST_F(ReferenceFile, EveryChangedOrMissingByteIsNoticed) {
  const std::string text = to_text(some());
  EXPECT_EQ(refusal(text), "");
  for (std::size_t i = 0; i < text.size(); ++i) {
    std::string changed = text;
    changed[i] = static_cast<char>(changed[i] ^ 1);
    EXPECT_NE(refusal(changed), "") << i;
    EXPECT_NE(refusal(text.substr(0, i)), "") << i;
  }
  EXPECT_NE(refusal(text + "more\n").find("damaged"), std::string::npos);
}

TEST_F(ReferenceFile, ForeignOnesAreNamed) {
  EXPECT_EQ(refusal("hello"), "F: this is no file of references, as diagnose --keep-reference writes it");
  EXPECT_EQ(refusal(to_text(some()), "lathe"),
            "F:2: these are references of the rig mill, not of lathe; learn the references anew");
  EXPECT_NE(refusal("faultline references 2\nrig mill\n").find("another form"), std::string::npos);
}

TEST_F(ReferenceFile, WhatIsNoReferenceOfThisRigIsNotReplaced) {
  put("my own notes\n");
  EXPECT_THROW(write_references(some(), file_), InputError);
  EXPECT_EQ(content(), "my own notes\n");
  References foreign = some();
  foreign.rig = "lathe";
  put(to_text(foreign));
  EXPECT_THROW(write_references(some(), file_), InputError);
  EXPECT_EQ(content(), to_text(foreign));
  std::string damaged = to_text(some());
  damaged.pop_back();
  put(damaged);
  EXPECT_THROW(write_references(some(), file_), InputError);
  EXPECT_EQ(content(), damaged);
  put(to_text(some()));
  References later = some();
  later.stages[0].reference.numbers[0] = 7;
  write_references(later, file_);
  EXPECT_EQ(content(), to_text(later));
}

// Killed at any moment of saving, the file holds what was there or what was to be, whole.
TEST_F(ReferenceFile, AKillWhileSavingLeavesAWholeFile) {
  References first = some(), second = some();
  for (References* r : {&first, &second}) {
    r->stages.push_back({"bins", {"histogram", 1, {}, {}}});
    Reference& large = r->stages.back().reference;
    large.names.assign(20000, "count");
    large.numbers.assign(20000, r == &first ? 1 : 2);
  }
  write_references(first, file_);
  for (int n = 0; n < 8; ++n) {
    int told[2];
    ASSERT_EQ(::pipe(told), 0);
    const pid_t child = ::fork();
    ASSERT_GE(child, 0);
    if (child == 0)
      for (int k = 0;; ++k) {
        write_references(k % 2 == 0 ? second : first, file_);
        if (k == 0 && ::write(told[1], "s", 1) != 1) ::_exit(1);
      }
    char saved = 0;
    ASSERT_EQ(::read(told[0], &saved, 1), 1);  // it is at it
    ::usleep(static_cast<useconds_t>(3701 * n));
    ASSERT_EQ(::kill(child, SIGKILL), 0);
    ASSERT_EQ(::waitpid(child, nullptr, 0), child);
    const References kept = read_references(file_, "mill");
    ASSERT_EQ(kept.stages.size(), 4u);
    const std::vector<double>& numbers = kept.stages[3].reference.numbers;
    ASSERT_EQ(numbers.size(), 20000u);
    EXPECT_EQ(numbers.front(), numbers.back());
    ::close(told[0]);
    ::close(told[1]);
  }
}

TEST_F(ReferenceFile, APlaceThatCannotBeWrittenIsNamed) {
  try {
    write_references(some(), (folder_ / "no" / "such" / "folder").string());
    FAIL();
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("No such file"), std::string::npos) << error.what();
  }
  EXPECT_THROW(read_references(folder_.string(), "mill"), InputError);
  EXPECT_THROW(read_references("/dev/zero", "mill"), InputError);  // endless
}

TEST_F(ReferenceFile, ALinkStaysALink) {
  put(to_text(some()));
  const fs::path link = folder_ / "link";
  fs::create_symlink(file_, link);
  References later = some();
  later.stages.pop_back();
  write_references(later, link.string());
  EXPECT_TRUE(fs::is_symlink(link));
  EXPECT_EQ(content(), to_text(later));
}

TEST(Reference, AnotherTypeVersionOrContentIsRefused) {
  const Reference given{"cusum", 1, {"torque"}, {0.1}};
  EXPECT_NO_THROW(check_reference(given, "cusum", 1, {"torque"}));
  EXPECT_THROW(check_reference(given, "redline", 1, {"torque"}), InputError);
  EXPECT_THROW(check_reference(given, "cusum", 2, {"torque"}), InputError);
  EXPECT_THROW(check_reference(given, "cusum", 1, {"speed"}), InputError);
  EXPECT_THROW(check_reference(given, "cusum", 1, {"torque", "speed"}), InputError);
}

}  // namespace
}  // namespace faultline
