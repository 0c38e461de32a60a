// Whether the readings of one channel look like its transducer's, by what the datasheet says of it alone: noise,
// rounding, range. Judged in blocks of 64 readings; what a block says holds until the next.
//
//   frozen     the same reading n times on end; with p = resolution/(2 sqrt(pi) noise) equal neighbours happen by
//              chance, and n is such that noise does so once in 1e13 readings. Or, with p below 0.3, three of four
//              readings of a block that are the one before: those of a slower rate, each held
//   noise      median |d6|/(0.6745 sqrt(924)), d6: sixth differences (sum of squares of their weights: 924). They
//              leave out what moves slowly: a swing of frequency f and amplitude a adds a (2 sin(pi f T))^6; a step
//              spoils seven of 64. noisy: above `kNoisy` times the datasheet's in two blocks on end, and white: at
//              least `kWhite` times what second differences over two samples say (x_k - 2 x_k-2 + x_k-4), which see
//              the lower half of the frequencies; and of an input at most `kMotion` times the datasheet's: a rig
//              that is moved as fast as it is sampled is not noisy. quiet: below 1/`kQuiet` of it, which no such
//              transducer gives, but one whose numbers come in another unit does
//   spiky      readings beyond all four neighbours by `kSpike` sigma and three times what these differ: three within
//              eight blocks that are neither noisy nor move as fast
//
// Readings at an end of the range say nothing of noise; where there are no others, at_end is said. Rounding coarser
// than two sigma hides all but spikes. Without a declared noise nothing is judged, and of a command that is measured
// only whether it is frozen: a controller makes its steps and noise.
#pragma once

#include <array>
#include <cstddef>

#include "faultline/estimators/estimate.h"
#include "faultline/signal/channel.h"

namespace faultline {

class ChannelWatch {
 public:
  explicit ChannelWatch(const Channel& channel);
  // A finite reading within the range; what its block said, as `good` or one of those.
  ChannelStatus add(double value);
  void reset();

 private:
  static constexpr std::size_t kBlock = 64, kBlocks = 8, kAround = 6;
  ChannelStatus judge();
  bool is_noise() const;  // that the block is noisy

  double low_, high_, sigma_ = 0, equal_share_ = 0;
  bool command_, input_, watched_, rounded_ = false;
  std::size_t count_ = 0;                            // equal readings that are frozen
  std::array<double, kAround + kBlock> readings_{};  // of a block, after the last ones of the block before
  std::array<int, kBlocks> spikes_{};
  std::size_t count_read_ = 0, same_ = 0, longest_ = 0, equal_ = 0, ends_ = 0, block_ = 0;
  int noisy_ = 0, quiet_ = 0;  // blocks on end
  ChannelStatus status_ = ChannelStatus::good;
};

}  // namespace faultline
