#include "faultline/gap/stochastic_model.h"

#include <algorithm>
#include <cmath>

#include "faultline/numerics/in_parallel.h"
#include "faultline/segments/propagation.h"
#include "faultline/segments/smoothing.h"

namespace faultline {
namespace {

constexpr std::size_t kStepsPerSegment = 50;  // resolves what a segment shows at a fraction of the samples' cost
constexpr std::size_t kMostSegments = 160;    // of all runs: levels and places show in these
// ... and fewer of a model with more states than this: a filter's effort grows with their cube, a model's passes with
// their number.
constexpr std::size_t kMostStates = 12, kLeastSegments = 48;
constexpr std::size_t kPieceSegments = 8;  // of neighbours, so that memories fill
constexpr double kPortFraction = 1e-4;     // of a port's range: a free signal's size for differences
constexpr double kWidest = 0.1;            // of a state's size: farther off a rig may be another one
constexpr double kNothing = 1e-300;        // a size that changes nothing; an effect of size 0 is not there
constexpr double kLeastResponse = 1e-9;    // of a state's size, below which a port moves nothing
constexpr double kAddedStep = 1e-5;        // of the size of a state that an effect added, for differences
constexpr double kLeastAddedStep = 1e-9;   // where it has none
constexpr int kUnitAttempts = 6;           // to find a port's unit, each four decades up at most
constexpr const char* kFree = "free_signal";

// What a pass with restarts at every row of a stretch leaves, rows x quantity.
struct Pass {
  Eigen::MatrixXd ended;    // states where the step from the row before ended; row 0: NaN
  Eigen::MatrixXd seen;     // outputs there, as the sensors show them
  Eigen::MatrixXd outputs;  // outputs at the reference before sensors
  Eigen::MatrixXd passed;   // what passed the port of an extra effect
};

// States of the process beside the rig's own, after them. A state that is shown by a sensor with a memory which what
// goes in and comes out says: the sensor's output is the state then, and what is behind it another one. Undone row by
// row instead, from the slope of what is shown, the position behind a slow sensor would say nothing of the velocity.
// And states that effects brought in, as what they are off from rest: left to go on along the recording, the load
// behind a play would not move with the piston.
struct HiddenStates {
  std::vector<Eigen::Index> behind;  // of the rig's states
  Eigen::Index added = 0;
  Eigen::Index count() const { return static_cast<Eigen::Index>(behind.size()) + added; }
};

HiddenStates hidden_states(const ResidualModel& residuals, const ModelChange& change) {
  const SegmentModel& model = residuals.model();
  HiddenStates result;
  for (const EffectSpec& effect : change.effects) {
    const Port& port = model.sheet().port(effect.port);
    if (port.kind != PortKind::sensor || !find_effect_type(effect.effect)->make()->resumes_by_values()) continue;
    const auto& shown = model.shown_by();
    const auto found = std::find(shown.begin(), shown.end(), model.sheet().channel(port.channel));
    const auto state = static_cast<Eigen::Index>(found - shown.begin());
    std::vector<Eigen::Index>& behind = result.behind;
    if (found != shown.end() && std::find(behind.begin(), behind.end(), state) == behind.end()) behind.push_back(state);
  }
  const auto driven = model.driven(change, residuals.runs().front(), residuals.noise());
  result.added = static_cast<Eigen::Index>(driven->added_count());
  return result;
}

// difference_steps() of all states.
Eigen::VectorXd steps_of(const Datasheet& sheet, const Eigen::VectorXd& size, const HiddenStates& hidden) {
  const Eigen::Index own = size.size() - hidden.count();
  Eigen::VectorXd steps(size.size());
  steps.head(own) = difference_steps(sheet, size.head(own));
  for (std::size_t b = 0; b < hidden.behind.size(); ++b)
    steps[own + static_cast<Eigen::Index>(b)] = steps[hidden.behind[b]];
  for (Eigen::Index a = own + hidden.count() - hidden.added; a < size.size(); ++a)
    steps[a] = std::max(kAddedStep * size[a], kLeastAddedStep);
  return steps;
}

// What is run ahead of a stretch, which may begin anywhere in its run, so that the memories of effects fill: from a
// segment's start on, put back at each. `all` of the run before it: where states go on from the rig's own start.
struct Ahead {
  std::vector<std::size_t> restarts;
  std::vector<double> starts;
};

Ahead ahead_of(const SegmentModel& model, const SegmentedRun& run, std::size_t first, bool remembers, bool all) {
  Ahead result;
  if (!all && !remembers) return result;
  const std::vector<double> starts = starts_of(run);
  const Stretched& within =
      *std::find_if(run.stretches.begin(), run.stretches.end(), [&](const Stretched& s) { return first < s.last; });
  const std::size_t most = model.options().ahead_segments * run.segment, states = model.shown_by().size();
  for (std::size_t g = 0; g < run.segments() && run.restarts[g] < first; ++g) {
    if (run.restarts[g] < within.first || (!all && run.restarts[g] + most < first)) continue;
    result.restarts.push_back(run.restarts[g]);
    const auto own = starts.begin() + static_cast<std::ptrdiff_t>(g * states);
    result.starts.insert(result.starts.end(), own, own + static_cast<std::ptrdiff_t>(states));
  }
  return result;
}

class Passes {
 public:
  Passes(const ResidualModel& residuals, const ModelChange& change)
      : residuals_(residuals), change_(change), hidden_(hidden_states(residuals, change)) {}

  Pass run(const StochasticStretch& stretch, const Eigen::VectorXd& offset, const EffectSpec* extra) const {
    const SegmentModel& model = residuals_.model();
    const SegmentedRun& run = residuals_.runs()[stretch.run];
    ModelChange change = change_;
    if (extra) change.effects.push_back(*extra);
    const auto driven = model.driven(change, run, residuals_.noise());
    const auto states = static_cast<Eigen::Index>(model.shown_by().size());
    const auto rows = static_cast<Eigen::Index>(stretch.rows.size());
    const auto outputs = static_cast<Eigen::Index>(model.outputs().size());
    const Ahead ahead = ahead_of(model, run, stretch.rows.front(), driven->remembers(), false);
    std::vector<std::size_t> restarts = ahead.restarts;
    restarts.insert(restarts.end(), stretch.rows.begin(), stretch.rows.end());
    std::vector<double> starts = ahead.starts, hidden;
    for (const Eigen::VectorXd& x : stretch.reference)
      for (Eigen::Index s = 0; s < states; ++s) starts.push_back(x[s] + offset[s]);
    // A signal in a line or a transmission may bring states of its own: then these go on.
    const auto hides = static_cast<Eigen::Index>(hidden_.behind.size()), first = states + hides;
    const bool same = static_cast<Eigen::Index>(driven->added_count()) == hidden_.added;
    if (same && hidden_.count() > 0) {
      const auto width = static_cast<std::size_t>(states + hidden_.added);
      hidden.assign(restarts.size() * width, std::nan(""));
      for (std::size_t i = 0; i < stretch.rows.size(); ++i) {
        const Eigen::VectorXd x = stretch.reference[i] + offset;
        double* known = &hidden[(ahead.restarts.size() + i) * width];
        for (Eigen::Index b = 0; b < hides; ++b) known[hidden_.behind[static_cast<std::size_t>(b)]] = x[states + b];
        for (Eigen::Index a = 0; a < hidden_.added; ++a) known[states + a] = x[first + a];
      }
    }
    driven->set_hidden(std::move(hidden));
    Pass pass{Eigen::MatrixXd::Constant(rows, stretch.reference.front().size(), std::nan("")),
              Eigen::MatrixXd::Zero(rows, outputs),
              Eigen::MatrixXd::Zero(rows, outputs),
              {}};
    if (extra) pass.passed.resize(rows, kMostPassing);
    std::vector<double> bare(model.sheet().channels.size());
    Eigen::Index at = 0;
    const std::size_t from = restarts.front();
    driven->run(run.recording, from, stretch.rows.back() - from + 1, restarts, starts.data(),
                [&](std::size_t k, const double* channels) {
                  if (at == rows || k != stretch.rows[static_cast<std::size_t>(at)]) return;
                  driven->outputs(bare.data());
                  for (Eigen::Index o = 0; o < outputs; ++o) {
                    const auto c = static_cast<std::size_t>(model.outputs()[static_cast<std::size_t>(o)]);
                    pass.seen(at, o) = channels[c];
                    pass.outputs(at, o) = bare[c];
                  }
                  for (Eigen::Index s = 0; at > 0 && s < states; ++s) {
                    const int shown = model.shown_by()[static_cast<std::size_t>(s)];
                    pass.ended(at, s) = shown < 0 ? driven->ended()[s] : channels[shown];
                  }
                  for (Eigen::Index b = 0; at > 0 && b < hides; ++b)
                    pass.ended(at, states + b) = driven->ended()[hidden_.behind[static_cast<std::size_t>(b)]];
                  for (Eigen::Index a = 0; at > 0 && a < hidden_.added; ++a)
                    pass.ended(at, first + a) = same ? driven->ended()[states + a] : 0;
                  if (extra) {
                    const Passed passed = driven->passed(extra->port);
                    for (std::size_t p = 0; p < kMostPassing; ++p)
                      pass.passed(at, static_cast<Eigen::Index>(p)) = passed[p];
                  }
                  ++at;
                });
    return pass;
  }

 private:
  const ResidualModel& residuals_;
  const ModelChange& change_;
  const HiddenStates hidden_;
};

// Rows of neighbouring segments: all of a run, or of a long one evenly spread pieces, `most` segments in all.
std::vector<Stretched> pieces_of(const SegmentedRun& run, std::size_t most) {
  const bool whole = run.segments() <= most;
  std::vector<Stretched> pieces;
  for (const std::size_t row : run.restarts) {
    const bool follows = !pieces.empty() && row == pieces.back().last &&
                         (whole || pieces.back().last - pieces.back().first < kPieceSegments * run.segment);
    if (!follows) pieces.push_back({row, row});
    pieces.back().last = row + run.segment;
  }
  if (whole) return pieces;
  std::vector<Stretched> some;
  const std::size_t wanted = std::min(pieces.size(), most / kPieceSegments);
  for (std::size_t i = 0; i < wanted; ++i) some.push_back(pieces[(2 * i + 1) * pieces.size() / (2 * wanted)]);
  return some;
}

// States along a stretch: what channels show without their noise, the rest as the model has them within its segments.
void place_reference(const ResidualModel& residuals, const ModelChange& change, StochasticStretch& stretch) {
  const SegmentModel& model = residuals.model();
  const SegmentedRun& run = residuals.runs()[stretch.run];
  const auto states = static_cast<Eigen::Index>(model.shown_by().size());
  const Stretched& within = *std::find_if(run.stretches.begin(), run.stretches.end(),
                                          [&](const Stretched& s) { return stretch.rows.front() < s.last; });
  const HiddenStates hidden = hidden_states(residuals, change);
  const auto driven = model.driven(change, run, residuals.noise());
  const std::vector<double> all = starts_of(run);
  const bool goes_on = std::any_of(all.begin(), all.end(), [](double value) { return std::isnan(value); });
  Ahead ahead = ahead_of(model, run, stretch.rows.front(), driven->remembers(), goes_on);
  std::vector<std::size_t>& restarts = ahead.restarts;
  std::vector<double>& starts = ahead.starts;
  for (std::size_t g = 0; g < run.segments(); ++g) {
    if (run.restarts[g] < stretch.rows.front() || run.restarts[g] > stretch.rows.back()) continue;
    restarts.push_back(run.restarts[g]);
    for (Eigen::Index s = 0; s < states; ++s) starts.push_back(all[g * static_cast<std::size_t>(states) + s]);
  }
  stretch.reference.assign(stretch.rows.size(), Eigen::VectorXd::Zero(states + hidden.count()));
  std::size_t at = 0;
  const std::size_t from = restarts.front();
  driven->run(run.recording, from, stretch.rows.back() - from + 1, restarts, starts.data(),
              [&](std::size_t k, const double*) {
                if (at == stretch.rows.size() || k != stretch.rows[at]) return;
                Eigen::VectorXd& x = stretch.reference[at++];
                for (Eigen::Index s = 0; s < states; ++s) x[s] = driven->state()[s];
                Eigen::Index next = states;
                for (const Eigen::Index shown : hidden.behind) x[next++] = x[shown];
                driven->added(x.data() + next);
              });
  const std::size_t widest = run.segment / 10;
  for (Eigen::Index s = 0; s < states; ++s) {
    const int channel = model.shown_by()[static_cast<std::size_t>(s)];
    if (channel < 0) continue;
    const auto output = static_cast<std::size_t>(std::find(model.outputs().begin(), model.outputs().end(), channel) -
                                                 model.outputs().begin());
    double last = std::nan("");
    for (std::size_t i = 0; i < stretch.rows.size(); ++i) {
      const double value = smoothed(run.recording, stretch.rows[i], static_cast<std::size_t>(channel), within.first,
                                    within.last, residuals.noise()[output], widest, model.options())
                               .value;
      if (std::isfinite(value)) last = value;
      if (std::isfinite(last)) stretch.reference[i][s] = last;
    }
  }
}

// `known`: sigma, in sizes; without it F is taken over steps too small for C.
void linearise(const ResidualModel& residuals, const ModelChange& change, const Eigen::VectorXd& known, int jobs,
               StochasticModel& model) {
  const SegmentModel& segments = residuals.model();
  const Datasheet& sheet = segments.sheet();
  const auto states = model.size.size();
  const auto outputs = static_cast<Eigen::Index>(segments.outputs().size());
  const Passes passes(residuals, change);
  const auto count = static_cast<std::size_t>(states);
  const bool wide = known.size() > 0;
  const std::size_t all = 1 + (wide ? 2 : 1) * count;
  std::vector<Pass> done(all * model.stretches.size());
  const Eigen::VectorXd none = Eigen::VectorXd::Zero(states);
  Eigen::VectorXd moves = steps_of(sheet, model.size, hidden_states(residuals, change));
  if (wide) moves = moves.cwiseMax(known.cwiseMin(kWidest).cwiseProduct(model.size));
  in_parallel(done.size(), jobs, [&](std::size_t i) {
    const StochasticStretch& stretch = model.stretches[i / all];
    const std::size_t which = i % all;
    Eigen::VectorXd offset = none;
    if (which > 0) {
      const auto s = static_cast<Eigen::Index>((which - 1) % count);
      offset[s] = which > count ? -moves[s] : moves[s];
    }
    done[i] = passes.run(stretch, offset, nullptr);
  });
  for (std::size_t n = 0; n < model.stretches.size(); ++n) {
    StochasticStretch& stretch = model.stretches[n];
    const SegmentedRun& run = residuals.runs()[stretch.run];
    const Pass& base = done[n * all];
    const std::size_t rows = stretch.rows.size();
    stretch.f.assign(rows - 1, Eigen::MatrixXd::Zero(states, states));
    stretch.h.assign(rows, Eigen::MatrixXd::Zero(outputs, states));
    stretch.defect.assign(rows - 1, Eigen::VectorXd::Zero(states));
    stretch.bend.assign(rows - 1, Eigen::VectorXd::Zero(states));
    stretch.misfit.assign(rows, Eigen::VectorXd::Constant(outputs, std::nan("")));
    stretch.lost.assign(rows - 1, 0);
    for (std::size_t i = 0; i + 1 < rows; ++i) {
      const auto next = static_cast<Eigen::Index>(i + 1);
      stretch.defect[i] = (base.ended.row(next).transpose() - stretch.reference[i + 1]).cwiseQuotient(model.size);
      for (Eigen::Index s = 0; s < states; ++s) {
        const std::size_t pass = n * all + 1 + static_cast<std::size_t>(s);
        const Eigen::VectorXd up =
            (done[pass].ended.row(next) - base.ended.row(next)).transpose().cwiseQuotient(model.size);
        if (!wide) {
          stretch.f[i].col(s) = up * (model.size[s] / moves[s]);
          continue;
        }
        const Eigen::VectorXd down =
            (done[pass + count].ended.row(next) - base.ended.row(next)).transpose().cwiseQuotient(model.size);
        stretch.f[i].col(s) = (up - down) * (0.5 * model.size[s] / moves[s]);
        stretch.bend[i] += (0.5 * (up + down)).cwiseAbs2();
      }
      if (stretch.f[i].allFinite() && stretch.defect[i].allFinite()) continue;
      stretch.lost[i] = 1;
      stretch.f[i].setZero();
      stretch.defect[i].setZero();
      stretch.bend[i].setZero();
    }
    std::vector<SegmentModel::Held> held(segments.outputs().size(), {0, run.recording.rows(), 0});
    for (const SegmentModel::Held& one : segments.held_readings(change, run)) held[one.output] = one;
    for (std::size_t i = 0; i < rows; ++i) {
      const auto at = static_cast<Eigen::Index>(i);
      for (Eigen::Index o = 0; o < outputs; ++o) {
        const auto c = segments.outputs()[static_cast<std::size_t>(o)];
        const double noise = residuals.noise()[static_cast<std::size_t>(o)];
        const auto shown = std::find(segments.shown_by().begin(), segments.shown_by().end(), c);
        const double y = run.reading(stretch.rows[i], static_cast<std::size_t>(c));
        const bool counts = measures(sheet.channels[static_cast<std::size_t>(c)], y);
        const SegmentModel::Held& stuck = held[static_cast<std::size_t>(o)];
        if (stretch.rows[i] >= stuck.first) {  // it shows no state
          if (counts) stretch.misfit[i][o] = (y - stuck.value) / noise;
          continue;
        }
        if (shown != segments.shown_by().end()) {
          const auto s = shown - segments.shown_by().begin();
          stretch.h[i](o, s) = model.size[s] / noise;
          if (counts) stretch.misfit[i][o] = (y - stretch.reference[i][s]) / noise;
          continue;
        }
        for (Eigen::Index s = 0; s < states; ++s)
          stretch.h[i](o, s) = (done[n * all + 1 + static_cast<std::size_t>(s)].outputs(at, o) - base.outputs(at, o)) /
                               moves[s] * model.size[s] / noise;
        if (!stretch.h[i].row(o).allFinite()) {
          stretch.h[i].row(o).setZero();
          continue;
        }
        // seen() belongs to where the step before ended.
        if (counts && i > 0)
          stretch.misfit[i][o] = (y - base.seen(at, o)) / noise + stretch.h[i].row(o).dot(stretch.defect[i - 1]);
      }
    }
  }
}

EffectSpec free_signal(const std::string& port, double value) {
  EffectSpec spec;
  spec.effect = kFree;
  spec.port = port;
  spec.parameters = {value};
  return spec;
}

// An effect in a line or a transmission brings bodies and volumes of its own, of whatever size it is: they are there
// without the signal too. `bare`: the pass without an effect.
Pass without_signal(const Passes& passes, const StochasticStretch& stretch, const Pass& bare, const std::string& port) {
  const PortKind kind = port_kind(port);
  if (kind != PortKind::line && kind != PortKind::transmission) return bare;
  const EffectSpec nothing = free_signal(port, kNothing);
  return passes.run(stretch, Eigen::VectorXd::Zero(stretch.reference.front().size()), &nothing);
}

// What a free signal of kPortFraction of its unit does in every step.
void drive_ports(const ResidualModel& residuals, const ModelChange& change, int jobs, StochasticModel& model) {
  const Passes passes(residuals, change);
  const Eigen::VectorXd none = Eigen::VectorXd::Zero(model.size.size());
  for (StochasticStretch& stretch : model.stretches) {
    const Pass bare = passes.run(stretch, none, nullptr);
    stretch.port_drives.assign(model.ports.size(), {});
    in_parallel(model.ports.size(), jobs, [&](std::size_t p) {
      if (model.shows[p] >= 0) return;
      const Pass base = without_signal(passes, stretch, bare, model.ports[p]);
      const EffectSpec signal = free_signal(model.ports[p], kPortFraction * model.unit[p]);
      const Pass moved = passes.run(stretch, none, &signal);
      Eigen::MatrixXd drive(model.size.size(), moved.ended.rows() - 1);
      for (Eigen::Index i = 0; i < drive.cols(); ++i)
        if (stretch.lost[static_cast<std::size_t>(i)])
          drive.col(i).setZero();
        else
          drive.col(i) =
              (moved.ended.row(i + 1) - base.ended.row(i + 1)).transpose().cwiseQuotient(model.size) / kPortFraction;
      if (drive.allFinite() && drive.cwiseAbs().maxCoeff() > kLeastResponse) stretch.port_drives[p] = std::move(drive);
    });
  }
}

// Ports where a free signal adds no states of its own.
void find_ports(const ResidualModel& residuals, const ModelChange& change, const std::string& only,
                StochasticModel& model) {
  const SegmentModel& segments = residuals.model();
  const Datasheet& sheet = segments.sheet();
  const SegmentedRun& run = residuals.runs().front();
  const bool before = segments.driven(change, run, residuals.noise())->remembers();
  const EffectType& type = *find_effect_type(kFree);
  for (const Port& port : sheet.ports) {
    if (!type.fits_kind(port.kind) || (!only.empty() && port.name != only)) continue;
    int shows = -1;
    double unit = 1;
    if (!port.channel.empty()) {
      const auto c = static_cast<std::size_t>(sheet.channel(port.channel));
      unit = std::max(std::abs(sheet.channels[c].minimum), std::abs(sheet.channels[c].maximum));
      const auto output = std::find(segments.outputs().begin(), segments.outputs().end(), static_cast<int>(c));
      if (port.kind == PortKind::sensor && output != segments.outputs().end())
        shows = static_cast<int>(output - segments.outputs().begin());
    }
    ModelChange with = change;
    with.effects.push_back(free_signal(port.name, kPortFraction * unit));
    if (shows < 0 && segments.driven(with, run, residuals.noise())->remembers() != before) continue;
    model.ports.push_back(port.name);
    model.shows.push_back(shows);
    model.unit.push_back(unit);
    model.shown.push_back(shows < 0 ? 0 : unit / residuals.noise()[static_cast<std::size_t>(shows)]);
  }
}

// Largest move of a state, in its size, that a free signal of `value` makes in a step of a stretch.
double response(const Passes& passes, const StochasticModel& model, const StochasticStretch& stretch, const Pass& base,
                const std::string& port, double value) {
  const EffectSpec signal = free_signal(port, value);
  const Pass moved = passes.run(stretch, Eigen::VectorXd::Zero(model.size.size()), &signal);
  double largest = 0;
  for (Eigen::Index i = 1; i < moved.ended.rows(); ++i) {
    const double here =
        (moved.ended.row(i) - base.ended.row(i)).transpose().cwiseQuotient(model.size).cwiseAbs().maxCoeff();
    if (std::isfinite(here)) largest = std::max(largest, here);
  }
  return largest;
}

// Units in which a free signal of kPortFraction moves a state by about as much of its size: well above rounding
// whatever passes the port.
void find_units(const ResidualModel& residuals, const ModelChange& change, int jobs, StochasticModel& model) {
  const Passes passes(residuals, change);
  const StochasticStretch& stretch = model.stretches.front();
  const Pass bare = passes.run(stretch, Eigen::VectorXd::Zero(model.size.size()), nullptr);
  in_parallel(model.ports.size(), jobs, [&](std::size_t p) {
    if (model.shows[p] >= 0) return;
    const Pass base = without_signal(passes, stretch, bare, model.ports[p]);
    for (int attempt = 0; attempt < kUnitAttempts; ++attempt) {
      const double moved = response(passes, model, stretch, base, model.ports[p], kPortFraction * model.unit[p]);
      const double ratio = moved > kLeastResponse ? kPortFraction / moved : 1 / kPortFraction;
      if (ratio > 0.1 && ratio < 10) break;
      model.unit[p] *= ratio;
    }
  });
}

}  // namespace

StochasticModel stochastic_model(const ResidualModel& residuals, const ModelChange& change,
                                 const std::vector<std::size_t>& runs, int jobs) {
  StochasticModel model;
  const SegmentModel& segments = residuals.model();
  const SegmentedRun* slowest = &residuals.runs()[runs.front()];
  for (const std::size_t r : runs)
    if (residuals.runs()[r].period > slowest->period) slowest = &residuals.runs()[r];
  const std::size_t strides = std::max<std::size_t>(1, slowest->segment / kStepsPerSegment);
  model.step = static_cast<double>(strides) * slowest->period;
  model.block = std::max<std::size_t>(2, slowest->segment / strides);
  const HiddenStates hidden = hidden_states(residuals, change);
  const auto states = static_cast<Eigen::Index>(segments.shown_by().size()) + hidden.count();
  const std::size_t many = std::max(kMostStates, segments.shown_by().size());
  const std::size_t most = std::max(kLeastSegments, kMostSegments * kMostStates * kMostStates / (many * many));
  for (const std::size_t r : runs) {
    const SegmentedRun& run = residuals.runs()[r];
    const auto stride = static_cast<std::size_t>(std::max(1.0, std::round(model.step / run.period)));
    for (const Stretched& piece : pieces_of(run, std::max(kPieceSegments, most / runs.size()))) {
      StochasticStretch stretch;
      stretch.run = r;
      for (std::size_t k = piece.first; k < piece.last; k += stride) stretch.rows.push_back(k);
      if (stretch.rows.size() < 3) continue;
      place_reference(residuals, change, stretch);
      model.stretches.push_back(std::move(stretch));
    }
  }
  model.size = Eigen::VectorXd::Zero(states);
  for (const StochasticStretch& stretch : model.stretches)
    for (const Eigen::VectorXd& x : stretch.reference)
      if (x.allFinite()) model.size = model.size.cwiseMax(x.cwiseAbs());
  model.size = model.size.cwiseMax(steps_of(segments.sheet(), model.size, hidden));
  linearise(residuals, change, {}, jobs, model);
  return model;
}

void move_reference(const ResidualModel& residuals, const ModelChange& change,
                    const std::vector<Eigen::MatrixXd>& shifts, const Eigen::VectorXd& known, int jobs,
                    StochasticModel& model) {
  for (std::size_t n = 0; n < model.stretches.size(); ++n)
    for (std::size_t i = 0; i < model.stretches[n].rows.size(); ++i)
      model.stretches[n].reference[i] += model.size.cwiseProduct(shifts[n].col(static_cast<Eigen::Index>(i)));
  linearise(residuals, change, known, jobs, model);
}

void open_ports(const ResidualModel& residuals, const ModelChange& change, int jobs, StochasticModel& model,
                const std::string& only) {
  find_ports(residuals, change, only, model);
  find_units(residuals, change, jobs, model);
  drive_ports(residuals, change, jobs, model);
}

std::vector<Eigen::MatrixXd> passing_along(const ResidualModel& residuals, const ModelChange& change,
                                           const StochasticModel& model, std::size_t port) {
  const Passes passes(residuals, change);
  const EffectSpec signal = free_signal(model.ports[port], kPortFraction * model.unit[port]);
  std::vector<Eigen::MatrixXd> result;
  for (const StochasticStretch& stretch : model.stretches)
    result.push_back(passes.run(stretch, Eigen::VectorXd::Zero(model.size.size()), &signal).passed);
  return result;
}

}  // namespace faultline
