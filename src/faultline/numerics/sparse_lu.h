// LU factors of (d I - J) for a small sparse J whose places of non-zeros never change: the places that fill in, and the order of
// elimination, are worked out once (Markowitz's count on the diagonal), so that factor() and solve() run down flat lists and
// allocate nothing. No pivoting: right where d is large against what couples the states, as in implicit steps of a
// dissipative rig.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

namespace faultline {

class SparseLu {
 public:
  // `entries`: (row, column) of J's non-zeros in any order; one that stands twice is summed.
  SparseLu(int size, const std::vector<std::pair<int, int>>& entries);

  // `values`: one per entry, in the same order. A pivot of zero makes the solution infinite.
  void factor(double diagonal, const double* values);
  void solve(double* right_side) const;  // in place

 private:
  struct Update {  // target -= left right
    std::uint16_t target, left, right;
  };
  struct Pivot {
    std::uint16_t diagonal, state;                                 // place of the pivot, and which state it is
    std::uint32_t updated_end, below_end, above_begin, above_end;  // in updates_, below_ and above_
  };
  struct Place {  // of an off-diagonal factor: the state it couples to
    std::uint16_t value, state;
  };

  std::vector<double> values_;
  std::vector<std::uint16_t> entry_places_, diagonal_places_;
  std::vector<Update> updates_;
  std::vector<Place> below_, above_;
  std::vector<Pivot> pivots_;  // in order of elimination
};

}  // namespace faultline
