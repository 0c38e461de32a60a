// C += X' Y for tall X and Y (samples x columns), in double precision.
//
// The compiler's default for x86-64 knows no vector unit that is younger than 2003. Where the processor has AVX2 and
// FMA, which is asked at run time, a kernel of 4 x 12 sums in registers is two to three times as fast; elsewhere it is
// Eigen's product. The order of the additions, and so the last digits, depends on which it was.
#pragma once

#include <vector>

#include <Eigen/Core>

namespace faultline {

class SumOfProducts {
 public:
  SumOfProducts(Eigen::Index rows, Eigen::Index columns);
  // X and Y have the same number of samples, and the columns that were told.
  void add(const Eigen::Ref<const Eigen::MatrixXd>& x, const Eigen::Ref<const Eigen::MatrixXd>& y);
  const Eigen::MatrixXd& sum() const { return sum_; }

 private:
  Eigen::MatrixXd sum_;
  std::vector<double> left_, right_;  // X and Y in panels, as the kernel reads them
};

}  // namespace faultline
