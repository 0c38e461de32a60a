#include "cli/subcommand.h"

#include <algorithm>

namespace faultline {
namespace {

std::vector<Subcommand>& registry() {
  static std::vector<Subcommand> all;
  return all;
}

}  // namespace

const std::vector<Subcommand>& subcommands() { return registry(); }

bool register_subcommand(Subcommand subcommand) {
  auto& all = registry();
  const auto place = std::lower_bound(all.begin(), all.end(), subcommand,
                                      [](const Subcommand& a, const Subcommand& b) { return a.name < b.name; });
  all.insert(place, std::move(subcommand));
  return true;
}

}  // namespace faultline
