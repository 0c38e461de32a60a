// LU factors of (d I - J) for a small sparse J whose places of non-zeros never change, by KLU (Davis, Palamadai
// Natarajan, Algorithm 907: KLU, a direct sparse solver for circuit simulation problems, ACM Trans. Mathematical
// Software 37, 2010): ordering and pivots are chosen once, on the diagonal; factor() then refactors in the memory that
// is there. Right where d is large against what couples the states, as in implicit steps of a dissipative rig. A
// matrix that is singular with these pivots gets new ones, which allocates; one that is singular with any makes every
// solution NaN. A full matrix of a few states has no pattern to gain from: it is eliminated in place, with pivots by
// column.
#pragma once

#include <memory>
#include <utility>
#include <vector>

namespace faultline {

class SparseLu {
 public:
  // `entries`: (row, column) of J's non-zeros in any order; one that stands twice is summed. std::logic_error outside
  // the matrix.
  SparseLu(int size, const std::vector<std::pair<int, int>>& entries);
  ~SparseLu();

  // `values`: one per entry, in the same order.
  void factor(double diagonal, const double* values);
  void solve(double* right_side) const;                          // in place
  void solve(double* right_sides, int count, int stride) const;  // each so many values behind the one before

 private:
  void factor_full();
  void solve_full(double* right_side) const;

  struct Klu;
  std::unique_ptr<Klu> klu_;
  int size_;
  std::vector<int> columns_, rows_;  // by columns: where each begins, and the rows of its values
  std::vector<double> values_;
  std::vector<std::size_t> entry_places_, diagonal_places_;
  std::vector<int> order_;  // of the rows of a full matrix, whose factors are in values_; else empty
};

}  // namespace faultline
