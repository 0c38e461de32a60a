#include "faultline/detectors/run_length.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <Eigen/Dense>
#include <boost/math/quadrature/gauss.hpp>

#include "faultline/signal/error.h"

namespace faultline {
namespace {

constexpr int kNodesPerPanel = 8;  // even: no node in the middle
constexpr double kPanel = 0.5;     // sigma: the kernel is smooth on this length
constexpr int kMostPanels = 60;    // beyond that panels grow
constexpr double kHighest = 1e4;

double density(double x) { return std::exp(-0.5 * x * x) / std::sqrt(2 * M_PI); }
double below(double x) { return 0.5 * std::erfc(-x / std::sqrt(2.0)); }

// Nodes and weights of the Gauss-Legendre rule on [-1, 1]; Boost holds the positive half.
template <class Add>
void legendre(Add&& add) {
  using Rule = boost::math::quadrature::gauss<double, kNodesPerPanel>;
  for (std::size_t i = 0; i < Rule::abscissa().size(); ++i)
    for (const double side : {-1.0, 1.0}) add(side * Rule::abscissa()[i], Rule::weights()[i]);
}

}  // namespace

double cusum_run_length(double k, double h, double shift) {
  const int panels = std::clamp(static_cast<int>(std::ceil(h / kPanel)), 1, kMostPanels);
  const int n = panels * kNodesPerPanel;
  const double width = h / panels, drift = shift - k;
  Eigen::VectorXd x(n), w(n);
  int next = 0;
  for (int p = 0; p < panels; ++p)
    legendre([&](double node, double weight) {
      x[next] = width * (p + 0.5 * (node + 1));
      w[next++] = 0.5 * width * weight;
    });
  // Unknowns: L(0), then L at the nodes.
  Eigen::MatrixXd a = Eigen::MatrixXd::Identity(n + 1, n + 1);
  for (int i = 0; i <= n; ++i) {
    const double s = i == 0 ? 0.0 : x[i - 1];
    a(i, 0) -= below(-s - drift);
    for (int j = 0; j < n; ++j) a(i, j + 1) -= w[j] * density(x[j] - s - drift);
  }
  const double length = a.partialPivLu().solve(Eigen::VectorXd::Ones(n + 1))[0];
  // Beyond what double precision can tell from never.
  return length > 0 && length < 1e14 ? length : 1e14;
}

double two_sided_run_length(double k, double h, double shift) {
  return 1 / (1 / cusum_run_length(k, h, shift) + 1 / cusum_run_length(k, h, -shift));
}

double siegmund_threshold(double k, double samples) {
  if (!(k > 0) || !(samples > 1 && samples < 1e15))
    throw InputError(fmt::format(
        "a CUSUM of allowance {:g} sigma with a false alarm every {:g} samples: the allowance must be above 0, the "
        "samples between 1 and 1e15",
        k, samples));
  const double wanted = 2 * samples;  // one side
  const auto length = [k](double h) {
    const double b = 2 * k * (h + 1.166);
    return (std::exp(b) - 1 - b) / (2 * k * k);
  };
  double low = 0, high = 1;
  while (length(high) < wanted) {
    high *= 2;
    if (high > kHighest) throw InputError("a CUSUM threshold above 1e4 sigma is needed: ask for a larger change");
  }
  for (int i = 0; i < 60; ++i) (length(0.5 * (low + high)) < wanted ? low : high) = 0.5 * (low + high);
  return high;
}

double cusum_threshold(double k, double samples) {
  double h = siegmund_threshold(k, samples);
  if (h > kPanel * kMostPanels) return h;  // far out the approximation is as good as the nodes
  // The logarithm of the run length is nearly straight in h.
  for (int i = 0; i < 8; ++i) {
    const double off = std::log(2 * samples / cusum_run_length(k, h, 0));
    h = std::max(h + off / (2 * k), 1e-3);
    if (std::abs(off) < 1e-4) break;
  }
  return h;
}

}  // namespace faultline
