// Sparse factors against dense ones.
#include "faultline/numerics/sparse_lu.h"

#include <cmath>

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include "faultline/numerics/random.h"
#include "faultline/numerics/small_lu.h"

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

std::vector<std::pair<int, int>> full(int size) {
  std::vector<std::pair<int, int>> entries;
  for (int column = 0; column < size; ++column)
    for (int row = 0; row < size; ++row) entries.emplace_back(row, column);
  return entries;
}

TEST(SparseLu, SolvesFullMatricesOfAFewStates) {
  for (int size = 1; size <= 9; ++size) expect_solves(size, full(size), 11);
}

// The diagonal is 0, so that every column needs another row.
TEST(SparseLu, FullMatricesChooseTheirPivots) {
  constexpr int kSize = 5;
  Random random(5);
  Eigen::MatrixXd dense(kSize, kSize);
  std::vector<double> values;
  for (int column = 0; column < kSize; ++column)
    for (int row = 0; row < kSize; ++row) {
      dense(row, column) = row == column ? 0 : random.normal();
      values.push_back((row == column ? 2 : 0) - dense(row, column));
    }
  Eigen::VectorXd right = Eigen::VectorXd::LinSpaced(kSize, 1, 2);
  const Eigen::VectorXd expected = dense.partialPivLu().solve(right);
  SparseLu lu(kSize, full(kSize));
  lu.factor(2, values.data());
  lu.solve(right.data());
  EXPECT_LT((right - expected).cwiseAbs().maxCoeff(), 1e-12);
}

TEST(SmallLu, InvertsAsItSolves) {
  Random random(7);
  for (int k = 0; k < 20; ++k) {
    constexpr std::size_t kSize = 5;
    Eigen::Matrix<double, kSize, kSize> dense;
    for (double& value : dense.reshaped()) value = random.normal();
    if (k % 2 == 0) dense.diagonal().setZero();  // every column needs another row
    Eigen::Matrix<double, kSize, kSize, Eigen::RowMajor> inverse;
    Eigen::Matrix<double, kSize, kSize> factors = dense;
    std::array<int, kSize> order;
    factor_in_place<kSize>(factors.data(), order.data());
    invert<kSize>(factors.data(), order.data(), inverse.data());
    EXPECT_LT((inverse * dense - Eigen::Matrix<double, kSize, kSize>::Identity()).cwiseAbs().maxCoeff(),
              1e-12 * (1 + inverse.cwiseAbs().maxCoeff()));
  }
}

TEST(SparseLu, SingularFullMatricesSolveToNoNumber) {
  const std::vector<double> ones(9, 1.0);
  SparseLu lu(3, full(3));
  lu.factor(0, ones.data());
  double x[3] = {1, 2, 3};
  lu.solve(x);
  for (const double value : x) EXPECT_TRUE(std::isnan(value));
  lu.factor(5, ones.data());  // a regular one after it
  double y[3] = {1, 1, 1};
  lu.solve(y);
  EXPECT_NEAR(y[0], 0.5, 1e-14);
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
