#include "faultline/gap/free_signal_filter.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Cholesky>

#include "faultline/numerics/in_parallel.h"

namespace faultline {
namespace {

constexpr double kRounding = 1e-9;           // of a variance
constexpr double kFirstSigma = 4;            // of a state at the head of a stretch, in noise of what shows it
constexpr double kLeastBlockVariance = 0.2;  // of the innovations' own: a block cannot be better than its noise
constexpr double kTrimmed = 0.1;             // of the blocks, the worst ones, that do not speak for the process noise

// State, covariance and what the prediction used, of one row.
struct FilteredRow {
  Eigen::VectorXd before, after;
  Eigen::MatrixXd before_covariance, after_covariance, map;
};

// Most: states and signal together, at most; a number that the compiler knows spares the heap.
template <int Most>
class Filter {
  using Vector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, Most, 1>;
  using Square = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, Most, Most>;

 public:
  Filter(const StochasticModel& model, const StochasticStretch& stretch, const Eigen::VectorXd& q,
         const FreeSignal& signal)
      : model_(model), stretch_(stretch), q_(q), signal_(signal), states_(model.size.size()) {
    with_ = signal.port >= 0 ? 1 : 0;
    if (with_) {
      shows_ = model.shows[static_cast<std::size_t>(signal.port)];
      shown_ = model.shown[static_cast<std::size_t>(signal.port)];
      const Eigen::MatrixXd& drive = stretch.port_drives[static_cast<std::size_t>(signal.port)];
      if (drive.size() > 0) drive_ = &drive;
      keep_ = std::exp(-model.step / signal.memory);
    }
    n_ = states_ + with_;
    x_ = Vector::Zero(n_);
    // What is known at the head: shown states to a few times the noise, others to their size.
    Vector first = Vector::Ones(n_);
    const Eigen::MatrixXd& h = stretch.h.front();
    for (Eigen::Index o = 0; o < h.rows(); ++o)
      for (Eigen::Index s = 0; s < states_; ++s)
        if (std::abs(h(o, s)) > 0 && h.row(o).cwiseAbs().sum() == std::abs(h(o, s)))
          first[s] = std::min(1.0, kFirstSigma * kFirstSigma / (h(o, s) * h(o, s)));
    if (with_) first[states_] = signal.level * signal.level;
    p_ = first.asDiagonal();
    map_ = Square::Identity(n_, n_);
    information_ = Square::Zero(n_, n_);
    weighted_ = Vector::Zero(n_);
  }

  // Through all rows; visit(row, innovation, S) for every reading, done(row) after each row.
  template <class Visit, class Done>
  void run(Visit&& visit, Done&& done) {
    Vector row(n_), gain(n_);
    for (std::size_t i = 0; i < stretch_.rows.size(); ++i) {
      if (record_) start_record();
      const Eigen::VectorXd& misfit = stretch_.misfit[i];
      for (Eigen::Index o = 0; o < misfit.size(); ++o) {
        if (std::isnan(misfit[o])) continue;
        row.head(states_) = stretch_.h[i].row(o).transpose();
        if (with_) row[states_] = shows_ == o ? shown_ : 0.0;
        gain.noalias() = p_ * row;
        const double s = row.dot(gain) + 1;
        const double innovation = misfit[o] - row.dot(x_);
        if (courses_) {
          response_.noalias() = row.transpose() * known_;
          if (with_ && shows_ == o) response_ += shown_ * courses_->row(static_cast<Eigen::Index>(i));
        }
        visit(i, innovation, s);
        if (courses_) known_.noalias() -= gain * (response_ / s);
        x_ += gain * (innovation / s);
        p_.noalias() -= gain * (gain.transpose() / s);
      }
      done(i);
      if (i + 1 == stretch_.rows.size()) break;
      predict(i);
      if (courses_) {
        known_ = (map_ * known_).eval();
        const auto at = static_cast<Eigen::Index>(i);
        if (drive_) known_.topRows(states_) += drive_->col(at) * courses_->row(at);
      }
    }
  }

  // All readings of row i at once, by the matrix inversion lemma: for many readings of few states much less work.
  //   P = L L', A = I + L' H'H L:  P+ = L A^-1 L', e+ = e + P+ H'r, sum of log S = log |A|, r'S^-1 r = r'r - r'H P+ H'r
  // Returns r'S^-1 r and the sum of logarithms.
  std::pair<double, double> take(std::size_t i, const GatheredRow& row) {
    information_.topLeftCorner(states_, states_) = row.information;
    weighted_.head(states_) = row.weighted;
    if (with_) {
      information_.col(states_).setZero();
      information_.row(states_).setZero();
      weighted_[states_] = 0;
      const double misfit = shows_ >= 0 ? stretch_.misfit[i][shows_] : std::nan("");
      if (!std::isnan(misfit)) {
        information_.col(states_).head(states_) = shown_ * stretch_.h[i].row(shows_).transpose();
        information_.row(states_).head(states_) = information_.col(states_).head(states_).transpose();
        information_(states_, states_) = shown_ * shown_;
        weighted_[states_] = shown_ * misfit;
      }
    }
    const Vector seen = information_.lazyProduct(x_);
    const double before = row.square - 2 * x_.dot(weighted_) + x_.dot(seen);  // r'r
    const Vector news = weighted_ - seen;                                     // H'r
    Eigen::LLT<Square> known(p_);
    if (known.info() != Eigen::Success) {  // rounding: two states that are nearly one
      p_.diagonal() *= 1 + kRounding;
      known.compute(p_);
    }
    const Square root = known.matrixL();
    product_.noalias() = information_.lazyProduct(root);
    Square inner = root.transpose().lazyProduct(product_);
    inner.diagonal().array() += 1;
    const Eigen::LLT<Square> factor(inner);
    const Square half = factor.matrixL().solve(root.transpose().eval());
    p_.noalias() = half.transpose().lazyProduct(half);
    const Vector moved = p_.lazyProduct(news);
    x_ += moved;
    return {before - news.dot(moved), 2 * factor.matrixLLT().diagonal().array().log().sum()};
  }

  // To the row after i.
  void predict(std::size_t i) {
    set_map(i, map_);
    x_ = map_.lazyProduct(x_).eval();
    x_.head(states_) += stretch_.defect[i];
    product_.noalias() = map_.lazyProduct(p_);
    p_.noalias() = product_.lazyProduct(map_.transpose());
    p_.diagonal().head(states_) += q_ + stretch_.bend[i];
    if (stretch_.lost[i]) p_.diagonal().head(states_).array() += 1;
    if (with_) p_(states_, states_) += signal_.level * signal_.level * (1 - keep_ * keep_);
    p_ = 0.5 * (p_ + p_.transpose().eval());
  }

  void record(std::vector<FilteredRow>& into) { record_ = &into; }
  void start_record() {
    record_->emplace_back();
    record_->back().before = x_;
    record_->back().before_covariance = p_;
  }
  // Known courses of the signal, rows x courses; response(): what of the reading that is visited each makes.
  void follow(const Eigen::MatrixXd& courses) {
    courses_ = &courses;
    known_ = Eigen::MatrixXd::Zero(n_, courses.cols());
  }
  const Eigen::RowVectorXd& response() const { return response_; }
  const Vector& x() const { return x_; }
  const Square& p() const { return p_; }
  Eigen::Index states() const { return states_; }

  // The map from row i to the next.
  Square map(std::size_t i) const {
    Square m = Square::Identity(n_, n_);
    set_map(i, m);
    return m;
  }

 private:
  void set_map(std::size_t i, Square& m) const {
    m.topLeftCorner(states_, states_) = stretch_.f[i];
    if (!with_) return;
    if (drive_) m.col(states_).head(states_) = drive_->col(static_cast<Eigen::Index>(i));
    m(states_, states_) = keep_;
  }

  const StochasticModel& model_;
  const StochasticStretch& stretch_;
  const Eigen::VectorXd& q_;
  const FreeSignal& signal_;
  Eigen::Index states_, n_ = 0;
  int with_ = 0, shows_ = -1;
  const Eigen::MatrixXd* drive_ = nullptr;
  double keep_ = 1, shown_ = 0;
  Vector x_, weighted_;
  Square p_, map_, information_, product_;
  std::vector<FilteredRow>* record_ = nullptr;
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

template <int Most>
std::vector<double> losses_of(const StochasticModel& model, const GatheredRows& rows, const Eigen::VectorXd& q,
                              const FreeSignal& signal) {
  std::vector<double> losses;
  for (std::size_t n = 0; n < model.stretches.size(); ++n) {
    const StochasticStretch& stretch = model.stretches[n];
    const std::size_t blocks = blocks_of(model, stretch);
    std::vector<double> squares(blocks, 0), logs(blocks, 0), count(blocks, 0);
    Filter<Most> filter(model, stretch, q, signal);
    for (std::size_t i = 0; i < stretch.rows.size(); ++i) {
      if (i > 0) filter.predict(i - 1);
      const GatheredRow& row = rows[n][i];
      if (row.count == 0) continue;
      const auto [square, log] = filter.take(i, row);
      const std::size_t b = i / model.block;
      squares[b] += square;
      logs[b] += log;
      count[b] += row.count;
    }
    for (std::size_t b = 0; b < blocks; ++b) {
      const double variance = block_variance(squares[b], count[b]);
      const double loss = 0.5 * logs[b] + 0.5 * count[b] * std::log(variance);
      losses.push_back(std::isfinite(loss) ? loss : 1e9);
    }
  }
  return losses;
}

constexpr int kFew = 16;  // states and signal

template <int Most>
FilteredStretch filter_stretch(const StochasticModel& model, const StochasticStretch& stretch,
                               const std::vector<GatheredRow>& rows, const Eigen::VectorXd& q) {
  FilteredStretch result;
  const FreeSignal none;
  Filter<Most> filter(model, stretch, q, none);
  result.square.assign(blocks_of(model, stretch), 0);
  result.count = result.square;
  for (std::size_t i = 0; i < stretch.rows.size(); ++i) {
    if (i > 0) filter.predict(i - 1);
    result.predicted.emplace_back(filter.x());
    if (rows[i].count > 0) result.square[i / model.block] += filter.take(i, rows[i]).first;
    result.count[i / model.block] += rows[i].count;
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

template <int Most>
SmoothedStretch smooth_stretch(const StochasticModel& model, const StochasticStretch& stretch, const Eigen::VectorXd& q,
                               const FreeSignal& signal) {
  using Vector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, Most, 1>;
  using Square = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, Most, Most>;
  const Eigen::Index states = model.size.size();
  std::vector<FilteredRow> passed;
  passed.reserve(stretch.rows.size());
  Filter<Most> filter(model, stretch, q, signal);
  filter.record(passed);
  filter.run([](std::size_t, double, double) {},
             [&](std::size_t) {
               passed.back().after = filter.x();
               passed.back().after_covariance = filter.p();
             });
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

GatheredRows gather(const StochasticModel& model) {
  GatheredRows result;
  for (const StochasticStretch& stretch : model.stretches) {
    std::vector<GatheredRow>& rows = result.emplace_back();
    for (std::size_t i = 0; i < stretch.rows.size(); ++i) {
      // What does not count weighs nothing.
      const Eigen::VectorXd counts = (stretch.misfit[i].array() == stretch.misfit[i].array()).cast<double>();
      const Eigen::VectorXd misfit = (counts.array() > 0).select(stretch.misfit[i], 0);
      const Eigen::MatrixXd h = counts.asDiagonal() * stretch.h[i];
      rows.push_back({h.transpose() * h, h.transpose() * misfit, misfit.squaredNorm(), counts.sum()});
    }
  }
  return result;
}

std::vector<double> block_losses(const StochasticModel& model, const GatheredRows& rows, const Eigen::VectorXd& q,
                                 const FreeSignal& signal) {
  return model.size.size() < kFew ? losses_of<kFew>(model, rows, q, signal)
                                  : losses_of<Eigen::Dynamic>(model, rows, q, signal);
}

std::vector<FilteredStretch> filter_stretches(const StochasticModel& model, const GatheredRows& rows,
                                              const Eigen::VectorXd& q, int jobs) {
  std::vector<FilteredStretch> result(model.stretches.size());
  in_parallel(result.size(), jobs, [&](std::size_t n) {
    const StochasticStretch& stretch = model.stretches[n];
    result[n] = model.size.size() < kFew ? filter_stretch<kFew>(model, stretch, rows[n], q)
                                         : filter_stretch<Eigen::Dynamic>(model, stretch, rows[n], q);
  });
  return result;
}

Smoothing smooth(const StochasticModel& model, const Eigen::VectorXd& q, const FreeSignal& signal, int jobs) {
  std::vector<SmoothedStretch> parts(model.stretches.size());
  in_parallel(parts.size(), jobs, [&](std::size_t n) {
    parts[n] = model.size.size() < kFew ? smooth_stretch<kFew>(model, model.stretches[n], q, signal)
                                        : smooth_stretch<Eigen::Dynamic>(model, model.stretches[n], q, signal);
  });
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
    Filter<Eigen::Dynamic> filter(model, stretch, q, signal);
    filter.follow(courses[n]);
    filter.run(
        [&](std::size_t, double innovation, double variance) {
          a.row(readings) = filter.response() / std::sqrt(variance);
          r[readings++] = innovation / std::sqrt(variance);
        },
        [&](std::size_t i) {
          if ((i + 1) % model.block == 0 || i + 1 == stretch.rows.size()) close(i / model.block);
        });
    for (std::size_t p = first; p < result.size(); ++p)
      result[p].a.triangularView<Eigen::StrictlyUpper>() = result[p].a.transpose();
  }
  return result;
}

}  // namespace faultline
