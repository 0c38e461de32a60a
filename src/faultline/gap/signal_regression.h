// Sparse regression of a missing signal: which few of many known courses explain the readings, fitted on one part of
// the runs and scored on the other.
//
//   gain on a part of the runs = t'b - 1/2 t'A t   log likelihood; t: least squares on the other part
#pragma once

#include <vector>

#include <Eigen/Core>

#include "faultline/gap/free_signal_filter.h"

namespace faultline {

struct Fold;

class SignalRegression {
 public:
  using Columns = std::vector<Eigen::Index>;

  SignalRegression(std::vector<SignalEquations> parts, const std::vector<Fold>& folds);

  struct Fit {
    Eigen::VectorXd size, standard_error;
  };
  // Over all runs, and over what a fold learns from. `penalty`: of the same size as the columns, or empty.
  Fit fit(const Columns& columns, const Eigen::MatrixXd& penalty = {}) const;
  Fit fit(const Columns& columns, std::size_t fold, const Eigen::MatrixXd& penalty = {}) const;

  struct Gain {
    double sum = 0;
    std::vector<double> parts;
  };
  Gain held_out(const Columns& columns, const Eigen::MatrixXd& penalty = {}) const;

  // Forward selection among `candidates`, the simplest first, each of one column or of several that only together say
  // something: the best next one, or a simpler one that is as good, as long as it adds more than its standard error.
  // At most `most` columns; those are left out again that add little beside what came after them.
  Columns select(const std::vector<Columns>& candidates, std::size_t most) const;

 private:
  struct Sums {
    Eigen::MatrixXd a;
    Eigen::VectorXd b;
  };
  Fit solve(const Sums& sums, const Columns& columns, const Eigen::MatrixXd& penalty) const;

  std::vector<SignalEquations> parts_;
  std::vector<std::vector<std::size_t>> tests_;  // per fold: parts that judge
  std::vector<Sums> train_;                      // per fold
  Sums all_;
};

}  // namespace faultline
