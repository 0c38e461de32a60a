// What a motion shows of the amplitudes of faults: from its sums over [r T D] (stretch_model.h), of residuals, of
// responses to parameters in tolerances and of responses to hypotheses. Parameters are known to their tolerance and
// from as much healthy motion as there is with the fault; what they could do as well is projected out.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "faultline/attribution/fault_hypothesis.h"

namespace faultline {

// Per pair of hypotheses, in amplitudes^-2.
Eigen::MatrixXd amplitude_information(Eigen::MatrixXd sums, Eigen::Index parameters);

// Standard errors of the amplitudes; infinite where the information is no more than `least`: standstill.
std::vector<double> amplitude_errors(const Eigen::MatrixXd& information, double least);

// Cosines between the responses to hypotheses; 0 for those that do not show.
Eigen::MatrixXd response_cosines(const Eigen::MatrixXd& information, double least);

// Whether at every place of the rig, transducers apart, some fault within its range would win so much evidence.
bool every_place_shows(const std::vector<FaultHypothesis>& hypotheses, const std::vector<double>& errors,
                       double evidence);

}  // namespace faultline
