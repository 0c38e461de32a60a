#include "faultline/gap/gap_series.h"

namespace faultline {
namespace {

constexpr std::size_t kMostRows = 4000;  // as docs/gap.schema.json promises
constexpr int kSettlings = 2;            // Gauss-Newton steps of the start states

}  // namespace

Eigen::MatrixXf settled_residuals(const ResidualModel& model, const ModelChange& at, std::size_t run, int jobs) {
  ResidualModel own = model.only(run);
  const std::vector<Eigen::MatrixXf> columns = own.settle_starts(at, 0, {}, jobs);
  for (int i = 1; i < kSettlings; ++i) own.settle_starts(at, 0, columns, jobs);
  return own.residuals(at, 0);
}

GapSeries gap_series(const ResidualModel& model, std::size_t run, const std::array<const Eigen::MatrixXf*, 3>& levels,
                     std::size_t given) {
  const bool cut = given < model.runs().size();
  const Recording& recording = model.runs()[run].recording;
  const double start = model.runs()[cut ? 0 : run].recording.time.front();
  GapSeries series;
  series.run = cut ? 0 : run;
  for (const int channel : model.outputs())
    series.channels.push_back(model.sheet().channels[static_cast<std::size_t>(channel)].name);
  const std::size_t every = (recording.rows() + kMostRows - 1) / kMostRows;
  for (std::size_t k = 0; k < recording.rows(); k += every) {
    series.time.push_back(recording.time[k] - start);
    for (std::size_t o = 0; o < model.outputs().size(); ++o) {
      const double measured = model.runs()[run].reading(k, static_cast<std::size_t>(model.outputs()[o]));
      series.values.push_back(measured);
      for (const Eigen::MatrixXf* level : levels)
        series.values.push_back(
            measured - model.noise()[o] *
                           static_cast<double>((*level)(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(o))));
    }
  }
  return series;
}

}  // namespace faultline
