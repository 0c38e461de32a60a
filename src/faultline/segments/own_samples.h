// Readings that were interpolated onto a finer grid, and the samples between which their straight lines run.
//
//   c_k = y_(k+1) - 2 y_k + y_(k-1)      a kink where |c_k| > 1e-3 median |y_(k+1) - y_k|
//
// Of a recording that was brought to n times its rate all kinks lie at every n-th row, the same for all transducers,
// and nearly every such row has one: noise makes it. What lies between says nothing new, and its noise is none.
// Where a command changes between such rows, the rows stay as they are: what drives a model is not thrown away.
#pragma once

#include <cstddef>

#include "faultline/signal/sample.h"

namespace faultline {

struct OwnSamples {
  std::size_t every = 1;  // rows from one sample to the next; 1: the rows themselves
  std::size_t first = 0;  // row of the first
};

// By the channels of role output and input. The largest `every`, up to 20, on which all agree that move.
OwnSamples own_samples(const Recording& recording);

// These rows alone. No more sequence is known than their order.
Recording at_own_samples(const Recording& recording, const OwnSamples& own);

}  // namespace faultline
