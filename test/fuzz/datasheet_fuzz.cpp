// Whatever bytes a datasheet holds: read_datasheet returns a sheet, or throws InputError with one line that begins with
// the file.
#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>

#include "faultline/rig/datasheet.h"
#include "faultline/signal/error.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace faultline;
  static const std::string file =
      (std::filesystem::temp_directory_path() / ("datasheet_fuzz_" + std::to_string(::getpid()) + ".yaml")).string();
  std::FILE* stream = std::fopen(file.c_str(), "wb");
  if (!stream) std::abort();
  if (size > 0 && std::fwrite(data, 1, size, stream) != size) std::abort();
  std::fclose(stream);
  bool fine = true;
  try {
    const Datasheet sheet = read_datasheet(file);
    fine = !sheet.rig.empty() && sheet.sample_period > 0;
  } catch (const InputError& error) {
    const std::string text = error.what();
    fine = text.find(file) != std::string::npos && text.find('\n') == std::string::npos;
    if (!fine) std::fprintf(stderr, "%s\n", text.c_str());
  }
  std::filesystem::remove(file);
  if (!fine) std::abort();
  return 0;
}
