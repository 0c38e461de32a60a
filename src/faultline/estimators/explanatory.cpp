#include "faultline/estimators/explanatory.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "faultline/numerics/random.h"

namespace faultline {
namespace {

constexpr double kTail = 0.001;  // of a range, at each end

// Every value's section among `count` of one width; all 0 where it never moves.
std::vector<std::uint16_t> sections_of(const std::vector<double>& values, int count) {
  std::vector<double> sorted = values;
  std::sort(sorted.begin(), sorted.end());
  const auto tail = static_cast<std::size_t>(kTail * static_cast<double>(sorted.size()));
  const double low = sorted[tail], high = sorted[sorted.size() - 1 - tail];
  std::vector<std::uint16_t> sections(values.size(), 0);
  if (high > low)
    for (std::size_t k = 0; k < values.size(); ++k)
      sections[k] = static_cast<std::uint16_t>(std::clamp((values[k] - low) / (high - low) * count, 0.0, count - 1.0));
  return sections;
}

// bit; of y within the bins of `a` and `b` (null: there is none).
double entropy(const std::vector<std::uint16_t>& y, int sections, const std::vector<std::uint16_t>* a,
               const std::vector<std::uint16_t>* b, int bins) {
  const std::size_t n = y.size();
  const auto width = static_cast<std::size_t>(sections), each = static_cast<std::size_t>(bins);
  std::vector<std::uint32_t> counts(each * each * width, 0);
  for (std::size_t k = 0; k < n; ++k) {
    const std::size_t place = (a ? (*a)[k] : 0) * each + (b ? (*b)[k] : 0);
    ++counts[place * width + y[k]];
  }
  double sum = 0;
  for (std::size_t place = 0; place < each * each; ++place) {
    const std::uint32_t* c = &counts[place * width];
    double total = 0;
    for (std::size_t i = 0; i < width; ++i) total += c[i];
    for (std::size_t i = 0; i < width; ++i)
      if (c[i] > 0) sum -= c[i] * std::log2(c[i] / total);
  }
  return sum / static_cast<double>(n);
}

std::vector<std::uint16_t> reordered(const std::vector<std::uint16_t>& values, int blocks, Random& random) {
  std::vector<std::size_t> order(static_cast<std::size_t>(blocks));
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  for (std::size_t i = order.size(); i-- > 1;)
    std::swap(order[i], order[static_cast<std::size_t>(random.uniform() * static_cast<double>(i + 1))]);
  std::vector<std::uint16_t> result;
  for (const std::size_t block : order) {
    const auto at = [&](std::size_t i) {
      return values.begin() + static_cast<std::ptrdiff_t>(i * values.size() / order.size());
    };
    result.insert(result.end(), at(block), at(block + 1));
  }
  return result;
}

}  // namespace

std::vector<Explained> explain(const Recording& recording, const std::vector<std::size_t>& observed,
                               const std::vector<std::size_t>& candidates, const ExplanatoryOptions& options) {
  std::vector<std::size_t> channels = observed;
  channels.insert(channels.end(), candidates.begin(), candidates.end());
  const std::size_t every = recording.rows() / options.most_rows + 1;
  std::vector<std::size_t> rows;
  for (std::size_t k = 0; k < recording.rows(); k += every)
    if (std::all_of(channels.begin(), channels.end(), [&](std::size_t c) { return std::isfinite(recording.at(k, c)); }))
      rows.push_back(k);
  std::vector<Explained> result;
  if (rows.empty()) return result;
  const auto column = [&](std::size_t c, int count) {
    std::vector<double> values;
    for (const std::size_t k : rows) values.push_back(recording.at(k, c));
    return sections_of(values, count);
  };
  std::vector<std::vector<std::uint16_t>> bins;
  for (const std::size_t c : candidates) bins.push_back(column(c, options.bins));

  for (const std::size_t c : observed) {
    Explained e;
    e.observed = c;
    const std::vector<std::uint16_t> y = column(c, options.sections);
    const auto left = [&](const std::vector<std::uint16_t>* a, const std::vector<std::uint16_t>* b) {
      return entropy(y, options.sections, a, b, options.bins);
    };
    e.entropy = e.left = left(nullptr, nullptr);
    // What every candidate gains beside `first`, best first.
    const auto gains = [&](const std::vector<std::uint16_t>* first) {
      const double before = left(first, nullptr);
      std::vector<Gain> found;
      for (std::size_t i = 0; i < candidates.size(); ++i) {
        if (candidates[i] == c || &bins[i] == first) continue;
        Random random(1);
        std::vector<double> chances;
        for (int k = 0; k < options.orders; ++k) {
          const std::vector<std::uint16_t> broken = reordered(bins[i], options.blocks, random);
          chances.push_back(before - left(first, &broken));
        }
        std::sort(chances.begin(), chances.end());
        found.push_back({candidates[i], before - left(first, &bins[i]), chances[chances.size() / 2], chances.back()});
      }
      std::stable_sort(found.begin(), found.end(),
                       [](const Gain& a, const Gain& b) { return a.beyond_chance() > b.beyond_chance(); });
      return found;
    };
    const auto choose = [&](const std::vector<Gain>& found) {
      if (found.empty() || e.entropy <= 0 || found[0].gain <= found[0].most ||
          found[0].beyond_chance() < options.least * e.entropy)
        return false;
      e.chosen.push_back(found[0].by);
      e.left -= found[0].beyond_chance();
      return true;
    };
    e.first = gains(nullptr);
    if (choose(e.first)) {
      const auto best = std::find(candidates.begin(), candidates.end(), e.chosen[0]) - candidates.begin();
      e.second = gains(&bins[static_cast<std::size_t>(best)]);
      choose(e.second);
    }
    result.push_back(std::move(e));
  }
  return result;
}

}  // namespace faultline
