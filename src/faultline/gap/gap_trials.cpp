#include "faultline/gap/gap_trials.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <numeric>

#include "faultline/gap/input_noise.h"
#include "faultline/gap/part_of_runs.h"
#include "faultline/gap/run_agreement.h"
#include "faultline/gap/run_phases.h"
#include "faultline/gap/screening.h"
#include "faultline/gap/size_search.h"
#include "faultline/gap/spectral_lines.h"
#include "faultline/gap/stuck_times.h"
#include "faultline/numerics/in_parallel.h"
#include "faultline/numerics/quantiles.h"
#include "faultline/numerics/random.h"

namespace faultline {
namespace {

constexpr std::uint64_t kInputNoise = 1, kOutputNoise = 1001;  // seeds

// Whether sensitivities around `from` still hold around `to`: parameters and effects have hardly moved; an effect
// that is new changes nothing yet.
bool near(const Datasheet& sheet, const ModelChange& from, const ModelChange& to, double fraction) {
  for (std::size_t i = 0; i < sheet.parameters.size(); ++i) {
    const Parameter& p = sheet.parameters[i];
    if (std::abs(to.parameters[i] - from.parameters[i]) > fraction * std::abs(p.nominal) * p.tolerance) return false;
  }
  if (to.effects.size() < from.effects.size()) return false;
  for (std::size_t e = 0; e < to.effects.size(); ++e) {
    const EffectType* type = find_effect_type(to.effects[e].effect);
    for (std::size_t i = 0; i < to.effects[e].parameters.size(); ++i) {
      const double none = type->parameters[i].none, value = to.effects[e].parameters[i];
      if (e >= from.effects.size()) {
        if (!std::isnan(none) && value != none) return false;
        continue;
      }
      if (from.effects[e].effect != to.effects[e].effect || from.effects[e].port != to.effects[e].port) return false;
      const double before = from.effects[e].parameters[i];
      const double size = std::isfinite(none) ? std::abs(before - none) : std::abs(before);
      if (std::abs(value - before) > fraction * size) return false;
    }
  }
  return true;
}

// The effects with what some runs may not decide held where it is: those that were found before, like the parameters,
// and what these runs hardly show - a rate limit that only steps reach would be fitted to anything. `shown`:
// information() of all runs.
std::vector<Candidate> left_to(const std::vector<std::size_t>& runs, std::vector<Candidate> effects, std::size_t held,
                               const std::vector<Eigen::VectorXd>& shown, double least_fraction) {
  Eigen::Index at = 0;
  for (std::size_t e = 0; e < effects.size(); ++e)
    for (std::size_t p = 0; p < effects[e].bounds.size(); ++p) {
      Bounds& bounds = effects[e].bounds[p];
      if (bounds.minimum >= bounds.maximum) continue;
      double known = 0, all = 0;
      for (const Eigen::VectorXd& run : shown) all += run[at];
      for (const std::size_t run : runs) known += shown[run][at];
      ++at;
      if (e < held || known < least_fraction * all) bounds.minimum = bounds.maximum = effects[e].effect.parameters[p];
    }
  return effects;
}

// Coordinates of a fitted effect, in those of `free`; not a number where they were held.
Eigen::VectorXd free_sizes(const Candidate& free, const Candidate& fitted) {
  Eigen::VectorXd result(static_cast<Eigen::Index>(free.bounds.size()));
  for (std::size_t p = 0; p < free.bounds.size(); ++p)
    result[static_cast<Eigen::Index>(p)] = fitted.bounds[p].minimum < fitted.bounds[p].maximum
                                               ? free.to_coordinate(p, fitted.effect.parameters[p])
                                               : std::nan("");
  return result;
}

}  // namespace

FitResult without_last(FitResult fit) {
  fit.effects.pop_back();
  fit.model = with_effects(fit.effects, fit.model.parameters);
  return fit;
}

double sum(const std::vector<double>& values) { return std::accumulate(values.begin(), values.end(), 0.0); }

std::vector<double> minus(const std::vector<double>& a, const std::vector<double>& b) {
  std::vector<double> result(a.size());
  for (std::size_t i = 0; i < a.size(); ++i) result[i] = a[i] - b[i];
  return result;
}

std::vector<double> GapTrials::robust(const std::vector<double>& losses) const {
  std::vector<double> result;
  for (const double loss : losses)
    result.push_back(faultline::robust(loss, segment_values(), options().linearisation.least_variance_fraction));
  return result;
}

double GapTrials::standard_error(const std::vector<double>& differences) const {
  double size = 0;
  for (const double d : differences) size += std::abs(d);
  const double correlated = options().trials.correlated_fraction * static_cast<double>(fewest_rows(model().runs()));
  return std::sqrt(2 * std::max(1.0, correlated) * size);
}

GapTrials::GapTrials(const Datasheet& sheet, std::vector<SegmentedRun> runs, const std::vector<Fold>& folds,
                     const std::vector<std::size_t>& learn, const GapSettings& settings, const GapProgress& progress)
    : sheet_(sheet), settings_(settings), progress_(progress), folds_(folds), learn_(learn) {
  around_.residuals = std::make_shared<ResidualModel>(sheet, std::move(runs), options());
  double duration = 0;
  for (const SegmentedRun& run : model().runs()) duration = std::max(duration, run.duration());
  all_ = where_still(with_open_shapes(candidates(sheet, settings.without, duration, options().candidates)), model());
  for (std::size_t i = 0; i < model().runs().size(); ++i) every_.push_back(i);
}

void GapTrials::tell(double share, const std::string& text) const {
  if (progress_) progress_(share, text);
}

Surroundings GapTrials::settle(const Surroundings& before, const ModelChange& at, Differences differences) const {
  const int jobs = settings_.jobs;
  Surroundings now;
  now.residuals = std::make_shared<ResidualModel>(*before.residuals);
  const bool closely = differences == Differences::central;
  const bool serve = before.linear && (!closely || before.linear->differences() == Differences::central);
  const bool known =
      serve && near(sheet_, before.seen_from, at,
                    closely ? options().trials.same_closely_fraction : options().trials.same_sensitivity_fraction);
  now.seen_from = known ? before.seen_from : at;
  std::vector<std::vector<Eigen::MatrixXf>> starts(every_.size());
  in_parallel(every_.size(), jobs, [&](std::size_t i) {
    starts[i] = now.residuals->settle_starts(
        at, every_[i], known ? before.linear->start_columns(i) : std::vector<Eigen::MatrixXf>(), jobs);
  });
  now.linear = known
                   ? std::make_shared<Linearisation>(*now.residuals, at, *before.linear, jobs)
                   : std::make_shared<Linearisation>(*now.residuals, at, every_, jobs, std::move(starts), differences);
  return now;
}

double GapTrials::learned_loss(const Surroundings& around) const {
  const Linearisation learn = around.linear->subset(learn_);
  return sum(robust(learn.segment_losses(learn.at_model())));
}

double GapTrials::learned_loss(const Surroundings& around, const ModelChange& at) const {
  const Linearisation learn = around.linear->subset(learn_);
  return sum(robust(learn.segment_losses(residuals_of(*around.residuals, at, learn_, settings_.jobs))));
}

FitResult GapTrials::refit(const ModelChange& start, const std::vector<Candidate>& effects) {
  Structure structure;
  structure.fit.effects = effects;
  structure.fit.model = with_effects(effects, start.parameters);
  structure.around = settle(around_, structure.fit.model);
  return refit(structure);
}

void GapTrials::come_back(const Standing& standing) {
  around_ = standing.around;
  part_ = standing.part;
  parted_ = standing.parted;
}

FitResult GapTrials::refit(const Structure& refined) {
  around_ = refined.around;
  FitResult fit = refined.fit;
  converge(fit, std::numeric_limits<double>::infinity());
  take_part(fit.model);
  return fit;
}

FitResult GapTrials::polish(FitResult fit) {
  if (least_own_part(*around_.residuals, fit, *around_.linear, settings_.jobs) > options().trials.ridge_part_fraction)
    return fit;
  around_ = settle(around_, fit.model, Differences::central);
  for (std::size_t round = 0; round < options().trials.polish_rounds; ++round) {
    const FitResult better = fit_gap(*around_.residuals, fit.model, fit.effects, around_.linear->subset(learn_),
                                     options().trials.steps, settings_.jobs);
    Surroundings moved = settle(around_, better.model, Differences::central);
    const double gained = learned_cost(around_, fit) - learned_cost(moved, better);
    if (!(gained > 0)) break;
    fit.model = better.model;
    fit.effects = better.effects;
    around_ = std::move(moved);
    if (gained < options().fit.polished_log_likelihood) break;
  }
  fit.covariance = uncertainty(*around_.residuals, fit, around_.linear->subset(learn_), settings_.jobs);
  return fit;
}

void GapTrials::converge(FitResult& fit, double aim) {
  double before = learned_loss(around_);
  for (std::size_t round = 0; round < options().trials.refit_rounds; ++round) {
    const FitResult better = fit_gap(*around_.residuals, fit.model, fit.effects, around_.linear->subset(learn_),
                                     options().trials.steps, settings_.jobs);
    Surroundings moved = settle(around_, better.model);
    const double now = learned_loss(moved);
    if (!(now < before)) break;
    fit.model = better.model;
    fit.effects = better.effects;
    around_ = std::move(moved);
    const double gained = before - now;
    if (gained < options().trials.relinearise_log_likelihood || now - gained > aim) break;
    before = now;
  }
}

double GapTrials::learned_cost(const Surroundings& around, const FitResult& fit) const {
  const Eigen::VectorXd z = deviations(model().sheet(), around.linear->free_parameters(), fit.model.parameters);
  return learned_loss(around) + 0.5 * z.squaredNorm();
}

FitResult GapTrials::refit_from_elsewhere(const FitResult& from_datasheet) {
  const Surroundings whole = around_;
  around_ = part_;
  FitResult best;
  const double known = learned_cost(around_, from_datasheet);
  double least = known, aim = learned_loss(around_);
  const Linearisation learn = part_.linear->subset(learn_);
  Random random(1);
  const std::vector<std::size_t> free = around_.linear->free_parameters();
  for (std::size_t s = 0; s < options().trials.other_starts; ++s) {
    Eigen::VectorXd move(static_cast<Eigen::Index>(free.size()));
    for (double& m : move) m = options().trials.other_start_tolerances * random.normal();
    FitResult other;
    other.model.parameters = sheet_.nominal();
    shift_parameters(model(), free, move, other.model.parameters);
    // With the derivatives that are there: where they lead into the valley that is known, nothing is found.
    const double reached = fit_gap(*part_.residuals, other.model, {}, learn, options().trials.quick_steps, jobs()).loss;
    if (std::abs(reached - known) < options().trials.relinearise_log_likelihood) continue;
    around_ = settle(part_, other.model);
    converge(other, aim);
    const double cost = learned_cost(around_, other);
    if (cost >= least - options().trials.relinearise_log_likelihood) continue;
    best = other;
    least = cost;
    aim = learned_loss(around_);
  }
  around_ = whole;
  return best.model.parameters.empty() ? from_datasheet : refit(best.model, {});
}

void GapTrials::take_part(const ModelChange& at) {
  tried_.clear();
  const auto segments = telling_segments(*around_.linear, model());
  part_ = around_;
  parted_ = false;
  for (std::size_t r = 0; r < segments.size(); ++r) parted_ |= segments[r].size() < model().runs()[r].segments();
  if (!parted_) return;
  part_.seen_from = at;
  part_.residuals = std::make_shared<ResidualModel>(model().part(segments));
  part_.linear = std::make_shared<Linearisation>(*part_.residuals, at, every_, settings_.jobs);
}

FitResult GapTrials::stand(const ModelChange& model) {
  FitResult fit;
  fit.model = model;
  around_ = settle(around_, model);
  take_part(fit.model);
  return fit;
}

std::string GapTrials::runs_disagree(const FitResult& fit) const {
  return disagreement(model(), around_.linear->subset(learn_), fit, settings_.jobs);
}

std::vector<SizeAgreement> GapTrials::sizes_agree(const FitResult& fit) const {
  return size_agreement(model(), fit, *around_.linear, settings_.jobs);
}

std::vector<Structure> GapTrials::screen(const FitResult& base, double from, double to) const {
  std::function<void(double)> progress;
  if (progress_) progress = [&](double done) { progress_(from + (to - from) * done, "trying effects"); };
  return screen_candidates(*part_.residuals, *part_.linear, tried_.empty() ? tried() : tried_, base, settings_.jobs,
                           progress);
}

std::vector<Structure> GapTrials::screen_at(const std::string& port, const FitResult& base) const {
  std::vector<Candidate> all = tried();
  all.erase(std::remove_if(all.begin(), all.end(), [&](const Candidate& c) { return c.effect.port != port; }),
            all.end());
  if (all.empty()) return {};
  return screen_candidates(*part_.residuals, *part_.linear, all, base, settings_.jobs, {});
}

std::vector<Candidate> GapTrials::tried() const {
  std::vector<double> periods;
  for (std::size_t run : around_.linear->runs()) periods.push_back(model().runs()[run].period);
  return at_lines(at_orders(all_, orders_), around_.linear->at_model(), periods, options().spectrum);
}

double GapTrials::put_in_step(const FitResult& standing) {
  orders_ = likeliest_orders(*part_.residuals, standing.model, all_, jobs());
  tried_ = tried();
  const RunPhases phases = run_phases(*part_.residuals, standing.model, tried_, jobs());
  around_.residuals->put_in_step(phases);
  part_.residuals->put_in_step(phases);
  return phases.closed;
}

void GapTrials::shortlist(const FitResult& base, std::vector<Structure>& structures, bool search, double from,
                          double to) const {
  if (structures.empty()) return;
  const GapOptions::Trials& trials = options().trials;
  const Linearisation learn = part_.linear->subset(learn_);
  const auto weighted = [&](const ModelChange& at) {
    return sum(robust(learn.segment_losses(residuals_of(*part_.residuals, at, learn_, settings_.jobs))));
  };
  const double before = weighted(base.model);
  // The time from which a signal is stuck has a narrow valley.
  const auto find_time = [&](FitResult& start) {
    double& time = start.effects.back().effect.parameters.front();
    const Bounds& bounds = start.effects.back().bounds.front();
    const double spacing = (bounds.maximum - bounds.minimum) / static_cast<double>(options().candidates.stuck_times);
    time = narrow(
        [&](double value) {
          time = value;
          return weighted(with_effects(start.effects, start.model.parameters));
        },
        std::max(bounds.minimum, time - spacing), std::min(bounds.maximum, time + spacing), trials.stuck_points,
        sheet_.sample_period);
  };
  const double promise = trials.promising_gain_fraction * structures.front().screened;
  std::atomic<std::size_t> done{0};
  // A candidate is judged by where its fit has converged, from the refit's parameters, which were bent without it, and
  // from the datasheet's: after one step it says more of the start than of the effect.
  const auto fit = [&](Structure& structure, const FitResult& start) {
    FitResult found = fit_gap(*part_.residuals, start.model, start.effects, learn, trials.quick_steps, settings_.jobs);
    const double gain = before - weighted(found.model);
    if (gain <= structure.quick) return;
    structure.fit = std::move(found);
    structure.quick = gain;
  };
  in_parallel(structures.size(), settings_.jobs, [&](std::size_t i) {
    Structure& structure = structures[i];
    const bool stuck = structure.fit.effects.back().family == "stuck";
    if (stuck) find_time(structure.fit);
    const FitResult bent = structure.fit;
    structure.quick = -std::numeric_limits<double>::infinity();
    fit(structure, bent);
    if (!stuck && structure.quick < structure.screened && structure.screened >= promise) {
      // A fit that wins less than the screening promised began in a valley of its own: parameters that were bent
      // without the effect, or sizes between which derivatives do not see.
      FitResult straight = bent;
      straight.model.parameters = sheet_.nominal();
      fit(structure, straight);
      FitResult other = bent;
      if (search && search_effect(*part_.residuals, learn, other, trials.wide_span_coordinate, trials.wide_points,
                                  settings_.jobs) >= trials.relinearise_log_likelihood)
        fit(structure, other);
    }
    const std::size_t now = ++done;
    if (progress_)
      progress_(from + (to - from) * static_cast<double>(now) / static_cast<double>(structures.size()),
                "fitting the best");
  });
  std::stable_sort(structures.begin(), structures.end(),
                   [](const Structure& a, const Structure& b) { return a.quick > b.quick; });
}

double GapTrials::follow(Structure& structure, const Surroundings& from, double base, std::size_t rounds) const {
  const GapOptions::Trials& trials = options().trials;
  structure.around = settle(from, structure.fit.model);
  double best = learned_loss(structure.around);
  for (std::size_t round = 0; round < rounds; ++round) {
    const Surroundings& own = structure.around;
    const FitResult fit = fit_gap(*own.residuals, structure.fit.model, structure.fit.effects,
                                  own.linear->subset(learn_), trials.steps, settings_.jobs);
    Surroundings moved = settle(own, fit.model);
    const double now = learned_loss(moved);
    if (!(now < best)) break;
    const bool converged =
        best - now < std::max(trials.relinearise_log_likelihood, trials.settled_gain_fraction * (base - now));
    best = now;
    structure.fit = fit;
    structure.around = std::move(moved);
    if (converged) break;
  }
  return best;
}

double GapTrials::begin(Structure& structure) const {
  // The refit without this effect may have bent parameters into a valley of their own, from which no step leads out:
  // the fit starts at the datasheet's parameters again, and goes on from there unless the quick fit is ahead of its
  // first round.
  const FitResult quick = structure.fit;
  const double quick_loss = learned_loss(part_, quick.model);
  structure.fit.model.parameters = sheet_.nominal();
  const double base = learned_loss(part_), best = follow(structure, part_, base, 1);
  if (best <= quick_loss) return best;
  structure.fit = quick;
  return follow(structure, part_, base, 1);
}

double GapTrials::finish(Structure& structure) const {
  const GapOptions::Trials& trials = options().trials;
  const double base = learned_loss(part_);
  double best = follow(structure, Surroundings(structure.around), base, trials.refine_rounds);
  const double values = segment_values() * static_cast<double>(part_.linear->subset(learn_).weights().size());
  const double enough = trials.search_excess_variances * 0.5 * values;
  for (std::size_t pass = 0; pass < trials.searches && best > enough; ++pass) {
    Structure searched = structure;
    if (search_effect(*structure.around.residuals, structure.around.linear->subset(learn_), searched.fit,
                      trials.close_span_coordinate, trials.close_points,
                      settings_.jobs) < trials.relinearise_log_likelihood)
      break;
    const double other = follow(searched, part_, base, 1);
    if (other > best - trials.relinearise_log_likelihood) break;
    structure = std::move(searched);
    best = other;
  }
  return best;
}

void GapTrials::finish_whole(Structure& structure) const {
  if (parted_) follow(structure, around_, learned_loss(around_), options().trials.whole_rounds);
  structure.fit.covariance =
      uncertainty(*structure.around.residuals, structure.fit, structure.around.linear->subset(learn_), settings_.jobs);
  cross_score(structure.around, structure, structure.fit.effects.size() - 1);
}

void GapTrials::cross_score(const Surroundings& around, Structure& structure, std::size_t held) const {
  const int jobs = settings_.jobs;
  const FitResult& fit = structure.fit;
  std::vector<Eigen::VectorXd> shown;
  if (folds_.size() > 1) shown = information(*around.residuals, fit, *around.linear, jobs);
  std::vector<std::vector<double>> losses(folds_.size());
  std::vector<Eigen::VectorXd> sizes(folds_.size());
  in_parallel(folds_.size(), jobs, [&](std::size_t f) {
    const Fold& fold = folds_[f];
    FitResult part = fit;
    if (fold.train != learn_) {
      const std::vector<Candidate> effects =
          left_to(fold.train, fit.effects, held, shown, options().trials.shown_information_fraction);
      part = fit_gap(*around.residuals, fit.model, effects, around.linear->subset(fold.train), options().trials.steps,
                     jobs, false);
    }
    if (!fit.effects.empty()) sizes[f] = free_sizes(fit.effects.back(), part.effects.back());
    losses[f] =
        around.linear->subset(fold.test).segment_losses(residuals_of(*around.residuals, part.model, fold.test, jobs));
  });
  structure.held_out.clear();
  for (const std::vector<double>& part : losses)
    structure.held_out.insert(structure.held_out.end(), part.begin(), part.end());
  structure.score = robust(structure.held_out);
  structure.apart = 0.5 * (sizes.front() - sizes.back()).cwiseAbs();
  for (Eigen::Index p = 0; p < structure.apart.size(); ++p)
    if (!std::isfinite(structure.apart[p])) structure.apart[p] = 0;
}

Structure GapTrials::score(const FitResult& fit) const {
  Structure structure;
  structure.fit = fit;
  cross_score(around_, structure, fit.effects.empty() ? 0 : fit.effects.size() - 1);
  return structure;
}

std::size_t GapTrials::refine(std::vector<Structure>& structures, double from, double to) const {
  std::atomic<std::size_t> done{0};
  const auto tell_one = [&](double steps) {
    const std::size_t now = ++done;
    if (progress_)
      progress_(from + (to - from) * std::min(1.0, static_cast<double>(now) / steps), "comparing the best");
  };
  const std::size_t count = structures.size();
  std::vector<double> losses(count);
  in_parallel(count, settings_.jobs, [&](std::size_t i) {
    losses[i] = begin(structures[i]);
    tell_one(3 * static_cast<double>(count));
  });
  const double base = learned_loss(part_);
  std::vector<Structure> behind;
  // Leaves out those that win too little against the best.
  const auto keep = [&](double fraction) {
    const auto best = static_cast<std::size_t>(std::min_element(losses.begin(), losses.end()) - losses.begin());
    const double enough = fraction * (base - losses[best]);
    std::size_t kept = 0;
    for (std::size_t i = 0; i < structures.size(); ++i) {
      structures[i].quick = base - losses[i];
      if (i == best || structures[i].quick >= enough) {
        if (kept != i) structures[kept] = std::move(structures[i]), losses[kept] = losses[i];
        ++kept;
      } else {
        structures[i].around = {};
        behind.push_back(std::move(structures[i]));
      }
    }
    structures.resize(kept);
    losses.resize(kept);
  };
  keep(options().search.kept_gain_fraction);
  const double steps = static_cast<double>(count + 2 * structures.size());
  in_parallel(structures.size(), settings_.jobs, [&](std::size_t i) {
    losses[i] = finish(structures[i]);
    tell_one(steps);
  });
  if (parted_) keep(options().search.whole_gain_fraction);
  in_parallel(structures.size(), settings_.jobs, [&](std::size_t i) {
    finish_whole(structures[i]);
    tell_one(steps);
  });
  const std::size_t kept = structures.size();
  for (Structure& structure : behind) structures.push_back(std::move(structure));
  return kept;
}

bool GapTrials::better_without(const Structure& structure) const {
  return learned_loss(structure.around, without_last(structure.fit).model) <
         learned_loss(around_) - options().trials.relinearise_log_likelihood;
}

double GapTrials::learned_gain(const Structure& structure) const {
  return learned_loss(around_) - learned_loss(structure.around);
}

double GapTrials::learned_gain(const Structure& structure, const ModelChange& instead) const {
  return learned_loss(around_) - learned_loss(structure.around, instead);
}

double GapTrials::gain_of_input_noise(const FitResult& standing, const Structure& structure) const {
  const std::vector<Eigen::MatrixXf> plain = around_.linear->subset(learn_).at_model();
  const std::vector<Eigen::MatrixXf> left = structure.around.linear->subset(learn_).at_model();
  const auto loss = [&](const Surroundings& around, const ModelChange& at) {
    const ResidualModel noisy = with_input_noise(*around.residuals, kInputNoise);
    return sum(robust(around.linear->subset(learn_).segment_losses(
        placebo_residuals(noisy, at, learn_, plain, left, kOutputNoise, settings_.jobs))));
  };
  return loss(around_, standing.model) - loss(structure.around, structure.fit.model);
}

std::vector<double> GapTrials::held_out(const ModelChange& at) const {
  std::vector<double> result;
  for (const Fold& fold : folds_) {
    const Linearisation test = around_.linear->subset(fold.test);
    std::vector<Eigen::MatrixXf> residuals;
    for (const std::size_t run : fold.test) residuals.push_back(model().residuals(at, run));
    const auto part = test.segment_losses(residuals);
    result.insert(result.end(), part.begin(), part.end());
  }
  return result;
}

double GapTrials::learned_segments() const {
  double count = 0;
  for (const std::size_t run : learn_) count += static_cast<double>(model().runs()[run].segments());
  return count;
}

double GapTrials::segment_s() const {
  const SegmentedRun& run = model().runs().front();
  return static_cast<double>(run.segment) * run.period;
}

double GapTrials::ninety_percent() const { return student_ninety_percent(std::max(1.0, learned_segments() - 1)); }

double GapTrials::held_out_values() const {
  double count = 0;
  for (const Fold& fold : folds_)
    for (const std::size_t run : fold.test)
      count += static_cast<double>(model().runs()[run].segments()) * segment_values();
  return count;
}

}  // namespace faultline
