#include "faultline/gap/signal_scan.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "faultline/numerics/in_parallel.h"

namespace faultline {
namespace {

constexpr std::size_t kBumpsPerBlock = 10;  // as fine as a signal's shape shows in what a block says
constexpr std::size_t kChunk = 20;          // bumps; two blocks, over which a filter forgets an error
constexpr std::size_t kSpan = 4;            // blocks over which what a bump does is told apart: a chunk, and after
constexpr double kWeakest = 1e-7, kStrongest = 1;  // levels that are tried, in the port's unit
constexpr double kMiddleMemory = 0.3;              // of a block: a memory between bumps and blocks
constexpr double kShortest = 0.1, kLongest = 100;  // memories that are tried, over the middle one

// The readings of a row as one: of H and y - m, over those that count.
struct GatheredRow {
  Eigen::MatrixXd information;  // H'H
  Eigen::VectorXd weighted;     // H'(y - m)
};

GatheredRow gather(const StochasticStretch& stretch, std::size_t i) {
  const Eigen::VectorXd counts = (stretch.misfit[i].array() == stretch.misfit[i].array()).cast<double>();
  const Eigen::VectorXd misfit = (counts.array() > 0).select(stretch.misfit[i], 0);
  const Eigen::MatrixXd h = counts.asDiagonal() * stretch.h[i];  // what does not count weighs nothing
  return {h.transpose() * h, h.transpose() * misfit};
}

// What serves all ports: the filter's loop along a stretch.
struct Loop {
  std::vector<Eigen::MatrixXd> step;       // L, per row but the last
  std::vector<Eigen::MatrixXd> shows;      // J, per row
  std::vector<Eigen::MatrixXd> seen;       // M, per row
  std::vector<Eigen::MatrixXd> ahead;      // N, per row
  std::vector<Eigen::VectorXd> score;      // r, per row
  std::vector<Eigen::VectorXd> news;       // H'v, per row
  std::vector<std::size_t> heads;          // first row of each bump
  std::vector<Eigen::MatrixXd> bump_step;  // L over a bump
  std::vector<Eigen::MatrixXd> bump_seen;  // information of a bump's rows about an error at its head
};

Loop close_loop(const StochasticModel& model, const StochasticStretch& stretch, const FilteredStretch& filtered) {
  const std::size_t count = stretch.rows.size();
  const Eigen::Index states = model.size.size();
  Loop loop;
  loop.step.resize(count - 1);
  loop.shows.resize(count);
  loop.seen.resize(count);
  loop.ahead.resize(count);
  loop.score.resize(count);
  loop.news.resize(count);
  for (std::size_t i = count; i-- > 0;) {
    GatheredRow row = gather(stretch, i);
    loop.shows[i] = std::move(row.information);
    const Eigen::MatrixXd& information = loop.shows[i];
    const Eigen::MatrixXd told = filtered.known[i] * information;  // P J
    loop.news[i] = row.weighted - information * filtered.predicted[i];
    loop.seen[i] = information;
    loop.seen[i].noalias() -= information * told;
    loop.score[i] = loop.news[i] - told.transpose() * loop.news[i];
    loop.ahead[i] = loop.seen[i];
    if (i + 1 == count) continue;
    loop.step[i].noalias() = stretch.f[i] * (Eigen::MatrixXd::Identity(states, states) - told);
    loop.ahead[i].noalias() += loop.step[i].transpose() * (loop.ahead[i + 1] * loop.step[i]);
    loop.score[i].noalias() += loop.step[i].transpose() * loop.score[i + 1];
  }
  const std::size_t bump = std::max<std::size_t>(1, model.block / kBumpsPerBlock);
  for (std::size_t head = 0; head < count; head += bump) {
    loop.heads.push_back(head);
    Eigen::MatrixXd over = Eigen::MatrixXd::Identity(states, states);
    for (std::size_t i = head; i < std::min(head + bump, count - 1); ++i) over = loop.step[i] * over;
    loop.bump_seen.push_back(loop.ahead[head]);
    if (head + bump < count) loop.bump_seen.back().noalias() -= over.transpose() * (loop.ahead[head + bump] * over);
    loop.bump_step.push_back(std::move(over));
  }
  return loop;
}

// A and b of a port's bumps along a stretch, in chunks: diagonal blocks, and those beside them.
struct Normal {
  std::vector<Eigen::MatrixXd> own, next;
  Eigen::VectorXd b;
  std::vector<std::size_t> block;     // of each bump
  Eigen::MatrixXd told;               // bumps x kSpan: fraction of what a bump does in its own block and the next ones
  std::vector<double> square, count;  // per block, without a signal
};

Normal normal_of(const StochasticModel& model, const StochasticStretch& stretch, const FilteredStretch& filtered,
                 const Loop& loop, std::size_t port) {
  const std::size_t count = stretch.rows.size(), bumps = loop.heads.size();
  const Eigen::Index states = model.size.size();
  const int shows = model.shows[port];
  const Eigen::MatrixXd& drive = stretch.port_drives[port];
  Normal normal;
  normal.b = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(bumps));
  for (const std::size_t head : loop.heads) normal.block.push_back(head / model.block);
  normal.square = filtered.square;
  normal.count = filtered.count;
  normal.told = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(bumps), static_cast<Eigen::Index>(kSpan));
  std::vector<double> own(bumps, 0);
  std::vector<Eigen::VectorXd> left(bumps), said(bumps);  // error behind a bump; what the bump's readings say of one
  std::vector<Eigen::VectorXd> errors, crossed;
  for (std::size_t k = 0; k < bumps; ++k) {
    const std::size_t end = k + 1 < bumps ? loop.heads[k + 1] : count;
    errors.assign(1, Eigen::VectorXd::Zero(states));
    crossed.clear();
    double b = 0;
    for (std::size_t i = loop.heads[k]; i < end; ++i) {
      const Eigen::VectorXd& error = errors.back();
      Eigen::VectorXd enters = Eigen::VectorXd::Zero(states), cross = Eigen::VectorXd::Zero(states);
      if (drive.size() > 0 && i + 1 < count) enters = drive.col(static_cast<Eigen::Index>(i));
      if (shows >= 0 && !std::isnan(stretch.misfit[i][shows])) {
        const double shown = model.shown[port];
        const Eigen::VectorXd row = stretch.h[i].row(shows).transpose();
        const Eigen::VectorXd known = filtered.known[i] * row;
        if (i + 1 < count) enters = -shown * (stretch.f[i] * known);
        // H'S^-1 D, D'S^-1 D and D'S^-1 v with S^-1 = I - H P H'.
        cross = shown * (row - loop.shows[i] * known);
        own[k] += shown * shown * (1 - row.dot(known));
        b += shown * (stretch.misfit[i][shows] - row.dot(filtered.predicted[i]) - known.dot(loop.news[i]));
      }
      const Eigen::VectorXd seen = loop.seen[i] * error;
      own[k] += error.dot(seen) + 2 * error.dot(cross);
      crossed.push_back(seen + cross);
      if (i + 1 == count) break;
      b += enters.dot(loop.score[i + 1]);
      errors.push_back(loop.step[i] * error + enters);
    }
    Eigen::VectorXd back = Eigen::VectorXd::Zero(states);
    normal.told(static_cast<Eigen::Index>(k), 0) = own[k];
    if (end < count) {
      back = loop.ahead[end] * errors.back();
      own[k] += errors.back().dot(back);
    }
    for (std::size_t i = crossed.size(); i-- > 0;) {
      const std::size_t row = loop.heads[k] + i;
      if (row + 1 < count) back = loop.step[row].transpose() * back;
      back += crossed[i];
    }
    left[k] = errors.back();
    said[k] = std::move(back);
    normal.b[static_cast<Eigen::Index>(k)] = b;
  }
  for (std::size_t first = 0; first < bumps; first += kChunk) {
    const std::size_t size = std::min(kChunk, bumps - first);
    const std::size_t after = std::min(kChunk, bumps - first - size);
    Eigen::MatrixXd here = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(size), static_cast<Eigen::Index>(size));
    Eigen::MatrixXd beside = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(after), static_cast<Eigen::Index>(size));
    for (std::size_t j = 0; j < size; ++j) {
      const auto column = static_cast<Eigen::Index>(j);
      here(column, column) = own[first + j];
      Eigen::VectorXd error = left[first + j];
      auto told = normal.told.row(static_cast<Eigen::Index>(first + j));
      for (std::size_t lag = 1; lag <= kChunk && first + j + lag < bumps; ++lag) {
        const std::size_t k = first + j + lag;
        const std::size_t later = std::min(normal.block[k] - normal.block[first + j], kSpan - 1);
        told[static_cast<Eigen::Index>(later)] += error.dot(loop.bump_seen[k] * error);
        const double both = error.dot(said[k]) * (1 - static_cast<double>(lag) / static_cast<double>(kChunk + 1));
        if (j + lag < size)
          here(static_cast<Eigen::Index>(j + lag), column) = both;
        else
          beside(static_cast<Eigen::Index>(j + lag - size), column) = both;
        error = loop.bump_step[k] * error;
      }
      told[static_cast<Eigen::Index>(kSpan - 1)] += std::max(0.0, own[first + j] - told.sum());
      if (own[first + j] > 0) told /= told.sum();
    }
    normal.own.push_back(std::move(here));
    normal.next.push_back(std::move(beside));
  }
  return normal;
}

// What a signal of a level and a memory wins along a stretch; not a number where rounding spoils it. `bump`: s.
double won(const Normal& normal, double level, double memory, double bump) {
  const double keep = std::exp(-bump / memory), fresh = level * level * (1 - keep * keep);
  const Eigen::Index bumps = normal.b.size();
  double logs = 0;
  std::vector<double> taken(normal.square.size(), 0);  // off the squares of each block
  Eigen::MatrixXd below, carried;
  Eigen::VectorXd solved;
  Eigen::Index at = 0;
  for (std::size_t c = 0; c < normal.own.size(); ++c) {
    const Eigen::Index size = normal.own[c].rows();
    Eigen::MatrixXd whole = normal.own[c];
    Eigen::VectorXd rest = normal.b.segment(at, size);
    for (Eigen::Index i = 0; i < size; ++i) {
      const bool end = at + i == 0 || at + i + 1 == bumps;
      whole(i, i) += (bumps == 1 ? 1 - keep * keep : end ? 1 : 1 + keep * keep) / fresh;
      if (i + 1 < size) whole(i + 1, i) -= keep / fresh;
    }
    if (c > 0) {
      whole.selfadjointView<Eigen::Lower>().rankUpdate(carried, -1);
      rest.noalias() -= carried * solved;
    }
    const Eigen::LLT<Eigen::MatrixXd> factor(whole);
    if (factor.info() != Eigen::Success) return std::nan("");
    logs += 2 * factor.matrixLLT().diagonal().array().log().sum();
    solved = factor.matrixL().solve(rest);
    for (Eigen::Index i = 0; i < size; ++i)
      for (std::size_t later = 0; later < kSpan; ++later)
        taken[std::min(normal.block[static_cast<std::size_t>(at + i)] + later, taken.size() - 1)] +=
            normal.told(at + i, static_cast<Eigen::Index>(later)) * solved[i] * solved[i];
    at += size;
    if (at == bumps) break;
    below = normal.next[c];
    below(0, size - 1) -= keep / fresh;
    carried = factor.matrixL().solve(below.transpose()).transpose();
  }
  const double prior =
      -static_cast<double>(bumps) * std::log(level * level) - static_cast<double>(bumps - 1) * std::log1p(-keep * keep);
  double fit = 0;
  for (std::size_t b = 0; b < taken.size(); ++b)
    fit += normal.count[b] * std::log(block_variance(normal.square[b], normal.count[b]) /
                                      block_variance(normal.square[b] - taken[b], normal.count[b]));
  return 0.5 * (fit - logs + prior);
}

}  // namespace

std::vector<ScannedSignal> scan_signals(const StochasticModel& model, const Eigen::VectorXd& q, int jobs) {
  const std::vector<FilteredStretch> filtered = filter_stretches(model, q, jobs);
  const std::size_t stretches = model.stretches.size();
  std::vector<Loop> loops(stretches);
  in_parallel(stretches, jobs, [&](std::size_t n) { loops[n] = close_loop(model, model.stretches[n], filtered[n]); });
  const double bump = model.step * static_cast<double>(std::max<std::size_t>(1, model.block / kBumpsPerBlock));
  const double middle = kMiddleMemory * static_cast<double>(model.block) * model.step;
  std::vector<ScannedSignal> result(model.ports.size());
  in_parallel(model.ports.size(), jobs, [&](std::size_t p) {
    std::vector<Normal> normals;
    for (std::size_t n = 0; n < stretches; ++n)
      normals.push_back(normal_of(model, model.stretches[n], filtered[n], loops[n], p));
    ScannedSignal& best = result[p];
    best.signal.port = static_cast<int>(p);
    best.signal.memory = middle;
    const auto attempt = [&](double level, double memory) {
      if (memory < kShortest * middle || memory > kLongest * middle) return false;
      double gain = 0;
      for (const Normal& normal : normals) gain += won(normal, level, memory, bump);
      if (!(gain > best.gain)) return false;
      best.gain = gain;
      best.signal.level = level;
      best.signal.memory = memory;
      return true;
    };
    for (double level = kWeakest; level <= kStrongest; level *= 10)
      for (const double ratio : {kShortest, 1.0, 10.0, kLongest}) attempt(level, ratio * middle);
    if (best.signal.level == 0) return;
    for (double step = 3; step > 1.2; step = std::sqrt(step)) {
      while (attempt(best.signal.level * step, best.signal.memory) ||
             attempt(best.signal.level / step, best.signal.memory)) {
      }
      while (attempt(best.signal.level, best.signal.memory * step) ||
             attempt(best.signal.level, best.signal.memory / step)) {
      }
    }
  });
  return result;
}

}  // namespace faultline
