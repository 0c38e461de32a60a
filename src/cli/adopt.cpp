#include "cli/adopt.h"

#include <cmath>
#include <regex>

#include <fmt/format.h>

#include "cli/datasheet_text.h"
#include "cli/output_file.h"
#include "faultline/rig/effect.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

std::string effect_text(const NamedEffect& effect) {
  EffectSpec spec;
  spec.effect = effect.effect;
  spec.port = effect.port;
  for (const EffectParameter& p : find_effect_type(effect.effect)->parameters)
    spec.parameters.push_back(effect.parameters.at(p.name));
  return to_string(spec);
}

}  // namespace

void adopt(const Datasheet& sheet, const GapResult& result, const std::string& file) {
  if (result.verdict == "unknown")
    throw InputError("--adopt: the answer is unknown, there is nothing that could be adopted");
  std::string text = datasheet_text(sheet);
  const GapLevel& level = result.gap.back();
  for (const auto& [name, factor] : level.parameters) {
    const Parameter& parameter = sheet.parameters[static_cast<std::size_t>(sheet.parameter(name))];
    if (std::abs(factor - 1) < 1e-6) continue;
    set_parameter(sheet, text, name, "nominal", parameter.nominal * factor);
  }
  std::string list;
  for (const std::string& known : sheet.nominal_effects) list += fmt::format("  - \"{}\"\n", known);
  for (const NamedEffect& effect : result.effects) list += fmt::format("  - \"{}\"\n", effect_text(effect));
  if (!list.empty() && !result.effects.empty()) {
    const std::regex section("(^|\n)nominal_effects:[^\n]*(\n[ -][^\n]*)*");
    text = std::regex_replace(text, section, "");
    text += "\n# found by `faultline gap` and adopted\nnominal_effects:\n" + list;
  }
  write_datasheet(text, file);
}

}  // namespace faultline
