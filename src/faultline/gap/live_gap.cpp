#include "faultline/gap/live_gap.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "faultline/gap/gap_series.h"
#include "faultline/gap/gap_trials.h"
#include "faultline/segments/even_rows.h"
#include "faultline/segments/segment_length.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

// Velocities and commands: what friction, valves and leaks depend on.
bool shows_regions(const Channel& channel) {
  if (channel.ground_truth) return false;
  return channel.role == Role::command ||
         (channel.role == Role::output && (channel.unit == "m/s" || channel.unit == "rad/s"));
}

}  // namespace

LiveGap::LiveGap(const Datasheet& sheet, const LiveGapSettings& settings)
    : sheet_(sheet), settings_(settings), gap_segment_(live_segment_length(sheet)) {
  segment_rows_ = static_cast<std::size_t>(std::lround(settings.segment_ratio * gap_segment_ / sheet.sample_period));
  if (segment_rows_ < 4 || settings.smoothing_segments < 2 || settings.least_segments < 1 ||
      settings.least_segments > settings.smoothing_segments || settings.locate_after_segments < 2 ||
      settings.locate_every_segments < 1 || !(settings.jump_segments > 0))
    throw InputError(fmt::format(
        "live gap of {}: segments of at least 4 samples, at least 2 of them, of which 1 or more judge, are allowed",
        sheet.rig));
  nominal_.parameters = sheet.nominal();
  for (const std::string& adopted : sheet.nominal_effects)
    parse_effect(adopted);  // the model takes them itself; here only checked
  for (const Channel& channel : sheet.channels) {
    const auto found = sheet.normal_gap.find(channel.name);
    normal_.push_back(found == sheet.normal_gap.end() ? std::numeric_limits<double>::quiet_NaN() : found->second);
  }
  reset();
}

void LiveGap::reset() {
  cut();
  measured_.clear();
  started_ = false;
  until_locate_ = 0;
  out_ = 0;
  state_ = LiveGapState();
}

void LiveGap::cut() {
  window_.clear();
  filling_ = Recording();
  filling_.rig = sheet_.rig;
  filling_.channels = sheet_.channels;
}

bool LiveGap::usable(const Sample& sample) const {
  if (sample.values.size() != sheet_.channels.size()) return false;
  for (std::size_t c = 0; c < sheet_.channels.size(); ++c) {
    const Role role = sheet_.channels[c].role;
    if ((role == Role::command || role == Role::input) && !std::isfinite(sample.values[c])) return false;
  }
  return true;
}

bool LiveGap::process(const Sample& sample) {
  ++counts_.samples;
  if (started_) {
    const double step = sample.time - last_time_;
    if (step == 0) return false;  // a duplicate
    if (step < 0 || step > settings_.jump_segments * settings_.segment_ratio * gap_segment_) {
      reset();
      ++counts_.restarts;
    } else if (!goes_on(step, sheet_.sample_period, settings_.period_error_fraction)) {
      cut();
      ++counts_.cuts;
    }
  }
  started_ = true;
  last_time_ = sample.time;
  if (!usable(sample)) {
    cut();
    ++counts_.cuts;
    return false;
  }
  filling_.append(sample);
  const double passed = (sample.time - filling_.time.front()) / sheet_.sample_period;
  if (static_cast<std::size_t>(std::lround(passed)) + 1 < segment_rows_) return false;
  if (measured_share(sheet_, filling_, segment_rows_) < kLeastMeasured) {
    cut();
    ++counts_.cuts;
    return false;
  }
  // With the rows that are missing, and without what came after them beyond the segment.
  Recording whole = even_rows(sheet_, std::move(filling_), sheet_.sample_period, settings_.gap.segments).recording;
  filling_ = Recording();
  filling_.rig = sheet_.rig;
  filling_.channels = sheet_.channels;
  if (whole.rows() < segment_rows_) {
    cut();
    ++counts_.cuts;
    return false;
  }
  whole.time.resize(segment_rows_);
  whole.sequence.resize(segment_rows_);
  whole.values.resize(segment_rows_ * sheet_.channels.size());
  window_.push_back(std::move(whole));
  if (window_.size() > settings_.smoothing_segments) window_.pop_front();
  // The first after a break only gives the next one's start states their past.
  if (window_.size() < 2) return false;
  ++counts_.segments;
  measure();
  judge();
  find_regions();
  if (state_.left) {
    if (until_locate_ > 0) --until_locate_;
    const std::size_t segments = std::min(window_.size(), ++out_);
    if (until_locate_ == 0 && segments >= std::min(settings_.locate_after_segments, settings_.smoothing_segments)) {
      locate(segments);
      until_locate_ = settings_.locate_every_segments;
    }
  }
  state_.text = sentence();
  return true;
}

Recording LiveGap::joined(std::size_t last) const {
  Recording result;
  result.rig = sheet_.rig;
  result.channels = sheet_.channels;
  for (std::size_t i = window_.size() - last; i < window_.size(); ++i) {
    result.time.insert(result.time.end(), window_[i].time.begin(), window_[i].time.end());
    result.sequence.insert(result.sequence.end(), window_[i].sequence.begin(), window_[i].sequence.end());
    result.values.insert(result.values.end(), window_[i].values.begin(), window_[i].values.end());
  }
  return result;
}

void LiveGap::measure() {
  SegmentedRun run = cut_run(sheet_, "live", joined(2), settings_.segment_ratio * gap_segment_, settings_.gap.segments);
  const ResidualModel model(sheet_, {std::move(run)}, settings_.gap);
  const auto length = static_cast<Eigen::Index>(segment_rows_);
  const Eigen::MatrixXf residuals = settled_residuals(model, nominal_, 0).bottomRows(length);
  Segment segment;
  segment.rows = window_.back();
  state_.time = window_.back().time.back();
  state_.channels.resize(model.outputs().size());
  for (std::size_t o = 0; o < model.outputs().size(); ++o) {
    const auto c = static_cast<std::size_t>(model.outputs()[o]);
    const double square =
        static_cast<double>(residuals.col(static_cast<Eigen::Index>(o)).squaredNorm()) / static_cast<double>(length);
    LiveChannelGap& gap = state_.channels[o];
    gap.channel = sheet_.channels[c].name;
    gap.unit = sheet_.channels[c].unit;
    gap.noise = model.noise()[o];
    gap.rms = gap.noise * std::sqrt(square);
    gap.excess = std::max(0.0, square - 1);
    gap.normal = normal_[c];
    segment.excess.push_back(gap.excess);
  }
  segment.row_square.resize(segment_rows_);
  for (Eigen::Index k = 0; k < length; ++k)
    segment.row_square[static_cast<std::size_t>(k)] = residuals.row(k).squaredNorm();
  measured_.push_back(std::move(segment));
  if (measured_.size() > settings_.smoothing_segments) measured_.pop_front();
}

void LiveGap::judge() {
  state_.segments = measured_.size();
  state_.judged = measured_.size() >= settings_.least_segments;
  state_.worst = 0;
  bool left = false;
  for (std::size_t o = 0; o < state_.channels.size(); ++o) {
    LiveChannelGap& gap = state_.channels[o];
    gap.smoothed = 0;
    for (const Segment& segment : measured_) gap.smoothed += segment.excess[o] / static_cast<double>(measured_.size());
    if (!state_.judged || std::isnan(gap.normal)) continue;
    gap.left = gap.smoothed > (gap.left ? settings_.return_ratio : 1.0) * gap.normal;
    left = left || gap.left;
    state_.worst = std::max(state_.worst, gap.smoothed / std::max(gap.normal, 1e-9));
  }
  if (left && !state_.left) {
    state_.since = state_.time;
    until_locate_ = settings_.locate_after_segments;
  }
  if (!left) {
    out_ = 0;
    state_.since = 0;
    state_.place = LivePlace();
  }
  state_.left = left;
}

void LiveGap::find_regions() {
  state_.regions.clear();
  double total = 0, rows = 0;
  for (const Segment& segment : measured_)
    for (const float s : segment.row_square) total += static_cast<double>(s), rows += 1;
  const double mean = total / rows;
  for (std::size_t c = 0; c < sheet_.channels.size(); ++c) {
    const Channel& channel = sheet_.channels[c];
    if (!shows_regions(channel)) continue;
    double least = std::numeric_limits<double>::infinity(), most = -least;
    for (const Segment& segment : measured_)
      for (std::size_t k = 0; k < segment.rows.rows(); ++k) {
        least = std::min(least, segment.rows.at(k, c));
        most = std::max(most, segment.rows.at(k, c));
      }
    const double largest = std::max(std::abs(least), std::abs(most)),
                 rest =
                     std::max(settings_.standstill_fraction * largest, settings_.standstill_sigma * channel.noise_std);
    struct Part {
      std::string name;
      double sum = 0, count = 0;
    };
    Part parts[] = {{channel.name + " positive"},
                    {channel.name + " negative"},
                    {channel.name + " near zero"},
                    {channel.name + " large"}};
    for (const Segment& segment : measured_)
      for (std::size_t k = 0; k < segment.rows.rows(); ++k) {
        const double v = segment.rows.at(k, c), s = static_cast<double>(segment.row_square[k]);
        const bool inside[] = {
            v > rest, v<-rest, std::abs(v) <= rest, std::abs(v)> std::max(rest, settings_.large_fraction * largest)};
        for (std::size_t i = 0; i < 4; ++i)
          if (inside[i]) parts[i].sum += s, parts[i].count += 1;
      }
    for (const Part& part : parts)
      if (part.count > settings_.least_fraction * rows && part.sum / part.count > settings_.notable_ratio * mean)
        state_.regions.push_back({part.name, part.sum / part.count / mean, part.count / rows});
  }
  std::stable_sort(state_.regions.begin(), state_.regions.end(),
                   [](const LiveRegion& a, const LiveRegion& b) { return a.enrichment > b.enrichment; });
  if (state_.regions.size() > settings_.most_regions) state_.regions.resize(settings_.most_regions);
}

void LiveGap::locate(std::size_t segments) {
  ++counts_.located;
  GapSettings settings;
  settings.options = settings_.gap;
  const GapProgress quiet;
  const Fold fold = {{0}, {0}};
  SegmentedRun window = cut_run(sheet_, "live", joined(segments), gap_segment_, settings_.gap.segments);
  GapTrials trials(sheet_, {std::move(window)}, {fold}, {0}, settings, quiet);
  const FitResult base = trials.stand(nominal_);  // the rig was normal before: its parameters are hardly off
  const double beyond = sum(trials.score(base).score) - trials.robust({0.5 * trials.segment_values()}).front();
  std::vector<Structure> structures = trials.screen(base, 0, 1);
  if (structures.size() > settings_.fitted_candidates) structures.resize(settings_.fitted_candidates);
  trials.shortlist(base, structures, false, 0, 1);
  state_.place = LivePlace();
  state_.place.time = state_.time;
  if (structures.empty() || structures.front().quick < settings_.least_explained_fraction * std::max(1.0, beyond))
    return;
  const Structure& best = structures.front();
  state_.place.port = best.fit.effects.back().effect.port;
  state_.place.component = sheet_.port(state_.place.port).component;
  state_.place.effect = best.fit.effects.back().effect.effect;
  state_.place.share = std::clamp(best.quick / std::max(1.0, beyond), 0.0, 1.0);
  for (const Structure& other : structures) {
    const std::string& port = other.fit.effects.back().effect.port;
    auto& known = state_.place.inseparable;
    if (other.quick > settings_.inseparable_gain_fraction * best.quick && port != state_.place.port &&
        std::find(known.begin(), known.end(), port) == known.end())
      known.push_back(port);
  }
}

std::string LiveGap::sentence() const {
  if (!state_.judged) return fmt::format("{} of {} segments seen", state_.segments, settings_.least_segments);
  if (!state_.left) {
    const bool stated = std::any_of(state_.channels.begin(), state_.channels.end(),
                                    [](const LiveChannelGap& c) { return !std::isnan(c.normal); });
    return stated ? "the gap is normal" : "the gap is measured; the datasheet does not say what is normal";
  }
  std::vector<std::string> channels;
  for (const LiveChannelGap& channel : state_.channels)
    if (channel.left)
      channels.push_back(
          fmt::format("{} {:.1f} times", channel.channel, channel.smoothed / std::max(channel.normal, 1e-9)));
  std::string text = fmt::format("the gap has left normal: {}", fmt::join(channels, ", "));
  if (!state_.regions.empty()) text += fmt::format("; mostly at {}", state_.regions.front().name);
  if (!state_.place.port.empty()) {
    text += fmt::format("; {} ({}) explains about {:.0f} %", state_.place.component, state_.place.port,
                        100 * state_.place.share);
    if (!state_.place.inseparable.empty())
      text += fmt::format(", not told apart from {}", fmt::join(state_.place.inseparable, ", "));
  } else if (state_.place.time > 0) {
    text += "; no single place explains it";
  }
  return text;
}

}  // namespace faultline
