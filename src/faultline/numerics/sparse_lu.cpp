#include "faultline/numerics/sparse_lu.h"

#include <algorithm>
#include <limits>
#include <map>
#include <new>
#include <stdexcept>
#include <type_traits>
#include <utility>

#include <klu.h>

#include "faultline/numerics/small_lu.h"

namespace faultline {
namespace {

// Loops whose length the compiler knows: calls work(n) with n a constant.
template <int kMost, class Work>
void with_size(int size, Work&& work) {
  if (size == kMost) return work(std::integral_constant<std::size_t, kMost>());
  if constexpr (kMost > 1) with_size<kMost - 1>(size, work);
}

}  // namespace

struct SparseLu::Klu {
  Klu() {
    klu_defaults(&common);
    common.scale = -1;  // neither scaling nor a check of the pattern, which is ours: less time
  }
  Klu(const Klu&) = delete;
  Klu& operator=(const Klu&) = delete;
  ~Klu() {
    klu_free_numeric(&numeric, &common);
    klu_free_symbolic(&symbolic, &common);
  }
  klu_common common;
  klu_symbolic* symbolic = nullptr;
  klu_numeric* numeric = nullptr;  // null: singular
};

SparseLu::SparseLu(int size, const std::vector<std::pair<int, int>>& entries)
    : klu_(std::make_unique<Klu>()), size_(size) {
  std::map<std::pair<int, int>, std::size_t> places;  // by (column, row)
  for (int i = 0; i < size; ++i) places[{i, i}] = 0;
  for (const auto& [row, column] : entries) {
    if (row < 0 || column < 0 || row >= size || column >= size)
      throw std::logic_error("a Jacobian entry lies outside the states");
    places[{column, row}] = 0;
  }
  for (auto& [at, place] : places) {
    while (static_cast<int>(columns_.size()) <= at.first) columns_.push_back(static_cast<int>(rows_.size()));
    place = rows_.size();
    rows_.push_back(at.second);
  }
  columns_.push_back(static_cast<int>(rows_.size()));
  for (const auto& [row, column] : entries) entry_places_.push_back(places[{column, row}]);
  for (int i = 0; i < size; ++i) diagonal_places_.push_back(places[{i, i}]);
  values_.resize(rows_.size());
  if (size <= kFewStates && rows_.size() == static_cast<std::size_t>(size) * static_cast<std::size_t>(size)) {
    order_.resize(static_cast<std::size_t>(size));
    return;
  }
  klu_->symbolic = klu_analyze(size, columns_.data(), rows_.data(), &klu_->common);
  if (!klu_->symbolic) throw std::bad_alloc();
  factor(1, std::vector<double>(entries.size(), 0.0).data());  // pivots on the diagonal, memory for all factors
}

SparseLu::~SparseLu() = default;

void SparseLu::factor(double diagonal, const double* values) {
  std::fill(values_.begin(), values_.end(), 0);
  for (const std::size_t place : diagonal_places_) values_[place] = diagonal;
  for (std::size_t i = 0; i < entry_places_.size(); ++i) values_[entry_places_[i]] -= values[i];
  if (!order_.empty()) return factor_full();
  Klu& k = *klu_;
  if (k.numeric && klu_refactor(columns_.data(), rows_.data(), values_.data(), k.symbolic, k.numeric, &k.common) &&
      k.common.status == KLU_OK)
    return;
  klu_free_numeric(&k.numeric, &k.common);
  k.numeric = klu_factor(columns_.data(), rows_.data(), values_.data(), k.symbolic, &k.common);
}

void SparseLu::factor_full() {
  with_size<kFewStates>(size_, [&](auto n) { factor_in_place<n()>(values_.data(), order_.data()); });
}

void SparseLu::solve_full(double* right_side) const {
  with_size<kFewStates>(size_, [&](auto n) { solve_in_place<n()>(values_.data(), order_.data(), right_side); });
}

void SparseLu::solve(double* right_side) const { solve(right_side, 1, size_); }

void SparseLu::solve(double* right_sides, int count, int stride) const {
  if (order_.empty() && klu_->numeric) {
    klu_solve(klu_->symbolic, klu_->numeric, stride, count, right_sides, &klu_->common);
    return;
  }
  for (int i = 0; i < count; ++i, right_sides += stride)
    if (!order_.empty())
      solve_full(right_sides);
    else
      std::fill_n(right_sides, size_, std::numeric_limits<double>::quiet_NaN());
}

}  // namespace faultline
