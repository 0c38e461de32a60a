// Since when: whether the model, with parameters of its own, explains runs up to some moment and not from then on.
//
//   max over t of  n_1 n_2/(n_1 + n_2) (mean_2 - mean_1)^2 / (squares_1 + squares_2)
//
// of the segments' log-likelihoods (linearisation.h) with theta, which is fitted to what is before t; mean_i and
// squares_i, the scatter around it, before and after. Each segment has a noise level of its own there, so theta
// is that of the segments that it explains, and one in which the model goes astray is no step. Runs follow one another
// in the order in which they are given, or begin together, whichever shows it better: a fault that is put in during
// each of them. Then each run gets a moment of its own, its beginning or its end among them. The model is made linear
// anew around theta, and t sought again. Whether a cause that explains what follows was not there before is asked of
// all runs (contradicted()): one that did not show before, since the rig did not move so, may have been there all the
// time. Where some runs are before and the others after, the rig may be another one, too: its parameters move.
#pragma once

#include <optional>

#include "faultline/gap/fit_gap.h"
#include "faultline/gap/gap_result.h"

namespace faultline {

struct Onset {
  // Of each run, the first segment that shows it: 0, if it is there all the time; as many as the run has, if it is not.
  std::vector<std::size_t> segments;
  // Each the time of such a segment inside its run; where there is none, of runs that show it from their beginning on,
  // others not at all.
  std::vector<Since::Moment> moments;
  std::vector<double> parameters;        // theta, in the datasheet's order
  std::vector<double> uncertainty;       // ... and how well what is before tells them, in tolerances: 1 not at all
  double following = 0;                  // excess that theta leaves from then on
  double begins(std::size_t run) const;  // s from that run's beginning; 0 where it does not, or with the run
};

class OnsetSearch {
 public:
  // Runs as they are, none cut.
  OnsetSearch(const Datasheet& sheet, std::vector<SegmentedRun> runs, const GapOptions& options, int jobs);

  // Nothing where before t there is as much to explain as after, or where t lies next to an end of a run.
  std::optional<Onset> find();
  // How much worse the runs are explained with these effects from the beginning than from the onset on, over how much
  // worse they are without (times in them are of what follows): 0 where they may have been there all the time.
  // Parameters at their best for each.
  double contradicted(const Onset& onset, const std::vector<EffectSpec>& effects) const;

 private:
  using Firsts = std::vector<std::size_t>;  // Onset::segments
  using Products = std::vector<Eigen::MatrixXd>;
  struct Split {
    Firsts firsts;
    Adjusted before;
    double score = 0;
  };
  std::vector<bool> follows(const Firsts& firsts) const;  // per segment, runs one after the other
  void settle(const ModelChange& at);
  std::optional<Split> best_split(const Products& products, const Eigen::VectorXd& z) const;
  void try_order(const std::vector<std::size_t>& order, const Products& products, const Eigen::VectorXd& z,
                 std::optional<Split>& best) const;
  void part_runs(const Products& products, const Eigen::VectorXd& z, Split& split) const;
  double score(const std::vector<double>& level, const Firsts& firsts) const;
  std::vector<double> levels(const Products& products, const Eigen::VectorXd& move) const;
  std::vector<double> uncertainty(const Products& products) const;  // Onset::uncertainty, of these segments

  int jobs_;
  ResidualModel residuals_;
  std::vector<std::size_t> every_;
  std::shared_ptr<const Linearisation> linear_;
};

// The run from the segment on, as a run of its own.
SegmentedRun rest_of(const Datasheet& sheet, const SegmentedRun& run, std::size_t segment,
                     const SegmentOptions& options);
// The rig as it was before: its parameters are known to a fraction of their tolerances, but those of which that told
// nothing. They do not move by themselves: what moves them is a cause.
Datasheet calibrated(const Datasheet& sheet, const Onset& onset, const GapOptions::Onset& options);

}  // namespace faultline
