#include "faultline/estimators/plausibility.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "faultline/signal/error.h"

namespace faultline {
namespace {

constexpr double kGain = 2.3, kLead = 1.2;  // logarithms: mean squares of one output by a factor of 10, of 3
constexpr double kFarthest = 3;             // times the datasheet's value, or a third of it
constexpr int kFactors = 4, kHalvings = 4;  // factors tried on either side; how often what lies between is halved

// L per segment; the first only fills memories.
double misfit(const StretchModel& model, const Stretch& stretch, const ModelPoint& point) {
  const Eigen::MatrixXf residuals = model.residuals(stretch, point);
  const auto rows = static_cast<Eigen::Index>(model.segment_rows());
  double sum = 0;
  const std::vector<std::size_t>& restarts = stretch.run.restarts;
  for (std::size_t s = 1; s < restarts.size(); ++s) {
    const auto first = static_cast<Eigen::Index>(restarts[s]);
    const Eigen::Index count = std::min(rows, residuals.rows() - first);
    for (Eigen::Index o = 0; o < residuals.cols(); ++o)
      sum += std::log1p(static_cast<double>(residuals.col(o).segment(first, count).squaredNorm()) /
                        static_cast<double>(count));
  }
  return sum / static_cast<double>(restarts.size() - 1);
}

bool in_range(const Recording& recording, std::size_t c) {
  for (std::size_t row = 0; row < recording.rows(); ++row) {
    const double value = recording.at(row, c);
    if (value < recording.channels[c].minimum || value > recording.channels[c].maximum) return false;
  }
  return true;
}

// The factor on a parameter that fits best, and L with it.
std::pair<double, double> best_factor(const StretchModel& model, const Stretch& stretch, std::size_t parameter) {
  const auto tried = [&](double logarithm) {
    ModelPoint point = model.nominal();
    point.parameters[parameter] *= std::exp(logarithm);
    try {
      return misfit(model, stretch, point);
    } catch (const InputError&) {  // no such rig
      return kInfinity;
    }
  };
  double step = std::log(kFarthest) / kFactors, at = 0, least = kInfinity;
  const auto consider = [&](double logarithm) {
    const double found = tried(logarithm);
    if (!(found < least)) return;
    least = found;
    at = logarithm;
  };
  for (int i = -kFactors; i <= kFactors; ++i)
    if (i != 0) consider(i * step);
  for (int i = 0; i < kHalvings; ++i) {
    step /= 2;
    const double middle = at;
    consider(middle - step);
    consider(middle + step);
  }
  return {std::exp(at), least};
}

}  // namespace

std::string better_reading(const Datasheet& sheet, const StretchModel& model, const Stretch& stretch,
                           const ModelPoint& fault, bool always) {
  if (stretch.run.restarts.size() < 2) return "";
  const ModelPoint nominal = model.nominal();
  double least = std::min(misfit(model, stretch, nominal) - kGain, misfit(model, stretch, fault) - kLead);
  std::string best;
  if (least <= 0) return best;  // nothing can be that much better
  Recording tried = stretch.run.recording;
  const std::size_t columns = tried.columns();
  const auto consider = [&](std::size_t one, std::size_t other, const std::string& text) {
    if (!in_range(tried, one) || !in_range(tried, other)) return;
    try {
      const double found = misfit(model, *model.prepare(tried), nominal);
      if (found >= least) return;
      least = found;
      best = text;
    } catch (const InputError&) {  // such a reading leaves nothing to run
    }
  };
  for (std::size_t c = 0; c < columns; ++c) {
    const Channel& channel = sheet.channels[c];
    if (channel.role == Role::setpoint || channel.ground_truth) continue;
    const auto turn = [&] {
      for (std::size_t row = 0; row < tried.rows(); ++row) tried.values[row * columns + c] *= -1;
    };
    turn();
    consider(c, c, fmt::format("{}: its sign is turned; with the other sign the model fits", channel.name));
    turn();
    for (std::size_t d = c + 1; d < columns; ++d) {
      const Channel& second = sheet.channels[d];
      const bool alike = second.unit == channel.unit && !second.ground_truth &&
                         (second.role == Role::command) == (channel.role == Role::command) &&
                         second.role != Role::setpoint;
      if (!alike) continue;
      const auto exchange = [&] {
        for (std::size_t row = 0; row < tried.rows(); ++row)
          std::swap(tried.values[row * columns + c], tried.values[row * columns + d]);
      };
      exchange();
      consider(c, d,
               fmt::format("{} and {} are exchanged; the other way round the model fits", channel.name, second.name));
      exchange();
    }
  }
  for (std::size_t i = 0; always && i < sheet.parameters.size(); ++i) {
    const Parameter& parameter = sheet.parameters[i];
    if (!(parameter.tolerance > 0) || parameter.nominal == 0) continue;
    const auto [factor, found] = best_factor(model, stretch, i);
    if (!(found < least) || std::abs(factor - 1) <= model.settings().farthest_tolerances * parameter.tolerance)
      continue;
    least = found;
    best =
        fmt::format("{}: {:.2g} times the datasheet's value fits, as on another build or with another rig's datasheet",
                    parameter.name, factor);
  }
  return best;
}

}  // namespace faultline
