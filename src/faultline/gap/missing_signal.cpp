#include "faultline/gap/missing_signal.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>

#include <fmt/format.h>

#include "faultline/gap/gap_trials.h"
#include "faultline/gap/reconstruction.h"
#include "faultline/gap/signal_regression.h"
#include "faultline/rig/effect_unit.h"

namespace faultline {
namespace {

constexpr std::size_t kParts = 16;     // pieces of all runs whose gains tell a standard error, about
constexpr std::size_t kMostTerms = 3;  // of a formula
constexpr std::size_t kPaired = 5;     // variables of which products are tried
constexpr double kLeastRise = 0.02;    // of the score, for which further terms are told
constexpr double kLeastScore = 0.3;    // from which a formula or a curve is told
constexpr double kStraight = 1e-6;  // penalty on steps of a curve, of its best known ordinate: joins what no row visits
constexpr std::size_t kMostPoints = 500, kMostRows = 400;  // of pictures

std::string unit_of(const Datasheet& sheet, const Port& port) {
  switch (port.kind) {
    case PortKind::restriction:
    case PortKind::compliance:
    case PortKind::transmission:
      return "1";
    case PortKind::flow:
      return port.unit.empty() ? "m^3/s" : port.unit;
    case PortKind::heat:
      return "W/K";
    default:
      return effect_unit(sheet, port, "port");
  }
}

// Hat functions over the nodes of a variable's range: rows x nodes per stretch.
std::vector<Eigen::MatrixXd> hats(const SignalVariable& variable) {
  const CurveGrid grid(variable.low, variable.high);
  std::vector<Eigen::MatrixXd> result;
  for (const Eigen::VectorXd& values : variable.values) {
    result.emplace_back(Eigen::MatrixXd::Zero(values.size(), static_cast<Eigen::Index>(kCurveNodes)));
    for (Eigen::Index i = 0; i < values.size(); ++i) {
      const CurveGrid::Place place = grid.place(values[i]);
      const auto node = static_cast<Eigen::Index>(place.node);
      result.back()(i, node) = 1 - place.share;
      result.back()(i, node + 1) = place.share;
    }
  }
  return result;
}

Eigen::MatrixXd straightness() {
  constexpr auto kNodes = static_cast<Eigen::Index>(kCurveNodes);
  Eigen::MatrixXd penalty = Eigen::MatrixXd::Zero(kNodes, kNodes);
  for (Eigen::Index j = 0; j + 1 < kNodes; ++j) {
    penalty(j, j) += kStraight;
    penalty(j + 1, j + 1) += kStraight;
    penalty(j, j + 1) -= kStraight;
    penalty(j + 1, j) -= kStraight;
  }
  return penalty;
}

class Shape {
 public:
  Shape(const ResidualModel& residuals, const ModelChange& change, const std::vector<Fold>& folds, Reconstruction at,
        Sought sought)
      : residuals_(residuals),
        folds_(folds),
        at_(std::move(at)),
        variables_(find_variables(residuals, change, at_)),
        terms_(variables_, at_.model.step) {
    if (sought == Sought::all) return;
    variables_.erase(std::remove_if(variables_.begin(), variables_.end(), [](const auto& v) { return v.passes < 0; }),
                     variables_.end());
  }

  void describe(Sought sought, MissingSignal& result) {
    if (variables_.empty()) return;
    if (sought == Sought::all) {
      terms_.add_singles();
      const std::vector<std::size_t> best = best_variables();
      terms_.add_memories();
      terms_.add_products(best);
    }
    courses_ = terms_.courses();
    std::vector<Eigen::Index> first_hat;
    for (const SignalVariable& variable : variables_) {
      first_hat.push_back(courses_.front().cols());
      const std::vector<Eigen::MatrixXd> more = hats(variable);
      for (std::size_t n = 0; n < courses_.size(); ++n) {
        const Eigen::Index had = courses_[n].cols();
        courses_[n].conservativeResize(Eigen::NoChange, had + more[n].cols());
        courses_[n].rightCols(more[n].cols()) = more[n];
      }
    }
    const SignalRegression regression = regress(courses_);
    if (sought == Sought::all) write_formula(regression, result);
    write_curves(regression, first_hat, result);
  }

 private:
  SignalRegression regress(const std::vector<Eigen::MatrixXd>& courses) const {
    const std::size_t parts = std::max<std::size_t>(2, kParts / at_.model.stretches.size());
    return SignalRegression(signal_equations(at_.model, at_.q, at_.signal, courses, parts), folds_);
  }

  // Those whose own terms explain most, best first.
  std::vector<std::size_t> best_variables() const {
    const SignalRegression regression = regress(terms_.courses());
    std::vector<double> gains(variables_.size(), 0);
    for (std::size_t t = 0; t < terms_.terms().size(); ++t) {
      const std::size_t v = terms_.terms()[t].variable;
      if (v < gains.size()) gains[v] = std::max(gains[v], regression.held_out({static_cast<Eigen::Index>(t)}).sum);
    }
    std::vector<std::size_t> order(variables_.size());
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return gains[a] > gains[b]; });
    order.resize(std::min(order.size(), kPaired));
    return order;
  }

  // Share of the reconstructed signal's square that courses explain on runs that judge, fitted on the others.
  double score(const SignalRegression& regression, const SignalRegression::Columns& columns,
               const Eigen::MatrixXd& penalty) const {
    double left = 0, whole = 0;
    for (std::size_t f = 0; f < folds_.size(); ++f) {
      const Eigen::VectorXd size = regression.fit(columns, f, penalty).size;
      const SignalCourses known = sum_of(columns, size);
      const Smoothing rest = smooth(with_signal(at_.model, known), at_.q, at_.signal);
      for (std::size_t n = 0; n < at_.model.stretches.size(); ++n) {
        const std::vector<std::size_t>& test = folds_[f].test;
        if (std::find(test.begin(), test.end(), at_.model.stretches[n].run) == test.end()) continue;
        left += rest.signal[n].squaredNorm();
        whole += at_.course.signal[n].squaredNorm();
      }
    }
    return whole > 0 ? 1 - left / whole : 0;
  }

  SignalCourses sum_of(const SignalRegression::Columns& columns, const Eigen::VectorXd& size) const {
    SignalCourses result;
    for (const Eigen::MatrixXd& courses : courses_) {
      result.emplace_back(Eigen::VectorXd::Zero(courses.rows()));
      for (std::size_t k = 0; k < columns.size(); ++k)
        result.back() += size[static_cast<Eigen::Index>(k)] * courses.col(columns[k]);
    }
    return result;
  }

  void write_formula(const SignalRegression& regression, MissingSignal& result) {
    std::vector<SignalRegression::Columns> candidates;
    for (std::size_t t = 0; t < terms_.terms().size(); ++t) candidates.push_back({static_cast<Eigen::Index>(t)});
    for (std::size_t t = 0; t < terms_.terms().size(); ++t)
      if (const int like = terms_.terms()[t].like; like >= 0)
        candidates.push_back({like, static_cast<Eigen::Index>(t)});
    const SignalRegression::Columns most = regression.select(candidates, kMostTerms);
    SignalRegression::Columns tried, chosen;
    for (const Eigen::Index next : most) {
      tried.push_back(next);
      const double now = score(regression, tried, {});
      if (!chosen.empty() && now < result.score + kLeastRise) continue;
      result.score = now;
      chosen = tried;
    }
    if (chosen.empty()) return;
    // Of a free signal that hardly changes a constant is nearly all; what the terms win beside it is in the readings.
    constexpr Eigen::Index kConstant = 0;  // the simplest term
    if (std::find(chosen.begin(), chosen.end(), kConstant) == chosen.end()) {
      tried = most;
      tried.push_back(kConstant);
      if (const double now = score(regression, tried, {}); now > result.score + kLeastRise) {
        result.score = now;
        chosen = tried;
      }
    }
    const SignalRegression::Fit fit = regression.fit(chosen);
    formula_ = sum_of(chosen, fit.size);
    if (result.score < kLeastScore) return;
    for (std::size_t k = 0; k < chosen.size(); ++k) {
      const SignalTerm& term = terms_.terms()[static_cast<std::size_t>(chosen[k])];
      const double size = fit.size[static_cast<Eigen::Index>(k)] * at_.unit() / term.norm;
      result.formula += fmt::format("{}{:.3g}{}",
                                    result.formula.empty() ? (size < 0 ? "-" : "")
                                    : size < 0             ? " - "
                                                           : " + ",
                                    std::abs(size), term.text == "1" ? "" : " " + term.text);
    }
  }

  void write_curves(const SignalRegression& regression, const std::vector<Eigen::Index>& first, MissingSignal& result) {
    const Eigen::MatrixXd penalty = straightness();
    const auto columns_of = [&](std::size_t v) {
      SignalRegression::Columns columns(kCurveNodes);
      std::iota(columns.begin(), columns.end(), first[v]);
      return columns;
    };
    int best = -1, seen = -1;
    double most = 0, most_seen = 0;
    for (std::size_t v = 0; v < variables_.size(); ++v) {
      const double gain = regression.held_out(columns_of(v), penalty).sum;
      if (gain > most) most = gain, best = static_cast<int>(v);
      if (variables_[v].passes >= 0 && gain > most_seen) most_seen = gain, seen = static_cast<int>(v);
    }
    const auto curve = [&](int which) -> std::optional<SignalCurve> {
      if (which < 0) return {};
      const auto v = static_cast<std::size_t>(which);
      const SignalVariable& variable = variables_[v];
      SignalCurve found;
      found.score = score(regression, columns_of(v), penalty);
      if (found.score < kLeastScore) return {};
      found.variable = variable.name;
      found.unit = variable.unit;
      found.passes = variable.passes;
      found.at = CurveGrid(variable.low, variable.high).nodes();
      const SignalRegression::Fit fit = regression.fit(columns_of(v), penalty);
      for (std::size_t j = 0; j < kCurveNodes; ++j) {
        found.value[j] = at_.unit() * fit.size[static_cast<Eigen::Index>(j)];
        found.standard_error[j] = at_.unit() * fit.standard_error[static_cast<Eigen::Index>(j)];
      }
      return found;
    };
    result.curve = curve(best);
    result.adoptable = seen == best ? result.curve : curve(seen);
    if (result.curve) write_points(variables_[static_cast<std::size_t>(best)], result.points);
    write_course(result.course);
  }

  void write_points(const SignalVariable& variable, SignalPoints& points) const {
    std::size_t rows = 0;
    for (const Eigen::VectorXd& u : at_.course.signal) rows += static_cast<std::size_t>(u.size());
    const std::size_t stride = rows / kMostPoints + 1;
    std::size_t k = 0;
    for (std::size_t n = 0; n < at_.course.signal.size(); ++n)
      for (Eigen::Index i = 0; i < at_.course.signal[n].size(); ++i)
        if (k++ % stride == 0) {
          points.at.push_back(variable.values[n][i]);
          points.value.push_back(at_.unit() * at_.course.signal[n][i]);
        }
  }

  // The window in which the signal is largest.
  void write_course(SignalCourse& course) const {
    std::size_t best = 0;
    Eigen::Index first = 0;
    double most = -1;
    for (std::size_t n = 0; n < at_.course.signal.size(); ++n) {
      const Eigen::VectorXd& u = at_.course.signal[n];
      const Eigen::Index window = std::min<Eigen::Index>(u.size(), kMostRows);
      for (Eigen::Index i = 0; i + window <= u.size(); i += std::max<Eigen::Index>(1, window / 4)) {
        const double squares = u.segment(i, window).squaredNorm() / static_cast<double>(window);
        if (squares > most) most = squares, best = n, first = i;
      }
    }
    const StochasticStretch& stretch = at_.model.stretches[best];
    const SegmentedRun& run = residuals_.runs()[stretch.run];
    course.run = run.name;
    for (Eigen::Index i = first; i < std::min<Eigen::Index>(at_.course.signal[best].size(), first + kMostRows); ++i) {
      course.time.push_back(run.recording.time[stretch.rows[static_cast<std::size_t>(i)]] - run.recording.time.front());
      course.value.push_back(at_.unit() * at_.course.signal[best][i]);
      course.standard_error.push_back(at_.unit() * at_.course.spread[best][i]);
      if (!formula_.empty()) course.formula.push_back(at_.unit() * formula_[best][i]);
    }
  }

  const ResidualModel& residuals_;
  const std::vector<Fold>& folds_;
  const Reconstruction at_;
  std::vector<SignalVariable> variables_;
  SignalTerms terms_;
  std::vector<Eigen::MatrixXd> courses_;
  SignalCourses formula_;
};

}  // namespace

MissingSignal find_missing_signal(const ResidualModel& residuals, const ModelChange& change, const FreePlace& place,
                                  const std::vector<Fold>& folds, int jobs, Sought sought) {
  std::set<std::size_t> runs;
  for (const Fold& fold : folds) {
    runs.insert(fold.train.begin(), fold.train.end());
    runs.insert(fold.test.begin(), fold.test.end());
  }
  Reconstruction at = reconstruct(residuals, change, place, {runs.begin(), runs.end()}, jobs);
  MissingSignal result;
  result.port = place.port;
  result.unit = unit_of(residuals.sheet(), residuals.sheet().port(place.port));
  result.size = at.signal.level * at.unit();
  result.memory = at.signal.memory;
  for (const StochasticStretch& stretch : at.model.stretches)
    for (const Eigen::VectorXd& misfit : stretch.misfit)
      result.readings += static_cast<double>((misfit.array() == misfit.array()).count());
  Shape(residuals, change, folds, std::move(at), sought).describe(sought, result);
  return result;
}

EffectSpec curve_effect(const std::string& port, const SignalCurve& curve) {
  EffectSpec spec;
  spec.effect = "free_curve";
  spec.port = port;
  spec.parameters = {static_cast<double>(curve.passes), curve.at.front(), curve.at.back()};
  spec.parameters.insert(spec.parameters.end(), curve.value.begin(), curve.value.end());
  return spec;
}

}  // namespace faultline
