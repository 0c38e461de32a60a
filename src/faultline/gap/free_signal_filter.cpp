#include "faultline/gap/free_signal_filter.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Cholesky>

#include "faultline/numerics/covariance.h"
#include "faultline/numerics/in_parallel.h"

namespace faultline {
namespace {

constexpr double kFirstSigma = 4;            // of a state at the head of a stretch, in noise of what shows it
constexpr double kLeastBlockVariance = 0.2;  // of the innovations' own: a block cannot be better than its noise
constexpr double kLarge = 1e100;             // a product from which its logarithm is taken: not of each factor
constexpr double kTrimmed = 0.1;             // of the blocks, the worst ones, that do not speak for the process noise

// State and covariance before and after the readings of one row.
struct FilteredRow {
  Eigen::VectorXd before, after;
  Eigen::MatrixXd before_covariance, after_covariance;
};

class Filter {
 public:
  Filter(const StochasticModel& model, const StochasticStretch& stretch, const Eigen::VectorXd& q,
         const FreeSignal& signal)
      : stretch_(stretch),
        q_(q),
        signal_(signal),
        states_(model.size.size()),
        n_(states_ + (signal.port >= 0 ? 1 : 0)),
        with_(n_ > states_),
        x_(Eigen::VectorXd::Zero(n_)),
        moved_(n_),
        row_(n_),
        map_(Eigen::MatrixXd::Identity(n_, n_)),
        p_(at_head()) {
    if (!with_) return;
    shows_ = model.shows[static_cast<std::size_t>(signal.port)];
    shown_ = model.shown[static_cast<std::size_t>(signal.port)];
    const Eigen::MatrixXd& drive = stretch.port_drives[static_cast<std::size_t>(signal.port)];
    if (drive.size() > 0) drive_ = &drive;
    keep_ = std::exp(-model.step / signal.memory);
  }

  // The readings of row i, one after the other; visit(innovation, S) for each.
  template <class Visit>
  void take(std::size_t i, Visit&& visit) {
    const Eigen::VectorXd& misfit = stretch_.misfit[i];
    for (Eigen::Index o = 0; o < misfit.size(); ++o) {
      if (std::isnan(misfit[o])) continue;
      row_.head(states_) = stretch_.h[i].row(o).transpose();
      if (with_) row_[states_] = shows_ == o ? shown_ : 0.0;
      const double innovation = misfit[o] - row_.dot(x_);
      const double variance = p_.take(row_);
      if (courses_) {
        response_.noalias() = row_.transpose() * known_;
        if (with_ && shows_ == o) response_ += shown_ * courses_->row(static_cast<Eigen::Index>(i));
        known_.noalias() -= p_.gain() * response_;
      }
      visit(innovation, variance);
      x_ += p_.gain() * innovation;
    }
  }

  // To the row after i.
  void predict(std::size_t i) {
    set_map(i, map_);
    moved_.noalias() = map_ * x_;
    moved_.head(states_) += stretch_.defect[i];
    x_.swap(moved_);
    p_.propagate(map_);
    p_.variances().head(states_) += q_ + stretch_.bend[i];
    if (stretch_.lost[i]) p_.variances().head(states_).array() += 1;
    if (with_) p_.variances()[states_] += signal_.level * signal_.level * (1 - keep_ * keep_);
    if (!courses_) return;
    known_ = (map_ * known_).eval();
    const auto at = static_cast<Eigen::Index>(i);
    if (drive_) known_.topRows(states_) += drive_->col(at) * courses_->row(at);
  }

  // Known courses of the signal, rows x courses; response(): what of the reading that is visited each makes.
  void follow(const Eigen::MatrixXd& courses) {
    courses_ = &courses;
    known_ = Eigen::MatrixXd::Zero(n_, courses.cols());
  }
  const Eigen::RowVectorXd& response() const { return response_; }
  const Eigen::VectorXd& x() const { return x_; }
  auto p() const { return p_.matrix(); }

  // The map from row i to the next.
  Eigen::MatrixXd map(std::size_t i) const {
    Eigen::MatrixXd m = Eigen::MatrixXd::Identity(n_, n_);
    set_map(i, m);
    return m;
  }

 private:
  // What is known at the head: shown states to a few times the noise, others to their size.
  Eigen::VectorXd at_head() const {
    Eigen::VectorXd first = Eigen::VectorXd::Ones(n_);
    const Eigen::MatrixXd& h = stretch_.h.front();
    for (Eigen::Index o = 0; o < h.rows(); ++o)
      for (Eigen::Index s = 0; s < states_; ++s)
        if (std::abs(h(o, s)) > 0 && h.row(o).cwiseAbs().sum() == std::abs(h(o, s)))
          first[s] = std::min(1.0, kFirstSigma * kFirstSigma / (h(o, s) * h(o, s)));
    if (with_) first[states_] = signal_.level * signal_.level;
    return first;
  }

  void set_map(std::size_t i, Eigen::MatrixXd& m) const {
    m.topLeftCorner(states_, states_) = stretch_.f[i];
    if (!with_) return;
    if (drive_) m.col(states_).head(states_) = drive_->col(static_cast<Eigen::Index>(i));
    m(states_, states_) = keep_;
  }

  const StochasticStretch& stretch_;
  const Eigen::VectorXd& q_;
  FreeSignal signal_;
  Eigen::Index states_, n_;
  bool with_;
  int shows_ = -1;
  const Eigen::MatrixXd* drive_ = nullptr;
  double keep_ = 1, shown_ = 0;
  Eigen::VectorXd x_, moved_, row_;
  Eigen::MatrixXd map_;
  Covariance p_;
  const Eigen::MatrixXd* courses_ = nullptr;
  Eigen::MatrixXd known_;  // what of x_ each course makes
  Eigen::RowVectorXd response_;
};

std::size_t blocks_of(const StochasticModel& model, const StochasticStretch& stretch) {
  return (stretch.rows.size() + model.block - 1) / model.block;
}

double trimmed_mean(std::vector<double> values) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  const auto keep =
      std::max<std::size_t>(1, values.size() - static_cast<std::size_t>(kTrimmed * static_cast<double>(values.size())));
  double sum = 0;
  for (std::size_t i = 0; i < keep; ++i) sum += values[i];
  return sum / static_cast<double>(keep);
}

FilteredStretch filter_stretch(const StochasticModel& model, const StochasticStretch& stretch,
                               const Eigen::VectorXd& q) {
  FilteredStretch result;
  Filter filter(model, stretch, q, {});
  result.square.assign(blocks_of(model, stretch), 0);
  result.count = result.square;
  for (std::size_t i = 0; i < stretch.rows.size(); ++i) {
    if (i > 0) filter.predict(i - 1);
    result.predicted.push_back(filter.x());
    double& square = result.square[i / model.block];
    double& count = result.count[i / model.block];
    filter.take(i, [&](double innovation, double variance) {
      square += innovation * innovation / variance;
      count += 1;
    });
    result.known.emplace_back(filter.p());
  }
  return result;
}

// What the backward pass says of one stretch.
struct SmoothedStretch {
  Eigen::MatrixXd course;  // states and signal x rows
  Eigen::VectorXd spread;
  std::vector<Eigen::VectorXd> squares;  // per block: mean squared process noise
  Eigen::VectorXd known;                 // mean variance of the states after a row's readings
};

SmoothedStretch smooth_stretch(const StochasticModel& model, const StochasticStretch& stretch, const Eigen::VectorXd& q,
                               const FreeSignal& signal) {
  using Vector = Eigen::VectorXd;
  using Square = Eigen::MatrixXd;
  const Eigen::Index states = model.size.size();
  std::vector<FilteredRow> passed(stretch.rows.size());
  Filter filter(model, stretch, q, signal);
  for (std::size_t i = 0; i < passed.size(); ++i) {
    if (i > 0) filter.predict(i - 1);
    passed[i].before = filter.x();
    passed[i].before_covariance = filter.p();
    filter.take(i, [](double, double) {});
    passed[i].after = filter.x();
    passed[i].after_covariance = filter.p();
  }
  const auto rows = static_cast<Eigen::Index>(stretch.rows.size());
  const Eigen::Index n = passed.front().after.size();
  SmoothedStretch result{Eigen::MatrixXd(n, rows), Eigen::VectorXd::Zero(rows), {}, Eigen::VectorXd::Zero(states)};
  for (const FilteredRow& row : passed) result.known += row.after_covariance.diagonal().head(states);
  result.known /= static_cast<double>(rows);
  std::vector<Eigen::VectorXd> sums(blocks_of(model, stretch), Eigen::VectorXd::Zero(n));
  std::vector<double> counts(sums.size(), 0);
  Vector x = passed.back().after;
  Square p = passed.back().after_covariance;
  result.course.col(rows - 1) = x;
  if (n > states) result.spread[rows - 1] = std::sqrt(std::max(0.0, p(states, states)));
  for (std::size_t i = passed.size() - 1; i-- > 0;) {
    const FilteredRow& now = passed[i];
    const FilteredRow& next = passed[i + 1];
    const Square map = filter.map(i);
    const Square known = now.after_covariance, before = next.before_covariance;
    const Eigen::LDLT<Square> predicted(before);
    const Square c = predicted.solve(map * known).transpose();
    const Vector own = now.after + c * (x - next.before);
    const Square cross = p * c.transpose();  // of next and now
    const Square earlier = known + c * (p - before) * c.transpose();
    Vector missed = x - map * own;
    missed.head(states) -= stretch.defect[i];
    const Square spread_of = p + map * earlier * map.transpose() - cross * map.transpose() - map * cross.transpose();
    const std::size_t b = i / model.block;
    if (!stretch.lost[i]) {
      // Of what a step misses, the part that is process noise and not what the linear model leaves out.
      Vector square = missed.cwiseAbs2() + spread_of.diagonal();
      const Vector share = q.cwiseQuotient(q + stretch.bend[i]);
      square.head(states) = share.cwiseAbs2().cwiseProduct(square.head(states)) + share.cwiseProduct(stretch.bend[i]);
      sums[b] += square;
    }
    if (!stretch.lost[i]) counts[b] += 1;
    x = own;
    p = earlier;
    result.course.col(static_cast<Eigen::Index>(i)) = x;
    if (n > states) result.spread[static_cast<Eigen::Index>(i)] = std::sqrt(std::max(0.0, p(states, states)));
  }
  for (std::size_t b = 0; b < sums.size(); ++b)
    if (counts[b] > 0) result.squares.push_back(sums[b] / counts[b]);
  return result;
}

}  // namespace

double block_variance(double square, double count) {
  return count > 0 ? std::max(square / count, kLeastBlockVariance) : 1;
}

std::vector<double> block_losses(const StochasticModel& model, const Eigen::VectorXd& q, const FreeSignal& signal) {
  std::vector<double> losses;
  for (const StochasticStretch& stretch : model.stretches) {
    const std::size_t blocks = blocks_of(model, stretch);
    Filter filter(model, stretch, q, signal);
    for (std::size_t b = 0; b < blocks; ++b) {
      double square = 0, count = 0, logs = 0, product = 1;
      for (std::size_t i = b * model.block; i < std::min((b + 1) * model.block, stretch.rows.size()); ++i) {
        if (i > 0) filter.predict(i - 1);
        filter.take(i, [&](double innovation, double variance) {
          square += innovation * innovation / variance;
          product *= variance;  // at least 1
          if (product > kLarge) logs += std::log(std::exchange(product, 1));
          count += 1;
        });
      }
      const double loss = 0.5 * (logs + std::log(product)) + 0.5 * count * std::log(block_variance(square, count));
      losses.push_back(std::isfinite(loss) ? loss : 1e9);
    }
  }
  return losses;
}

std::vector<FilteredStretch> filter_stretches(const StochasticModel& model, const Eigen::VectorXd& q, int jobs) {
  std::vector<FilteredStretch> result(model.stretches.size());
  in_parallel(result.size(), jobs, [&](std::size_t n) { result[n] = filter_stretch(model, model.stretches[n], q); });
  return result;
}

Smoothing smooth(const StochasticModel& model, const Eigen::VectorXd& q, const FreeSignal& signal, int jobs) {
  std::vector<SmoothedStretch> parts(model.stretches.size());
  in_parallel(parts.size(), jobs,
              [&](std::size_t n) { parts[n] = smooth_stretch(model, model.stretches[n], q, signal); });
  Smoothing result;
  const Eigen::Index states = model.size.size();
  std::vector<std::vector<double>> squares(static_cast<std::size_t>(states) + 1);  // per block
  result.known = Eigen::VectorXd::Zero(states);
  double rows = 0;
  for (SmoothedStretch& part : parts) {
    result.known += part.known * static_cast<double>(part.course.cols());
    rows += static_cast<double>(part.course.cols());
    const Eigen::Index n = part.course.rows();
    for (const Eigen::VectorXd& mean : part.squares)
      for (Eigen::Index s = 0; s < n; ++s)
        if (std::isfinite(mean[s])) squares[static_cast<std::size_t>(s)].push_back(std::max(0.0, mean[s]));
    result.states.push_back(part.course.topRows(states));
    result.signal.push_back(n > states ? Eigen::VectorXd(part.course.row(states).transpose()) : Eigen::VectorXd());
    result.spread.push_back(std::move(part.spread));
  }
  result.known = (result.known / rows).cwiseSqrt();
  result.q.resize(states);
  for (Eigen::Index s = 0; s < states; ++s) result.q[s] = trimmed_mean(squares[static_cast<std::size_t>(s)]);
  if (signal.port >= 0) {
    const double keep = std::exp(-model.step / signal.memory);
    result.level = std::sqrt(trimmed_mean(squares.back()) / std::max(1e-300, 1 - keep * keep));
  }
  return result;
}

std::vector<SignalEquations> signal_equations(const StochasticModel& model, const Eigen::VectorXd& q,
                                              const FreeSignal& signal, const std::vector<Eigen::MatrixXd>& courses,
                                              std::size_t parts) {
  std::vector<SignalEquations> result;
  const Eigen::Index count = courses.front().cols();
  for (std::size_t n = 0; n < model.stretches.size(); ++n) {
    const StochasticStretch& stretch = model.stretches[n];
    const std::size_t blocks = blocks_of(model, stretch), first = result.size();
    for (std::size_t p = 0; p < parts; ++p)
      result.push_back({stretch.run, Eigen::MatrixXd::Zero(count, count), Eigen::VectorXd::Zero(count)});
    Eigen::MatrixXd a(stretch.misfit.front().size() * static_cast<Eigen::Index>(model.block), count);
    Eigen::VectorXd r(a.rows());
    Eigen::Index readings = 0;
    const auto close = [&](std::size_t block) {
      if (readings == 0) return;
      const double variance =
          std::max(r.head(readings).squaredNorm() / static_cast<double>(readings), kLeastBlockVariance);
      SignalEquations& part = result[first + block * parts / blocks];
      if (std::isfinite(variance) && a.topRows(readings).allFinite()) {
        part.a.selfadjointView<Eigen::Lower>().rankUpdate(a.topRows(readings).transpose(), 1 / variance);
        part.b.noalias() += a.topRows(readings).transpose() * r.head(readings) / variance;
      }
      readings = 0;
    };
    Filter filter(model, stretch, q, signal);
    filter.follow(courses[n]);
    for (std::size_t i = 0; i < stretch.rows.size(); ++i) {
      if (i > 0) filter.predict(i - 1);
      filter.take(i, [&](double innovation, double variance) {
        a.row(readings) = filter.response() / std::sqrt(variance);
        r[readings++] = innovation / std::sqrt(variance);
      });
      if ((i + 1) % model.block == 0 || i + 1 == stretch.rows.size()) close(i / model.block);
    }
    for (std::size_t p = first; p < result.size(); ++p)
      result[p].a.triangularView<Eigen::StrictlyUpper>() = result[p].a.transpose();
  }
  return result;
}

}  // namespace faultline
