#include "faultline/segments/segment_model.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include <Eigen/Cholesky>

#include "faultline/numerics/in_parallel.h"
#include "faultline/rig/effect_chain.h"
#include "faultline/rig/swing.h"
#include "faultline/segments/smoothing.h"
#include "faultline/segments/state_smoother.h"

namespace faultline {
namespace {

constexpr double kTwoPi = 6.283185307179586;
constexpr double kFarStart = 3;  // standard deviations of its prior: what the channels show may say more

// What a channel shows `later` s after a row, from the quadratic around the nearest row.
Shown shown_around(const SegmentedRun& run, const Recording& recording, std::size_t row, std::size_t channel,
                   double noise, double later, const SegmentOptions& options) {
  const double place = static_cast<double>(row) + later / run.period, nearest = std::round(place);
  const auto stretch = std::find_if(run.stretches.begin(), run.stretches.end(),
                                    [&](const Stretched& s) { return row >= s.first && row < s.last; });
  if (stretch == run.stretches.end() || nearest < static_cast<double>(stretch->first) ||
      nearest >= static_cast<double>(stretch->last))
    return {std::nan("")};
  const Smoothed s = smoothed_course(recording, static_cast<std::size_t>(nearest), channel, stretch->first,
                                     stretch->last, noise, widest_window(run, options), options);
  const double x = place - nearest;
  return {s.value + s.slope * x + s.curvature * x * x, (s.slope + 2 * s.curvature * x) / run.period,
          s.slope_std / run.period, s.std};
}

auto rows_of(const SegmentedRun& run, const Eigen::MatrixXf& matrix, std::size_t segment) {
  return matrix.middleRows(static_cast<Eigen::Index>(run.restarts[segment]), static_cast<Eigen::Index>(run.segment));
}

std::vector<Stretched> parts_of(const SegmentedRun& run) {
  std::vector<Stretched> parts;
  for (const std::size_t row : run.restarts) parts.push_back({row, row + run.segment});
  return parts;
}

// The e of settled().
Eigen::VectorXd best_move(const SegmentedRun& run, const std::vector<Eigen::MatrixXf>& columns,
                          const Eigen::MatrixXf& residuals, std::size_t segment) {
  const auto n = static_cast<Eigen::Index>(columns.size());
  const auto product = [&](const Eigen::MatrixXf& a, const Eigen::MatrixXf& b) {
    return static_cast<double>(rows_of(run, a, segment).cwiseProduct(rows_of(run, b, segment)).sum());
  };
  Eigen::MatrixXd information = Eigen::MatrixXd::Identity(n, n);
  Eigen::VectorXd gradient = run.start_shift[segment];
  for (Eigen::Index i = 0; i < n; ++i) {
    const Eigen::MatrixXf& column = columns[static_cast<std::size_t>(i)];
    gradient[i] += product(column, residuals);
    for (Eigen::Index j = 0; j < n; ++j) information(i, j) += product(column, columns[static_cast<std::size_t>(j)]);
  }
  return -information.ldlt().solve(gradient);
}

// Noise of what the model leaves of an output within the segments of a run, in units of `residuals`; infinite where it
// shows none, as in segments of a few rows.
double noise_beside_model(const SegmentedRun& run, const Eigen::MatrixXf& residuals, Eigen::Index output,
                          std::size_t channel) {
  Recording left;
  left.channels.resize(1);
  left.channels.front().minimum = -std::numeric_limits<double>::infinity();
  left.channels.front().maximum = std::numeric_limits<double>::infinity();
  for (std::size_t g = 0; g < run.segments(); ++g)
    for (std::size_t i = 0; i < run.segment; ++i) {
      const std::size_t k = run.restarts[g] + i;
      left.time.push_back(run.recording.time[k]);
      // The first row of a segment shows nothing of it.
      const bool shown = i > 0 && std::isfinite(run.recording.at(k, channel));
      left.values.push_back(shown ? residuals(static_cast<Eigen::Index>(k), output) : std::nan(""));
    }
  const double noise = noise_floor(left, 0);
  return noise > 0 ? noise : std::numeric_limits<double>::infinity();
}

// A start that is not a number goes on.
bool same_starts(const std::vector<double>& a, const std::vector<double>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](double x, double y) { return x == y || (std::isnan(x) && std::isnan(y)); });
}

}  // namespace

Eigen::MatrixXf settled(const SegmentedRun& run, const std::vector<Eigen::MatrixXf>& columns,
                        Eigen::MatrixXf residuals) {
  for (std::size_t g = 0; g < run.segments(); ++g) {
    const Eigen::VectorXf move = best_move(run, columns, residuals, g).cast<float>();
    for (Eigen::Index i = 0; i < move.size(); ++i)
      residuals.middleRows(static_cast<Eigen::Index>(run.restarts[g]), static_cast<Eigen::Index>(run.segment)) +=
          move[i] * rows_of(run, columns[static_cast<std::size_t>(i)], g);
  }
  return residuals;
}

std::vector<double> place_all(const SegmentModel& model, std::vector<SegmentedRun>& runs) {
  const SegmentOptions& options = model.options();
  const auto place = [&](const std::vector<double>& noise) {
    for (SegmentedRun& run : runs) model.place_starts(run, noise, model.nominal());
  };
  std::vector<double> noise = noise_of(model.sheet(), runs, options);
  place(noise);
  std::vector<double> left(noise.size(), 0);
  for (const SegmentedRun& run : runs) {
    const Eigen::MatrixXf residuals = model.residuals(model.nominal(), run, noise);
    for (std::size_t o = 0; o < noise.size(); ++o)
      left[o] += noise_beside_model(run, residuals, static_cast<Eigen::Index>(o),
                                    static_cast<std::size_t>(model.outputs()[o])) /
                 static_cast<double>(runs.size());
  }
  const std::vector<double> least = least_noise_of(model.sheet(), runs, options);
  bool changed = false;
  for (std::size_t o = 0; o < noise.size(); ++o) {
    const double own = std::max(left[o] * noise[o], least[o]);
    if (!(own < options.model_noise_ratio * noise[o])) continue;
    noise[o] = own;
    changed = true;
  }
  if (changed) place(noise);
  return noise;
}

std::vector<double> starts_of(const SegmentedRun& run) {
  std::vector<double> result;
  for (std::size_t g = 0; g < run.segments(); ++g) {
    Eigen::VectorXd start = run.starts[g];
    start.noalias() += run.start_roots[g] * run.start_shift[g];
    result.insert(result.end(), start.data(), start.data() + start.size());
  }
  return result;
}

ModelChange in_run(ModelChange change, const SegmentedRun& run) {
  if (run.ahead == 0 && run.turned == 0) return change;
  for (EffectSpec& spec : change.effects) {
    const std::optional<Swing> swing = swing_of(*find_effect_type(spec.effect));
    if (!swing) continue;
    const double by = swing->by_angle ? run.turned : run.ahead;
    double& phase = spec.parameters[swing->phase];
    phase = std::remainder(phase + swing->rate(spec.parameters[swing->frequency]) * by, kTwoPi);
  }
  return change;
}

SegmentModel::SegmentModel(const Datasheet& sheet, const SegmentOptions& options)
    : sheet_(std::make_shared<const Datasheet>(sheet)), options_(options), outputs_(compared_outputs(sheet)) {
  for (const State& state : sheet_->states) {
    const auto place = std::find(outputs_.begin(), outputs_.end(), state.channel);
    shown_by_.push_back(place == outputs_.end() ? -1 : state.channel);
    at_.push_back(static_cast<std::size_t>(place - outputs_.begin()));
  }
}

bool SegmentModel::counts(const SegmentedRun& run, std::size_t row, std::size_t output) const {
  return std::isfinite(run.recording.at(row, static_cast<std::size_t>(outputs_[output])));
}

Eigen::Index SegmentModel::directions() const {
  return std::count_if(shown_by_.begin(), shown_by_.end(), [](int channel) { return channel >= 0; });
}

void SegmentModel::place_starts(SegmentedRun& run, const std::vector<double>& noise, const ModelChange& change) const {
  const auto states = static_cast<Eigen::Index>(shown_by_.size());
  const std::vector<int> hidden = hidden_states(*this, run);
  const Eigen::Index directions = this->directions() + static_cast<Eigen::Index>(hidden.size());
  StateCourse course;
  if (!hidden.empty()) course = smooth_states(*this, change, run, noise, run.restarts);
  run.starts.assign(run.segments(), Eigen::VectorXd::Constant(states, std::nan("")));
  run.start_roots.assign(run.segments(), Eigen::MatrixXd::Zero(states, directions));
  run.start_shift.assign(run.segments(), Eigen::VectorXd::Zero(directions));
  const std::size_t widest = widest_window(run, options_);
  std::vector<EffectSpec> specs = nominal_effects(*sheet_);
  specs.insert(specs.end(), change.effects.begin(), change.effects.end());
  const EffectSet effects(*sheet_, specs, run.period, 1);
  std::vector<const EffectChain*> chains(shown_by_.size(), nullptr);
  for (const Port& port : sheet_->ports)
    for (std::size_t s = 0; port.kind == PortKind::sensor && !port.channel.empty() && s < chains.size(); ++s)
      if (sheet_->channel(port.channel) == shown_by_[s] && !effects.at(port.name).empty())
        chains[s] = &effects.at(port.name);
  auto stretch = run.stretches.begin();
  for (std::size_t g = 0; g < run.segments(); ++g) {
    while (run.restarts[g] >= stretch->last) ++stretch;
    Eigen::Index direction = 0;
    for (Eigen::Index s = 0; s < states; ++s) {
      const auto state = static_cast<std::size_t>(s);
      if (shown_by_[state] < 0) continue;
      const double sigma = noise[at_[state]];
      const Smoothed start = smoothed(run.recording, run.restarts[g], static_cast<std::size_t>(shown_by_[state]),
                                      stretch->first, stretch->last, sigma, widest, options_);
      run.starts[g][s] = start.value;
      if (!std::isnan(start.value)) {
        const auto shown = [&](double later) {
          return shown_around(run, run.recording, run.restarts[g], static_cast<std::size_t>(shown_by_[state]), sigma,
                              later, options_);
        };
        const double undone = chains[state] ? chains[state]->resume(shown, 0, std::nan(""), std::nan("")).std : 0;
        run.start_roots[g](s, direction) =
            std::max(options_.start_prior_sigma * std::max(sigma, std::isnan(undone) ? 0 : undone), start.std);
      }
      ++direction;
    }
    if (!hidden.empty()) place_hidden(run, g, course.mean[g], course.covariance[g], hidden, direction);
  }
}

// The root of their part of the covariance; nothing where the smoother's model left all bounds.
void SegmentModel::place_hidden(SegmentedRun& run, std::size_t segment, const Eigen::VectorXd& mean,
                                const Eigen::MatrixXd& covariance, const std::vector<int>& hidden,
                                Eigen::Index direction) const {
  const auto n = static_cast<Eigen::Index>(hidden.size());
  Eigen::MatrixXd own(n, n);
  for (Eigen::Index a = 0; a < n; ++a)
    for (Eigen::Index b = 0; b < n; ++b)
      own(a, b) = covariance(hidden[static_cast<std::size_t>(a)], hidden[static_cast<std::size_t>(b)]);
  const Eigen::LLT<Eigen::MatrixXd> factor(own);
  if (!mean.allFinite() || !own.allFinite() || factor.info() != Eigen::Success) return;
  const Eigen::MatrixXd root = factor.matrixL();
  for (Eigen::Index a = 0; a < n; ++a) {
    const int state = hidden[static_cast<std::size_t>(a)];
    run.starts[segment][state] = mean[state];
    run.start_roots[segment].row(state).segment(direction, n) = options_.start_prior_sigma * root.row(a);
  }
}

std::vector<double> SegmentModel::shown_states(const SegmentedRun& run, std::size_t row) const {
  std::vector<double> result;
  for (const int channel : shown_by_)
    result.push_back(channel < 0 ? std::nan("") : run.reading(row, static_cast<std::size_t>(channel)));
  return result;
}

std::unique_ptr<DrivenModel> SegmentModel::driven(const ModelChange& change, const SegmentedRun& run,
                                                  const std::vector<double>& noise, Beside beside) const {
  SimulationSetup setup;
  setup.parameters = change.parameters;
  setup.effects = in_run(change, run).effects;
  setup.sample_period = run.period;
  setup.noise = false;
  setup.long_steps = options_.long_steps;
  setup.beside = options_.beside && beside == Beside::as_asked;
  setup.rough = options_.rough;
  auto model = std::make_unique<DrivenModel>(sheet_, setup);
  model->set_around(
      [this, &run, noise](const Recording& recording, std::size_t row, std::size_t channel, double later) {
        const auto output = std::find(outputs_.begin(), outputs_.end(), static_cast<int>(channel)) - outputs_.begin();
        const double own = output < static_cast<std::ptrdiff_t>(outputs_.size())
                               ? noise[static_cast<std::size_t>(output)]
                               : noise_of(sheet_->channels[channel], options_);
        return shown_around(run, recording, row, channel, own, later, options_);
      });
  return model;
}

double SegmentModel::largest_residual(std::size_t output, double sigma) const {
  const Channel& channel = sheet_->channels[static_cast<std::size_t>(outputs_[output])];
  const double range = (channel.maximum - channel.minimum) / sigma;
  return std::isfinite(range) ? std::max(options_.largest_residual_sigma, range) : options_.largest_residual_sigma;
}

std::vector<Eigen::MatrixXf> SegmentModel::simulate(const std::vector<Variant>& variants, const Models& models,
                                                    const SegmentedRun& run, const std::vector<std::size_t>& restarts,
                                                    const std::vector<double>& sigma, Restarted restarted,
                                                    const Enough& enough) const {
  DrivenModel& driven = *models.front();
  std::vector<Eigen::MatrixXf> results(models.size(),
                                       Eigen::MatrixXf::Zero(static_cast<Eigen::Index>(run.recording.rows()),
                                                             static_cast<Eigen::Index>(outputs_.size())));
  struct Compared {
    std::size_t channel;
    double minimum, maximum, per_sigma, largest;
    const double* unsmoothed;  // null: what the recording holds
    std::ptrdiff_t begin;      // of its residuals in a result
  };
  std::vector<Compared> compared;
  for (std::size_t i = 0; i < outputs_.size(); ++i) {
    const auto c = static_cast<std::size_t>(outputs_[i]);
    const Channel& channel = sheet_->channels[c];
    compared.push_back({c, channel.minimum, channel.maximum, 1 / sigma[i], largest_residual(i, sigma[i]),
                        run.unsmoothed[c].empty() ? nullptr : run.unsmoothed[c].data(),
                        static_cast<Eigen::Index>(i) * results.front().rows()});
  }
  const auto compare = [&](std::size_t row, const double* channels, float* result) {
    const double* const measured = run.recording.row(row);
    for (const Compared& one : compared) {
      if (!std::isfinite(measured[one.channel])) continue;  // as counts() says
      const double reading = one.unsmoothed ? one.unsmoothed[row] : measured[one.channel];
      const double r = (std::clamp(reading, one.minimum, one.maximum) -
                        std::clamp(channels[one.channel], one.minimum, one.maximum)) *
                       one.per_sigma;
      result[one.begin + static_cast<std::ptrdiff_t>(row)] =
          static_cast<float>(std::isfinite(r) ? std::clamp(r, -one.largest, one.largest) : one.largest);
    }
  };
  // A state that no start puts back goes on as well, and is what the effects before have made of it.
  const std::vector<double>& starts = variants.front().starts;
  const bool goes_on = std::any_of(starts.begin(), starts.end(), [](double value) { return std::isnan(value); });
  const bool remembers = std::any_of(models.begin(), models.end(), [](const auto& m) { return m->remembers(); });
  const std::size_t lead = goes_on || remembers ? 0 : run.lead;
  std::vector<char> alike;  // as the first moves
  for (std::size_t i = 0; i < models.size(); ++i)
    alike.push_back(same_starts(variants[i].starts, starts) && models[i]->moves_as(driven));
  auto restart = restarts.begin();
  bool ended = false;
  // From a restart on, of which `own` follow without a break; `ahead` rows before it fill memories.
  const auto run_on = [&](const std::vector<std::size_t>& own, std::size_t first, std::size_t last, std::size_t ahead) {
    std::vector<std::size_t> rows = own;
    std::vector<std::vector<double>> led;
    std::vector<DrivenModel::Beside> beside;
    if (ahead > 0) rows.insert(rows.begin(), own.front() - ahead);
    for (std::size_t i = 0; i < models.size(); ++i) {
      const double* from = &variants[i].starts[first];
      if (ahead > 0) {
        led.push_back(shown_states(run, rows.front()));
        led.back().insert(led.back().end(), from, from + own.size() * shown_by_.size());
        from = led.back().data();
      }
      beside.push_back({models[i].get(), from, alike[i] != 0});
    }
    const double* const leader = beside.front().start_states;
    beside.erase(beside.begin());
    auto next = rows.begin() + 1;
    bool shows_the_last = false;
    driven.run(run.recording, rows.front(), last - rows.front(), rows, leader, beside,
               [&](std::size_t k, std::size_t which, const double* channels) {
                 if (which == 0) {
                   const bool restarts_here = next != rows.end() && *next == k;
                   shows_the_last = restarts_here || (lead > 0 && k == rows.front());
                   next += restarts_here;
                 }
                 if (k < own.front()) return true;
                 if (!(shows_the_last && restarted == Restarted::left_out)) compare(k, channels, results[which].data());
                 if (which == 0) ended = enough && enough(k, results.front());
                 return !ended;
               });
  };
  for (const Stretched& stretch : run.stretches) {
    // What follows a lead is as it would be without.
    const auto ends = std::find_if(restart, restarts.end(), [&](std::size_t k) { return k >= stretch.last; });
    if (restart == ends) continue;
    restart += std::min<std::ptrdiff_t>(static_cast<std::ptrdiff_t>(lead), ends - restart - 1);
    while (restart != ends && !ended) {
      const std::size_t first = static_cast<std::size_t>(restart - restarts.begin()) * shown_by_.size();
      std::vector<std::size_t> own{*restart++};
      while (restart != ends && !(run.parted && *restart > own.back() + run.segment)) own.push_back(*restart++);
      const std::size_t ahead = run.parted && (remembers || goes_on) ? options_.ahead_segments * run.segment : 0;
      run_on(own, first, run.parted ? std::min(stretch.last, own.back() + run.segment) : stretch.last,
             std::min(ahead, own.front() - stretch.first));
    }
    if (ended) return results;
  }
  for (std::size_t i = 0; i < models.size(); ++i) read_held_values(*variants[i].change, run, sigma, results[i]);
  return results;
}

std::vector<SegmentModel::Held> SegmentModel::held_readings(const ModelChange& change, const SegmentedRun& run) const {
  std::vector<Held> result;
  for (const EffectSpec& spec : change.effects) {
    if (spec.effect != "stuck" || sheet_->port(spec.port).kind != PortKind::sensor) continue;
    const int channel = sheet_->channel(sheet_->port(spec.port).channel);
    const auto output = std::find(outputs_.begin(), outputs_.end(), channel) - outputs_.begin();
    if (output == static_cast<std::ptrdiff_t>(outputs_.size())) continue;
    const double from = spec.parameters.front() + run.recording.time.front();
    const auto first = std::lower_bound(run.recording.time.begin(), run.recording.time.end(), from);
    Held held{static_cast<std::size_t>(output), static_cast<std::size_t>(first - run.recording.time.begin()), 0};
    double count = 0;
    for (const Stretched& part : run.parted ? parts_of(run) : run.stretches)
      for (std::size_t k = std::max(held.first, part.first); k < part.last; ++k)
        if (counts(run, k, held.output)) {
          held.value += run.reading(k, static_cast<std::size_t>(channel));
          count += 1;
        }
    if (count == 0) continue;
    held.value /= count;
    result.push_back(held);
  }
  return result;
}

void SegmentModel::read_held_values(const ModelChange& change, const SegmentedRun& run,
                                    const std::vector<double>& sigma, Eigen::MatrixXf& residuals) const {
  for (const Held& held : held_readings(change, run)) {
    const double largest = largest_residual(held.output, sigma[held.output]);
    for (std::size_t k = held.first; k < run.recording.rows(); ++k)
      if (counts(run, k, held.output)) {
        const double r =
            (run.reading(k, static_cast<std::size_t>(outputs_[held.output])) - held.value) / sigma[held.output];
        residuals(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(held.output)) =
            static_cast<float>(std::clamp(r, -largest, largest));
      }
  }
}

Eigen::MatrixXf SegmentModel::residuals(const ModelChange& change, const SegmentedRun& run,
                                        const std::vector<double>& sigma) const {
  return residuals(change, run, sigma, Enough());
}

Eigen::MatrixXf SegmentModel::residuals(const ModelChange& change, const SegmentedRun& run,
                                        const std::vector<double>& sigma, const Enough& enough) const {
  Models models;
  models.push_back(driven(change, run, sigma));
  return std::move(
      simulate({{&change, starts_of(run)}}, models, run, run.restarts, sigma, Restarted::left_out, enough).front());
}

std::vector<Eigen::MatrixXf> SegmentModel::residuals(const std::vector<Variant>& variants, const SegmentedRun& run,
                                                     const std::vector<double>& sigma, int jobs, Beside beside) const {
  Models models(variants.size());
  std::vector<std::vector<std::size_t>> groups;  // that run together, after the first
  std::vector<std::size_t> light, heavy;         // beside it; heavy: what remembers needs the lead of the run
  for (std::size_t i = 0; i < variants.size(); ++i) {
    models[i] = driven(*variants[i].change, run, sigma, beside);
    if (i == 0) continue;
    if (!models[i]->goes_beside(*models.front()))
      groups.push_back({i});
    else if (models[i]->remembers())
      heavy.push_back(i);
    else
      light.push_back(i);
  }
  const std::size_t parts = static_cast<std::size_t>(idle_threads(jobs));
  for (const std::vector<std::size_t>* others : {&heavy, &light})
    for (std::size_t part = 0; part < parts; ++part) {
      std::vector<std::size_t> group{0};
      for (std::size_t i = part; i < others->size(); i += parts) group.push_back((*others)[i]);
      if (group.size() > 1 || (others == &light && part + 1 == parts)) groups.push_back(std::move(group));
    }
  std::reverse(groups.begin(), groups.end());  // the longest first
  std::vector<Eigen::MatrixXf> results(variants.size());
  in_parallel(groups.size(), jobs, [&](std::size_t g) {
    std::vector<Variant> own;
    Models together;
    for (const std::size_t i : groups[g]) {
      own.push_back(variants[i]);
      together.push_back(i == 0 ? driven(*variants[0].change, run, sigma, beside) : std::move(models[i]));
    }
    std::vector<Eigen::MatrixXf> found = simulate(own, together, run, run.restarts, sigma, Restarted::left_out, {});
    // Every group that the first leads has its own; one tells.
    for (std::size_t k = g > 0 && groups[g][0] == 0 ? 1 : 0; k < found.size(); ++k)
      results[groups[g][k]] = std::move(found[k]);
  });
  return results;
}

Eigen::MatrixXf SegmentModel::residuals(const ModelChange& change, const SegmentedRun& run,
                                        const std::vector<double>& noise, std::size_t horizon) const {
  SegmentedRun cut = run;
  cut.restarts.clear();
  for (const Stretched& stretch : run.stretches)
    for (std::size_t k = stretch.first; k < stretch.last; k += horizon) cut.restarts.push_back(k);
  place_starts(cut, noise, change);
  Models models;
  models.push_back(driven(change, cut, noise));
  return std::move(
      simulate({{&change, starts_of(cut)}}, models, cut, cut.restarts, noise, Restarted::counted, {}).front());
}

std::vector<Eigen::MatrixXf> SegmentModel::start_columns(const ModelChange& change, const SegmentedRun& run,
                                                         const std::vector<double>& sigma, int jobs,
                                                         const std::vector<ModelChange>& memories) const {
  const double step = options_.start_difference_sigma;
  std::vector<Variant> variants{{&change, starts_of(run)}};
  const std::size_t states = shown_by_.size();
  for (Eigen::Index i = 0; i < run.start_shift.front().size(); ++i) {
    variants.push_back(variants.front());
    for (std::size_t g = 0; g < run.segments(); ++g)
      Eigen::Map<Eigen::VectorXd>(&variants.back().starts[g * states], static_cast<Eigen::Index>(states)) +=
          step * run.start_roots[g].col(i);
  }
  const std::size_t shifts = variants.size();
  for (const ModelChange& memory : memories) variants.push_back({&memory, variants.front().starts});
  std::vector<Eigen::MatrixXf> result = residuals(variants, run, sigma, jobs);
  for (std::size_t i = 1; i < result.size(); ++i)
    result[i] = (result[i] - result[0]) / static_cast<float>(i < shifts ? step : 1);
  result.erase(result.begin());
  return result;
}

std::vector<Eigen::MatrixXf> SegmentModel::settle(const ModelChange& change, SegmentedRun& run,
                                                  const std::vector<double>& sigma, std::vector<Eigen::MatrixXf> known,
                                                  int jobs) const {
  const Eigen::MatrixXf before = residuals(change, run, sigma);
  std::vector<Eigen::MatrixXf> columns = known.empty() ? start_columns(change, run, sigma, jobs) : std::move(known);
  const double largest = options_.start_shift_limit_sigma;
  const std::vector<Eigen::VectorXd> old = run.start_shift;
  for (std::size_t g = 0; g < run.segments(); ++g)
    run.start_shift[g] = (old[g] + best_move(run, columns, before, g)).cwiseMax(-largest).cwiseMin(largest);
  const auto cost = [&run](const Eigen::MatrixXf& left, std::size_t g) {
    return static_cast<double>(rows_of(run, left, g).squaredNorm()) + run.start_shift[g].squaredNorm();
  };
  const Eigen::MatrixXf after = residuals(change, run, sigma);
  std::vector<double> least(run.segments());
  std::vector<Eigen::VectorXd> best = run.start_shift;
  bool far = false;
  for (std::size_t g = 0; g < run.segments(); ++g) {
    least[g] = cost(after, g);
    run.start_shift[g] = old[g];
    if (const double kept = cost(before, g); !(least[g] < kept)) {
      best[g] = old[g];
      least[g] = kept;
    }
    far |= (best[g].array().abs() > kFarStart).any();
  }
  if (far) {  // what shifted it may be gone, and no step leads back
    for (Eigen::VectorXd& shift : run.start_shift) shift.setZero();
    const Eigen::MatrixXf as_read = residuals(change, run, sigma);
    bool back = false;
    for (std::size_t g = 0; g < run.segments(); ++g) {
      if (!(cost(as_read, g) < least[g])) continue;
      best[g].setZero();
      back = true;
    }
    run.start_shift = std::move(best);
    return back ? start_columns(change, run, sigma, jobs) : columns;
  }
  run.start_shift = std::move(best);
  return columns;
}

}  // namespace faultline
