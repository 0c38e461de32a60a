#include "faultline/gap/part_of_runs.h"

#include <algorithm>
#include <numeric>

namespace faultline {
namespace {

std::vector<std::size_t> all_of(std::size_t count) {
  std::vector<std::size_t> all(count);
  std::iota(all.begin(), all.end(), std::size_t{0});
  return all;
}

// `wanted` of `places`, evenly spread.
std::vector<std::size_t> evenly(const std::vector<std::size_t>& places, std::size_t wanted) {
  std::vector<std::size_t> result;
  for (std::size_t i = 0; i < wanted; ++i) result.push_back(places[(2 * i + 1) * places.size() / (2 * wanted)]);
  return result;
}

std::vector<std::size_t> segments_of(std::vector<std::size_t> pieces, std::size_t piece, std::size_t segments) {
  std::sort(pieces.begin(), pieces.end());
  std::vector<std::size_t> result;
  for (const std::size_t p : pieces)
    for (std::size_t g = p * piece; g < std::min(segments, (p + 1) * piece); ++g) result.push_back(g);
  return result;
}

}  // namespace

std::vector<std::vector<std::size_t>> telling_segments(const Linearisation& linear, const ResidualModel& residuals) {
  const GapOptions::Trials& options = residuals.options().trials;
  const std::vector<SegmentedRun>& runs = residuals.runs();
  const std::vector<double> losses = linear.segment_losses(linear.at_model());
  const std::size_t piece = options.part_piece_segments;
  const std::size_t share = std::max(options.part_least_segments, options.part_segments / runs.size());
  std::vector<std::vector<std::size_t>> result;
  std::size_t all = 0, chosen = 0, before = 0;
  for (const SegmentedRun& run : runs) {
    const std::size_t pieces = (run.segments() + piece - 1) / piece, wanted = share / piece;
    all += run.segments();
    if (wanted >= pieces) {
      result.push_back(all_of(run.segments()));
    } else {
      std::vector<double> missed(pieces, 0);
      for (std::size_t g = 0; g < run.segments(); ++g) missed[g / piece] += linear.robust(losses[before + g]);
      std::vector<std::size_t> order = all_of(pieces);
      std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return missed[a] > missed[b]; });
      const auto half = order.begin() + static_cast<std::ptrdiff_t>(wanted / 2);
      std::vector<std::size_t> rest(half, order.end());
      std::sort(rest.begin(), rest.end());
      std::vector<std::size_t> pieces_of_it = evenly(rest, wanted - wanted / 2);
      pieces_of_it.insert(pieces_of_it.end(), order.begin(), half);
      result.push_back(segments_of(std::move(pieces_of_it), piece, run.segments()));
    }
    chosen += result.back().size();
    before += run.segments();
  }
  if (static_cast<double>(chosen) > options.part_worthwhile_fraction * static_cast<double>(all))
    for (std::size_t r = 0; r < runs.size(); ++r) result[r] = all_of(runs[r].segments());
  return result;
}

}  // namespace faultline
