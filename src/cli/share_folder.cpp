#include "cli/share_folder.h"

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <system_error>

#include "faultline/signal/error.h"

namespace faultline {
namespace {

namespace fs = std::filesystem;

bool holds_config(const fs::path& folder) {
  std::error_code error;
  return fs::is_directory(folder / "config", error);
}

}  // namespace

std::string share_folder() {
  if (const char* given = std::getenv("FAULTLINE_SHARE"); given != nullptr && *given != '\0') {
    if (!holds_config(given)) {
      throw InputError(std::string("FAULTLINE_SHARE=") + given +
                       ": no folder config/ in it; set it to a folder that holds faultline's config/, or unset it");
    }
    return given;
  }

  std::error_code error;
  const fs::path program = fs::read_symlink("/proc/self/exe", error);
  const fs::path share = program.parent_path().parent_path().parent_path() / "share" / "faultline";
  if (holds_config(share)) return share.string();

  std::ifstream file(share / "source_folder");
  if (std::string source; std::getline(file, source) && holds_config(source)) return source;

  const fs::path here = fs::current_path(error);
  if (fs::exists(here / "package.xml", error) && holds_config(here)) return here.string();

  throw InputError(share.string() + ": no folder config/ in it; install faultline again, or set FAULTLINE_SHARE");
}

}  // namespace faultline
