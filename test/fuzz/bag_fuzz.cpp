// Whatever bytes a bag holds: read_bag returns samples that fit together, or throws InputError; in either case the
// memory that it takes is in proportion to what is there, not to what a length in the file says.
#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "cli/bag_file.h"
#include "faultline/signal/error.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace faultline;
  constexpr long kMostMemory =
      1000000;  // kB; a chunk may decompress to 0.27 million, and the sanitizer keeps what was freed
  static const int handle = ::memfd_create("bag_fuzz", MFD_CLOEXEC);
  static const std::string file = "/proc/self/fd/" + std::to_string(handle);
  if (handle < 0 || ::ftruncate(handle, 0) != 0 || ::pwrite(handle, data, size, 0) != static_cast<ssize_t>(size))
    std::abort();
  try {
    const BagContent content = read_bag(file, "");
    const std::size_t rows = content.time.size();
    if (rows == 0 || content.stamp.size() != rows || content.sequence.size() != rows ||
        content.values.size() != rows * content.width)
      std::abort();
  } catch (const InputError& error) {
    if (std::string(error.what()).find(file) == std::string::npos) std::abort();
  }
  rusage usage = {};
  if (::getrusage(RUSAGE_SELF, &usage) != 0 || usage.ru_maxrss > kMostMemory) {
    std::fprintf(stderr, "%ld kB of memory for a bag of %zu bytes\n", usage.ru_maxrss, size);
    std::abort();
  }
  return 0;
}
