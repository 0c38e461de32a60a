// Whatever bytes stand before a right check sum: parse_references returns references that read back as they are
// written, or throws InputError; and a network takes them or throws InputError.
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string>

#include <fmt/format.h>
#include <boost/crc.hpp>

#include "faultline/networks/model.h"
#include "faultline/signal/error.h"

namespace {

// A network of one input, one output and one neuron.
faultline::NetworkShape shape() {
  faultline::NetworkShape s;
  s.inputs = {{"u", 0, faultline::NetworkInput::Kind::plain}};
  s.outputs = {{"y", 1}};
  faultline::NetworkUnit unit;
  unit.outputs = {0};
  unit.beside = {{false, 0, 0}, {true, 0, 1}};
  s.units = {unit};
  s.period = 0.01;
  return s;
}

void check(const std::string& text) {
  using namespace faultline;
  try {
    const References read = parse_references(text, "plant", "file");
    const References again = parse_references(to_text(read), "plant", "file");
    if (again.stages.size() != read.stages.size()) std::abort();
    for (const StageReference& stage : read.stages) {
      try {
        const NetworkModel model = to_model(shape(), stage.reference);
        if (!model.weights.allFinite() || !(model.outputs.scale[0] > 0)) std::abort();
      } catch (const InputError&) {
      }
    }
  } catch (const InputError&) {
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  check(text);
  boost::crc_32_type crc;
  crc.process_bytes(text.data(), text.size());
  check(fmt::format("{}crc32 {:08x}\n", text, crc.checksum()));
  return 0;
}
