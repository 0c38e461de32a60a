// Whether an effect has the same size wherever it shows: an effect whose size changes from part to part of the runs is
// no cause but makes up for one.
//
//   r(a) = r + (a - 1) D,   D = d r/d a at a = 1      a: all sizes of the effect, as an amplitude (fault_hypothesis.h)
//   a_p = 1 - D' W r / D' W D over the segments of part p, variance s_p^2 = k / D' W D
//
// with the parameters and all other effects as they were fitted, W of linearisation.h, and k samples of a misfit that
// say the same. Parts are runs, long ones in pieces. Those count that hold a tenth of what the part that shows the
// effect best does.
#pragma once

#include "faultline/gap/fit_gap.h"

namespace faultline {

struct SizeAgreement {
  int parts = 0;      // that show the effect
  double spread = 0;  // standard deviation of a_p over them beyond s_p; 0 where there is one part only
  double least = 1;   // smallest a_p
  double most = 1;    // ... and largest
};

// Of each effect of a fit. `linear` must stand at it. An effect without a size (stuck) has no parts.
std::vector<SizeAgreement> size_agreement(const ResidualModel& residuals, const FitResult& at,
                                          const Linearisation& linear, int jobs);

}  // namespace faultline
