#include "faultline/gap/normal_gap.h"

#include <algorithm>
#include <atomic>
#include <vector>

#include "faultline/numerics/in_parallel.h"
#include "faultline/rig/simulator.h"
#include "faultline/segments/segment_length.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

constexpr std::size_t kRigs = 8, kProfiles = 3;
constexpr std::uint64_t kSeed = 4101;
constexpr double kWindows = 6;      // of the means, that each simulation takes
constexpr std::size_t kTell = 100;  // samples between two words of the progress
constexpr double kBeyond = 2;       // of the largest seen
constexpr double kLeast = 1;        // noise variances: what the scatter of noise makes stays far below

}  // namespace

std::size_t normal_gap_simulations(const Datasheet& sheet) {
  return kRigs * std::min(kProfiles, sheet.profiles.size());
}

std::map<std::string, double> simulated_normal_gap(const Datasheet& given, const LiveGapSettings& settings, int jobs,
                                                   const NormalGapProgress& progress) {
  Datasheet sheet = given;
  sheet.normal_gap.clear();  // nothing leaves normal here, so that no place is sought
  // The first segment only gives the second its past.
  const double duration = (kWindows * static_cast<double>(settings.smoothing_segments) + 2) * settings.segment_ratio *
                          live_segment_length(sheet);
  const std::size_t profiles = std::min(kProfiles, sheet.profiles.size());
  if (profiles == 0) throw InputError(sheet.rig + ": the datasheet has no profile to simulate");
  std::vector<std::map<std::string, double>> seen(normal_gap_simulations(sheet));
  std::atomic<std::size_t> done{0};
  std::atomic<bool> stopped{false};
  in_parallel(seen.size(), jobs, [&](std::size_t i) {
    if (stopped) return;
    SimulationSetup setup;
    setup.profile = sheet.profiles[i % profiles].name;
    setup.seed = kSeed + i;
    setup.parameters = draw_parameters(sheet, kSeed + i / profiles);
    for (const std::string& effect : sheet.nuisance) setup.effects.push_back(parse_effect(effect));
    Simulator simulator(sheet, setup);
    LiveGap gap(sheet, settings);
    const auto rows = static_cast<std::size_t>(duration / sheet.sample_period);
    for (std::size_t k = 0; k < rows && !stopped; ++k) {
      if (k % kTell == 0 && !progress(done)) stopped = true;
      if (!gap.process(simulator.step())) continue;
      for (const LiveChannelGap& channel : gap.state().channels)
        if (gap.state().judged) seen[i][channel.channel] = std::max(seen[i][channel.channel], channel.smoothed);
    }
    if (!stopped && !progress(++done)) stopped = true;
  });
  if (stopped) return {};
  std::map<std::string, double> result;
  for (const auto& run : seen)
    for (const auto& [channel, excess] : run) result[channel] = std::max({result[channel], kLeast, kBeyond * excess});
  return result;
}

}  // namespace faultline
