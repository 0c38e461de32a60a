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

std::map<std::string, double> factors_beside(const Datasheet& sheet, const MissingSignal& missing) {
  std::map<std::string, double> factors;
  for (std::size_t p = 0; p < missing.parameters.size(); ++p)
    if (missing.parameters[p] != sheet.parameters[p].nominal && sheet.parameters[p].nominal != 0)
      factors[sheet.parameters[p].name] = missing.parameters[p] / sheet.parameters[p].nominal;
  return factors;
}

void adopt(const Datasheet& sheet, const GapResult& result, const std::string& file) {
  std::vector<std::string> effects;
  for (const NamedEffect& effect : result.effects) effects.push_back(effect_text(effect));
  if (result.missing && result.missing->adoptable)
    effects.push_back(to_string(curve_effect(result.missing->port, *result.missing->adoptable)));
  if (result.verdict == "unknown" && effects.empty())
    throw InputError(
        "--adopt: the answer is unknown, and no curve explains it; there is nothing that could be adopted");
  std::string text = datasheet_text(sheet);
  const bool curve = result.missing && result.missing->adoptable;
  const std::map<std::string, double> factors =
      curve ? factors_beside(sheet, *result.missing) : result.gap.back().parameters;
  for (const auto& [name, factor] : factors) {
    const Parameter& parameter = sheet.parameters[static_cast<std::size_t>(sheet.parameter(name))];
    if (std::abs(factor - 1) < 1e-6) continue;
    set_parameter(sheet, text, name, "nominal", parameter.nominal * factor);
  }
  std::string list;
  for (const std::string& known : sheet.nominal_effects) list += fmt::format("  - \"{}\"\n", known);
  for (const std::string& effect : effects) list += fmt::format("  - \"{}\"\n", effect);
  if (!effects.empty()) {
    const std::regex section("(^|\n)nominal_effects:[^\n]*(\n[ -][^\n]*)*");
    text = std::regex_replace(text, section, "");
    text += "\n# found by `faultline gap` and adopted\nnominal_effects:\n" + list;
  }
  write_datasheet(text, file);
}

}  // namespace faultline
