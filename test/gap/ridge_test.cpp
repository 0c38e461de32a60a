// A ridge: the direction of which readings say least, and sensitivities that are wrong by a small part of what makes
// itself up.
#include "faultline/gap/ridge.h"

#include <gtest/gtest.h>

#include "faultline/numerics/random.h"

namespace faultline {
namespace {

struct Columns {
  Eigen::MatrixXd exact = Eigen::MatrixXd(200, 3), wrong;
  Eigen::VectorXd residual = Eigen::VectorXd(200), along = Eigen::Vector3d(1, 0.5, -0.25);
  // The third column is made up for by the others: exact * along = 0.
  Columns() {
    Random random(3);
    for (Eigen::Index i = 0; i < 200; ++i) {
      exact(i, 0) = 1e6 * random.normal();
      exact(i, 1) = 1e6 * random.normal();
      residual[i] = random.normal();
    }
    exact.col(2) = 4 * exact.col(0) + 2 * exact.col(1);
    wrong = exact;
    for (double& value : wrong.reshaped()) value *= 1 + 1e-4 * random.normal();
  }
  Eigen::MatrixXd products(const Eigen::MatrixXd& columns) const {
    Eigen::MatrixXd all(200, 1 + columns.cols());
    all << residual, columns;
    return all.transpose() * all;
  }
};

TEST(Ridge, IsTheDirectionOfWhichReadingsSayLeast) {
  const Columns columns;
  const Ridge ridge = weakest(columns.products(columns.wrong).bottomRightCorner(3, 3));
  const Eigen::VectorXd along = ridge.along / ridge.along[0];
  EXPECT_NEAR((along - columns.along).norm(), 0, 1e-3);
  EXPECT_NEAR(ridge.along.cwiseAbs().maxCoeff(), 1, 1e-12);
}

TEST(Ridge, IsAsFlatAsItIsMeasured) {
  const Columns columns;
  Ridge ridge;
  ridge.along = columns.along;
  const Eigen::VectorXd wrong = columns.wrong * columns.along;
  EXPECT_GT(wrong.squaredNorm(), 1e5);  // what looks like information
  for (ridge.replaced = 0; ridge.replaced < 3; ++ridge.replaced) {
    Eigen::MatrixXd with(200, 4);
    with << columns.wrong, columns.exact * columns.along;
    const Eigen::MatrixXd straight = straightened(columns.products(with), ridge);
    ASSERT_EQ(straight.rows(), 4);
    const Eigen::MatrixXd information = straight.bottomRightCorner(3, 3);
    EXPECT_LT(columns.along.dot(information * columns.along), 1);
    EXPECT_NEAR(straight(0, 0), columns.residual.squaredNorm(), 1e-9);
    // Of the others it says what it did.
    const Eigen::MatrixXd exact = columns.products(columns.exact).bottomRightCorner(3, 3);
    const Eigen::Vector3d other(0.3, -1, 2);
    EXPECT_NEAR(other.dot(information * other) / other.dot(exact * other), 1, 1e-2);
  }
}

// Where the measured response is what the columns say, nothing changes.
TEST(Ridge, ChangesNothingWhereColumnsAreRight) {
  const Columns columns;
  Ridge ridge;
  ridge.along = Eigen::Vector3d(0.2, 1, 0.7);
  ridge.replaced = 1;
  Eigen::MatrixXd with(200, 4);
  with << columns.wrong, columns.wrong * ridge.along;
  const Eigen::MatrixXd same = columns.products(columns.wrong);
  EXPECT_NEAR((straightened(columns.products(with), ridge) - same).norm() / same.norm(), 0, 1e-9);
}

}  // namespace
}  // namespace faultline
