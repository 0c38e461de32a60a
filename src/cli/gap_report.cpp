#include "cli/gap_report.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <memory>
#include <system_error>

#include <fmt/format.h>

#include "cli/interrupt.h"
#include "cli/output_file.h"
#include "faultline/signal/error.h"
#include "nodes/python_script.h"

extern char** environ;

namespace faultline {
namespace {

namespace fs = std::filesystem;

constexpr const char* kRemedy =
    "; install python3, python3-matplotlib, python3-jinja2, python3-numpy and python3-yaml, or do without --report";

class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::error_code error;
    const fs::path base = fs::temp_directory_path(error);
    std::string name = ((error ? fs::path("/tmp") : base) / "faultline_gap_XXXXXX").string();
    if (!::mkdtemp(name.data()))
      throw InputError(fmt::format("{}: no folder can be made there ({}); set TMPDIR", name, std::strerror(errno)));
    folder_ = name;
    unfinished_.push_back(std::make_unique<Unfinished>(name));
  }
  ~TemporaryFolder() {
    std::error_code error;
    fs::remove_all(folder_, error);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  std::string file(const std::string& name) {
    unfinished_.push_back(std::make_unique<Unfinished>((folder_ / name).string()));
    return (folder_ / name).string();
  }

 private:
  fs::path folder_;
  std::vector<std::unique_ptr<Unfinished>> unfinished_;
};

// Runs the script without a shell; what it says goes to `said`.
void run_script(const std::vector<std::string>& arguments, const std::string& said) {
  std::vector<std::string> words = {python_interpreter(), find_script("gap_report.py")};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> pointers;
  for (std::string& word : words) pointers.push_back(word.data());
  pointers.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  ::posix_spawn_file_actions_init(&actions);
  ::posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  ::posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  ::posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, said.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
  pid_t child = 0;
  const int failure = ::posix_spawnp(&child, pointers.front(), &actions, nullptr, pointers.data(), environ);
  ::posix_spawn_file_actions_destroy(&actions);
  if (failure != 0)
    throw InputError(fmt::format("--report: {} cannot be run ({}){}", words.front(), std::strerror(failure), kRemedy));
  int status = 0;
  watch_child(child);
  while (::waitpid(child, &status, 0) < 0 && errno == EINTR) continue;
  watch_child(0);
  if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return;

  // Its last line says what went wrong.
  std::string text = read_text(said);
  text.erase(text.find_last_not_of(" \n\r") + 1);
  text.erase(0, text.find_last_of('\n') + 1);
  const std::string prefix = "faultline gap_report: ";
  if (text.compare(0, prefix.size(), prefix) == 0) text.erase(0, prefix.size());
  if (text.empty()) text = fmt::format("{} ended with status {} and said nothing{}", words.front(), status, kRemedy);
  throw InputError("--report: " + text);
}

}  // namespace

void check_gap_report() {
  TemporaryFolder folder;
  run_script({"--check"}, folder.file("said"));
}

void write_gap_report(const GapReportInput& input, const std::string& file) {
  TemporaryFolder folder;
  const std::string answer = folder.file("answer.json"), series = folder.file("series.csv");
  write_text(answer, input.answer);
  write_text(series, input.series);
  std::vector<std::string> arguments = {"--json",    answer,        "--series", series, "--datasheet", input.datasheet,
                                        "--command", input.command, "--output", file,   "--"};
  arguments.insert(arguments.end(), input.recordings.begin(), input.recordings.end());
  run_script(arguments, folder.file("said"));
}

}  // namespace faultline
