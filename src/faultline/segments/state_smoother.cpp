#include "faultline/segments/state_smoother.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "faultline/segments/own_start.h"
#include "faultline/segments/propagation.h"
#include "faultline/segments/smoothing.h"

namespace faultline {
namespace {

constexpr double kForgotten = 0.1;      // of a segment, within which a state must forget its start to go on by itself
constexpr std::size_t kJudgedRows = 5;  // at which that is judged; odd, for their median
constexpr std::size_t kLikelihoodRows = 400;     // of a stretch, over which q is sought: bounds the effort
constexpr std::size_t kToleranceRows = 9;        // at which Q is taken
constexpr int kLeastPower = -4, kMostPower = 4;  // of ten, of q
constexpr double kLeastNoise = 1e-6;             // of a state's size, per step: keeps covariances regular

bool finite(const Eigen::MatrixXd& matrix) { return matrix.allFinite(); }

// What a row shows of the states; the rest from `other`.
Eigen::VectorXd shown(const SegmentModel& model, const SegmentedRun& run, std::size_t row, Eigen::VectorXd other) {
  const Datasheet& sheet = model.sheet();
  for (std::size_t s = 0; s < sheet.states.size(); ++s) {
    const int channel = model.shown_by()[s];
    if (channel < 0) continue;
    const double value = run.recording.at(row, static_cast<std::size_t>(channel));
    if (measures(sheet.channels[static_cast<std::size_t>(channel)], value)) other[static_cast<Eigen::Index>(s)] = value;
  }
  return other;
}

class Smoother {
 public:
  Smoother(const SegmentModel& model, const ModelChange& change, const SegmentedRun& run,
           const std::vector<double>& noise)
      : model_(model), run_(run), noise_(noise), propagation_(model.sheet(), in_run(change, run), run.period) {
    find_sizes();
    find_process_noise(change);
  }

  // Log likelihood of the innovations over at most `rows` rows of a stretch; keeps what backwards() needs if `keep`.
  // `anew`: linearised along this course, else along that of the last call that was, over the same rows.
  double forwards(const Stretched& stretch, double q, std::size_t rows, bool keep, bool anew) {
    passed_.clear();
    if (anew) linear_.clear();
    Eigen::VectorXd x = shown(model_, run_, stretch.first, propagation_.own_start(run_.recording, stretch.first));
    Eigen::MatrixXd p = sizes_.cwiseAbs2().asDiagonal();
    double likelihood = 0;
    const std::size_t last = std::min(stretch.last, stretch.first + rows);
    for (std::size_t k = stretch.first; k < last; ++k) {
      Passed now;
      now.before = x;
      now.before_covariance = p;
      const std::size_t from = std::min(k, stretch.last - 2);  // the last row has no step of its own
      if (anew) {
        linear_.emplace_back();
        propagation_.jacobians(run_.recording, from, x, steps_, linear_.back().f, linear_.back().h);
      }
      if (linear_.size() <= k - stretch.first) return -kInfinity;  // that course ended here
      const auto& [f, h] = linear_[k - stretch.first];
      const Step here = propagation_.step(run_.recording, from, x);
      if (!finite(f) || !finite(h) || !here.outputs.allFinite()) return -kInfinity;
      for (Eigen::Index o = 0; o < h.rows(); ++o) {
        const auto output = static_cast<std::size_t>(o);
        const auto c = static_cast<std::size_t>(model_.outputs()[output]);
        const double y = run_.recording.at(k, c);
        if (!measures(model_.sheet().channels[c], y)) continue;
        const Eigen::VectorXd ph = p * h.row(o).transpose();
        const double variance = h.row(o).dot(ph) + noise_[output] * noise_[output];
        const double innovation = y - here.outputs[o] - h.row(o).dot(x - now.before);
        x += ph * (innovation / variance);
        p -= ph * ph.transpose() / variance;
        likelihood -= 0.5 * (innovation * innovation / variance + std::log(variance));
      }
      now.after = x;
      now.after_covariance = p;
      if (k + 1 < stretch.last) {
        x = propagation_.step(run_.recording, k, x).next;
        p = f * p * f.transpose();
        p.diagonal() += q * process_;
        p = 0.5 * (p + p.transpose().eval());
      }
      if (!x.allFinite() || !finite(p)) return -kInfinity;
      if (keep) passed_.push_back(std::move(now));
    }
    return likelihood;
  }

  double best_q() {
    const Stretched& longest =
        *std::max_element(run_.stretches.begin(), run_.stretches.end(),
                          [](const Stretched& a, const Stretched& b) { return a.last - a.first < b.last - b.first; });
    double best = 1, most = -kInfinity;
    forwards(longest, best, kLikelihoodRows, false, true);
    for (int power = kLeastPower; power <= kMostPower; ++power) {
      const double likelihood = forwards(longest, std::pow(10, power), kLikelihoodRows, false, false);
      if (likelihood <= most) continue;
      most = likelihood;
      best = std::pow(10, power);
    }
    return best;
  }

  // After forwards() over a whole stretch; visit(row, mean, covariance) from its last row to its first.
  template <class Visit>
  void backwards(const Stretched& stretch, Visit&& visit) {
    Eigen::VectorXd x;
    Eigen::MatrixXd p;
    for (std::size_t i = passed_.size(); i-- > 0;) {
      const Passed& now = passed_[i];
      if (i + 1 == passed_.size()) {
        x = now.after;
        p = now.after_covariance;
      } else {
        const Passed& next = passed_[i + 1];
        const Eigen::LDLT<Eigen::MatrixXd> predicted(next.before_covariance);
        const Eigen::MatrixXd c = predicted.solve(linear_[i].f * now.after_covariance).transpose();
        x = now.after + c * (x - next.before);
        p = now.after_covariance + c * (p - next.before_covariance) * c.transpose();
      }
      visit(stretch.first + i, x, p);
    }
  }

 private:
  struct Passed {
    Eigen::VectorXd before, after;  // the correction
    Eigen::MatrixXd before_covariance, after_covariance;
  };
  struct Linear {
    Eigen::MatrixXd f, h;
  };

  // Largest magnitude of each state, measured or in the model's own course.
  void find_sizes() {
    const Stretched& stretch = run_.stretches.front();
    Eigen::VectorXd x = propagation_.own_start(run_.recording, stretch.first);
    sizes_ = x.cwiseAbs();
    for (std::size_t k = stretch.first; k + 1 < std::min(stretch.last, stretch.first + kLikelihoodRows); ++k) {
      x = propagation_.step(run_.recording, k, shown(model_, run_, k, x)).next;
      if (!x.allFinite()) break;
      sizes_ = sizes_.cwiseMax(x.cwiseAbs());
    }
    steps_ = difference_steps(model_.sheet(), sizes_);
    sizes_ = sizes_.cwiseMax(steps_);
  }

  void find_process_noise(const ModelChange& change) {
    process_ = (kLeastNoise * sizes_).cwiseAbs2();
    const Stretched& stretch = run_.stretches.front();
    const Datasheet& sheet = model_.sheet();
    const std::size_t every = std::max<std::size_t>(1, (stretch.last - stretch.first - 1) / kToleranceRows);
    std::vector<std::size_t> rows;
    std::vector<Eigen::VectorXd> states, next;
    Eigen::VectorXd x = propagation_.own_start(run_.recording, stretch.first);
    for (std::size_t k = stretch.first; k + 1 < stretch.last && rows.size() < kToleranceRows; ++k) {
      x = shown(model_, run_, k, x);
      const Eigen::VectorXd after = propagation_.step(run_.recording, k, x).next;
      if (!after.allFinite()) break;
      if ((k - stretch.first) % every == 0) {
        rows.push_back(k);
        states.push_back(x);
        next.push_back(after);
      }
      x = after;
    }
    for (std::size_t i = 0; i < sheet.parameters.size(); ++i) {
      const Parameter& parameter = sheet.parameters[i];
      if (parameter.tolerance <= 0) continue;
      ModelChange moved = change;
      moved.parameters[i] += parameter.tolerance * parameter.nominal;
      Propagation other(sheet, in_run(moved, run_), run_.period);
      for (std::size_t r = 0; r < rows.size(); ++r) {
        const Eigen::VectorXd off = other.step(run_.recording, rows[r], states[r]).next - next[r];
        if (off.allFinite()) process_ += off.cwiseAbs2() / static_cast<double>(rows.size());
      }
    }
  }

  const SegmentModel& model_;
  const SegmentedRun& run_;
  const std::vector<double>& noise_;
  Propagation propagation_;
  Eigen::VectorXd sizes_, steps_, process_;
  std::vector<Passed> passed_;
  std::vector<Linear> linear_;  // per row of the stretch
};

}  // namespace

std::vector<int> hidden_states(const SegmentModel& model, const SegmentedRun& run) {
  std::vector<int> hidden;
  for (std::size_t s = 0; s < model.shown_by().size(); ++s)
    if (model.shown_by()[s] < 0 && model.sheet().states[s].channel < 0) hidden.push_back(static_cast<int>(s));
  if (hidden.empty() || runs_on_from_its_own_start(model.sheet())) return {};
  Propagation propagation(model.sheet(), model.nominal(), run.period);
  const Eigen::VectorXd start = propagation.own_start(run.recording, run.restarts.front());
  const Eigen::VectorXd steps = difference_steps(model.sheet(), start.cwiseAbs());
  std::vector<double> lasting;  // samples
  for (std::size_t i = 0; i < kJudgedRows; ++i) {
    // The last segment may be the last row alone; a step begins before it.
    const std::size_t row =
        std::min(run.restarts[i * (run.segments() - 1) / (kJudgedRows - 1)], run.recording.rows() - 2);
    Eigen::MatrixXd f, h;
    propagation.jacobians(run.recording, row, shown(model, run, row, start), steps, f, h);
    Eigen::MatrixXd own(static_cast<Eigen::Index>(hidden.size()), static_cast<Eigen::Index>(hidden.size()));
    for (Eigen::Index a = 0; a < own.rows(); ++a)
      for (Eigen::Index b = 0; b < own.cols(); ++b)
        own(a, b) = f(hidden[static_cast<std::size_t>(a)], hidden[static_cast<std::size_t>(b)]);
    if (!finite(own)) continue;
    const double radius = own.eigenvalues().cwiseAbs().maxCoeff();
    lasting.push_back(radius < 1 ? -1 / std::log(std::max(radius, 1e-300)) : kInfinity);
  }
  if (lasting.empty()) return {};
  const auto middle = lasting.begin() + static_cast<std::ptrdiff_t>(lasting.size() / 2);
  std::nth_element(lasting.begin(), middle, lasting.end());
  return *middle > kForgotten * static_cast<double>(run.segment) ? hidden : std::vector<int>();
}

StateCourse smooth_states(const SegmentModel& model, const ModelChange& change, const SegmentedRun& run,
                          const std::vector<double>& noise, const std::vector<std::size_t>& rows) {
  StateCourse course;
  const auto n = static_cast<Eigen::Index>(model.sheet().states.size());
  course.mean.assign(rows.size(), Eigen::VectorXd::Constant(n, std::nan("")));
  course.covariance.assign(rows.size(), Eigen::MatrixXd::Zero(n, n));
  Smoother smoother(model, change, run, noise);
  const double q = smoother.best_q();
  const auto pass = [&](const Stretched& stretch, double noise_ratio, bool means) {
    smoother.forwards(stretch, noise_ratio, stretch.last - stretch.first, true, means);
    smoother.backwards(stretch, [&](std::size_t row, const Eigen::VectorXd& mean, const Eigen::MatrixXd& covariance) {
      const auto at = std::lower_bound(rows.begin(), rows.end(), row);
      if (at == rows.end() || *at != row) return;
      const auto i = static_cast<std::size_t>(at - rows.begin());
      if (means) course.mean[i] = mean;
      course.covariance[i] = covariance;
    });
  };
  for (const Stretched& stretch : run.stretches) {
    pass(stretch, q, true);
    if (q < 1) pass(stretch, 1, false);
  }
  return course;
}

}  // namespace faultline
