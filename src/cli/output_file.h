// A file that is there whole or not at all: it is written beside its place under a name of its own (NAME.RANDOM.part),
// which no other run and no other file has, and renamed by commit(); without commit(), and when the program is
// interrupted, the part is removed. A link stays a link. What exists and is no regular file (a device, a pipe) is
// written directly. Errors are InputErrors that name the file.
#pragma once

#include <cstdio>
#include <memory>
#include <string>

#include "cli/interrupt.h"

namespace faultline {

class OutputFile {
 public:
  explicit OutputFile(const std::string& file);
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  const std::string& name() const { return file_; }     // as it was asked for
  const std::string& written() const { return part_; }  // where the bytes go until commit()
  void commit();

 private:
  std::string file_, target_, part_;
  std::unique_ptr<Unfinished> unfinished_;
  bool direct_ = false;
  bool done_ = false;
};

// Text into an OutputFile, or to stdout for "-".
class TextOutput {
 public:
  explicit TextOutput(const std::string& file);
  ~TextOutput();
  void write(const std::string& text);
  void commit();

 private:
  [[noreturn]] void fail(const char* what) const;
  std::unique_ptr<OutputFile> output_;
  std::FILE* stream_ = nullptr;
};

void write_text(const std::string& file, const std::string& text);

// The whole of a file; InputError if it cannot be read.
std::string read_text(const std::string& file);

// The absolute path of a file that need not exist, through all links.
std::string resolved(const std::string& file);

bool ends_with(const std::string& text, const std::string& end);

}  // namespace faultline
