#include "nodes/parameters.h"

#include <string>

#include <gtest/gtest.h>

#include "faultline/signal/error.h"

namespace faultline {
namespace {

XmlRpc::XmlRpcValue some() {
  XmlRpc::XmlRpcValue values;
  values["rate"] = 2;
  values["gain"] = 0.5;
  values["name"] = std::string("square");
  values["list"] = std::string("a@b:c=1 ;  d@e:f=2;");
  values["on"] = true;
  return values;
}

template <class Call>
std::string said(Call call) {
  try {
    call();
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(Parameters, ReadsWhatIsThereAndFallsBackWhereItIsNot) {
  Parameters p("/node", some());
  EXPECT_EQ(p.number("rate", 1, 0, 10), 2);
  EXPECT_EQ(p.number("gain", 1, 0, 10), 0.5);
  EXPECT_EQ(p.number("absent", 7, 0, 10), 7);
  EXPECT_EQ(p.integer("rate", 1, 0, 10), 2);
  EXPECT_EQ(p.word("name"), "square");
  EXPECT_EQ(p.word("other", "x"), "x");
  EXPECT_EQ(p.words("list"), (std::vector<std::string>{"a@b:c=1", "d@e:f=2"}));
  EXPECT_TRUE(p.words("none").empty());
  EXPECT_TRUE(p.flag("on", false));
  EXPECT_NO_THROW(p.check_used());
}

TEST(Parameters, ListsMayBeLists) {
  XmlRpc::XmlRpcValue values;
  values["effects"][0] = std::string("one");
  values["effects"][1] = std::string("two");
  Parameters p("/node", values);
  EXPECT_EQ(p.words("effects"), (std::vector<std::string>{"one", "two"}));
  values["effects"][2] = 4;
  Parameters q("/node", values);
  EXPECT_EQ(said([&] { q.words("effects"); }),
            "/node: parameter ~effects holds 4 at place 3; a list of texts is allowed");
}

TEST(Parameters, SaysWhatIsWrong) {
  Parameters p("/node", some());
  EXPECT_EQ(said([&] { p.word("rig"); }), "/node: parameter ~rig is missing; it must be given");
  EXPECT_EQ(said([&] { p.number("rate", 1, 3, 4); }), "/node: parameter ~rate is 2; 3 to 4 is allowed");
  EXPECT_EQ(said([&] { p.number("name", 1, 3, 4); }),
            "/node: parameter ~name is 'square'; a number from 3 to 4 is allowed");
  EXPECT_EQ(said([&] { p.integer("gain", 1, 0, 4); }),
            "/node: parameter ~gain is 0.5; a whole number from 0 to 4 is allowed");
  EXPECT_EQ(said([&] { p.choice("name", "a", {"a", "b"}); }), "/node: parameter ~name is 'square'; allowed: a, b");
  EXPECT_EQ(said([&] { p.flag("rate", false); }), "/node: parameter ~rate is 2; true or false is allowed");
}

TEST(Parameters, RefusesUnknownKeys) {
  XmlRpc::XmlRpcValue values;
  values["rig"] = std::string("x");
  values["rgi"] = std::string("y");
  Parameters p("/node", values);
  p.word("rig");
  EXPECT_EQ(said([&] { p.check_used(); }), "/node: parameter ~rgi is unknown; allowed: diagnostic_period, rig");
}

TEST(Parameters, NoneAtAllIsFine) {
  Parameters p("/node", XmlRpc::XmlRpcValue());
  EXPECT_FALSE(p.has("rig"));
  EXPECT_NO_THROW(p.check_used());
}

}  // namespace
}  // namespace faultline
