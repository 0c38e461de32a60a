#include "faultline/signal/late_library.h"

#include <dlfcn.h>

#include <filesystem>
#include <stdexcept>

#include <fmt/format.h>

namespace faultline {

void* late_symbol(const std::string& name, const std::string& symbol) {
  Dl_info here{};
  if (::dladdr(reinterpret_cast<const void*>(&late_symbol), &here) == 0)
    throw std::runtime_error(fmt::format("it cannot be told where the library '{}' is", name));
  const std::string file = std::filesystem::path(here.dli_fname).parent_path() / ("lib" + name + ".so");
  void* const library = ::dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
  void* const found = library ? ::dlsym(library, symbol.c_str()) : nullptr;
  if (!found) {
    const char* const why = ::dlerror();
    throw std::runtime_error(fmt::format("{}: this part of the program cannot be loaded ({}); build faultline again",
                                         file, why ? why : "unknown reason"));
  }
  return found;
}

}  // namespace faultline
