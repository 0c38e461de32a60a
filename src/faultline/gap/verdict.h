// From how wrong the model is, before and after effects were added (discrepancy.h), to the verdict. All are ratios of
// what was measured on the same recordings: a model is a little wrong everywhere on every rig, and no number of noise
// widths says from where on that is a cause.
#pragma once

#include <string>

#include "faultline/gap/discrepancy.h"
#include "faultline/gap/gap_options.h"

namespace faultline {

struct GapEvidence {
  bool found = false;             // whether the search took effects
  bool plain = true;              // whether restarts leave the effects as they are: restarts_freely()
  double shrink = 0;              // fraction of the refit's excess that they close on held-out data
  double shrink_low = 1;          // low end of its 90 % interval: what rests on one segment alone may be nothing
  double typical_shrink = 0;      // the same of a typical segment (typical_excess): a few that go astray do not decide
  double typical_shrink_low = 1;  // ... and the low end of its interval
  double output_shrink = 0;       // the most that is closed of what the refit leaves in one output
  double perfect = 0;             // log likelihood that a perfect model would win over the refit ...
  double effects = 0;             // ... the effects do win ...
  double free_before = 0;         // ... and a free signal at one place would, without ...
  double free_after = 0;          // ... and beside them
  double readings = 0;            // over which these are summed
  double size = 0;        // gap of the refit beyond the noise, over what the channels move: rms over the channels
  double excess = 0;      // ... and squared over the noise: mean over the channels
  double calibrated = 0;  // excess that the refit removed
  double left = 0;        // excess beside the effects on held-out data ...
  double quiet = 0;       // ... and that of a healthy rig
  double spread = 0;      // of an effect's size from part to part of the runs, the largest: SizeAgreement
  bool beyond =
      false;  // whether a size lies beyond the datasheet's range and much is left, or at the end of what is tried
};

struct GapVerdict {
  std::string verdict;  // none | miscalibrated | named | unknown
  bool names = false;   // whether the effects are told: under "unknown" they are part of the cause
  double doubt = 0;     // of a name or of silence; above 1: unknown
  bool placed = false;  // under "unknown": effects are a part of it, or a signal at one place is
};

GapEvidence gap_evidence(const Discrepancy& before, const Discrepancy& after, bool found);

// `matters`: size of a gap from which it must have a cause; one that stands out is told from a fraction of that on.
GapVerdict judge_gap(const GapEvidence& evidence, double matters, const GapOptions::Verdict& options);

}  // namespace faultline
