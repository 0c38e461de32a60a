#include "nodes/python_script.h"

#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <system_error>

#include <fmt/format.h>

#include "faultline/signal/error.h"

namespace faultline {

namespace fs = std::filesystem;

std::string find_script(const std::string& name) {
  std::error_code error;
  const fs::path folder = fs::read_symlink("/proc/self/exe", error).parent_path();
  if (fs::is_regular_file(folder / name, error)) return (folder / name).string();
  std::ifstream file(folder.parent_path().parent_path() / "share" / "faultline" / "source_folder");
  std::string source;
  std::getline(file, source);
  const fs::path in_tree = fs::path(source) / "scripts" / name;
  if (fs::is_regular_file(in_tree, error)) return in_tree.string();
  throw InputError(fmt::format("{}: the script is not there; install faultline again", (folder / name).string()));
}

std::string python_interpreter() {
  if (const char* given = std::getenv("FAULTLINE_PYTHON"); given != nullptr && *given != '\0') return given;
  return ::access("/usr/bin/python3", X_OK) == 0 ? "/usr/bin/python3" : "python3";
}

}  // namespace faultline
