// The gap while the rig runs: the nominal model beside the live samples, segment by segment.
//
//   excess of a segment = max(0, rms^2 - noise^2)/noise^2   per channel, settled residuals of the nominal model
//   smoothed            = mean excess over the last `smoothing_segments`
//
// A channel leaves normal when its smoothed excess is above what the datasheet calls normal, and is back below
// `return_ratio` of that. While some channel is out, the place is sought at times, on the window of the last
// segments, by the first steps of `faultline gap` (gap_trials.h): every effect screened, the best fitted together
// with the parameters. The port of the best is the place; ports that gain nearly as much cannot be told apart from it
// on this window. `faultline gap` on recordings does the rest.
//
// Deterministic in the samples, reads no clock, knows no rig. Not thread safe; process() may take some seconds when a
// place is sought, so a live caller gives it a thread of its own. A missing, invalid or late sample cuts the window;
// a jump of time begins anew.
#pragma once

#include <cstdint>
#include <deque>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "faultline/gap/gap_options.h"
#include "faultline/gap/residual_model.h"

namespace faultline {

// All that the answers depend on; units in the names, as in gap_options.h.
struct LiveGapSettings {
  double segment_ratio = 2;                // to the rig's segment: one must show the motion's both directions
  std::size_t smoothing_segments = 10;     // of the means, the regions and the place
  std::size_t least_segments = 4;          // before anything is judged: a mean of fewer scatters
  std::size_t locate_after_segments = 5;   // after leaving normal, so that the window shows the trouble
  std::size_t locate_every_segments = 20;  // bounds the effort
  double jump_segments = 1;                // of missing time, forwards, from which all begins anew; backwards any
  double return_ratio = 0.7;  // to the normal limit, below which a channel is back: hysteresis against flicker
  double period_error_fraction = 0.45;      // of a sample period, that a stamp may be off
  double notable_ratio = 1.25;              // enrichment from which a region is told
  double standstill_fraction = 0.02;        // of a channel's largest magnitude in the window: near zero ...
  double standstill_sigma = 3;              // ... and within this many standard deviations of its noise
  double large_fraction = 0.5;              // of the same, from which a value is large
  double least_fraction = 0.01;             // of the samples, below which a region says nothing
  std::size_t most_regions = 4;             // told
  std::size_t fitted_candidates = 8;        // effects that are fitted after screening: bounds the effort
  double inseparable_gain_fraction = 0.85;  // of the best gain, from which two places are not told apart
  double least_explained_fraction = 0.05;   // of the residual, that a place must explain to be named
  GapOptions gap;                           // of the model beside the rig and of the search for the place
};

template <class Visit>
void for_each_option(LiveGapSettings& options, Visit&& visit) {
#define FAULTLINE_OPTION(member) visit(#member, options.member)
  FAULTLINE_OPTION(segment_ratio);
  FAULTLINE_OPTION(smoothing_segments);
  FAULTLINE_OPTION(least_segments);
  FAULTLINE_OPTION(locate_after_segments);
  FAULTLINE_OPTION(locate_every_segments);
  FAULTLINE_OPTION(jump_segments);
  FAULTLINE_OPTION(return_ratio);
  FAULTLINE_OPTION(period_error_fraction);
  FAULTLINE_OPTION(notable_ratio);
  FAULTLINE_OPTION(standstill_fraction);
  FAULTLINE_OPTION(standstill_sigma);
  FAULTLINE_OPTION(large_fraction);
  FAULTLINE_OPTION(least_fraction);
  FAULTLINE_OPTION(most_regions);
  FAULTLINE_OPTION(fitted_candidates);
  FAULTLINE_OPTION(inseparable_gain_fraction);
  FAULTLINE_OPTION(least_explained_fraction);
#undef FAULTLINE_OPTION
}

struct LiveChannelGap {
  std::string channel;
  std::string unit;
  double rms = 0;     // of the last segment
  double noise = 0;   // standard deviation, of the same samples
  double excess = 0;  // of the last segment
  double smoothed = 0;
  double normal = 0;  // largest smoothed excess that is normal; NaN: the datasheet says nothing
  bool left = false;
};

struct LiveRegion {
  std::string name;
  double enrichment = 1;  // mean squared residual there over its mean everywhere
  double share = 0;       // fraction of the samples
};

struct LivePlace {
  std::string port;  // empty: not sought, or nothing fits
  std::string component;
  std::string effect;                    // that fits best there
  double share = 0;                      // fraction of the residual beyond noise and tolerances that it explains
  std::vector<std::string> inseparable;  // other ports that explain nearly as much
  double time = 0;                       // s, end of the window it was found in
};

struct LiveGapState {
  double time = 0;           // s, of the last sample of the segment
  std::size_t segments = 0;  // over which the means go
  std::vector<LiveChannelGap> channels;
  std::vector<LiveRegion> regions;  // where the residual is clearly larger than elsewhere, worst first
  bool judged = false;              // enough segments
  bool left = false;                // some channel is out of normal
  double since = 0;                 // s, end of the segment at which it left
  double worst = 0;                 // largest smoothed excess over its normal limit
  LivePlace place;
  std::string text;  // one sentence
};

struct LiveGapCounts {
  std::uint64_t samples = 0, segments = 0, cuts = 0, restarts = 0, located = 0;
};

class LiveGap {
 public:
  LiveGap(const Datasheet& sheet, const LiveGapSettings& settings);

  // True when the sample completed a segment: state() is new. Samples in the datasheet's order.
  bool process(const Sample& sample);
  const LiveGapState& state() const { return state_; }
  const LiveGapCounts& counts() const { return counts_; }
  void reset();

 private:
  struct Segment {
    std::vector<double> excess;     // per channel that counts
    std::vector<float> row_square;  // per row: squared normalised residuals, sum over channels
    Recording rows;
  };

  bool usable(const Sample& sample) const;
  void cut();
  Recording joined(std::size_t last) const;  // the last segments' rows, time from 0
  void measure();
  void judge();
  void find_regions();
  void locate(std::size_t segments);
  std::string sentence() const;

  Datasheet sheet_;
  LiveGapSettings settings_;
  double gap_segment_;        // s, the rig's
  std::size_t segment_rows_;  // of a segment of the live gap
  ModelChange nominal_;
  std::vector<double> normal_;    // per channel of the datasheet; NaN: not given
  std::deque<Recording> window_;  // whole segments without a break, newest last
  std::deque<Segment> measured_;  // of those the last that were measured; breaks between them do not matter
  Recording filling_;
  bool started_ = false;
  double last_time_ = 0;
  std::size_t until_locate_ = 0, out_ = 0;  // segments: to the next search, since leaving normal
  LiveGapState state_;
  LiveGapCounts counts_;
};

}  // namespace faultline
