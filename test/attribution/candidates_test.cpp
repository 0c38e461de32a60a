// Shapes that a datasheet does not list: as usual where a live detector looks, open where a search has time.
#include "faultline/attribution/candidates.h"

#include <gtest/gtest.h>

#include <set>

#include "config_folder.h"

namespace faultline {
namespace {

const Candidate& find(const std::vector<Candidate>& all, const std::string& effect) {
  for (const Candidate& candidate : all)
    if (candidate.effect.effect == effect) return candidate;
  throw std::runtime_error(effect);
}

TEST(Candidates, ShapesThatAreUsualMayBeAnything) {
  const Datasheet sheet = find_datasheet(config_folder(), "pump_cylinder");
  const std::vector<Candidate> all = candidates(sheet, {}), open = with_open_shapes(all);
  const Bounds usual = find(all, "entrained_air").bounds[1], any = find(open, "entrained_air").bounds[1];
  EXPECT_EQ(usual.minimum, 1);
  EXPECT_EQ(usual.maximum, 1);
  EXPECT_EQ(any.minimum, 1);
  EXPECT_EQ(any.maximum, 1.4);
  // What the datasheet lists stays as it is.
  EXPECT_EQ(find(open, "displacement_ripple").bounds[1].minimum, 5);
  EXPECT_EQ(find(open, "displacement_ripple").bounds[1].maximum, 13);
  for (const std::vector<double>& point : starting_points(find(all, "lag"))) EXPECT_EQ(point[1], 0);
  for (const std::vector<double>& point : starting_points(find(open, "lag"))) EXPECT_EQ(point[1], 0.25);
  // A screening takes each third first, and must see every quarter of the phase.
  const std::vector<std::vector<double>> points = starting_points(find(open, "displacement_ripple"));
  std::set<double> first;
  for (std::size_t i = 1; i < points.size(); i += 3) first.insert(points[i][2]);
  EXPECT_EQ(first.size(), 4u);
}

}  // namespace
}  // namespace faultline
