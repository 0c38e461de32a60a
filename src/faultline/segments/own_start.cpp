#include "faultline/segments/own_start.h"

#include <algorithm>

#include <fmt/format.h>

#include "faultline/rig/time_scales.h"
#include "faultline/segments/segmented_run.h"

namespace faultline {
namespace {

constexpr std::size_t kMostAllHidden = 6;  // states: smoothing more takes longer than the rig does

}  // namespace

bool runs_on_from_its_own_start(const Datasheet& sheet) {
  const std::vector<int> outputs = compared_outputs(sheet);
  const auto is_shown = [&](const State& state) {
    return std::find(outputs.begin(), outputs.end(), state.channel) != outputs.end();
  };
  return sheet.states.size() > kMostAllHidden && std::none_of(sheet.states.begin(), sheet.states.end(), is_shown);
}

std::string remark_of_own_start(const Datasheet& sheet, double segment_s) {
  if (!runs_on_from_its_own_start(sheet) || time_scales(sheet).slowest_s <= segment_s) return "";
  return fmt::format(
      "no channel shows any of the rig's {} states, too many to be estimated: the model begins every run at the rig's "
      "own start and runs on from segment to segment",
      sheet.states.size());
}

}  // namespace faultline
