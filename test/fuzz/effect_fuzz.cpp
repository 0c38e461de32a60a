// Whatever is written as an effect: parse_effect returns one whose text reads back as the same effect, or throws
// InputError. What parses can be checked against a port and asked for its growth.
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string>

#include "faultline/rig/effect.h"
#include "faultline/signal/error.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace faultline;
  try {
    const EffectSpec spec = parse_effect(std::string(reinterpret_cast<const char*>(data), size));
    const EffectType* type = find_effect_type(spec.effect);
    if (!type || spec.parameters.size() != type->parameters.size()) std::abort();
    for (const double time : {-1.0, 0.0, 1.0, 1e9}) {
      const double size_then = growth(spec, time);
      if (!(size_then >= 0 && size_then <= 1)) std::abort();
    }
    const EffectSpec again = parse_effect(to_string(spec));
    if (again.effect != spec.effect || again.port != spec.port) std::abort();
  } catch (const InputError&) {
  }
  return 0;
}
