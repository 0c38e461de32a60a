#include "faultline/numerics/sparse_lu.h"

#include <algorithm>
#include <stdexcept>

namespace faultline {
namespace {

using Grid = std::vector<std::vector<char>>;

int count(const Grid& filled, const std::vector<char>& done, int state, bool row) {
  int others = 0;
  for (std::size_t j = 0; j < done.size(); ++j)
    if (!done[j] && static_cast<int>(j) != state)
      others += row ? filled[static_cast<std::size_t>(state)][j] : filled[j][static_cast<std::size_t>(state)];
  return others;
}

// The state not yet eliminated that fills in least.
std::size_t cheapest(const Grid& filled, const std::vector<char>& done) {
  int best = -1, best_cost = 0;
  for (int s = 0; s < static_cast<int>(done.size()); ++s) {
    if (done[static_cast<std::size_t>(s)]) continue;
    const int cost = count(filled, done, s, true) * count(filled, done, s, false);
    if (best < 0 || cost < best_cost) {
      best = s;
      best_cost = cost;
    }
  }
  return static_cast<std::size_t>(best);
}

}  // namespace

SparseLu::SparseLu(int size, const std::vector<std::pair<int, int>>& entries) {
  const auto n = static_cast<std::size_t>(size);
  Grid filled(n, std::vector<char>(n, 0));
  for (std::size_t i = 0; i < n; ++i) filled[i][i] = 1;
  for (const auto& [row, column] : entries) {
    if (row < 0 || column < 0 || row >= size || column >= size)
      throw std::logic_error("a Jacobian entry lies outside the states");
    filled[static_cast<std::size_t>(row)][static_cast<std::size_t>(column)] = 1;
  }
  std::vector<std::size_t> order;
  std::vector<char> done(n, 0);
  for (std::size_t k = 0; k < n; ++k) {
    const std::size_t pivot = cheapest(filled, done);
    done[pivot] = 1;
    order.push_back(pivot);
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t j = 0; j < n; ++j)
        if (!done[i] && !done[j] && filled[i][pivot] && filled[pivot][j]) filled[i][j] = 1;
  }
  std::vector<std::vector<std::uint16_t>> place(n, std::vector<std::uint16_t>(n, 0));
  std::uint16_t stored = 0;
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < n; ++j)
      if (filled[i][j]) place[i][j] = stored++;
  values_.assign(stored, 0);
  for (const auto& [row, column] : entries)
    entry_places_.push_back(place[static_cast<std::size_t>(row)][static_cast<std::size_t>(column)]);
  for (std::size_t i = 0; i < n; ++i) diagonal_places_.push_back(place[i][i]);

  std::fill(done.begin(), done.end(), 0);
  for (const std::size_t k : order) {
    done[k] = 1;
    Pivot pivot{};
    pivot.diagonal = place[k][k];
    pivot.state = static_cast<std::uint16_t>(k);
    pivot.above_begin = static_cast<std::uint32_t>(above_.size());
    for (std::size_t i = 0; i < n; ++i) {
      if (done[i]) continue;
      if (filled[k][i]) above_.push_back({place[k][i], static_cast<std::uint16_t>(i)});
      if (!filled[i][k]) continue;
      below_.push_back({place[i][k], static_cast<std::uint16_t>(i)});
      for (std::size_t j = 0; j < n; ++j)
        if (!done[j] && filled[k][j]) updates_.push_back({place[i][j], place[i][k], place[k][j]});
    }
    pivot.updated_end = static_cast<std::uint32_t>(updates_.size());
    pivot.below_end = static_cast<std::uint32_t>(below_.size());
    pivot.above_end = static_cast<std::uint32_t>(above_.size());
    pivots_.push_back(pivot);
  }
}

void SparseLu::factor(double diagonal, const double* values) {
  std::fill(values_.begin(), values_.end(), 0);
  for (const std::uint16_t place : diagonal_places_) values_[place] = diagonal;
  for (std::size_t i = 0; i < entry_places_.size(); ++i) values_[entry_places_[i]] -= values[i];
  double* v = values_.data();
  std::size_t below = 0, updated = 0;
  for (const Pivot& pivot : pivots_) {
    const double inverse = 1 / v[pivot.diagonal];
    v[pivot.diagonal] = inverse;
    for (; below < pivot.below_end; ++below) v[below_[below].value] *= inverse;
    for (; updated < pivot.updated_end; ++updated) {
      const Update& u = updates_[updated];
      v[u.target] -= v[u.left] * v[u.right];
    }
  }
}

void SparseLu::solve(double* x) const {
  const double* v = values_.data();
  std::size_t below = 0;
  for (const Pivot& pivot : pivots_) {
    const double here = x[pivot.state];
    for (; below < pivot.below_end; ++below) x[below_[below].state] -= v[below_[below].value] * here;
  }
  for (auto pivot = pivots_.rbegin(); pivot != pivots_.rend(); ++pivot) {
    double sum = x[pivot->state];
    for (std::size_t a = pivot->above_begin; a < pivot->above_end; ++a) sum -= v[above_[a].value] * x[above_[a].state];
    x[pivot->state] = sum * v[pivot->diagonal];
  }
}

}  // namespace faultline
