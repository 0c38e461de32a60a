#include "faultline/gap/gap_series.h"

#include <Eigen/Cholesky>

namespace faultline {
namespace {

constexpr std::size_t kMostRows = 4000;  // as docs/gap.schema.json promises

}  // namespace

Eigen::MatrixXf settled_residuals(const ResidualModel& model, const GapModel& at, std::size_t run) {
  Eigen::MatrixXf residuals = model.residuals(at, run);
  const std::vector<Eigen::MatrixXf> starts = model.start_sensitivity(at, run);
  const Eigen::MatrixXd shift = model.start_shift(run);
  const auto n = static_cast<Eigen::Index>(starts.size()), length = static_cast<Eigen::Index>(model.segment());
  for (std::size_t g = 0; g < model.runs()[run].segments(); ++g) {
    auto part = residuals.middleRows(static_cast<Eigen::Index>(g) * length, length);
    const auto column = [&](Eigen::Index i) {
      return starts[static_cast<std::size_t>(i)].middleRows(static_cast<Eigen::Index>(g) * length, length);
    };
    Eigen::MatrixXd information = Eigen::MatrixXd::Identity(n, n);
    Eigen::VectorXd against(n);
    for (Eigen::Index i = 0; i < n; ++i) {
      against[i] = shift(static_cast<Eigen::Index>(g), i) + static_cast<double>(column(i).cwiseProduct(part).sum());
      for (Eigen::Index j = 0; j < n; ++j)
        information(i, j) += static_cast<double>(column(i).cwiseProduct(column(j)).sum());
    }
    const Eigen::VectorXd move = information.ldlt().solve(against);
    for (Eigen::Index i = 0; i < n; ++i) part -= static_cast<float>(move[i]) * column(i);
  }
  return residuals;
}

GapSeries gap_series(const ResidualModel& model, std::size_t run, const GapModel& nominal, const GapModel& refitted,
                     const GapModel& explained, std::size_t given) {
  const bool cut = given < model.runs().size();
  const Recording& recording = model.runs()[run].recording;
  const double start = model.runs()[cut ? 0 : run].recording.time.front();
  GapSeries series;
  series.run = cut ? 0 : run;
  for (const int channel : model.outputs())
    series.channels.push_back(model.sheet().channels[static_cast<std::size_t>(channel)].name);
  const Eigen::MatrixXf levels[] = {settled_residuals(model, nominal, run), settled_residuals(model, refitted, run),
                                    settled_residuals(model, explained, run)};
  const std::size_t every = (recording.rows() + kMostRows - 1) / kMostRows;
  for (std::size_t k = 0; k < recording.rows(); k += every) {
    series.time.push_back(recording.time[k] - start);
    for (std::size_t o = 0; o < model.outputs().size(); ++o) {
      const double measured = recording.at(k, static_cast<std::size_t>(model.outputs()[o]));
      series.values.push_back(measured);
      for (const Eigen::MatrixXf& level : levels)
        series.values.push_back(measured - model.noise()[o] * static_cast<double>(level(static_cast<Eigen::Index>(k),
                                                                                        static_cast<Eigen::Index>(o))));
    }
  }
  return series;
}

}  // namespace faultline
