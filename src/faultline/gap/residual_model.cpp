#include "faultline/gap/residual_model.h"

#include "faultline/segments/state_smoother.h"

namespace faultline {

ResidualModel::ResidualModel(const Datasheet& sheet, std::vector<SegmentedRun> runs, const GapOptions& options)
    : model_(sheet, options.segments),
      runs_(std::move(runs)),
      options_(options),
      noise_(noise_of(sheet, runs_, options.segments)) {
  for (SegmentedRun& run : runs_) model_.place_starts(run, noise_, model_.nominal());
}

Eigen::MatrixXf ResidualModel::residuals(const ModelChange& model, std::size_t run) const {
  return model_.residuals(model, runs_[run], noise_);
}

Eigen::MatrixXf ResidualModel::residuals(const ModelChange& model, std::size_t run, std::size_t horizon) const {
  return model_.residuals(model, runs_[run], noise_, horizon);
}

std::vector<Eigen::MatrixXf> ResidualModel::start_sensitivity(const ModelChange& model, std::size_t run) const {
  return model_.start_columns(model, runs_[run], noise_);
}

std::vector<Eigen::MatrixXf> ResidualModel::settle_starts(const ModelChange& model, std::size_t run,
                                                          std::vector<Eigen::MatrixXf> known) {
  // Hidden states are as the model at hand has them, unless it has hardly moved.
  if (known.empty() && !hidden_states(model_, model, runs_[run]).empty())
    model_.place_starts(runs_[run], noise_, model);
  return model_.settle(model, runs_[run], noise_, std::move(known));
}

}  // namespace faultline
