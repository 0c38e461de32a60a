// Registry: sorted by name whatever the order of registration, found by name, and what it says of a name that it does
// not know.
#include "faultline/signal/registry.h"

#include <gtest/gtest.h>

namespace faultline {

struct Valve {
  static constexpr const char* kKind = "valve";
  std::string name;
  double area;
};

FAULTLINE_REGISTER(Valve, spool, {"spool", 2e-5});
FAULTLINE_REGISTER(Valve, ball, {"ball", 3e-4});

struct Pump {
  static constexpr const char* kKind = "pump";
  std::string name;
};

struct Filter {
  static constexpr const char* kKind = "filter";
  std::string name;
};

namespace {

TEST(Registry, IsSortedByName) {
  ASSERT_EQ(registry<Valve>().all().size(), 2u);
  EXPECT_EQ(registry<Valve>().all().begin()->name, "ball");
  EXPECT_EQ(registry<Valve>().all().rbegin()->area, 2e-5);
}

TEST(Registry, FindsByName) {
  ASSERT_NE(registry<Valve>().find("spool"), nullptr);
  EXPECT_EQ(registry<Valve>().find("spool")->area, 2e-5);
  EXPECT_EQ(registry<Valve>().find("spoo"), nullptr);
  EXPECT_EQ(registry<Valve>().find(""), nullptr);
  EXPECT_EQ(&registry<Valve>().require("ball", "x.yaml:3"), registry<Valve>().find("ball"));
}

std::string complaint(const std::string& name) {
  try {
    registry<Valve>().require(name, "x.yaml:3: 'valves[0]'");
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(Registry, SaysWhereAndWhatThereIs) {
  EXPECT_EQ(complaint("gate"), "x.yaml:3: 'valves[0]': there is no valve 'gate'; there are ball, spool");
  try {
    registry<Pump>().require("gear", "here");
    FAIL();
  } catch (const InputError& error) {
    EXPECT_STREQ(error.what(), "here: there is no pump 'gear'; there are none");
  }
}

TEST(Registry, RefusesASecondOfOneName) {
  EXPECT_THROW(registry<Valve>().add({"ball", 1}), std::logic_error);
  EXPECT_EQ(registry<Valve>().all().size(), 2u);
}

TEST(Registry, TellsASecondOfOneNameWhileALibraryIsLoaded) {
  std::vector<std::string> told;
  taken_names() = &told;
  EXPECT_FALSE(registry<Valve>().add({"ball", 1}));
  taken_names() = nullptr;
  EXPECT_EQ(told, std::vector<std::string>{"two of the kind 'valve' are called 'ball'"});
  EXPECT_EQ(registry<Valve>().find("ball")->area, 3e-4);
}

TEST(Registry, ReferencesStayGoodWhenMoreComes) {
  registry<Filter>().add({"mesh"});
  const Filter* mesh = registry<Filter>().find("mesh");
  for (char c = 'a'; c <= 'z'; ++c) registry<Filter>().add({std::string(1, c)});
  EXPECT_EQ(registry<Filter>().find("mesh"), mesh);
}

}  // namespace
}  // namespace faultline
