#include "faultline/segments/segmented_run.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <fmt/format.h>

#include "faultline/rig/rig.h"
#include "faultline/rig/time_scales.h"
#include "faultline/segments/even_rows.h"
#include "faultline/segments/grid_step.h"
#include "faultline/segments/smoothing.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

constexpr double kSmallestNoise = 1e-12;  // of a channel's range: a guard where the noise is 0
constexpr std::size_t kFewestRows = 4;    // of a segment: a start and what it leads to
constexpr double kBeyond = 0.01;          // of a channel's range, from which a reading outside is none and no bound
constexpr double kFast = 0.5;             // of the rig's fastest time scale, that lies between two samples
constexpr double kSlower = 1.01;          // than the datasheet's period: a slower one there is its author's word

double smallest_noise(const Channel& channel, const SegmentOptions& options) {
  return std::max({options.least_noise_fraction * channel.noise_std, rounding_noise(channel.resolution),
                   kSmallestNoise * (channel.maximum - channel.minimum)});
}

// What no transducer of that range shows and no command can be - a wire that is off for a moment, a digit that is
// lost - is missing.
void drop_strays(const Datasheet& sheet, Recording& recording) {
  for (std::size_t c = 0; c < sheet.channels.size(); ++c) {
    const Channel& channel = sheet.channels[c];
    const double beyond = kBeyond * (channel.maximum - channel.minimum);
    if (channel.role == Role::setpoint || channel.ground_truth || !std::isfinite(beyond)) continue;
    for (std::size_t k = 0; k < recording.rows(); ++k)
      if (double& value = recording.values[k * recording.columns() + c];
          value < channel.minimum - beyond || value > channel.maximum + beyond)
        value = std::nan("");
  }
}

// "; 12 readings are missing (position 10, velocity 2)"; empty where there are none. `counts`: per output.
std::string told(const Datasheet& sheet, const std::vector<int>& outputs, const std::vector<std::size_t>& counts,
                 const std::string& what) {
  std::size_t all = 0;
  std::vector<std::string> names;
  for (std::size_t o = 0; o < counts.size(); ++o) {
    if (counts[o] == 0) continue;
    all += counts[o];
    names.push_back(fmt::format("{} {}", sheet.channels[static_cast<std::size_t>(outputs[o])].name, counts[o]));
  }
  return all == 0 ? "" : fmt::format("; {} {} ({})", all, what, fmt::join(names, ", "));
}

// Why the model cannot be driven over a row; null where it can.
const Channel* missing_drive(const Datasheet& sheet, const Recording& recording, std::size_t row) {
  for (std::size_t c = 0; c < sheet.channels.size(); ++c) {
    const Channel& channel = sheet.channels[c];
    if ((channel.role == Role::command || channel.role == Role::input) && !std::isfinite(recording.at(row, c)))
      return &channel;
  }
  return nullptr;
}

struct Breaks {
  std::vector<Stretched> stretches;
  std::size_t count = 0;
  std::size_t drives_missing = 0;  // of them, where a command or input is
  std::string first;               // the first one, in words
};

Breaks find_breaks(const Datasheet& sheet, const SegmentedRun& run, const EvenRows& even) {
  Breaks found;
  const Recording& r = run.recording;
  const auto note = [&](const std::string& text) {
    if (found.count++ == 0) found.first = text;
  };
  std::size_t first = 0;
  const auto end = [&](std::size_t last) {
    if (last >= first + run.segment) found.stretches.push_back({first, last});
  };
  auto next = even.breaks.begin();
  for (std::size_t k = 0; k < r.rows(); ++k) {
    if (next != even.breaks.end() && *next == k) {
      note(even.first_break);
      ++next;
      end(k);
      first = k;
    }
    if (const Channel* missing = missing_drive(sheet, r, k)) {
      note(fmt::format("channel {} is missing or outside its range {:g}..{:g} {} at {:.3f} s", missing->name,
                       missing->minimum, missing->maximum, missing->unit, r.time[k] - r.time.front()));
      found.drives_missing += 1;
      end(k);
      first = k + 1;
    }
  }
  end(r.rows());
  return found;
}

// Third differences of a signal that rests between two levels are 0: what a grid takes away is noise all the same.
double noise_of_grid(const Datasheet& sheet, const SegmentedRun& run, std::size_t channel,
                     const SegmentOptions& options) {
  std::vector<double> readings(run.recording.rows());
  for (std::size_t k = 0; k < readings.size(); ++k) readings[k] = run.reading(k, channel);
  return rounding_noise(
      grid_step(std::move(readings), sheet.channels[channel].resolution, options.grid_least_levels, options));
}

// Of an input that its command predicts, the noise about its command: what that itself carries is no noise of the
// transducer.
double noise_about_command(const Datasheet& sheet, const SegmentedRun& run, std::size_t channel) {
  Recording difference;
  difference.time = run.recording.time;
  difference.channels = {sheet.channels[channel]};
  const double range = sheet.channels[channel].maximum - sheet.channels[channel].minimum;
  difference.channels.front().minimum = -range;
  difference.channels.front().maximum = range;
  const auto command = static_cast<std::size_t>(sheet.channel(sheet.channels[channel].predicted_by));
  for (std::size_t k = 0; k < run.recording.rows(); ++k)
    difference.values.push_back(run.reading(k, channel) - run.recording.at(k, command));
  return noise_floor(difference, 0);
}

// Of the segment that begins at a row.
double counted_readings(const Datasheet& sheet, const SegmentedRun& run, std::size_t first,
                        const SegmentOptions& options) {
  const std::vector<int> outputs = compared_outputs(sheet);
  std::size_t counted = 0;
  for (const int output : outputs) {
    const auto c = static_cast<std::size_t>(output);
    for (std::size_t i = first; i < first + run.segment; ++i)
      counted += measures(sheet.channels[c], run.recording.at(i, c));
  }
  const auto all = static_cast<double>(run.segment * outputs.size());
  return std::max(static_cast<double>(counted), options.least_counted_fraction * all);
}

void forget_segments(SegmentedRun& run) {
  run.restarts.clear();
  run.counted.clear();
  run.starts.clear();
  run.start_shift.clear();
  run.start_roots.clear();
}

}  // namespace

std::vector<int> compared_outputs(const Datasheet& sheet) {
  std::vector<int> outputs;
  for (std::size_t c = 0; c < sheet.channels.size(); ++c)
    if ((sheet.channels[c].role == Role::output || !sheet.channels[c].predicted_by.empty()) &&
        !sheet.channels[c].ground_truth)
      outputs.push_back(static_cast<int>(c));
  return outputs;
}

Sample SegmentedRun::measured(std::size_t row) const {
  Sample sample = recording.sample(row);
  for (std::size_t c = 0; c < sample.values.size(); ++c) sample.values[c] = reading(row, c);
  return sample;
}

SegmentedRun cut_run(const Datasheet& sheet, const std::string& name, Recording recording, double segment,
                     const SegmentOptions& options, Inputs inputs) {
  for (std::size_t c = 0; c < sheet.channels.size(); ++c) {
    if (!sheet.channels[c].ground_truth && sheet.channels[c].role != Role::setpoint) continue;
    for (std::size_t k = 0; k < recording.rows(); ++k) recording.values[k * recording.columns() + c] = 0;
  }
  SegmentedRun run;
  run.name = name;
  run.period = fitted_period(sheet, recording);
  run.segment = std::max(kFewestRows, static_cast<std::size_t>(std::lround(segment / run.period)));
  EvenRows even = even_rows(sheet, std::move(recording), run.period, options);
  run.recording = std::move(even.recording);
  drop_strays(sheet, run.recording);
  const Breaks breaks = find_breaks(sheet, run, even);
  run.stretches = breaks.stretches;

  run.unsmoothed.resize(sheet.channels.size());
  for (std::size_t c = 0; c < sheet.channels.size(); ++c)
    for (std::size_t k = 0; !sheet.channels[c].predicted_by.empty() && k < run.recording.rows(); ++k)
      run.unsmoothed[c].push_back(run.recording.at(k, c));

  std::vector<double> noise(sheet.channels.size(), 0);
  run.input_noise.assign(sheet.channels.size(), 0);
  for (std::size_t c = 0; c < sheet.channels.size(); ++c) {
    if (inputs != Inputs::smoothed || sheet.channels[c].role != Role::input) continue;
    const double rounding = noise_of_grid(sheet, run, c, options);
    noise[c] = std::max(noise_floor(run.recording, c), rounding);
    // What is far more than the transducer's noise moves the rig: an excitation as fast as the samples.
    if (const double own = sheet.channels[c].noise_std; own > 0 && noise[c] > options.most_input_noise_ratio * own)
      noise[c] = std::max(own, rounding);
    run.input_noise[c] = run.unsmoothed[c].empty() ? noise[c] : std::max(noise_about_command(sheet, run, c), rounding);
  }
  for (const Stretched& stretch : run.stretches)
    smooth_inputs(sheet, run.recording, stretch.first, stretch.last, widest_window(run, options), noise, options);

  const std::vector<int> outputs = compared_outputs(sheet);
  std::vector<std::size_t> missing(outputs.size(), 0), bounds = missing;
  for (const Stretched& stretch : run.stretches)
    for (std::size_t k = stretch.first; k + run.segment <= stretch.last; k += run.segment) {
      for (std::size_t o = 0; o < outputs.size(); ++o)
        for (std::size_t i = k; i < k + run.segment; ++i) {
          const auto c = static_cast<std::size_t>(outputs[o]);
          const double value = run.recording.at(i, c);
          const bool good = measures(sheet.channels[c], value), there = std::isfinite(value);
          missing[o] += !there;
          bounds[o] += there && !good;
        }
      run.restarts.push_back(k);
      run.counted.push_back(counted_readings(sheet, run, k, options));
    }
  const std::size_t used = run.segments() * run.segment;
  const std::string why = breaks.count > 0 ? "; " + breaks.first : "";
  if (run.restarts.empty())
    throw InputError(fmt::format(
        "{}: no {:g} s without a break are in it ({} samples){}; {}", name,
        static_cast<double>(run.segment) * run.period, run.recording.rows(), why,
        2 * breaks.drives_missing > breaks.count
            ? "the model is driven by that channel: record it, or set its range right in the datasheet"
            : "record longer, give the datasheet a shorter segment, or bring the samples to an even rate (import "
              "--resample)"));
  std::string slow;
  const RigType* type = find_rig_type(sheet.rig);
  if (run.period > kSlower * std::max(sheet.sample_period, type ? type->shown_period : 0) &&
      run.period > kFast * time_scales(sheet).fastest_s)
    slow = fmt::format(
        "{}: samples every {:g} s are slow against the rig's fastest motion: what lies between them is "
        "taken as straight, and answers may be off by more than their intervals",
        name, run.period);
  const std::string lost = told(sheet, outputs, missing, "readings are missing"),
                    at_ends = told(sheet, outputs, bounds, "readings at an end of their range count as bounds");
  if (breaks.count > 0 || even.filled > 0 || !lost.empty() || !at_ends.empty()) {
    run.remark = fmt::format("{}: {} of {} samples lie in {} segments that are used", name, used, run.recording.rows(),
                             run.restarts.size());
    if (breaks.count > 0) run.remark += fmt::format("; {} breaks, the first: {}", breaks.count, breaks.first);
    if (even.filled > 0) run.remark += fmt::format("; {} rows were put in where single ones are missing", even.filled);
    run.remark += lost + at_ends;
  }
  if (!slow.empty()) run.remark += (run.remark.empty() ? "" : "; ") + slow;
  return run;
}

void need_readings(const Datasheet& sheet, const std::vector<SegmentedRun>& runs) {
  for (const SegmentedRun& run : runs)
    for (const int output : compared_outputs(sheet)) {
      const auto c = static_cast<std::size_t>(output);
      for (std::size_t k = 0; k < run.recording.rows(); ++k)
        if (measures(sheet.channels[c], run.recording.at(k, c))) return;
    }
  throw InputError(
      fmt::format("{}: every reading of every output is missing or at an end of its range; there is nothing to compare "
                  "a model with",
                  runs.front().name));
}

std::size_t widest_window(const SegmentedRun& run, const SegmentOptions& options) {
  return static_cast<std::size_t>(options.smoothing_segment_fraction * static_cast<double>(run.segment) + 1e-9);
}

std::size_t fewest_rows(const std::vector<SegmentedRun>& runs) {
  std::size_t rows = runs.front().segment;
  for (const SegmentedRun& run : runs) rows = std::min(rows, run.segment);
  return rows;
}

SegmentedRun some_segments(const SegmentedRun& run, const std::vector<std::size_t>& which) {
  SegmentedRun part = run;
  part.parted = true;
  const auto keep = [&](const auto& all, auto& some) {
    some.clear();
    for (const std::size_t g : which)
      if (g < all.size()) some.push_back(all[g]);
  };
  keep(run.restarts, part.restarts);
  keep(run.counted, part.counted);
  keep(run.starts, part.starts);
  keep(run.start_shift, part.start_shift);
  keep(run.start_roots, part.start_roots);
  return part;
}

SegmentedRun joined_segments(const SegmentedRun& run, std::size_t times) {
  SegmentedRun joined = run;
  forget_segments(joined);
  joined.segment = times * run.segment;
  for (std::size_t g = 0; g + times <= run.segments();) {
    if (run.restarts[g + times - 1] != run.restarts[g] + (times - 1) * run.segment) {
      ++g;
      continue;
    }
    const auto first = run.counted.begin() + static_cast<std::ptrdiff_t>(g);
    joined.restarts.push_back(run.restarts[g]);
    joined.counted.push_back(std::accumulate(first, first + static_cast<std::ptrdiff_t>(times), 0.0));
    g += times;
  }
  return joined;
}

SegmentedRun shorter_segments(const Datasheet& sheet, const SegmentedRun& run, std::size_t times,
                              const SegmentOptions& options) {
  SegmentedRun shorter = run;
  forget_segments(shorter);
  shorter.segment = run.segment / times;
  for (const std::size_t first : run.restarts)
    for (std::size_t i = 0; i < times; ++i) {
      shorter.restarts.push_back(first + i * shorter.segment);
      shorter.counted.push_back(counted_readings(sheet, shorter, shorter.restarts.back(), options));
    }
  return shorter;
}

std::vector<double> noise_of(const Datasheet& sheet, const std::vector<SegmentedRun>& runs,
                             const SegmentOptions& options) {
  std::vector<double> result;
  for (const int output : compared_outputs(sheet)) {
    const auto c = static_cast<std::size_t>(output);
    double floor = 0;
    for (const SegmentedRun& run : runs)
      floor += std::max(noise_of_grid(sheet, run, c, options), sheet.channels[c].predicted_by.empty()
                                                                   ? noise_floor(run.recording, c)
                                                                   : noise_about_command(sheet, run, c)) /
               static_cast<double>(runs.size());
    result.push_back(std::max(floor, smallest_noise(sheet.channels[c], options)));
  }
  return result;
}

std::vector<double> least_noise_of(const Datasheet& sheet, const std::vector<SegmentedRun>& runs,
                                   const SegmentOptions& options) {
  std::vector<double> result;
  for (const int output : compared_outputs(sheet)) {
    const auto c = static_cast<std::size_t>(output);
    double grid = 0;
    for (const SegmentedRun& run : runs)
      grid += noise_of_grid(sheet, run, c, options) / static_cast<double>(runs.size());
    result.push_back(std::max(grid, smallest_noise(sheet.channels[c], options)));
  }
  return result;
}

std::vector<double> noise_of(const Datasheet& sheet, const SegmentOptions& options) {
  std::vector<double> result;
  for (const int output : compared_outputs(sheet))
    result.push_back(noise_of(sheet.channels[static_cast<std::size_t>(output)], options));
  return result;
}

double noise_of(const Channel& channel, const SegmentOptions& options) {
  return std::max(channel.noise_std, smallest_noise(channel, options));
}

}  // namespace faultline
