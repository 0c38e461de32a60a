// Which fault, or which two, explain how estimated parameters changed: a table of signatures.
// Source: Yu, Control Engineering Practice 5 (1997), section 4; Gertler, Fault Detection and Diagnosis in Engineering
// Systems (1998), chapter 3.
//
// A fault h that multiplies the physical quantity behind it by e^s multiplies parameter i by e^(E_hi s): its signature
// is the row of exponents E_h. With the change y_i = ln(theta_i/theta_0i) of covariance V,
//   one fault:    s_h = argmin chi2_h,   chi2_h = (y - E_h s)' V^-1 (y - E_h s)
//   two faults:   likewise with (E_g, E_h)(s_g, s_h)
//   evidence      y' V^-1 y - chi2
// sizes being held within the datasheet's bounds. Two are sought where no single one fits: the least chi2_h is above
// `fit`. If two do not fit either, it is neither.
// V gains (relative_error max|y|)^2 on its diagonal: a signature is right to that fraction of what it explains.
// What cannot be told apart has the same chi2 and stands side by side in the ranking: signatures that span the same
// plane explain the same changes in pairs (of three signatures in one plane, any two).
//
// Settings: signatures (labels, with commas); for each label fault_LABEL (effect@port), exponents_LABEL (a list),
// opposite_LABEL [no] where the size grows as the quantity falls (yes: size = none - (e^s - 1)) and
// unit_LABEL, the parameter of the datasheet whose nominal value is one relative change of the effect's size (size =
// none + unit (e^s - 1)), without it 1; fit, relative_error. This rig's parameter is off that nominal value by its
// tolerance, and the size with it: its bounds have that.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "faultline/estimators/estimate.h"
#include "faultline/rig/datasheet.h"

namespace faultline {

class SignatureTable {
 public:
  SignatureTable(const Datasheet& sheet, const Settings& settings, int parameters);

  struct Answer {
    bool explained = false;                       // by one or two faults
    std::vector<RankedHypothesis> first, second;  // as in Ranking
    std::string nearest;                          // the single that comes closest
  };
  Answer explain(const Eigen::VectorXd& change, const Eigen::MatrixXd& covariance) const;

 private:
  struct Signature {
    RankedHypothesis hypothesis;  // with nothing explained
    Eigen::VectorXd exponents;
    double low = 0, high = 0;  // of s
    double unit_error = 0;     // relative, 1 sigma
  };
  struct Match {
    std::vector<std::size_t> which;
    Eigen::VectorXd sizes, stds;  // s
    double chi2 = 0;
  };
  Match match(const std::vector<std::size_t>& which, const Eigen::VectorXd& change,
              const Eigen::MatrixXd& weight) const;
  RankedHypothesis told(const Match& m, std::size_t place, double evidence) const;

  std::vector<Signature> signatures_;
  double fit_, relative_error_;
};

}  // namespace faultline
