#include "faultline/rig/reference.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <boost/crc.hpp>

#include "faultline/signal/error.h"

namespace faultline {
namespace {

namespace fs = std::filesystem;

constexpr int kForm = 1;  // of the file
constexpr const char* kTitle = "faultline references";
constexpr const char* kCheckSum = "crc32 ";
constexpr std::size_t kLargestFile = 64 << 20;  // bytes; histograms have some ten thousand numbers

std::string check_sum(const std::string& text) {
  boost::crc_32_type crc;
  crc.process_bytes(text.data(), text.size());
  return fmt::format("{}{:08x}\n", kCheckSum, crc.checksum());
}

// The lines of a file whose check sum is right, one after the other. What does not read as it was written is of another
// form.
class Lines {
 public:
  Lines(const std::string& text, const std::string& file) : stream_(text), file_(file) {}

  [[noreturn]] void refuse(const std::string& what) const {
    throw InputError(fmt::format("{}:{}: {}; learn the references anew", file_, number_, what));
  }
  bool more() { return stream_.peek() != std::istringstream::traits_type::eof(); }
  std::vector<std::string> words(std::size_t count) {
    std::string line;
    if (!std::getline(stream_, line)) refuse("the file ends too early");
    ++number_;
    std::vector<std::string> words;
    std::istringstream parts(line);
    for (std::string word; parts >> word;) words.push_back(word);
    if (words.size() != count) refuse(fmt::format("a line of {} words is expected", count));
    return words;
  }
  double number(const std::string& word) const {
    char* end = nullptr;
    const double value = std::strtod(word.c_str(), &end);
    if (end == word.c_str() || *end != '\0' || !std::isfinite(value))
      refuse(fmt::format("'{}' is not a finite number", word));
    return value;
  }
  std::size_t count(const std::string& word) const {
    const double value = number(word);
    if (value < 0 || value > 1e6 || value != std::floor(value)) refuse(fmt::format("'{}' is not a count", word));
    return static_cast<std::size_t>(value);
  }

 private:
  std::istringstream stream_;
  std::string file_;
  int number_ = 0;
};

// A file under a name of its own until it is complete.
class Part {
 public:
  explicit Part(const std::string& file) : file_(file), name_(file + ".XXXXXX"), descriptor_(::mkstemp(name_.data())) {
    if (descriptor_ < 0) fail();
  }
  ~Part() {
    if (descriptor_ < 0) return;
    ::close(descriptor_);
    ::unlink(name_.c_str());
  }
  Part(const Part&) = delete;
  Part& operator=(const Part&) = delete;

  void write(const std::string& text) {
    for (std::size_t done = 0; done < text.size();) {
      const ssize_t more = ::write(descriptor_, text.data() + done, text.size() - done);
      if (more < 0 && errno == EINTR) continue;
      if (more <= 0) fail();
      done += static_cast<std::size_t>(more);
    }
    if (::fchmod(descriptor_, 0644) != 0 || ::fsync(descriptor_) != 0) fail();
  }
  void commit() {
    if (std::rename(name_.c_str(), file_.c_str()) != 0) fail();
    ::close(descriptor_);
    descriptor_ = -1;
  }

 private:
  [[noreturn]] void fail() const {
    throw InputError(
        fmt::format("{}: the references cannot be written ({}); what was there is kept", file_, std::strerror(errno)));
  }
  std::string file_, name_;
  int descriptor_;
};

// Of a folder, among those who ask for it. Where the system has none there, they go on without.
class Lock {
 public:
  explicit Lock(const std::string& folder) : descriptor_(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)) {
    if (descriptor_ >= 0) ::flock(descriptor_, LOCK_EX);
  }
  ~Lock() {
    if (descriptor_ >= 0) ::close(descriptor_);
  }
  Lock(const Lock&) = delete;
  Lock& operator=(const Lock&) = delete;

 private:
  int descriptor_;
};

}  // namespace

void check_reference(const Reference& given, const std::string& type, int version,
                     const std::vector<std::string>& names) {
  if (given.type != type)
    throw InputError(
        fmt::format("the reference is one of type {}, this stage is of type {}; learn it anew", given.type, type));
  if (given.version != version)
    throw InputError(fmt::format("the reference is of version {}, this program reads version {}; learn it anew",
                                 given.version, version));
  if (given.names != names)
    throw InputError(fmt::format("the reference holds {}, this stage needs {}; learn it anew",
                                 fmt::join(given.names, ", "), fmt::join(names, ", ")));
}

std::string to_text(const References& references) {
  std::string text = fmt::format("{} {}\nrig {}\n", kTitle, kForm, references.rig);
  for (const auto& [stage, reference] : references.stages) {
    text += fmt::format("stage {} {} {} {}\n", stage, reference.type, reference.version, reference.names.size());
    for (std::size_t i = 0; i < reference.names.size(); ++i)
      text += fmt::format("{} {:.17g}\n", reference.names[i], reference.numbers.at(i));
  }
  return text + check_sum(text);
}

References parse_references(const std::string& text, const std::string& rig, const std::string& file) {
  if (text.rfind(kTitle, 0) != 0)
    throw InputError(fmt::format("{}: this is no file of references, as diagnose --keep-reference writes it", file));
  const std::string title = fmt::format("{} {}\n", kTitle, kForm);
  if (text.rfind(title, 0) != 0)
    throw InputError(fmt::format(
        "{}:1: these references are of another form, this program reads form {}; learn them anew", file, kForm));
  const std::size_t last = text.rfind(kCheckSum);
  if (last == std::string::npos || text.substr(last) != check_sum(text.substr(0, last)))
    throw InputError(
        fmt::format("{}: the file is damaged or cut off (its check sum is wrong); learn the references anew", file));

  Lines lines(text.substr(0, last), file);
  lines.words(3);
  References references;
  references.file = file;
  references.rig = lines.words(2)[1];
  if (references.rig != rig)
    lines.refuse(fmt::format("these are references of the rig {}, not of {}", references.rig, rig));
  while (lines.more()) {
    const std::vector<std::string> head = lines.words(5);
    StageReference entry;
    entry.stage = head[1];
    entry.reference.type = head[2];
    entry.reference.version = static_cast<int>(lines.count(head[3]));
    for (std::size_t left = lines.count(head[4]); left > 0; --left) {
      const std::vector<std::string> pair = lines.words(2);
      entry.reference.names.push_back(pair[0]);
      entry.reference.numbers.push_back(lines.number(pair[1]));
    }
    references.stages.push_back(std::move(entry));
  }
  return references;
}

References read_references(const std::string& file, const std::string& rig) {
  std::error_code error;
  if (fs::is_directory(file, error)) throw InputError(fmt::format("{}: this is a folder, not a file", file));
  std::ifstream stream(file, std::ios::binary);
  if (!stream) throw InputError(fmt::format("{}: the references cannot be read ({})", file, std::strerror(errno)));
  // The rest only of what begins like one: the name may be that of an endless device.
  std::string text;
  char block[1 << 12];
  do {
    stream.read(block, sizeof block);
    text.append(block, static_cast<std::size_t>(stream.gcount()));
  } while (stream && text.rfind(kTitle, 0) == 0 && text.size() < kLargestFile);
  return parse_references(text, rig, file);
}

void check_replaceable(const std::string& file, const std::string& rig) {
  std::error_code error;
  if (!fs::exists(fs::symlink_status(file, error))) return;
  try {
    read_references(file, rig);
  } catch (const InputError& refused) {
    throw InputError(fmt::format("{}; it is kept, choose another name or remove it", refused.what()));
  }
}

void update_references(const References& references, const std::string& file) {
  References all = references;
  const Lock lock(fs::absolute(file).parent_path().string());
  std::error_code error;
  if (fs::exists(file, error))
    for (StageReference& old : read_references(file, references.rig).stages)
      if (std::none_of(references.stages.begin(), references.stages.end(),
                       [&](const StageReference& s) { return s.stage == old.stage; }))
        all.stages.push_back(std::move(old));
  write_references(all, file);
}

void write_references(const References& references, const std::string& file) {
  check_replaceable(file, references.rig);
  std::error_code error;
  const fs::path target = fs::canonical(file, error);  // a link stays a link
  Part part(error ? file : target.string());
  part.write(to_text(references));
  part.commit();
}

}  // namespace faultline
