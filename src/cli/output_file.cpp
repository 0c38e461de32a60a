#include "cli/output_file.h"

#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <memory>
#include <system_error>

#include <fmt/format.h>

#include "faultline/signal/error.h"

namespace faultline {

namespace fs = std::filesystem;

OutputFile::OutputFile(const std::string& file) : file_(file), target_(file) {
  std::error_code error;
  const fs::file_status status = fs::status(file, error);
  if (fs::is_directory(status)) throw InputError(fmt::format("{}: this is a folder; name a file in it", file));
  direct_ = fs::exists(status) && !fs::is_regular_file(status);
  if (fs::exists(status)) {
    const fs::path resolved = fs::canonical(file, error);  // a link stays a link
    if (!error) target_ = resolved.string();
  }
  part_ = direct_ ? target_ : target_ + ".part";
  std::FILE* probe = std::fopen(part_.c_str(), direct_ ? "r+b" : "wb");
  if (!probe)
    throw InputError(fmt::format("{}: the file cannot be written ({}); choose another place with -o or mend its rights",
                                 file, std::strerror(errno)));
  std::fclose(probe);
}

OutputFile::~OutputFile() {
  if (!done_ && !direct_) ::unlink(part_.c_str());
}

void OutputFile::commit() {
  if (!direct_ && std::rename(part_.c_str(), target_.c_str()) != 0)
    throw InputError(fmt::format("{}: the finished file cannot take its name ({})", file_, std::strerror(errno)));
  done_ = true;
}

TextOutput::TextOutput(const std::string& file) {
  if (file == "-") {
    stream_ = stdout;
    return;
  }
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
  if (fs::is_directory(file, error)) throw InputError(fmt::format("{}: this is a folder, not a file", file));
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
