#include "faultline/gap/gap_series.h"

namespace faultline {
namespace {

constexpr std::size_t kRows = 4000;

}  // namespace

GapSeries gap_series(const ResidualModel& model, std::size_t run, const GapModel& nominal, const GapModel& refitted,
                     const GapModel& explained, std::size_t given) {
  const bool cut = given < model.runs().size();
  const Recording& recording = model.runs()[run].recording;
  const double start = model.runs()[cut ? 0 : run].recording.time.front();
  GapSeries series;
  series.run = cut ? 0 : run;
  for (const int channel : model.outputs()) series.channels.push_back(model.sheet().channels[static_cast<std::size_t>(channel)].name);
  const Eigen::MatrixXf levels[] = {model.residuals(nominal, run), model.residuals(refitted, run), model.residuals(explained, run)};
  const std::size_t every = (recording.rows() + kRows - 1) / kRows;
  for (std::size_t k = 0; k < recording.rows(); k += every) {
    series.time.push_back(recording.time[k] - start);
    for (std::size_t o = 0; o < model.outputs().size(); ++o) {
      const double measured = recording.at(k, static_cast<std::size_t>(model.outputs()[o]));
      series.values.push_back(measured);
      for (const Eigen::MatrixXf& level : levels)
        series.values.push_back(measured - model.noise()[o] * static_cast<double>(level(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(o))));
    }
  }
  return series;
}

}  // namespace faultline
