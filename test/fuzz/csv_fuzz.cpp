// Whatever bytes a CSV file holds: read_csv returns samples that fit together, or throws InputError with one line.
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string>

#include "faultline/signal/csv.h"
#include "faultline/signal/error.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace faultline;
  static const std::vector<Channel> channels = [] {
    std::vector<Channel> result(3);
    result[0].name = "reference";
    result[0].unit = "m";
    result[0].role = Role::setpoint;
    result[1].name = "pressure";
    result[1].unit = "Pa";
    result[2].name = "speed";
    result[2].unit = "rad/s";
    return result;
  }();
  try {
    const CsvContent content =
        read_csv(std::string(reinterpret_cast<const char*>(data), size), "fuzz.csv", "toy", channels);
    const Recording& recording = content.recording;
    if (recording.rows() == 0 || recording.values.size() != recording.rows() * channels.size()) std::abort();
    for (std::size_t row = 1; row < recording.rows(); ++row)
      if (!(recording.time[row] > recording.time[row - 1])) std::abort();
  } catch (const InputError& error) {
    const std::string text = error.what();
    if (text.empty() || text.find('\n') != std::string::npos) std::abort();
  }
  return 0;
}
