// Sums of products against Eigen's, in shapes that fill the kernel's tiles and that do not.
#include "faultline/numerics/sum_of_products.h"

#include <gtest/gtest.h>

namespace faultline {
namespace {

TEST(SumOfProducts, AsWrittenOut) {
  std::srand(1);
  for (const auto& [rows, columns] : {std::pair{1, 1}, {4, 12}, {5, 13}, {8, 24}, {30, 7}, {3, 100}}) {
    SumOfProducts sum(rows, columns);
    Eigen::MatrixXd expected = Eigen::MatrixXd::Zero(rows, columns);
    for (const int samples : {1, 7, 256}) {
      const Eigen::MatrixXd x = Eigen::MatrixXd::Random(samples, rows), y = Eigen::MatrixXd::Random(samples, columns);
      for (int i = 0; i < rows; ++i)
        for (int j = 0; j < columns; ++j)
          for (int k = 0; k < samples; ++k) expected(i, j) += x(k, i) * y(k, j);
      sum.add(x, y);
      EXPECT_LT((sum.sum() - expected).cwiseAbs().maxCoeff(), 1e-12) << rows << " x " << columns << ", " << samples;
    }
  }
}

TEST(SumOfProducts, OfAPartOfAMatrix) {
  const Eigen::MatrixXd all = Eigen::MatrixXd::Random(20, 9);
  SumOfProducts sum(5, 3);
  sum.add(all.block(2, 1, 15, 5), all.block(3, 6, 15, 3));
  const Eigen::MatrixXd expected = all.block(2, 1, 15, 5).transpose() * all.block(3, 6, 15, 3);
  EXPECT_LT((sum.sum() - expected).cwiseAbs().maxCoeff(), 1e-12);
}

}  // namespace
}  // namespace faultline
