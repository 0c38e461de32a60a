// States that no channel shows, estimated over a run by an extended Kalman filter and a backward pass over the rig's
// own model (Rauch, Tung, Striebel, AIAA J. 3, 1965), both linearised by differences (propagation.h).
//
//   x_k+1 = f(x_k, u_k) + v,  y_k = h(x_k) + w,   v ~ N(0, q Q),  w ~ N(0, R)
//   Q = sum over parameters of (df/dp p tolerance)^2, diagonal: what the tolerances make of one step
//   q: of powers of ten the one with the largest likelihood of the innovations; for covariances not below 1, since a
//      model that follows a run closely with the wrong parameters does not know its hidden states as well as that
//   backwards: C = P_k F' (P_k+1^-)^-1,  x_k^s = x_k + C (x_k+1^s - x_k+1^-),  P_k^s = P_k + C (P_k+1^s - P_k+1^-) C'
//
// R: the recording's own noise; readings that measure nothing (smoothing.h) are left out. The first state of a stretch
// is what its row shows and, where no channel shows a state, the rig's own start, known to the state's size. Assumes
// that effects with memory hide nothing; a state that nothing measured depends on keeps the rig's own start and its
// spread.
#pragma once

#include "faultline/segments/segment_model.h"

namespace faultline {

// The datasheet's states that no compared output shows and that must be estimated over this run: all, if what is
// wrong with one of them lasts longer than a tenth of a segment while the measured states are held; else none - they
// go on from segment to segment. None either of a rig with more than 6 states none of which a channel shows:
// smoothing them takes longer than the rig does (cooling circuit). Judged at the datasheet's parameters, so that all
// models of a run are compared alike.
std::vector<int> hidden_states(const SegmentModel& model, const SegmentedRun& run);

struct StateCourse {
  std::vector<Eigen::VectorXd> mean;        // per wanted row
  std::vector<Eigen::MatrixXd> covariance;  // likewise
};

// All states at `rows` (rising, within the run's stretches). `noise`: of each output.
StateCourse smooth_states(const SegmentModel& model, const ModelChange& change, const SegmentedRun& run,
                          const std::vector<double>& noise, const std::vector<std::size_t>& rows);

}  // namespace faultline
