// `faultline new-rig`: a package for a rig of one's own, made from the one in examples/my_rig, in which the rig's name
// stands as my_rig and MyRig.
#include <algorithm>
#include <cctype>
#include <cerrno>
#include <filesystem>
#include <fstream>
#include <memory>
#include <set>
#include <system_error>

#include <fmt/format.h>
#include <unistd.h>

#include "cli/output_file.h"
#include "cli/share_folder.h"
#include "cli/subcommand.h"
#include "faultline/rig/rig.h"
#include "faultline/rig/yaml_reader.h"
#include "faultline/signal/error.h"
#include "nodes/rig_packages.h"

namespace faultline {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kLongestName = 60;
const char* const kName = "my_rig";      // as the template has it: in file names, and for programs
const char* const kClass = "MyRig";      // as a class
const char* const kTemplate = "my_rig";  // its folder in examples/

struct Options {
  std::string name, folder;
};

// What CMake and catkin call their own targets: the rig's library is one too.
const std::set<std::string>& taken_targets() {
  static const std::set<std::string> names = {
      "all",  "clean",   "clean_test_results",      "doxygen", "edit_cache",    "faultline",
      "help", "install", "list_install_components", "package", "rebuild_cache", "run_tests",
      "test", "tests"};
  return names;
}

void check_name(const std::string& name) {
  if (!is_name(name) || name.size() > kLongestName)
    throw InputError(
        fmt::format("'{}' is no name for a rig; take lower-case letters, digits and _, a letter first, {} at most",
                    name, kLongestName));
  if (taken_targets().count(name) > 0)
    throw InputError(fmt::format("'{}' is a target of CMake or catkin; take another name", name));
  std::error_code error;
  if (fs::exists(fs::path(share_folder()) / "config" / name, error))
    throw InputError(fmt::format("there is a rig '{}' already, in {}/config; take another name", name, share_folder()));
  for (const RigPlace& place : outside_rigs())
    if (place.rig == name)
      throw InputError(fmt::format("there is a rig '{}' already, in {}; take another name", name, place.package));
}

std::string class_name(const std::string& name) {
  std::string text;
  bool begins = true;
  for (const char c : name) {
    if (c != '_') text += begins ? static_cast<char>(std::toupper(static_cast<unsigned char>(c))) : c;
    begins = c == '_';
  }
  return text;
}

std::string with_name(std::string text, const std::string& name) {
  const auto replace = [&text](const std::string& from, const std::string& to) {
    for (std::size_t place = 0; (place = text.find(from, place)) != std::string::npos; place += to.size())
      text.replace(place, from.size(), to);
  };
  replace(kName, name);
  replace(kClass, class_name(name));
  return text;
}

// Beside its place until it is whole; where that fails, nothing stays.
class PartFolder {
 public:
  explicit PartFolder(const fs::path& target)
      : target_(target), part_(target.string() + fmt::format(".{}.part", ::getpid())) {
    if (!fs::create_directory(part_, error_)) fail(part_, error_);
  }
  ~PartFolder() {
    if (!done_) fs::remove_all(part_, error_);
  }
  PartFolder(const PartFolder&) = delete;
  PartFolder& operator=(const PartFolder&) = delete;

  void write(const fs::path& name, const std::string& text) {
    const fs::path file = part_ / name;
    fs::create_directories(file.parent_path(), error_);
    if (error_) fail(file.parent_path(), error_);
    std::ofstream stream(file, std::ios::binary);
    stream << text;
    stream.close();
    if (!stream) fail(file, std::error_code(errno, std::generic_category()));
  }
  // rename() does not replace a folder that holds something, nor a file.
  void commit() {
    fs::rename(part_, target_, error_);
    if (error_) fail(target_, error_);
    done_ = true;
  }

 private:
  [[noreturn]] static void fail(const fs::path& path, const std::error_code& error) {
    throw InputError(
        fmt::format("{}: this cannot be written ({}); choose another folder with -o", path.string(), error.message()));
  }
  fs::path target_, part_;
  std::error_code error_;
  bool done_ = false;
};

void run(const Options& options) {
  check_name(options.name);
  std::error_code error;
  std::string folder = fs::absolute(options.folder.empty() ? options.name : options.folder, error).lexically_normal();
  while (folder.size() > 1 && folder.back() == '/') folder.pop_back();
  if (fs::exists(fs::symlink_status(folder, error)))
    throw InputError(
        fmt::format("{}: this is there already; nothing is overwritten: choose another folder with -o", folder));
  const fs::path source = fs::path(share_folder()) / "examples" / kTemplate;
  std::vector<fs::path> files;
  for (fs::recursive_directory_iterator entry(source, error), end; !error && entry != end; entry.increment(error)) {
    if (entry->path().filename() == "build") entry.disable_recursion_pending();  // of somebody who tried it in place
    if (entry->is_regular_file()) files.push_back(fs::relative(entry->path(), source));
  }
  if (error || files.empty())
    throw InputError(fmt::format("{}: the template is not there; install faultline again", source.string()));
  std::sort(files.begin(), files.end());
  PartFolder part(folder);
  for (const fs::path& file : files)
    part.write(with_name(file.string(), options.name), with_name(read_text((source / file).string()), options.name));
  part.commit();
  fmt::print("{}: a package for the rig {}\n", folder, options.name);
  for (const fs::path& file : files) fmt::print("    {}\n", with_name(file.string(), options.name));
  fmt::print(
      "It is a tank that works as it is. Edit config/ and src/ (docs/your_own_stand.md); build and test it where "
      "faultline's setup.bash is sourced:\n"
      "    cmake -S {0} -B {0}/build && cmake --build {0}/build && ctest --test-dir {0}/build\n"
      "    export FAULTLINE_RIG_PATH={0}\n",
      folder);
}

std::function<void()> add(CLI::App& app) {
  const auto options = std::make_shared<Options>();
  app.add_option("NAME", options->name, "of the rig and its package: lower-case letters, digits and _")->required();
  app.add_option("-o,--output", options->folder, "folder of the package, which must not exist yet; default: ./NAME");
  return [options] { run(*options); };
}

FAULTLINE_SUBCOMMAND(new_rig, {"new-rig", "make a package for a rig of your own: datasheet, equations, test, launch",
                               "faultline new-rig pump_stand -o pump_stand", add});

}  // namespace
}  // namespace faultline
