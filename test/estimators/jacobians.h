// A process model's Jacobian against central differences.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include "faultline/estimators/process_model.h"

namespace faultline {

using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// Largest difference of A from differences of predict(), each entry in parts of its row's largest, columns scaled by
// `scale`.
inline double worst_entry(const ProcessModel& model, const std::vector<double>& x, const std::vector<double>& scale,
                          double dt) {
  const auto n = static_cast<Eigen::Index>(x.size());
  Matrix analytic(n, n), numeric(n, n);
  EXPECT_TRUE(model.jacobian(x.data(), dt, analytic.data()));
  for (Eigen::Index j = 0; j < n; ++j) {
    const double step = 1e-5 * scale[static_cast<std::size_t>(j)];
    std::vector<double> plus = x, minus = x, high(x.size()), low(x.size());
    plus[static_cast<std::size_t>(j)] += step;
    minus[static_cast<std::size_t>(j)] -= step;
    model.predict(plus.data(), dt, high.data());
    model.predict(minus.data(), dt, low.data());
    for (Eigen::Index i = 0; i < n; ++i)
      numeric(i, j) = (high[static_cast<std::size_t>(i)] - low[static_cast<std::size_t>(i)]) / (2 * step);
  }
  double worst = 0;
  for (Eigen::Index i = 0; i < n; ++i) {
    double largest = 0;
    for (Eigen::Index j = 0; j < n; ++j)
      largest = std::max(largest, std::abs(numeric(i, j)) * scale[static_cast<std::size_t>(j)]);
    for (Eigen::Index j = 0; j < n; ++j)
      worst = std::max(worst, std::abs(analytic(i, j) - numeric(i, j)) * scale[static_cast<std::size_t>(j)] / largest);
  }
  return worst;
}

}  // namespace faultline
