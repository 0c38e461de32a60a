#include "cli/bag_reader.h"

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <memory>
#include <system_error>
#include <vector>

#include <fmt/format.h>
#include <rosbag/chunked_file.h>
#include <rosbag/exceptions.h>

#include "faultline/signal/error.h"

namespace faultline {
namespace {

constexpr char kVersion[] = "#ROSBAG V2.0\n";
enum Op : std::uint8_t { kMessage = 2, kBagHeader = 3, kIndex = 4, kChunk = 5, kChunkInfo = 6, kConnection = 7 };

struct CutOff {};

// A stretch of memory that is read from its front.
struct Bytes {
  std::uint8_t* at = nullptr;
  std::uint8_t* end = nullptr;

  std::size_t left() const { return static_cast<std::size_t>(end - at); }
  Bytes take(std::size_t size) {
    if (size > left()) throw CutOff();
    Bytes part{at, at + size};
    at += size;
    return part;
  }
  std::uint32_t number() {
    std::uint32_t value = 0;
    std::memcpy(&value, take(4).at, 4);
    return value;
  }
};

// Fields of a record's header that matter here, `name=value` each.
struct Fields {
  std::uint8_t op = 0;
  std::uint32_t connection = 0, connections = 0, chunks = 0, size = 0, seconds = 0, nanoseconds = 0;
  std::uint64_t index_position = 0;
  std::string compression, encryptor, topic;
};

bool named(const Bytes& field, const char* name, std::size_t length) {
  return field.left() > length && std::memcmp(field.at, name, length) == 0 && field.at[length] == '=';
}

template <class T>
void copy_value(const Bytes& field, std::size_t name_length, T& value) {
  if (field.left() != name_length + 1 + sizeof value) throw CutOff();
  std::memcpy(&value, field.at + name_length + 1, sizeof value);
}

std::string text_value(const Bytes& field, std::size_t name_length) {
  return std::string(reinterpret_cast<const char*>(field.at) + name_length + 1, field.left() - name_length - 1);
}

Fields read_fields(Bytes header) {
  Fields fields;
  while (header.left() > 0) {
    const Bytes field = header.take(header.number());
    if (named(field, "op", 2)) copy_value(field, 2, fields.op);
    if (named(field, "conn", 4)) copy_value(field, 4, fields.connection);
    if (named(field, "conn_count", 10)) copy_value(field, 10, fields.connections);
    if (named(field, "chunk_count", 11)) copy_value(field, 11, fields.chunks);
    if (named(field, "topic", 5)) fields.topic = text_value(field, 5);
    if (named(field, "size", 4)) copy_value(field, 4, fields.size);
    if (named(field, "time", 4) && field.left() == 13) {
      std::memcpy(&fields.seconds, field.at + 5, 4);
      std::memcpy(&fields.nanoseconds, field.at + 9, 4);
    }
    if (named(field, "index_pos", 9)) copy_value(field, 9, fields.index_position);
    if (named(field, "compression", 11)) fields.compression = text_value(field, 11);
    if (named(field, "encryptor", 9)) fields.encryptor = text_value(field, 9);
  }
  return fields;
}

class Reader {
 public:
  Reader(const std::string& file, const std::function<void(const BagMessage&)>& take) : file_(file), take_(take) {}

  void run() {
    std::error_code error;
    const std::filesystem::file_status status = std::filesystem::status(file_, error);
    if (std::filesystem::is_directory(status)) throw InputError(fmt::format("{}: this is a folder, not a bag", file_));
    if (std::filesystem::exists(status) && !std::filesystem::is_regular_file(status))
      throw InputError(fmt::format("{}: this is a device or a pipe; a bag is read from a file", file_));
    stream_.reset(std::fopen(file_.c_str(), "rb"));
    if (!stream_) throw InputError(fmt::format("{}: the bag cannot be read ({})", file_, std::strerror(errno)));
    size_ = std::filesystem::file_size(file_, error);
    if (error) throw InputError(fmt::format("{}: the bag cannot be read ({})", file_, error.message()));
    if (size_ == 0) throw InputError(fmt::format("{}: the file is empty", file_));
    char version[sizeof kVersion - 1];
    if (std::fread(version, 1, sizeof version, stream_.get()) != sizeof version ||
        std::memcmp(version, kVersion, sizeof version) != 0)
      throw InputError(fmt::format("{}: this is not a ROS bag of format 2.0; `rosbag check` tells more", file_));
    at_ = sizeof version;
    try {
      read_records();
    } catch (const CutOff&) {
      throw InputError(fmt::format(
          "{}: the bag is cut off or damaged near byte {}; run `rosbag reindex {}` and try again", file_, at_, file_));
    } catch (const rosbag::BagException& damaged) {
      throw InputError(fmt::format("{}: the bag is damaged near byte {} ({}); run `rosbag reindex {}` and try again",
                                   file_, at_, damaged.what(), file_));
    }
  }

 private:
  // One record: header and data, in memory until the next call.
  bool next(Fields& fields, Bytes& data) {
    if (at_ == size_) return false;
    fields = read_fields(block(header_));
    data = block(data_);
    return true;
  }

  Bytes block(std::vector<std::uint8_t>& memory) {
    std::uint32_t length = 0;
    get(&length, sizeof length);
    if (length > size_ - at_ || length > kLargestRecord) throw CutOff();
    memory.resize(length);
    if (length > 0) get(memory.data(), length);
    return {memory.data(), memory.data() + length};
  }

  void get(void* target, std::size_t size) {
    if (std::fread(target, 1, size, stream_.get()) != size) throw CutOff();
    at_ += size;
  }

  void read_records() {
    Fields fields;
    Bytes data;
    if (!next(fields, data) || fields.op != kBagHeader) throw CutOff();
    if (!fields.encryptor.empty())
      throw InputError(fmt::format("{}: the bag is encrypted; decrypt it with `rosbag decrypt`", file_));
    // The index stands behind the last chunk; its place is written when a recording is closed.
    if (fields.index_position == 0 || fields.index_position > size_) throw CutOff();
    if (fields.index_position == size_ && fields.connections > 0) throw CutOff();
    const std::uint32_t chunks = fields.chunks;
    std::uint32_t listed = 0;
    while (next(fields, data)) {
      if (fields.op == kChunk) read_chunk(fields, data);
      if (fields.op == kConnection) connect(fields, data);
      if (fields.op == kChunkInfo) ++listed;
    }
    if (listed != chunks) throw CutOff();  // the end of the index is missing
  }

  void read_chunk(const Fields& chunk, Bytes data) {
    if (chunk.compression == "none") {
      read_messages(data);
      return;
    }
    const bool bz2 = chunk.compression == "bz2";
    if (!bz2 && chunk.compression != "lz4")
      throw InputError(
          fmt::format("{}: the compression '{}' is not known; none, bz2 and lz4 are", file_, chunk.compression));
    if (chunk.size > kLargestRecord || data.left() == 0) throw CutOff();
    // The size is what the record says. calloc's memory costs nothing before it is written to, and what the
    // decompressor leaves of it is zeros, which are no record.
    chunk_.reset(static_cast<std::uint8_t*>(std::calloc(chunk.size, 1)));
    if (!chunk_) throw CutOff();
    decompressor_.decompress(bz2 ? rosbag::compression::BZ2 : rosbag::compression::LZ4, chunk_.get(), chunk.size,
                             data.at, static_cast<unsigned int>(data.left()));
    read_messages({chunk_.get(), chunk_.get() + chunk.size});
  }

  void read_messages(Bytes records) {
    BagMessage message;
    while (records.left() > 0) {
      const Fields fields = read_fields(records.take(records.number()));
      const Bytes data = records.take(records.number());
      if (fields.op == 0) throw CutOff();
      if (fields.op == kConnection) connect(fields, data);
      if (fields.op != kMessage) continue;
      const auto found = connections_.find(fields.connection);
      if (found == connections_.end()) throw CutOff();
      message.connection = &found->second;
      if (fields.nanoseconds >= 1000000000) throw CutOff();
      message.received = ros::Time(fields.seconds, fields.nanoseconds);
      message.data = data.at;
      message.size = static_cast<std::uint32_t>(data.left());
      take_(message);
    }
  }

  void connect(const Fields& fields, Bytes data) {
    BagConnection connection;
    connection.topic = fields.topic;
    while (data.left() > 0) {
      const Bytes field = data.take(data.number());
      if (named(field, "type", 4)) connection.type = text_value(field, 4);
      if (named(field, "md5sum", 6)) connection.checksum = text_value(field, 6);
    }
    connections_.emplace(fields.connection, connection);
  }

  // Bytes of a record, and of a chunk when it is decompressed. rosbag fills a chunk to 0.8 MB and one message more.
  static constexpr std::uint32_t kLargestRecord = 1u << 28;

  const std::string& file_;
  const std::function<void(const BagMessage&)>& take_;
  std::unique_ptr<std::FILE, int (*)(std::FILE*)> stream_{nullptr, std::fclose};
  std::uint64_t size_ = 0, at_ = 0;
  std::vector<std::uint8_t> header_, data_;
  std::unique_ptr<std::uint8_t, void (*)(void*)> chunk_{nullptr, std::free};
  std::map<std::uint32_t, BagConnection> connections_;
  rosbag::ChunkedFile decompressor_;
};

}  // namespace

void read_bag_messages(const std::string& file, const std::function<void(const BagMessage&)>& take) {
  Reader(file, take).run();
}

}  // namespace faultline
