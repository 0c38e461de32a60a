#include "cli/bag_file.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <exception>
#include <set>

#include <fmt/format.h>
#include <rosbag/bag.h>

#include "cli/bag_reader.h"
#include "faultline/signal/error.h"
#include "nodes/conversion.h"

namespace faultline {
namespace {

constexpr char kSampleType[] = "faultline/Sample";
constexpr char kDescriptionType[] = "faultline/RigDescription";

rosbag::CompressionType of(BagCompression compression) {
  switch (compression) {
    case BagCompression::none:
      return rosbag::compression::Uncompressed;
    case BagCompression::lz4:
      return rosbag::compression::LZ4;
    case BagCompression::bz2:
      break;
  }
  return rosbag::compression::BZ2;
}

// Straight from the time since kBagEpoch, so that no digit is lost to the epoch.
ros::Time stamp_of(double time) {
  try {
    return ros::Time(static_cast<std::uint32_t>(kBagEpoch), 0) +
           ros::Duration().fromNSec(static_cast<std::int64_t>(std::llround(time * 1e9)));
  } catch (const std::exception&) {
    throw InputError(fmt::format("time {} s does not fit a bag, which holds 1970 to 2106", time));
  }
}

// The rig of a topic /RIG/name.
std::string rig_of(const std::string& topic) {
  const auto end = topic.rfind('/');
  if (end == std::string::npos || end == 0) return topic;
  const auto begin = topic.rfind('/', end - 1);
  return topic.substr(begin == std::string::npos ? 0 : begin + 1, end - (begin == std::string::npos ? 0 : begin + 1));
}

std::string joined_names(const std::set<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text;
}

template <class Message>
void check_checksum(const std::string& file, const BagConnection& connection) {
  if (connection.checksum != ros::message_traits::MD5Sum<Message>::value())
    throw InputError(
        fmt::format("{}: topic {} was recorded with another version of {}; record it again or use `rosbag fix`", file,
                    connection.topic, connection.type));
}

// The bytes of a message, to be walked over before they are read: what ROS generates makes room for as many items as an
// array says it has, before it looks whether they are there.
class Walk {
 public:
  Walk(const std::string& file, const BagMessage& message) : file_(file), message_(message) {}

  void skip(std::uint64_t bytes) {
    if (bytes > message_.size - at_)
      throw InputError(fmt::format("{}: a message on {} says that it is longer than its {} bytes; the bag is damaged",
                                   file_, message_.connection->topic, message_.size));
    at_ += static_cast<std::uint32_t>(bytes);
  }
  // A string or an array: its length, and as many items of `item` bytes.
  std::uint32_t skip_items(std::uint32_t item) {
    std::uint32_t length = 0;
    skip(sizeof length);
    std::memcpy(&length, message_.data + at_ - sizeof length, sizeof length);
    skip(static_cast<std::uint64_t>(length) * item);
    return length;
  }
  void skip_header() {
    skip(12);  // seq, stamp
    skip_items(1);
  }

 private:
  const std::string& file_;
  const BagMessage& message_;
  std::uint32_t at_ = 0;
};

void check_lengths(Walk walk, const faultline_msgs::Sample&) {
  walk.skip_header();
  walk.skip(8);        // sequence
  walk.skip_items(8);  // values
}

void check_lengths(Walk walk, const faultline_msgs::RigDescription&) {
  walk.skip_header();
  walk.skip_items(1);  // rig
  walk.skip(8);        // sample_period
  const std::uint32_t channels = walk.skip_items(0);
  for (std::uint32_t i = 0; i < channels; ++i)
    for (int text = 0; text < 3; ++text) walk.skip_items(1);  // name, unit, role
  walk.skip_items(1);                                         // made_by
}

template <class Message>
void deserialise(const std::string& file, const BagMessage& from, Message& to) {
  check_lengths(Walk(file, from), to);
  try {
    ros::serialization::IStream stream(from.data, from.size);
    ros::serialization::deserialize(stream, to);
  } catch (const ros::Exception& error) {
    throw InputError(
        fmt::format("{}: a message on {} cannot be read ({})", file, from.connection->topic, error.what()));
  }
}

}  // namespace

double time_in_bag(double time) { return to_seconds(stamp_of(time)); }

std::int64_t stamp_in_bag(double time) { return static_cast<std::int64_t>(stamp_of(time).toNSec()); }

BagCompression bag_compression(const std::string& name) {
  if (name == "none") return BagCompression::none;
  if (name == "lz4") return BagCompression::lz4;
  if (name == "bz2") return BagCompression::bz2;
  throw InputError(fmt::format("the compression '{}' is not known; there are none, lz4 and bz2", name));
}

struct BagWriter::Parts {
  std::string shown, rig, sample_topic;
  std::unique_ptr<rosbag::Bag> bag;
  faultline_msgs::Sample message;

  // A bag that failed once must not be closed again: its destructor would throw. What it holds is lost with the
  // program.
  [[noreturn]] void fail(const std::string& why) {
    static_cast<void>(bag.release());
    throw InputError(
        fmt::format("{}: writing failed ({}); nothing is kept; make room or choose another place", shown, why));
  }
};

BagWriter::BagWriter(const std::string& file, const std::string& shown, const Datasheet& sheet,
                     const std::string& made_by, double first_time, BagCompression compression)
    : parts_(std::make_unique<Parts>()) {
  parts_->shown = shown;
  parts_->rig = sheet.rig;
  parts_->sample_topic = "/" + sheet.rig + "/sample";
  parts_->bag = std::make_unique<rosbag::Bag>();
  try {
    parts_->bag->open(file, rosbag::bagmode::Write);
    parts_->bag->setCompression(of(compression));
    faultline_msgs::RigDescription description = to_message(sheet, made_by);
    description.header.stamp = stamp_of(first_time);
    parts_->bag->write("/" + sheet.rig + "/description", description.header.stamp, description);
  } catch (const rosbag::BagException& error) {
    parts_->fail(error.what());
  }
}

BagWriter::~BagWriter() {
  if (!parts_->bag) return;
  try {
    parts_->bag->close();
  } catch (const rosbag::BagException&) {
    static_cast<void>(parts_->bag.release());
  }
}

void BagWriter::write(const Sample& sample) {
  faultline_msgs::Sample& message = parts_->message;
  const ros::Time stamp = stamp_of(sample.time);
  message.header.stamp = stamp;
  message.header.frame_id = parts_->rig;
  message.header.seq = static_cast<std::uint32_t>(sample.sequence);
  message.sequence = sample.sequence;
  message.values = sample.values;
  try {
    parts_->bag->write(parts_->sample_topic, stamp, message);
  } catch (const rosbag::BagException& error) {
    parts_->fail(error.what());
  }
}

void BagWriter::close() {
  try {
    parts_->bag->close();
  } catch (const rosbag::BagException& error) {
    parts_->fail(error.what());
  }
  parts_->bag.reset();
}

std::string read_bag(const std::string& file, const std::string& rig, BagTaker& taker) {
  std::string chosen = rig;
  std::set<std::string> topics, rigs;
  const BagConnection* checked_sample = nullptr;
  faultline_msgs::Sample message_sample;
  BagSample taken;
  std::uint64_t samples = 0;
  bool any = false;

  read_bag_messages(file, [&](const BagMessage& message) {
    any = true;
    const BagConnection& connection = *message.connection;
    const bool is_sample = connection.type == kSampleType;
    if (!is_sample && connection.type != kDescriptionType) {
      if (topics.size() < 20) topics.insert(connection.topic + " (" + connection.type + ")");
      return;
    }
    if (!is_sample || &connection != checked_sample) {
      const std::string name = rig_of(connection.topic);
      if (is_sample) rigs.insert(name);
      if (chosen.empty()) chosen = name;
      if (name != chosen) return;
    }
    if (!is_sample) {
      check_checksum<faultline_msgs::RigDescription>(file, connection);
      faultline_msgs::RigDescription description;
      deserialise(file, message, description);
      taker.describe(from_message(description));
      return;
    }
    if (&connection != checked_sample) check_checksum<faultline_msgs::Sample>(file, connection);
    checked_sample = &connection;
    deserialise(file, message, message_sample);
    if (samples > 0 && message_sample.values.size() != taken.sample.values.size())
      throw InputError(fmt::format("{}: sample {} on {} has {} values, those before it have {}", file, samples,
                                   connection.topic, message_sample.values.size(), taken.sample.values.size()));
    ++samples;
    taken.received = message.received;
    taken.stamp = static_cast<std::int64_t>(message_sample.header.stamp.toNSec());
    taken.sample.time = to_seconds(message_sample.header.stamp);
    taken.sample.sequence = message_sample.sequence;
    taken.sample.values.assign(message_sample.values.begin(), message_sample.values.end());
    taker.take(taken);
  });

  if (!any) throw InputError(fmt::format("{}: the bag holds no messages", file));
  if (rigs.empty()) {
    throw InputError(fmt::format("{}: the bag holds no topic of type {}{}", file, kSampleType,
                                 topics.empty() ? std::string() : "; it holds " + joined_names(topics)));
  }
  if (samples == 0 || (rig.empty() && rigs.size() > 1))
    throw InputError(
        fmt::format("{}: the bag holds samples of {}; choose one of them with --rig", file, joined_names(rigs)));
  return chosen;
}

BagContent read_bag(const std::string& file, const std::string& rig) {
  struct Keeper : BagTaker {
    BagContent content;
    std::vector<ros::Time> received;
    bool sorted = true;
    void describe(const Description& description) override {
      // The run that the first sample is of is the first one described.
      const double start = content.described ? content.description.start : description.start;
      content.description = description;
      content.description.start = start;
      content.described = true;
    }
    void take(const BagSample& taken) override {
      content.width = taken.sample.values.size();
      sorted = sorted && (received.empty() || taken.received >= received.back());
      received.push_back(taken.received);
      content.time.push_back(taken.sample.time);
      content.stamp.push_back(taken.stamp);
      content.sequence.push_back(taken.sample.sequence);
      content.values.insert(content.values.end(), taken.sample.values.begin(), taken.sample.values.end());
    }
  } keeper;
  BagContent& content = keeper.content;
  content.rig = read_bag(file, rig, keeper);
  if (!keeper.sorted) {
    // As replay does it: by receive time.
    const std::vector<ros::Time>& received = keeper.received;
    std::vector<std::size_t> order(received.size());
    for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
    std::stable_sort(order.begin(), order.end(),
                     [&](std::size_t a, std::size_t b) { return received[a] < received[b]; });
    BagContent arranged = content;
    for (std::size_t i = 0; i < order.size(); ++i) {
      arranged.time[i] = content.time[order[i]];
      arranged.stamp[i] = content.stamp[order[i]];
      arranged.sequence[i] = content.sequence[order[i]];
      std::copy_n(content.values.begin() + static_cast<std::ptrdiff_t>(order[i] * content.width), content.width,
                  arranged.values.begin() + static_cast<std::ptrdiff_t>(i * content.width));
    }
    content = std::move(arranged);
  }
  return std::move(content);
}

}  // namespace faultline
