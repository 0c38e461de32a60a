// What the minimum of a fit knows of each parameter, in the solver's coordinates (tolerances; segment_solver.h).
//
// With H the Hessian of the residuals alone, c the number of residuals that say the same, G the sum over B blocks of
// (gradient gradient') and n parameters:
//   variance     H^-1 C H^-1 (Huber, White), C = G B/(B - n): blocks tell how far gradients scatter where the residuals
//                are neither white nor normal. At the minimum n of their sums are 0, so that few blocks tell nothing:
//                from 2 n down to n of them C = c H takes over, from the residuals' correlation
//   rank         eigenvectors v of H that the data know to less than one tolerance, v'Hv < k = max(1, v'Cv/v'Hv): a
//                product or a ratio of parameters that changes nothing. Their variance is at least k/v'Hv: no gradient
//                scatters along them
//   systematic   how far the estimate moves when a parameter that is not estimated is off by its tolerance, and when
//                an effect of the datasheet's `nuisance` is there
//   profile      an end of an interval is moved out to where the cost, minimised over all others, rises as much as the
//                Hessian said it would: a valley that bends, or ends at a bound, is wider than its curvature
#pragma once

#include <string>

#include "faultline/fit/segment_solver.h"

namespace faultline {

struct FitErrors {
  Eigen::MatrixXd variance;     // from the data alone
  Eigen::VectorXd systematic;   // variance
  Eigen::VectorXd conditional;  // standard error with all others known
  Eigen::VectorXd posterior;    // standard error of the estimate, tolerances included, without the systematic part
  Eigen::MatrixXd curvature;    // inverse of the Hessian of the whole cost
  Eigen::MatrixXd unseen;       // columns: directions that the data do not know to one tolerance
  double freedom = 1;           // degrees, for Student's t
};

FitErrors fit_errors(const SegmentSolver& solver, const Datasheet& sheet, const std::vector<double>& values,
                     const std::vector<std::size_t>& free);

// How many times wider the interval of free[at] is on each side than `half_width` (coordinates), at most so that it
// reaches `farthest` from the estimate.
struct Widening {
  double below = 1, above = 1;
};
Widening profile(const SegmentSolver& solver, const FitErrors& errors, const std::vector<double>& values,
                 const std::vector<std::size_t>& free, std::size_t at, double half_width, double farthest,
                 const FitOptions& options);

// Why free[at] is not determined.
std::string reason_undetermined(const Datasheet& sheet, const std::vector<double>& scales, const FitErrors& errors,
                                const std::vector<std::size_t>& free, std::size_t at, const FitOptions& options);

}  // namespace faultline
