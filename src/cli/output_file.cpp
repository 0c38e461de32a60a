#include "cli/output_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <memory>
#include <random>
#include <system_error>

#include <fmt/format.h>

#include "faultline/signal/error.h"

namespace faultline {

namespace fs = std::filesystem;

namespace {

constexpr std::size_t kLongestName =
    200;                    // bytes of a file's name that its part's name repeats; 255 is the most there may be
constexpr int kLinks = 40;  // followed, as the kernel does

// Creates NAME.RANDOM.part beside `target`; empty, with errno, where that cannot be.
std::string create_part(const fs::path& target, std::unique_ptr<Unfinished>& unfinished) {
  std::random_device random;
  for (int attempt = 0; attempt < 100; ++attempt) {
    const std::string name =
        fmt::format("{}.{:08x}.part", target.filename().string().substr(0, kLongestName), random());
    const std::string part = (target.parent_path() / name).string();
    unfinished = std::make_unique<Unfinished>(part);
    const int handle = ::open(part.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (handle >= 0) {
      ::close(handle);
      return part;
    }
    if (errno != EEXIST) break;
  }
  unfinished.reset();
  return "";
}

bool is_bag(const std::string& file) {
  const std::string magic = "#ROSBAG";
  std::string found(magic.size(), '\0');
  std::error_code error;
  if (!fs::is_regular_file(file, error)) return false;  // a pipe gives its bytes once
  return std::ifstream(file, std::ios::binary).read(found.data(), static_cast<std::streamsize>(found.size())) &&
         found == magic;
}

}  // namespace

std::string resolved(const std::string& file) {
  fs::path path(file);
  std::error_code error;
  for (int i = 0; i < kLinks && fs::is_symlink(path, error); ++i)
    path = path.parent_path() / fs::read_symlink(path, error);
  const fs::path whole = fs::weakly_canonical(fs::absolute(path, error), error);
  return error ? path.string() : whole.string();
}

OutputFile::OutputFile(const std::string& file) : file_(file), target_(resolved(file)) {
  const auto refuse = [&](const char* why) {
    throw InputError(
        fmt::format("{}: the file cannot be written ({}); choose another place or mend its rights", file, why));
  };
  std::error_code error;
  const fs::file_status status = fs::status(target_, error);
  if (fs::is_directory(status)) throw InputError(fmt::format("{}: this is a folder; name a file in it", file));
  if (fs::is_symlink(target_, error)) refuse("it is a link that leads nowhere");
  direct_ = fs::exists(status) && !fs::is_regular_file(status);
  // A file that nobody may write is not replaced either.
  if (fs::exists(status) && ::access(target_.c_str(), W_OK) != 0) refuse(std::strerror(errno));
  part_ = direct_ ? target_ : create_part(target_, unfinished_);
  if (part_.empty()) refuse(std::strerror(errno));
  if (fs::is_regular_file(status)) fs::permissions(part_, status.permissions(), error);
}

OutputFile::~OutputFile() {
  if (!done_ && !direct_) ::unlink(part_.c_str());
}

void OutputFile::commit() {
  if (!direct_ && std::rename(part_.c_str(), target_.c_str()) != 0)
    throw InputError(fmt::format("{}: the finished file cannot take its name ({})", file_, std::strerror(errno)));
  done_ = true;
  unfinished_.reset();
}

TextOutput::TextOutput(const std::string& file) {
  if (file == "-") {
    stream_ = stdout;
    return;
  }
  if (is_bag(file)) throw InputError(fmt::format("{}: this is a recording; name another file for text", file));
  output_ = std::make_unique<OutputFile>(file);
  stream_ = std::fopen(output_->written().c_str(), "wb");
  if (!stream_) throw InputError(fmt::format("{}: the file cannot be written ({})", file, std::strerror(errno)));
}

TextOutput::~TextOutput() {
  if (stream_ && stream_ != stdout) std::fclose(stream_);
}

void TextOutput::fail(const char* what) const {
  throw InputError(fmt::format("{}: {} ({}); nothing is kept; make room or choose another place",
                               output_ ? output_->name() : "standard output", what, std::strerror(errno)));
}

void TextOutput::write(const std::string& text) {
  if (std::fwrite(text.data(), 1, text.size(), stream_) != text.size()) fail("writing failed");
}

void TextOutput::commit() {
  if (std::fflush(stream_) != 0) fail("writing failed");
  if (stream_ == stdout) return;
  std::FILE* stream = stream_;
  stream_ = nullptr;
  if (std::fclose(stream) != 0) fail("closing failed");
  output_->commit();
}

void write_text(const std::string& file, const std::string& text) {
  TextOutput output(file);
  output.write(text);
  output.commit();
}

std::string read_text(const std::string& file) {
  std::error_code error;
  const fs::file_status status = fs::status(file, error);
  if (fs::is_directory(status)) throw InputError(fmt::format("{}: this is a folder, not a file", file));
  if (fs::is_character_file(status) || fs::is_block_file(status))
    throw InputError(fmt::format("{}: this is a device, not a file", file));
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> stream(std::fopen(file.c_str(), "rb"), std::fclose);
  if (!stream) throw InputError(fmt::format("{}: the file cannot be read ({})", file, std::strerror(errno)));
  std::string text;
  char block[1 << 16];
  for (std::size_t n; (n = std::fread(block, 1, sizeof block, stream.get())) > 0;) text.append(block, n);
  if (std::ferror(stream.get())) throw InputError(fmt::format("{}: reading failed ({})", file, std::strerror(errno)));
  return text;
}

bool ends_with(const std::string& text, const std::string& end) {
  return text.size() >= end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
}

}  // namespace faultline
