#include "faultline/networks/one_step.h"

#include <algorithm>
#include <limits>

#include "faultline/numerics/sum_of_products.h"

namespace faultline {
namespace {

using Index = Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using Rows = Network::Rows;

constexpr Index kBlock = 256;  // samples at once: what is made of them stays in the cache

// A unit over a block of samples, a sample a row.
class Block {
 public:
  Block(const NetworkUnit& unit, const double* weights)
      : unit_(unit),
        entries_(static_cast<Index>(unit.entries())),
        hidden_(static_cast<Index>(unit.hidden)),
        per_output_(hidden_ + (unit.integrating ? 0 : 1)),
        first_(Eigen::Map<const Rows>(weights, hidden_, entries_).transpose()),
        bias_(Eigen::Map<const VectorXd>(weights + hidden_ * entries_, hidden_)),
        second_(Eigen::Map<const Rows>(weights + hidden_ * (entries_ + 1), static_cast<Index>(unit.outputs.size()),
                                       per_output_)
                    .transpose() *
                unit.gain) {}

  // Samples from `from` on; a run's signals before it are those of its beginning.
  void take(const NetworkRun& run, Index from, Index samples) {
    z.resize(samples, entries_ + 1);
    h.resize(samples, hidden_ + 1);
    Index next = 0;
    for (const Tap& tap : unit_.beside) {
      const MatrixXd& signals = tap.output ? run.outputs : run.inputs;
      const auto signal = static_cast<Index>(tap.signal), lag = static_cast<Index>(tap.lag);
      for (Index k = 0; k < samples; ++k) z(k, next) = signals(signal, std::max<Index>(0, from + k - lag));
      ++next;
    }
    z.col(next).setOnes();
    h.leftCols(hidden_).noalias() = z.leftCols(entries_) * first_;
    // tanh by the exponential, of which several are had at once
    h.leftCols(hidden_) = 1 - 2 / ((2 * (h.leftCols(hidden_).rowwise() + bias_.transpose()).array()).exp() + 1);
    h.col(hidden_).setOnes();
    error.resize(samples, second_.cols());
    error.noalias() = -h.leftCols(per_output_) * second_;
    for (Index o = 0; o < error.cols(); ++o) {
      const auto output = static_cast<Index>(unit_.outputs[static_cast<std::size_t>(o)]);
      for (Index k = 0; k < samples; ++k)
        error(k, o) += run.outputs(output, from + k) - (unit_.integrating ? run.outputs(output, from + k - 1) : 0.0);
    }
  }

  const NetworkUnit& unit() const { return unit_; }
  Index entries() const { return entries_; }
  Index hidden() const { return hidden_; }
  Index per_output() const { return per_output_; }
  const MatrixXd& second() const { return second_; }  // with the gain

  MatrixXd z, h;  // what enters the hidden layer and what leaves it, with a last column of 1
  MatrixXd error;

 private:
  const NetworkUnit& unit_;
  Index entries_, hidden_, per_output_;
  MatrixXd first_;
  VectorXd bias_;
  MatrixXd second_;
};

// Calls `each` with the samples of every block.
template <class Each>
void for_blocks(const std::vector<NetworkRun>& runs, Each each) {
  for (const NetworkRun& run : runs)
    for (Index from = 1; from < run.inputs.cols(); from += kBlock)
      each(run, from, std::min(kBlock, run.inputs.cols() - from));
}

double samples_of(const std::vector<NetworkRun>& runs) {
  double count = 0;
  for (const NetworkRun& run : runs) count += static_cast<double>(std::max<Index>(0, run.inputs.cols() - 1));
  return std::max(1.0, count);
}

// Products of every column with itself and those before it.
void pairs(const Eigen::Ref<const MatrixXd>& columns, MatrixXd& products) {
  products.resize(columns.rows(), columns.cols() * (columns.cols() + 1) / 2);
  Index next = 0;
  for (Index i = 0; i < columns.cols(); ++i)
    for (Index j = 0; j <= i; ++j) products.col(next++) = columns.col(i).cwiseProduct(columns.col(j));
}

Index pair(Index i, Index j) { return i >= j ? i * (i + 1) / 2 + j : j * (j + 1) / 2 + i; }

// One unit's part of J'J and J'e, not yet divided by the samples.
class UnitSums {
 public:
  explicit UnitSums(const Block& block)
      : hidden_(block.hidden()),
        inner_(hidden_ * (hidden_ + 1) / 2, (block.entries() + 1) * (block.entries() + 2) / 2),
        across_(hidden_ * (block.entries() + 1), block.per_output()),
        outer_(MatrixXd::Zero(block.per_output(), block.per_output())),
        first_(MatrixXd::Zero(hidden_, block.entries() + 1)),
        second_(MatrixXd::Zero(block.per_output(), block.second().cols())) {}

  void add(const Block& block) {
    const MatrixXd slope = 1 - block.h.leftCols(hidden_).array().square();
    const auto leaving = block.h.leftCols(block.per_output());
    pairs(slope, slopes_);
    pairs(block.z, entries_);
    inner_.add(slopes_, entries_);
    both_.resize(block.z.rows(), hidden_ * block.z.cols());
    Index next = 0;
    for (Index i = 0; i < hidden_; ++i)
      for (Index a = 0; a < block.z.cols(); ++a) both_.col(next++) = slope.col(i).cwiseProduct(block.z.col(a));
    across_.add(both_, leaving);
    outer_.noalias() += leaving.transpose() * leaving;
    first_.noalias() +=
        (block.error * block.second().topRows(hidden_).transpose()).cwiseProduct(slope).transpose() * block.z;
    second_.noalias() += leaving.transpose() * block.error;
  }

  void finish(const Block& block, Index offset, NormalEquations& equations) const {
    const MatrixXd& second = block.second();
    const MatrixXd both_ways = second.topRows(hidden_) * second.topRows(hidden_).transpose();
    const Index columns = block.entries() + 1, gained = block.per_output();
    const double gain = block.unit().gain;
    const auto at = [&](Index i, Index a) {  // the first layer's weights, then its biases
      return offset + (a < block.entries() ? i * block.entries() + a : hidden_ * block.entries() + i);
    };
    for (Index i = 0; i < hidden_; ++i)
      for (Index a = 0; a < columns; ++a) {
        for (Index j = 0; j < hidden_; ++j)
          for (Index b = 0; b < columns; ++b)
            equations.square(at(i, a), at(j, b)) = both_ways(i, j) * inner_.sum()(pair(i, j), pair(a, b));
        equations.gradient[at(i, a)] = first_(i, a);
      }
    for (Index o = 0; o < second.cols(); ++o) {
      const Index own = offset + hidden_ * columns + o * gained;
      equations.square.block(own, own, gained, gained) = gain * gain * outer_;
      equations.gradient.segment(own, gained) = gain * second_.col(o);
      for (Index i = 0; i < hidden_; ++i)
        for (Index a = 0; a < columns; ++a)
          equations.square.col(at(i, a)).segment(own, gained) =
              gain * second(i, o) * across_.sum().row(i * columns + a).transpose();
    }
  }

 private:
  Index hidden_;
  SumOfProducts inner_, across_;  // (s_i s_j)(z_a z_b); (s_i z_a) h_j
  MatrixXd outer_, first_, second_;
  MatrixXd slopes_, entries_, both_;
};

std::vector<Block> blocks_of(const NetworkShape& shape, const VectorXd& weights, std::vector<Index>& offsets) {
  std::vector<Block> blocks;
  offsets.assign(1, 0);
  for (const NetworkUnit& unit : shape.units) {
    blocks.emplace_back(unit, weights.data() + offsets.back());
    offsets.push_back(offsets.back() + static_cast<Index>(unit.weights()));
  }
  return blocks;
}

}  // namespace

bool is_one_step(const NetworkShape& shape) {
  return shape.feedback == Feedback::none &&
         std::all_of(shape.units.begin(), shape.units.end(), [](const NetworkUnit& unit) { return unit.sum.empty(); });
}

VectorXd one_step_mean_squares(const NetworkShape& shape, const VectorXd& weights,
                               const std::vector<NetworkRun>& runs) {
  std::vector<Index> offsets;
  VectorXd sum = VectorXd::Zero(static_cast<Index>(shape.outputs.size()));
  for (Block& block : blocks_of(shape, weights, offsets))
    for_blocks(runs, [&](const NetworkRun& run, Index from, Index samples) {
      block.take(run, from, samples);
      for (Index o = 0; o < block.error.cols(); ++o)
        sum[static_cast<Index>(block.unit().outputs[static_cast<std::size_t>(o)])] += block.error.col(o).squaredNorm();
    });
  return sum / samples_of(runs);
}

NormalEquations one_step_equations(const NetworkShape& shape, const VectorXd& weights,
                                   const std::vector<NetworkRun>& runs) {
  NormalEquations equations;
  equations.square.setZero(weights.size(), weights.size());
  equations.gradient.setZero(weights.size());
  std::vector<Index> offsets;
  std::vector<Block> blocks = blocks_of(shape, weights, offsets);
  for (std::size_t u = 0; u < blocks.size(); ++u) {
    UnitSums sums(blocks[u]);
    for_blocks(runs, [&](const NetworkRun& run, Index from, Index samples) {
      blocks[u].take(run, from, samples);
      equations.error += blocks[u].error.squaredNorm();
      sums.add(blocks[u]);
    });
    sums.finish(blocks[u], offsets[u], equations);
  }
  const double count = samples_of(runs);
  equations.square /= count;
  equations.gradient /= count;
  equations.error /= count;
  return equations;
}

}  // namespace faultline
