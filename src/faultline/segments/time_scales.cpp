#include "faultline/segments/time_scales.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>

#include "faultline/segments/propagation.h"

namespace faultline {
namespace {

constexpr double kSlowest = 10;            // times the slowest scale makes a segment
constexpr double kFewestSegments = 16;     // of all runs: statistics over segments need as many
constexpr double kFewestSamples = 20;      // of a segment: readings beyond what its start states take
constexpr std::size_t kRows = 15;          // at which scales are taken; odd, for their median
constexpr std::size_t kUnknownRows = 2000;  // samples of the run that stands for one that is not known

// What the model does when it is driven by the recording: its states at some rows, and how large they become.
struct Course {
  std::vector<std::size_t> rows;
  std::vector<Eigen::VectorXd> states;
  Eigen::VectorXd size;
};

Course course_of(Propagation& propagation, const Recording& recording, std::size_t states) {
  Course course;
  course.size = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(states));
  Eigen::VectorXd state = propagation.own_start(recording, 0);
  const std::size_t every = std::max<std::size_t>(1, recording.rows() / (kRows + 1));
  for (std::size_t k = 0; k + 1 < recording.rows() && course.rows.size() < kRows; ++k) {
    state = propagation.step(recording, k, state).next;
    if (!state.allFinite()) break;
    course.size = course.size.cwiseMax(state.cwiseAbs());
    if ((k + 1) % every != 0) continue;
    course.rows.push_back(k);
    course.states.push_back(state);
  }
  return course;
}

// Commands in the middle of their ranges, inputs as the datasheet has them.
Recording at_mid_command(const Datasheet& sheet) {
  Recording recording;
  recording.rig = sheet.rig;
  recording.channels = sheet.channels;
  Sample sample;
  for (const Channel& channel : sheet.channels)
    sample.values.push_back(channel.ground_truth ? 0 : 0.5 * (channel.minimum + channel.maximum));
  for (const InputSignal& input : sheet.inputs)
    sample.values[static_cast<std::size_t>(sheet.channel(input.channel))] = input.value;
  for (std::size_t k = 0; k < kUnknownRows; ++k) {
    sample.time = static_cast<double>(k) * sheet.sample_period;
    recording.append(sample);
  }
  return recording;
}

double typical_period(const Datasheet& sheet, const Recording& recording) {
  if (recording.rows() < 2) return sheet.sample_period;
  std::vector<double> steps;
  for (std::size_t k = 1; k < recording.rows(); ++k) steps.push_back(recording.time[k] - recording.time[k - 1]);
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  return *middle > 0 ? *middle : sheet.sample_period;
}

// Rows over which the model can be driven.
Recording drivable(const Datasheet& sheet, const Recording& recording) {
  Recording result;
  result.rig = recording.rig;
  result.channels = recording.channels;
  for (std::size_t k = 0; k < recording.rows(); ++k) {
    Sample sample = recording.sample(k);
    bool good = true;
    for (std::size_t c = 0; c < sheet.channels.size(); ++c) {
      const Channel& channel = sheet.channels[c];
      if (channel.ground_truth || channel.role == Role::setpoint) sample.values[c] = 0;
      if (channel.role != Role::output) good = good && std::isfinite(sample.values[c]);
    }
    if (good) result.append(sample);
  }
  return result;
}

double length_from(const std::vector<double>& scales, double period, double duration) {
  double slowest = 0;
  for (const double scale : scales)
    if (std::isfinite(scale)) slowest = std::max(slowest, scale);
  return std::max(kFewestSamples * period, std::min(kSlowest * slowest, duration / kFewestSegments));
}

}  // namespace

std::vector<double> time_scales(const Datasheet& sheet, const Recording& recording) {
  const Recording driven = drivable(sheet, recording);
  const double period = typical_period(sheet, recording);
  const double duration = static_cast<double>(recording.rows()) * period;
  Propagation propagation(sheet, {sheet.nominal(), {}}, period);
  const Course course = course_of(propagation, driven, sheet.states.size());
  const Eigen::VectorXd steps = difference_steps(sheet, course.size);
  std::vector<std::vector<double>> found(sheet.states.size());
  for (std::size_t k = 0; k < course.rows.size(); ++k) {
    Eigen::MatrixXd f, h;
    propagation.jacobians(driven, course.rows[k], course.states[k], steps, f, h);
    if (!f.allFinite()) continue;
    std::vector<double> scales;
    const Eigen::VectorXcd lambdas = f.eigenvalues();
    for (Eigen::Index i = 0; i < lambdas.size(); ++i) {
      const std::complex<double> lambda = lambdas[i];
      const double rate = std::abs(lambda) > 0 ? std::abs(std::log(lambda)) / period : kInfinity;
      scales.push_back(rate * duration < 1 ? kInfinity : std::max(period, 1 / rate));
    }
    std::sort(scales.begin(), scales.end());
    for (std::size_t s = 0; s < scales.size(); ++s) found[s].push_back(scales[s]);
  }
  std::vector<double> result;
  for (std::vector<double>& of_state : found) {
    if (of_state.empty()) continue;
    const auto middle = of_state.begin() + static_cast<std::ptrdiff_t>(of_state.size() / 2);
    std::nth_element(of_state.begin(), middle, of_state.end());
    result.push_back(*middle);
  }
  return result;
}

double segment_length(const Datasheet& sheet, const std::vector<const Recording*>& runs) {
  if (sheet.segment > 0) return sheet.segment;
  const Recording* longest = runs.front();
  double duration = 0, period = 0;
  for (const Recording* run : runs) {
    if (run->rows() > longest->rows()) longest = run;
    const double own = typical_period(sheet, *run);
    period = std::max(period, own);
    duration += static_cast<double>(run->rows()) * own;
  }
  return length_from(time_scales(sheet, *longest), period, duration);
}

double segment_length(const Datasheet& sheet) {
  if (sheet.segment > 0) return sheet.segment;
  const Recording recording = at_mid_command(sheet);
  return length_from(time_scales(sheet, recording), sheet.sample_period,
                     static_cast<double>(recording.rows()) * sheet.sample_period);
}

}  // namespace faultline
