// What `faultline gap` answers: how far recording and model are apart, where, why, and how far the gap shrinks. Dumb
// data; the JSON form is docs/gap.schema.json.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "faultline/gap/discrepancy.h"
#include "faultline/gap/missing_signal.h"
#include "faultline/gap/verdict.h"

namespace faultline {

struct Interval {
  double low = 0, high = 0;
};

// Distance between recording and model on one channel, in the channel's unit unless said otherwise.
struct ChannelGap {
  std::string channel;
  std::string unit;
  double noise_std = 0;                 // what the recording's own noise is
  std::map<std::string, double> rms;    // by horizon: "1", "10", "100" samples, "segment", "free"
  std::map<std::string, double> nrmse;  // rms over the channel's standard deviation
  std::map<std::string, double> fit;    // 1 - nrmse, in percent; 100 is perfect
  double excess = 0;                    // max(0, rms^2 - noise^2)/noise^2 on segments
};

struct GapLevel {
  std::string name;  // nominal | refit | explained
  std::vector<ChannelGap> channels;
  double excess = 0;                         // mean over the channels
  std::map<std::string, double> parameters;  // that differ from nominal: factor on the nominal value
};

struct Region {
  std::string name;       // of the operating range, "velocity positive" and the like
  double enrichment = 1;  // mean squared residual there over its mean everywhere
  double share = 0;       // fraction of the samples
  double refit = 0;       // mean squared residual there, in noise variances, of the refitted model ...
  double explained = 0;   // ... and with the effects added
};

struct PlaceScore {
  std::string port;
  std::string component;
  std::string kind;                      // process | sensor
  double score = 0;                      // gain in log-likelihood that an effect at this place can win
  double share = 0;                      // posterior probability that the cause is at this place
  std::vector<std::string> inseparable;  // places whose signature this excitation cannot tell from this one
};

struct NamedEffect {
  std::string effect;
  std::string port;
  std::string family;
  std::map<std::string, double> parameters;
  std::map<std::string, Interval> intervals;  // 90 %
  std::vector<std::string> at_bounds;         // parameters whose value is an end of the range that the datasheet allows
  double probability = 0;
  bool least = false;      // its size is near the least that is tried
  std::string instead_of;  // effect@port among those found, of one that these runs cannot tell from it
};

struct RankedCause {
  NamedEffect effect;
  double gain = 0;            // held-out log-likelihood over the refitted model
  double behind = 0;          // how far behind the best
  double standard_error = 0;  // of that
  bool followed = true;       // false: fitted quickly and left behind; its gain is at most this
};

struct NextRun {
  std::string excitation;  // a profile of the datasheet
  double duration = 0;     // s
  double gain = 0;         // predicted distance of the two rivals, in log-likelihood
  std::string between;     // which two it separates
};

// The deciding run and what the three levels make of it, at most 4000 rows: every n-th row as it is, so that columns
// may be subtracted.
struct GapSeries {
  std::size_t run = 0;  // position among the runs and then the held-out runs, as they were given
  std::vector<std::string> channels;
  std::vector<double> time;    // s from the start of that run
  std::vector<double> values;  // per row and channel: measured, nominal, refit, explained
};

// How wrong the model of a level is by place (discrepancy.h).
struct LevelDiscrepancy {
  std::string name;
  Discrepancy discrepancy;
};

// A cause that began during runs: until then the model, calibrated there, explains the recordings.
struct Since {
  struct Moment {
    std::size_t run;  // position among the runs and then the held-out runs, as they were given
    double time;      // s from its beginning
  };
  std::vector<Moment> moments;  // at least one, of each run in which it began
  double within = 0;            // s; how long a segment is
};

struct GapResult {
  std::string rig;
  std::vector<std::string> runs, holdout;
  std::string deciding_run;  // which run showed it most
  std::vector<GapLevel> gap;
  std::vector<PlaceScore> places;
  std::string where_kind;  // process | sensor | none
  std::vector<Region> regions;
  std::vector<Region> bands;       // frequency bands of the residual, enrichment over white
  std::string verdict;             // none | miscalibrated | named | unknown
  GapEvidence evidence;            // on which the verdict rests ...
  double matters = 0;              // ... and the size from which a gap must have a cause
  double unknown_probability = 0;  // that the cause is something that the library does not have
  std::string sentence;
  std::vector<NamedEffect> effects;
  std::optional<Since> since;  // of the effects; then all levels and shares are of what follows, nominal: calibrated
  std::vector<NamedEffect> equivalent;  // to one of the effects, beside the others
  std::string why_equivalent;
  std::vector<RankedCause> ranked;
  double shrink_refit = 0;    // 1 - excess_explained/excess_refit, held out
  double shrink_nominal = 0;  // against nominal
  Interval shrink_interval;   // 90 %, of shrink_refit
  double closable = 0;        // of what the effects and the best free signal beside them win, the effects' share
  std::vector<LevelDiscrepancy> discrepancies;
  std::optional<MissingSignal> missing;  // where the verdict is unknown
  std::vector<NextRun> next;
  std::vector<std::string> remarks;  // what could not be done, or is to be minded, each a sentence
  GapSeries series;
  double seconds = 0;
};

}  // namespace faultline
