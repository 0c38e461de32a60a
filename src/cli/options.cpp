#include "cli/options.h"

#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <system_error>

#include <fmt/format.h>

#include "cli/output_file.h"
#include "cli/share_folder.h"
#include "faultline/signal/error.h"
#include "nodes/rig_packages.h"

namespace faultline {
namespace {

namespace fs = std::filesystem;

// Shown by --help, and what check_files() knows them by.
constexpr char kInput[] = "INPUT";
constexpr char kOutput[] = "OUTPUT";
constexpr char kTextOutput[] = "OUTPUT|-";
constexpr char kStandardOutput[] = "/dev/fd/1";

struct NamedFile {
  std::string option, file, path;  // `path`: resolved
};

bool is_file(const std::string& path) {
  std::error_code error;
  return fs::is_regular_file(path, error);
}

// Two names of one file: links, and hard links. What is no regular file (a terminal, /dev/null) takes and gives at
// once.
bool same_file(const std::string& a, const std::string& b) {
  std::error_code error;
  if (fs::exists(a, error) && !is_file(a)) return false;
  return a == b || (fs::exists(a, error) && fs::equivalent(a, b, error));
}

// A datasheet that is given as its folder or its rig.yaml is read from two files.
std::vector<std::string> parts_of(const std::string& file) {
  std::error_code error;
  const fs::path path = fs::is_directory(file, error) ? fs::path(file) / "rig.yaml" : fs::path(file);
  if (path.filename() != "rig.yaml") return {file};
  return {path.string(), (path.parent_path() / "stages.yaml").string()};
}

std::vector<NamedFile> files_of(const CLI::App& app, std::initializer_list<const char*> types) {
  std::vector<NamedFile> files;
  for (const CLI::Option* option : app.get_options())
    for (const char* type : types)
      if (option->get_type_name() == type)
        for (const std::string& file : option->results())
          for (const std::string& part : parts_of(file)) files.push_back({option->get_name(), file, resolved(part)});
  return files;
}

// The folders of the program's own datasheets and of those of rigs outside this tree, with a / behind them.
std::vector<std::string> datasheet_folders() {
  std::vector<std::string> folders;
  try {
    folders.push_back(resolved(share_folder() + "/config") + "/");
  } catch (const InputError&) {
    // whoever needs one will say so
  }
  for (const RigPlace& place : outside_rigs())
    if (!place.config.empty()) folders.push_back(resolved(place.config) + "/");
  return folders;
}

void check_output(const NamedFile& output, const std::vector<NamedFile>& inputs) {
  const auto refuse = [&](const std::string& why) {
    throw InputError(fmt::format("{} {}: {}; choose another name", output.option, output.file, why));
  };
  for (const NamedFile& input : inputs)
    if (same_file(output.path, input.path)) refuse(fmt::format("this file is read, as {}", input.option));
  if (!is_file(output.path)) return;
  for (const std::string& folder : datasheet_folders())
    if (output.path.compare(0, folder.size(), folder) == 0) refuse("this is one of the program's own datasheets");
}

}  // namespace

CLI::Option* add_input(CLI::App& app, const std::string& name, std::string& file, const std::string& meaning) {
  return app.add_option(name, file, meaning)->type_name(kInput);
}

CLI::Option* add_input(CLI::App& app, const std::string& name, std::vector<std::string>& files,
                       const std::string& meaning) {
  return app.add_option(name, files, meaning)->type_name(kInput);
}

CLI::Option* add_output(CLI::App& app, const std::string& name, std::string& file, const std::string& meaning) {
  return app.add_option(name, file, meaning)->type_name(kOutput);
}

CLI::Option* add_text_output(CLI::App& app, const std::string& name, std::string& file, const std::string& meaning) {
  return app.add_option(name, file, meaning)->type_name(kTextOutput);
}

void check_files(const CLI::App& app) {
  for (const CLI::Option* option : app.get_options())
    for (const std::string& value : option->results())
      if (value.empty())
        throw InputError(
            fmt::format("{}: the value is empty; give one, or leave {} out", option->get_name(), option->get_name()));

  const std::vector<NamedFile> inputs = files_of(app, {kInput});
  std::vector<NamedFile> outputs = files_of(app, {kOutput});
  for (const NamedFile& output : outputs)
    if (output.file == "-")
      throw InputError(fmt::format("{} -: this is written to a file, not to standard output; name one", output.option));
  for (const NamedFile& output : files_of(app, {kTextOutput})) outputs.push_back(output);

  // A run that is learned from cannot judge what was learned, and one that counts twice is not twice as sure.
  for (auto input = inputs.begin(); input != inputs.end(); ++input)
    for (auto other = inputs.begin(); other != input; ++other) {
      if (!same_file(input->path, other->path)) continue;
      if (input->option != other->option)
        throw InputError(fmt::format("{}: this file is given as {} and as {}; take another for one of them",
                                     input->file, other->option, input->option));
      throw InputError(fmt::format("{}: this file is given twice as {}{}; give it once", input->file, input->option,
                                   other->file == input->file ? "" : ", as " + other->file + " too"));
    }
  for (const NamedFile& input : inputs)
    if (same_file(resolved(kStandardOutput), input.path))
      throw InputError(
          fmt::format("{}: standard output goes into this file, which is read; choose another", input.file));
  for (auto output = outputs.begin(); output != outputs.end(); ++output) {
    for (auto other = outputs.begin(); other != output; ++other) {
      if (output->file == "-" && other->file == "-")
        throw InputError(
            fmt::format("{} - and {} -: standard output takes one of them", other->option, output->option));
      if (output->file != "-" && other->file != "-" && same_file(output->path, other->path))
        throw InputError(fmt::format("{} {}: {} is written to the same place; choose another name", output->option,
                                     output->file, other->option));
    }
    if (output->file == "-") continue;
    check_output(*output, inputs);
    OutputFile probe(output->file);
  }
}

CLI::Validator number_between(double low, double high) {
  return CLI::Validator(
      [low, high](std::string& text) {
        char* end = nullptr;
        const double value = std::strtod(text.c_str(), &end);
        const bool good = !text.empty() && end == text.c_str() + text.size() && value >= low && value <= high;
        return good ? std::string() : fmt::format("'{}' is no number of {:g} to {:g}", text, low, high);
      },
      fmt::format("{:g} to {:g}", low, high));
}

CLI::Validator whole_number(std::uint64_t low, std::uint64_t high) {
  return CLI::Validator(
      [low, high](std::string& text) {
        bool good = !text.empty() && text.size() <= 20 && text.find_first_not_of("0123456789") == std::string::npos;
        errno = 0;
        const std::uint64_t value = good ? std::strtoull(text.c_str(), nullptr, 10) : 0;
        good = good && errno == 0 && value >= low && value <= high;
        return good ? std::string() : fmt::format("'{}' is no whole number of {} to {}", text, low, high);
      },
      fmt::format("{} to {}", low, high));
}

}  // namespace faultline
