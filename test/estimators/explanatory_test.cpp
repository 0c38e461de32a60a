// Selection of explanatory variables by entropy, on signals whose entropies are known.
#include "faultline/estimators/explanatory.h"

#include <gtest/gtest.h>

#include <cmath>

#include "faultline/numerics/random.h"

namespace faultline {
namespace {

// Channels: step (8 levels), swing (sinus of another period), noise, of_step, of_both, still.
Recording signals() {
  Recording r;
  r.channels.resize(6);
  Random random(1);
  double level = 0, wander = 0;
  for (int k = 0; k < 40000; ++k) {
    if (k % 50 == 0) level = std::floor(random.uniform(0, 8));
    wander += 0.02 * (random.normal() - wander);
    const double swing = std::sin(k / 377.0);
    Sample s;
    s.time = k;
    s.values = {level, swing, wander, level + 0.01 * random.normal(), level + 4 * swing + 0.2 * random.normal(), 7};
    r.append(s);
  }
  return r;
}

TEST(Explanatory, FindsWhatEachIsMadeOf) {
  const std::vector<Explained> all = explain(signals(), {3, 4, 2, 5}, {0, 1, 2});
  ASSERT_EQ(all.size(), 4u);
  // Eight levels alike: three bits, all of them the step's.
  EXPECT_NEAR(all[0].entropy, 3, 0.1);
  EXPECT_EQ(all[0].chosen, std::vector<std::size_t>{0});
  EXPECT_LT(all[0].left, 0.2);
  EXPECT_NEAR(all[0].first[0].gain, 3, 0.1);
  // Both make the second; that the swing is periodic is no chance.
  EXPECT_EQ(all[1].chosen, (std::vector<std::size_t>{0, 1}));
  EXPECT_LT(all[1].left, all[1].entropy - 2);
  // What neither makes gains by chance only, and not enough to be chosen; nor does it explain itself.
  EXPECT_TRUE(all[2].chosen.empty());
  EXPECT_EQ(all[2].first.size(), 2u);
  EXPECT_NEAR(all[2].first[0].beyond_chance(), 0, 0.05);
  EXPECT_GT(all[2].first[0].chance, 0.001);
  EXPECT_EQ(all[3].entropy, 0);
  EXPECT_TRUE(all[3].chosen.empty());
}

TEST(Explanatory, RowsWithoutANumberAreLeftOut) {
  Recording r = signals();
  for (std::size_t k = 0; k < r.rows(); k += 3) r.values[k * 6 + 3] = std::nan("");
  const std::vector<Explained> all = explain(r, {3}, {0, 1});
  ASSERT_EQ(all.size(), 1u);
  EXPECT_NEAR(all[0].entropy, 3, 0.1);
  for (std::size_t k = 0; k < r.rows(); ++k) r.values[k * 6 + 3] = std::nan("");
  EXPECT_TRUE(explain(r, {3}, {0, 1}).empty());
}

}  // namespace
}  // namespace faultline
