// Which channels explain an observed one, by information entropy: h = -sum p_i log2 p_i of the observed variable over
// sections of its range, p_i the shares of the samples (Manninen, Aalto University 2012, eq. (16)). What another
// variable explains is how far the entropy falls where it is taken in each of that variable's bins by itself:
//
//   gain(y | e) = h(y) - sum_b p_b h(y in bin b of e)
//
// Finite runs gain something from any variable. How much is measured: the same gain with the explanatory variable cut
// into blocks of time that are put in another order, which breaks the relation and leaves the signal as it is,
// periodic or not. `chance` is the median of several orders. A variable is chosen where it gains more than in any of
// these orders, and gain - chance is at least `least` of h(y); greedily, the best first, then the best beside it, at
// most two. Limits: ranges are those between the quantiles 0.001 and 0.999 of the run, sections and bins of one width;
// what never moved in the run explains nothing; of two that move alike the better one hides the other.
#pragma once

#include <cstddef>
#include <vector>

#include "faultline/signal/sample.h"

namespace faultline {

struct ExplanatoryOptions {
  int bins = 8, sections = 32;
  double least = 0.01;  // of the entropy
  int blocks = 50, orders = 9;
  std::size_t most_rows = 100000;  // of longer runs every n-th
};

struct Gain {
  std::size_t by = 0;                     // channel
  double gain = 0, chance = 0, most = 0;  // bit; most: of any order
  double beyond_chance() const { return gain - chance; }
};

struct Explained {
  std::size_t observed = 0;         // channel
  double entropy = 0;               // bit; 0: it never moved
  double left = 0;                  // bit, given what is chosen, chance taken off
  std::vector<std::size_t> chosen;  // none to two
  std::vector<Gain> first;          // of every candidate alone, best first
  std::vector<Gain> second;         // of every other one beside the best; empty where none was chosen
};

// A channel does not explain itself. Rows in which a channel is no number are left out.
std::vector<Explained> explain(const Recording& recording, const std::vector<std::size_t>& observed,
                               const std::vector<std::size_t>& candidates, const ExplanatoryOptions& options = {});

}  // namespace faultline
