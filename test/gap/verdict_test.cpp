// The verdict in words: it does not contradict what is left.
#include "faultline/gap/measure.h"

#include <gtest/gtest.h>

namespace faultline {
namespace {

std::string said(const std::string& verdict, const std::string& left) {
  Datasheet sheet;
  Parameter parameter;
  parameter.name = "area";
  parameter.tolerance = 0.01;
  sheet.parameters.push_back(parameter);
  GapResult result;
  result.verdict = verdict;
  result.gap.resize(2);
  result.gap[1].parameters["area"] = 1.05;
  describe(sheet, result, left);
  return result.sentence;
}

TEST(Verdict, NothingIsSaidToFitWhereMuchIsLeft) {
  EXPECT_EQ(said("none", ""), "No gap beyond the noise and the tolerances of the datasheet.");
  EXPECT_EQ(said("none", "flow 440 times its noise"),
            "No place and no effect tells what is left: flow 440 times its noise.");
  EXPECT_EQ(said("miscalibrated", ""), "The structure fits; the parameters are off: area x 1.050.");
  EXPECT_EQ(
      said("miscalibrated", "flow 440 times its noise"),
      "The parameters are off: area x 1.050. No place and no effect tells what is left: flow 440 times its noise.");
}

}  // namespace
}  // namespace faultline
