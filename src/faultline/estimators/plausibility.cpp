#include "faultline/estimators/plausibility.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>
#include <utility>

#include <fmt/format.h>

#include "faultline/signal/error.h"

namespace faultline {
namespace {

constexpr double kGain = 2.3, kLead = 1.2;  // logarithms: mean squares of one output by a factor of 10, of 3
constexpr double kMoves = 0.3;              // logarithms: by what a command moves that is not followed
constexpr double kFarthest = 3;             // times the datasheet's value, or a third of it
constexpr double kStill = 1.6;              // noises, root mean square: readings that do not move
constexpr double kMoved = 3;                // noises, likewise: by what the model moves them all the same
constexpr double kBeyondNoise = 4.5;        // noises: a reading from before the transducer was stuck
constexpr int kFactors = 4, kHalvings = 4;  // factors tried on either side; how often what lies between is halved

// L of each segment but the first, which only fills memories.
std::vector<double> misfits(const StretchModel& model, const Stretch& stretch, const ModelPoint& point) {
  std::vector<double> each;
  const Eigen::MatrixXf residuals = model.residuals(stretch, point);
  const auto rows = static_cast<Eigen::Index>(model.segment_rows());
  const std::vector<std::size_t>& restarts = stretch.run.restarts;
  for (std::size_t s = 1; s < restarts.size(); ++s) {
    const auto first = static_cast<Eigen::Index>(restarts[s]);
    const Eigen::Index count = std::min(rows, residuals.rows() - first);
    double sum = 0;
    for (Eigen::Index o = 0; o < residuals.cols(); ++o)
      sum += std::log1p(static_cast<double>(residuals.col(o).segment(first, count).squaredNorm()) /
                        static_cast<double>(count));
    each.push_back(sum);
  }
  return each;
}

// L per segment.
double misfit(const StretchModel& model, const Stretch& stretch, const ModelPoint& point) {
  const std::vector<double> each = misfits(model, stretch, point);
  return std::accumulate(each.begin(), each.end(), 0.0) / static_cast<double>(each.size());
}

OtherReading of_channels(std::size_t one, std::size_t other) {
  OtherReading reading;
  reading.one = one;
  reading.other = other;
  return reading;
}

std::string text_of(const OtherReading& r, const std::vector<Channel>& channels) {
  const std::string& name = channels[r.one].name;
  if (r.one == r.other) return name + ": its sign is turned; with the other sign the model fits";
  return fmt::format("{} and {} are exchanged; the other way round the model fits", name, channels[r.other].name);
}

std::string text_of(const std::string& parameter, double factor) {
  // What lies beyond all that was tried is no other build: something else is wrong that this parameter makes up for.
  if (std::abs(std::log(factor)) > std::log(kFarthest))
    return "The model does not fit, whatever fault is in it: channels that are not what they are called, wrong "
           "scales, or another rig's datasheet";
  return fmt::format("{}: {:.2g} times the datasheet's value fits, as on another build or with another rig's datasheet",
                     parameter, factor);
}

std::vector<OtherReading> readings_of(const std::vector<Channel>& channels) {
  const auto usable = [](const Channel& c) { return c.role != Role::setpoint && !c.ground_truth; };
  std::vector<OtherReading> readings;
  for (std::size_t c = 0; c < channels.size(); ++c) {
    if (!usable(channels[c])) continue;
    readings.push_back(of_channels(c, c));
    for (std::size_t d = c + 1; d < channels.size(); ++d)
      if (usable(channels[d]) && channels[d].unit == channels[c].unit &&
          (channels[d].role == Role::command) == (channels[c].role == Role::command))
        readings.push_back(of_channels(c, d));
  }
  return readings;
}

bool in_range(const Recording& recording, std::size_t c) {
  for (std::size_t row = 0; row < recording.rows(); ++row) {
    const double value = recording.at(row, c);
    if (value < recording.channels[c].minimum || value > recording.channels[c].maximum) return false;
  }
  return true;
}

// L of the recording read so; infinite where it cannot be.
double misfit_read_as(const StretchModel& model, Recording recording, const OtherReading& r) {
  const std::size_t columns = recording.columns();
  for (std::size_t row = 0; row < recording.rows(); ++row) {
    double* values = &recording.values[row * columns];
    if (r.one == r.other)
      values[r.one] *= -1;
    else
      std::swap(values[r.one], values[r.other]);
  }
  if (!in_range(recording, r.one) || !in_range(recording, r.other)) return kInfinity;
  try {
    return misfit(model, *model.prepare(recording), model.nominal());
  } catch (const InputError&) {  // such a reading leaves nothing to run
    return kInfinity;
  }
}

double misfit_with(const StretchModel& model, const Stretch& stretch, std::size_t parameter, double factor) {
  ModelPoint point = model.nominal();
  point.parameters[parameter] *= factor;
  try {
    return misfit(model, stretch, point);
  } catch (const InputError&) {  // no such rig
    return kInfinity;
  }
}

double least_misfit(const StretchModel& model, const Stretch& stretch, const std::vector<ModelPoint>& points) {
  double least = kInfinity;
  for (const ModelPoint& point : points) try {
      least = std::min(least, misfit(model, stretch, point));
    } catch (const InputError&) {  // no such rig
    }
  return least;
}

// What a reading must stay below for the faults alone. Two faults have more to set than one reading, so that they need
// no lead over it: a rate limit beside what is near a stuck command does what a stuck command does.
double less_than(const StretchModel& model, const Stretch& stretch, const std::vector<ModelPoint>& faults) {
  double least = kInfinity;
  for (const ModelPoint& fault : faults)
    least = std::min(least, least_misfit(model, stretch, {fault}) - (fault.effects.size() > 1 ? 0 : kLead));
  return least;
}

// A course about its mean.
struct Level {
  double mean = 0, rms = 0;
};

template <class Values>
Level level_of(std::size_t count, const Values& value) {
  Level level;
  double squares = 0;
  for (std::size_t k = 0; k < count; ++k) {
    const double x = value(k), delta = x - level.mean;
    level.mean += delta / static_cast<double>(k + 1);
    squares += delta * (x - level.mean);
  }
  level.rms = std::sqrt(squares / static_cast<double>(std::max<std::size_t>(1, count)));
  return level;
}

// Where in -farthest..farthest L is least, and how much it is: steps, and halves of the best.
template <class Misfit>
std::pair<double, double> best_within(double farthest, const Misfit& misfit) {
  double step = farthest / kFactors, at = 0, least = kInfinity;
  const auto consider = [&](double x) {
    const double found = misfit(x);
    if (!(found < least)) return;
    least = found;
    at = x;
  };
  for (int i = -kFactors; i <= kFactors; ++i) consider(i * step);
  for (int i = 0; i < kHalvings; ++i) {
    step /= 2;
    const double middle = at;
    consider(middle - step);
    consider(middle + step);
  }
  return {at, least};
}

// L of the stretch if the transducer of this output is stuck: of the model of a rig without it, and of its own readings
// about their mean.
double misfit_stuck(const Datasheet& sheet, const StretchModel& model, const Stretch& stretch,
                    const ModelPoint& healthy, std::size_t channel, double still) {
  Datasheet rest = sheet;
  rest.channels[channel].ground_truth = true;
  try {
    const StretchModel without(rest, model.settings());
    return misfit(without, *without.prepare(stretch.run.recording), healthy) + std::log1p(still * still);
  } catch (const InputError&) {  // it shows too little without
    return kInfinity;
  }
}

// What the model leaves of an output about its mean, in noises.
double moved_by_model(const StretchModel& model, const Stretch& stretch, const ModelPoint& point, std::size_t output) {
  const Eigen::MatrixXf residuals = model.residuals(stretch, point);
  return level_of(
             static_cast<std::size_t>(residuals.rows()),
             [&](std::size_t k) {
               return static_cast<double>(residuals(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(output)));
             })
      .rms;
}

// Whether the transducer shows what the model does and is off by a constant, however large: that is not stuck.
bool follows_shifted(const Datasheet& sheet, const StretchModel& model, const Stretch& stretch,
                     const ModelPoint& healthy, std::size_t output) {
  const Channel& c = sheet.channels[static_cast<std::size_t>(model.output_channels()[output])];
  const auto port = std::find_if(sheet.ports.begin(), sheet.ports.end(),
                                 [&](const Port& p) { return p.kind == PortKind::sensor && p.channel == c.name; });
  if (port == sheet.ports.end()) return false;
  const auto shifted = [&](double value) {
    ModelPoint point = healthy;
    point.effects.push_back({"offset", port->name, {value}});
    return point;
  };
  const double best = best_within(0.5 * (c.maximum - c.minimum), [&](double value) {
                        return least_misfit(model, stretch, {shifted(value)});
                      }).first;
  return moved_by_model(model, stretch, shifted(best), output) < kMoved;
}

// The readings of an output about their mean, in noises.
Level readings_of_output(const StretchModel& model, const Recording& recording, std::size_t output) {
  const auto channel = static_cast<std::size_t>(model.output_channels()[output]);
  return level_of(recording.rows(), [&](std::size_t k) { return recording.at(k, channel) / model.noise()[output]; });
}

// A transducer without supply reads zero. Where the datasheet has a scale for that, that is its name.
bool scale_says_it(const Datasheet& sheet, std::size_t channel, double mean) {
  constexpr double kZero = 3, kLeastFactor = 0.05;  // noises
  if (std::abs(mean) > kZero) return false;
  for (const Port& port : sheet.ports) {
    if (port.kind != PortKind::sensor || port.channel != sheet.channels[channel].name) continue;
    for (const FittingEffect& effect : port.effects) {
      const auto factor = effect.effect == "scale" ? effect.bounds.find("factor") : effect.bounds.end();
      if (factor != effect.bounds.end() && factor->second.minimum < kLeastFactor) return true;
    }
  }
  return false;
}

// Since when the readings of a channel stay where they are; in a stretch in which nothing was wrong, or in this one.
double stuck_since(const Recording& before, const Recording& now, std::size_t channel, double held, double noise) {
  double since = now.time.front();
  for (const Recording* recording : {&now, &before})
    for (std::size_t k = recording->rows(); k-- > 0; since = recording->time[k])
      if (std::abs(recording->at(k, channel) - held) > kBeyondNoise * noise) return since;
  return since;
}

// The factor on a parameter that fits best, and L with it.
std::pair<double, double> best_factor(const StretchModel& model, const Stretch& stretch, std::size_t parameter) {
  const auto [logarithm, least] =
      best_within(std::log(kFarthest), [&](double x) { return misfit_with(model, stretch, parameter, std::exp(x)); });
  return {std::exp(logarithm), least};
}

// The stretch with this command held.
std::unique_ptr<Stretch> held_at(const StretchModel& model, Recording recording, std::size_t command, double held) {
  for (std::size_t row = 0; row < recording.rows(); ++row) recording.values[row * recording.columns() + command] = held;
  return model.prepare(recording);
}

// L of the stretch if what this command drives stands still at `held`.
double misfit_held(const StretchModel& model, const Recording& recording, const ModelPoint& healthy,
                   std::size_t command, double held) {
  try {
    return misfit(model, *held_at(model, recording, command, held), healthy);
  } catch (const InputError&) {  // nothing to run
    return kInfinity;
  }
}

// That a datasheet allows at a port; 0: none.
double largest_offset(const Port& port) {
  for (const FittingEffect& effect : port.effects)
    if (const auto value = effect.bounds.find("value"); effect.effect == "offset" && value != effect.bounds.end())
      return std::max(std::abs(value->second.minimum), std::abs(value->second.maximum));
  return 0;
}

// L of the stretch with this command off by a constant, the one within `reach` that fits best: what is stuck fits so,
// too, where the command stands still.
double misfit_off(const StretchModel& model, const Recording& recording, const ModelPoint& healthy, std::size_t command,
                  double reach) {
  return best_within(reach,
                     [&](double by) {
                       Recording off = recording;
                       for (std::size_t row = 0; row < off.rows(); ++row)
                         off.values[row * off.columns() + command] += by;
                       try {
                         return misfit(model, *model.prepare(off), healthy);
                       } catch (const InputError&) {  // nothing to run
                         return kInfinity;
                       }
                     })
      .second;
}

// Since when a command is held: from the segment on from which this says most more than the commands that were given;
// in a stretch in which nothing was found, or in this one.
double held_since(const StretchModel& model, const Recording& before, const Recording& now, const ModelPoint& healthy,
                  std::size_t command, double held) {
  double since = now.time.front(), gained = 0, most = 0;
  for (const Recording* recording : {&now, &before}) try {
      if (recording->rows() == 0) continue;
      const std::unique_ptr<Stretch> as_given = model.prepare(*recording);
      const std::vector<double> given = misfits(model, *as_given, healthy);
      const std::vector<double> still = misfits(model, *held_at(model, *recording, command, held), healthy);
      for (std::size_t s = std::min(given.size(), still.size()); s-- > 0;) {
        gained += given[s] - still[s];
        if (gained <= most) continue;
        most = gained;
        since = recording->time[as_given->run.restarts[s + 1]];
      }
    } catch (const InputError&) {  // nothing to run
      break;
    }
  return since;
}

bool can_be_stuck(const Datasheet& sheet, const Port& port) {
  return port.kind == PortKind::command && !port.channel.empty() &&
         sheet.channels[static_cast<std::size_t>(sheet.channel(port.channel))].role == Role::command &&
         std::any_of(port.effects.begin(), port.effects.end(),
                     [](const FittingEffect& effect) { return effect.effect == "stuck"; });
}

}  // namespace

std::string stuck_port(const Datasheet& sheet, const OtherReading& reading) {
  if (!reading.is_stuck()) return "";
  for (const Port& port : sheet.ports)
    if ((port.kind == PortKind::sensor || port.kind == PortKind::command) &&
        port.channel == sheet.channels[reading.one].name)
      return port.name;
  return "";
}

OtherReading better_reading(const Datasheet& sheet, const StretchModel& model, const Stretch& stretch,
                            const std::vector<ModelPoint>& faults, const ModelPoint& healthy, bool change,
                            const Recording& before) {
  OtherReading best;
  if (stretch.run.restarts.size() < 2) return best;
  double least = std::min(misfit(model, stretch, model.nominal()) - kGain, less_than(model, stretch, faults));
  if (least <= 0) return best;  // nothing can be that much better
  const std::unique_ptr<Stretch> earlier = before.rows() > 0 ? model.prepare(before) : nullptr;
  const double as_it_was = earlier ? misfit(model, *earlier, model.nominal()) + kLead : kInfinity;
  for (const OtherReading& reading : readings_of(sheet.channels)) {
    const double found = misfit_read_as(model, stretch.run.recording, reading);
    if (!(found < least) || (earlier && misfit_read_as(model, before, reading) > as_it_was)) continue;
    least = found;
    best = reading;
    best.text = text_of(reading, sheet.channels);
  }
  for (std::size_t o = 0; o < model.outputs(); ++o) {
    const Recording& recording = stretch.run.recording;
    const auto channel = static_cast<std::size_t>(model.output_channels()[o]);
    const Level read = readings_of_output(model, recording, o);
    if (!(read.rms <= kStill) || scale_says_it(sheet, channel, read.mean) ||
        !(moved_by_model(model, stretch, healthy, o) >= kMoved))
      continue;
    const double found = misfit_stuck(sheet, model, stretch, healthy, channel, read.rms);
    if (!(found < least) || follows_shifted(sheet, model, stretch, healthy, o)) continue;
    best = of_channels(channel, channel);
    best.of = OtherReading::Of::stuck;
    best.lead = least - found;
    least = found;
    best.since = stuck_since(before, recording, channel, read.mean * model.noise()[o], model.noise()[o]);
    best.text = sheet.channels[channel].name + ": this transducer is stuck";
  }
  for (const Port& port : sheet.ports) {
    if (!can_be_stuck(sheet, port)) continue;
    const Recording& recording = stretch.run.recording;
    const auto channel = static_cast<std::size_t>(sheet.channel(port.channel));
    const Recording& shown = before.rows() > 0 ? before : recording;
    double low = kInfinity, high = -kInfinity;  // of what it was commanded before
    for (std::size_t row = 0; row < shown.rows(); ++row) {
      low = std::min(low, shown.at(row, channel));
      high = std::max(high, shown.at(row, channel));
    }
    const double middle = 0.5 * (low + high);
    const auto [from_middle, found] = best_within(
        0.5 * (high - low), [&](double x) { return misfit_held(model, recording, healthy, channel, middle + x); });
    if (!(found < least) || found > misfit_off(model, recording, healthy, channel, largest_offset(port)) - kMoves)
      continue;
    best = of_channels(channel, channel);
    best.of = OtherReading::Of::stuck;
    best.lead = least - found;
    least = found;
    best.held = middle + from_middle;
    best.left = found;
    best.since = held_since(model, before, recording, healthy, channel, best.held);
    best.text = fmt::format("{}: this command is no longer followed: what it drives is stuck", port.channel);
  }
  for (std::size_t i = 0; !change && i < sheet.parameters.size(); ++i) {
    const Parameter& parameter = sheet.parameters[i];
    if (!(parameter.tolerance > 0) || parameter.nominal == 0) continue;
    const auto [factor, found] = best_factor(model, stretch, i);
    if (!(found < least) || std::abs(factor - 1) <= model.settings().farthest_tolerances * parameter.tolerance ||
        (earlier && misfit_with(model, *earlier, i, factor) > as_it_was))
      continue;
    least = found;
    best = OtherReading();
    best.of = OtherReading::Of::parameter;
    best.parameter = i;
    best.factor = factor;
    best.text = text_of(parameter.name, factor);
  }
  return best;
}

bool contradicts(const Datasheet& sheet, const StretchModel& model, const Stretch& stretch,
                 const std::vector<ModelPoint>& faults, const ModelPoint& healthy, const OtherReading& reading) {
  if (stretch.run.restarts.size() < 2) return false;
  double found = kInfinity;
  switch (reading.of) {
    case OtherReading::Of::channels:
      found = misfit_read_as(model, stretch.run.recording, reading);
      break;
    case OtherReading::Of::parameter:
      found = misfit_with(model, stretch, reading.parameter, reading.factor);
      break;
    case OtherReading::Of::stuck: {
      if (sheet.channels[reading.one].role == Role::command) {
        found = misfit_held(model, stretch.run.recording, healthy, reading.one, reading.held);
        if (found > reading.left + kGain) return true;
        break;
      }
      const std::vector<int>& channels = model.output_channels();
      const auto o = static_cast<std::size_t>(
          std::find(channels.begin(), channels.end(), static_cast<int>(reading.one)) - channels.begin());
      const double still = readings_of_output(model, stretch.run.recording, o).rms;
      if (still > kStill) return true;
      found = misfit_stuck(sheet, model, stretch, healthy, reading.one, still);
    }
  }
  return found > least_misfit(model, stretch, faults) + kLead;
}

}  // namespace faultline
