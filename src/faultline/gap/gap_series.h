// The course of one run as recorded and as the three levels of the model have it, for plots.
//
//   y_model = y - sigma r          r: residual of ResidualModel, the states put back every segment
//
// Residuals are settled (segments/segment_model.h). At most 4000 rows: every n-th row as it is.
// Where a model is off by more than 1e4 noise levels, its course is cut there.
#pragma once

#include <array>

#include "faultline/gap/gap_result.h"
#include "faultline/gap/residual_model.h"

namespace faultline {

Eigen::MatrixXf settled_residuals(const ResidualModel& model, const ModelChange& at, std::size_t run, int jobs = 1);

// `run`: of the model's. `levels`: its settled_residuals() of the nominal, the refitted and the explained model.
// `given`: how many runs were asked for; fewer than the model has where a single one was cut in two, and then the time
// goes on over the cut.
GapSeries gap_series(const ResidualModel& model, std::size_t run, const std::array<const Eigen::MatrixXf*, 3>& levels,
                     std::size_t given);

}  // namespace faultline
