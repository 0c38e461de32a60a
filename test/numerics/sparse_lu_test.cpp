// Sparse factors against dense ones.
#include "faultline/numerics/sparse_lu.h"

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include "faultline/numerics/random.h"

namespace faultline {
namespace {

// Non-zeros of a bordered matrix (one hub, blocks around it) or of a random one, with values below the diagonal's.
std::vector<std::pair<int, int>> bordered(int blocks) {
  std::vector<std::pair<int, int>> entries = {{0, 0}};
  for (int b = 0; b < blocks; ++b) {
    const int i = 1 + 2 * b, j = i + 1;
    for (const auto& entry : {std::pair{0, i}, {i, 0}, {i, i}, {i, j}, {j, i}, {j, j}}) entries.push_back(entry);
  }
  return entries;
}

void expect_solves(int size, const std::vector<std::pair<int, int>>& entries, std::uint64_t seed) {
  Random random(seed);
  SparseLu lu(size, entries);
  for (int again = 0; again < 3; ++again) {
    std::vector<double> values;
    Eigen::MatrixXd dense = 4.0 * Eigen::MatrixXd::Identity(size, size);
    for (const auto& [row, column] : entries) {
      values.push_back(random.normal() / size);
      dense(row, column) -= values.back();
    }
    Eigen::VectorXd right(size);
    for (int i = 0; i < size; ++i) right[i] = random.normal();
    const Eigen::VectorXd expected = dense.partialPivLu().solve(right);
    lu.factor(4, values.data());
    lu.solve(right.data());
    EXPECT_LT((right - expected).cwiseAbs().maxCoeff(), 1e-12) << size << " states, seed " << seed;
  }
}

TEST(SparseLu, SolvesBorderedMatrices) {
  for (const int blocks : {0, 1, 5, 15}) expect_solves(1 + 2 * blocks, bordered(blocks), 7);
}

TEST(SparseLu, SolvesRandomMatrices) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    Random random(seed);
    const int size = 2 + static_cast<int>(random.uniform(0, 30));
    std::vector<std::pair<int, int>> entries;
    for (int k = 0; k < 3 * size; ++k)
      entries.emplace_back(static_cast<int>(random.uniform(0, size)), static_cast<int>(random.uniform(0, size)));
    expect_solves(size, entries, seed);  // some places stand twice: they add up
  }
}

TEST(SparseLu, WithoutEntriesItDivides) {
  SparseLu lu(3, {});
  double x[3] = {2, -4, 8};
  lu.factor(4, nullptr);
  lu.solve(x);
  EXPECT_EQ(x[0], 0.5);
  EXPECT_EQ(x[1], -1);
  EXPECT_EQ(x[2], 2);
}

TEST(SparseLu, PlacesOutsideAreRefused) { EXPECT_THROW(SparseLu(2, {{0, 2}}), std::logic_error); }

}  // namespace
}  // namespace faultline
