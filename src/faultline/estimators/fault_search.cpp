#include "faultline/estimators/fault_search.h"

#include <algorithm>
#include <cmath>

#include "faultline/attribution/screening.h"
#include "faultline/numerics/in_parallel.h"

namespace faultline {
namespace {

// Evidence that segments do not hold a fault: twice what one parameter wins in noise. That they do, before the stretch
// which shows it: a fraction of the threshold, and in each of what a segment of that stretch has.
constexpr double kClearEvidence = 4, kSuspicion = 0.25, kAsMuch = 1.0 / 3;
constexpr double kSameShare = 0.5;  // of what a stretch says for one cause, that it says for another name of it
constexpr double kMostGrown = 32;   // times what it was when it was found, that a fault may be

void sort_by_evidence(std::vector<RankedFault>& faults) {
  std::sort(faults.begin(), faults.end(),
            [](const RankedFault& a, const RankedFault& b) { return a.evidence > b.evidence; });
}

// Evidence of a stretch alone for a cause of this size.
double says(const StretchModel& model, const Scene& scene, const Stretch& stretch, const RankedFault& cause,
            double amplitude) {
  return model.loss(scene.prior, {&stretch}) -
         model.loss(scene.prior, {&stretch}, scene.point, {model.hypotheses()[cause.hypothesis].at(amplitude)});
}

}  // namespace

std::vector<RankedFault> screen(const StretchModel& model, const Eigen::MatrixXd& gram) {
  const std::vector<FaultHypothesis>& all = model.hypotheses();
  const Eigen::MatrixXd left = without_parameters(gram, model.parameters());
  std::vector<RankedFault> result;
  for (std::size_t h = 0; h < all.size(); ++h) {
    const BestSize best = best_size(left, 1 + static_cast<Eigen::Index>(h), all[h].lowest, all[h].highest,
                                    model.settings().least_response);
    // At a standstill nothing is said.
    result.push_back({h, best.size, best.information > 0 ? 1 / std::sqrt(best.information) : kInfinity, best.gain});
  }
  sort_by_evidence(result);
  return result;
}

RankedFault refine(const StretchModel& model, const Scene& scene, RankedFault start, double loss) {
  const ResponseSettings& settings = model.settings();
  const FaultHypothesis& h = model.hypotheses()[start.hypothesis];
  if (!std::isfinite(start.std)) return start;
  const double least = std::isinf(h.none) ? h.lowest : -kInfinity;
  const auto at = [&](double amplitude) {
    return model.loss(scene.prior, scene.stretches, scene.point, {h.at(amplitude)});
  };
  double a = std::max(start.amplitude, least);
  double here = a > start.amplitude || std::isinf(loss) ? at(a) : loss;
  double curvature = 1 / (start.std * start.std);
  for (std::size_t i = 0; i < settings.refinements; ++i) {
    const double step = std::max(settings.refine_step_fraction * std::abs(a), settings.refine_step_sigma * start.std);
    const double up = std::min(a + step, h.highest), down = std::max({a - step, h.lowest, least});
    const double l_up = up > a ? at(up) : here, l_down = down < a ? at(down) : here;
    double slope, bend = curvature;
    if (up > a && down < a) {
      const double s1 = (l_up - here) / (up - a), s2 = (here - l_down) / (a - down);
      slope = (s1 * (a - down) + s2 * (up - a)) / (up - down);
      bend = (s1 - s2) / (up - down);
    } else {
      slope = up > a ? (l_up - here) / (up - a) : (here - l_down) / (a - down);
    }
    if (bend > 0) curvature = bend;
    double best = a, least_loss = here;
    for (const auto& [amplitude, l] : {std::pair(up, l_up), std::pair(down, l_down)})
      if (l < least_loss) {
        best = amplitude;
        least_loss = l;
      }
    const double wide = std::max(std::abs(a), settings.refine_reach_sigma * start.std);
    const double newton =
        std::clamp(a - std::clamp(slope / (2 * curvature), -wide, wide), std::max(h.lowest, least), h.highest);
    const double l_newton = at(newton);
    if (l_newton < least_loss) {
      best = newton;
      least_loss = l_newton;
    }
    const bool done = here - least_loss < settings.refine_settled_fraction * (scene.healthy_loss - least_loss);
    a = best;
    here = least_loss;
    if (done) break;
  }
  start.amplitude = a;
  start.evidence = scene.healthy_loss - here;
  start.std = 1 / std::sqrt(std::max(curvature, 1e-300));
  return start;
}

std::vector<RankedFault> best_of(const StretchModel& model, const Scene& scene, std::vector<RankedFault> screened,
                                 const std::map<std::size_t, double>& before, std::map<std::size_t, double>* closely) {
  const ResponseSettings& settings = model.settings();
  if (!before.empty()) {
    const std::size_t looked = std::min(screened.size(), settings.looked_hypotheses);
    screened.erase(std::remove_if(screened.begin() + static_cast<std::ptrdiff_t>(looked), screened.end(),
                                  [&](const RankedFault& f) { return before.count(f.hypothesis) == 0; }),
                   screened.end());
  }
  // Those that screening puts first tell how good the others would have to be: most of them end after few rows.
  const std::size_t first = std::max(settings.kept_hypotheses, settings.refined_hypotheses);
  std::vector<Trial> trials;
  std::vector<double> amplitudes;
  for (std::size_t i = 0; i < screened.size(); ++i) {
    const FaultHypothesis& h = model.hypotheses()[screened[i].hypothesis];
    std::vector<double> sizes = {screened[i].amplitude};
    const auto known = before.find(screened[i].hypothesis);
    if (known != before.end()) sizes.push_back(known->second);
    if (before.empty())
      for (const double fraction : settings.coarse_fractions)
        sizes.insert(sizes.end(), {fraction * h.highest, fraction * h.lowest});
    for (const double a : sizes) {
      if (a == 0 || (std::isinf(h.none) && a < h.lowest)) continue;
      trials.push_back({i, i < first});
      amplitudes.push_back(a);
    }
  }
  double worth = kInfinity;
  LossCourse limits;
  const auto loss = [&](std::size_t i, double enough) {
    const FaultHypothesis& h = model.hypotheses()[screened[trials[i].hypothesis].hypothesis];
    return model.loss(scene.prior, scene.stretches, scene.point, {h.at(amplitudes[i])}, std::min(enough, worth),
                      nullptr, limits.empty() ? nullptr : &limits);
  };
  const auto worth_beside = [&](double least) {
    return scene.healthy_loss - settings.alternative_evidence_fraction * std::max(0.0, scene.healthy_loss - least);
  };
  if (!trials.empty()) {
    LossCourse best;
    const FaultHypothesis& h = model.hypotheses()[screened.front().hypothesis];
    worth = worth_beside(model.loss(scene.prior, scene.stretches, scene.point, {h.at(amplitudes.front())}, kInfinity,
                                    nullptr, nullptr, &best));
    // A rival need not win as much in every part of the motion, but something.
    model.loss(scene.prior, scene.stretches, &limits);
    for (std::size_t k = 0; k < limits.size(); ++k)
      limits[k] += settings.worthwhile_evidence - settings.pace_fraction * std::max(0.0, limits[k] - best[k]);
  }
  std::vector<RankedFault> result;
  for (const std::size_t i : try_sizes(trials, settings.refined_hypotheses, settings.jobs, loss)) {
    result.push_back(screened[trials[i].hypothesis]);
    result.back().amplitude = amplitudes[i];
    result.back().evidence = scene.healthy_loss - trials[i].loss;
  }
  if (closely != nullptr) {
    closely->clear();
    for (std::size_t i = 0; i < std::min(settings.kept_hypotheses, result.size()); ++i)
      (*closely)[result[i].hypothesis] = result[i].amplitude;
  }
  result.resize(std::min(result.size(), settings.refined_hypotheses));
  const auto refined = [&](std::size_t i) {
    const double reached = scene.healthy_loss - result[i].evidence;
    if (reached <= worth) result[i] = refine(model, scene, result[i], reached);
  };
  if (!result.empty()) refined(0);
  if (!result.empty()) worth = worth_beside(scene.healthy_loss - result[0].evidence);
  in_parallel(result.empty() ? 0 : result.size() - 1, settings.jobs, [&](std::size_t i) { refined(i + 1); });
  sort_by_evidence(result);
  return result;
}

std::vector<RankedFault> beside(const StretchModel& model, Scene scene, const std::vector<RankedFault>& found,
                                double limit, const std::map<std::size_t, double>& before) {
  const std::vector<FaultHypothesis>& all = model.hypotheses();
  const FaultHypothesis& first = all[found.front().hypothesis];
  scene.point.effects = {first.at(found.front().amplitude)};
  const double alternative = model.settings().alternative_evidence_fraction * found.front().evidence;
  // What the first leaves at its own place, and what explains it nearly as well, is no second fault.
  const auto is_none = [&](const RankedFault& f) {
    return all[f.hypothesis].port == first.port ||
           std::any_of(found.begin(), found.end(), [&](const RankedFault& other) {
             return other.hypothesis == f.hypothesis && other.evidence > alternative;
           });
  };
  const Stretches without = scene.stretches;
  std::vector<std::unique_ptr<Stretch>> around;
  // `make` gives a stretch around the model with the first in it.
  const auto screened_with = [&](const auto& make) {
    around.clear();
    Eigen::MatrixXd sums = model.no_sums();
    sums.topLeftCorner(scene.prior.rows(), scene.prior.cols()) = scene.prior;
    for (std::size_t i = 0; i < without.size(); ++i) {
      around.push_back(make(*without[i]));
      scene.stretches[i] = around.back().get();
      sums += around.back()->sums;
    }
    std::vector<RankedFault> screened = screen(model, sums);
    screened.erase(std::remove_if(screened.begin(), screened.end(), is_none), screened.end());
    return screened;
  };
  std::vector<RankedFault> screened = screened_with([&](const Stretch& stretch) {
    auto near = std::make_unique<Stretch>(stretch);
    model.follow(*near, scene.point);
    return near;
  });
  if (screened.empty() || screened.front().evidence <= model.settings().near_fraction * limit) return {};
  screened = screened_with([&](const Stretch& stretch) {
    auto own = model.prepare(stretch.run.recording);
    model.respond(*own, scene.point);
    model.weigh(*own, scene.point);
    return own;
  });
  if (screened.empty() || screened.front().evidence <= limit) return {};
  screened.resize(std::min(screened.size(), model.settings().kept_hypotheses));
  scene.healthy_loss = model.loss(scene.prior, scene.stretches);
  screened = best_of(model, scene, screened, before);
  if (screened.empty() || screened.front().evidence <= limit) return {};
  return screened;
}

double onset(const StretchModel& model, const Scene& scene, const Stretch* before, const Stretch& shows,
             const std::vector<EffectSpec>& effects) {
  // Begins where the evidence of all segments before is least, if that is clearly less than at the stretch's beginning.
  struct Least {
    double begin, evidence, whole;
    std::size_t segments;  // from there on
  };
  const auto least_of = [&](const Stretch& stretch) {
    LossCourse without, with;
    if (stretch.segments.empty()) return Least{stretch.begin, 0, 0, 1};
    model.loss(scene.prior, {&stretch}, &without);
    model.loss(scene.prior, {&stretch}, scene.point, effects, kInfinity, nullptr, nullptr, &with);
    Least least{stretch.begin, 0, without.back() - with.back(), with.size()};
    for (std::size_t s = 0; s + 1 < with.size(); ++s) {
      if (without[s] - with[s] > std::min(least.evidence, -kClearEvidence)) continue;
      least.evidence = without[s] - with[s];
      least.begin = stretch.run.recording.time[stretch.run.restarts[s + 2]];  // the first one does not count
      least.segments = with.size() - s - 1;
    }
    return least;
  };
  const Least at = least_of(shows);
  if (before == nullptr || !before->responded) return at.begin;
  const Least earlier = least_of(*before);
  const auto each = [](const Least& least) {
    return (least.whole - least.evidence) / static_cast<double>(least.segments);
  };
  const bool clearly = earlier.whole - earlier.evidence > kSuspicion * model.settings().threshold_evidence;
  return clearly && each(earlier) > kAsMuch * each(at) ? earlier.begin : at.begin;
}

Found found_in(const StretchModel& model, const Scene& scene, const RankedFault& cause) {
  const auto most =
      std::max_element(scene.stretches.begin(), scene.stretches.end(), [&](const Stretch* a, const Stretch* b) {
        return says(model, scene, *a, cause, cause.amplitude) < says(model, scene, *b, cause, cause.amplitude);
      });
  return {cause, (*most)->run.recording};
}

bool came_later(const StretchModel& model, const Scene& scene, const Found& found, const RankedFault& cause) {
  const bool grown =
      cause.hypothesis == found.cause.hypothesis && cause.amplitude * found.cause.amplitude > 0;  // as a drift does
  if (grown || found.stretch.rows() == 0) return false;
  const auto shows = model.prepare(found.stretch);
  model.respond(*shows, scene.point);
  const double then = says(model, scene, *shows, found.cause, found.cause.amplitude);
  if (then < model.settings().over_evidence) return false;
  for (double share = 1; share >= 1 / kMostGrown; share /= 2)
    if (says(model, scene, *shows, cause, share * cause.amplitude) >= kSameShare * then) return false;
  return true;
}

bool put_first(std::vector<RankedFault>& ranked, std::size_t hypothesis, double margin) {
  const auto found =
      std::find_if(ranked.begin(), ranked.end(), [&](const RankedFault& f) { return f.hypothesis == hypothesis; });
  const bool other = found != ranked.end() && found != ranked.begin();
  if (!other || found->evidence < ranked.front().evidence - margin) return false;
  std::rotate(ranked.begin(), found, found + 1);
  return true;
}

std::size_t speaking_alone(const StretchModel& model, const Scene& scene, const RankedFault& cause) {
  const auto silent = std::find_if(scene.stretches.begin(), scene.stretches.end(), [&](const Stretch* stretch) {
    return says(model, scene, *stretch, cause, cause.amplitude) <= 0;
  });
  return std::max<std::size_t>(1, static_cast<std::size_t>(silent - scene.stretches.begin()));
}

}  // namespace faultline
