// Of the library faultline_bag_writer: bags as bag_file.h writes them, with rosbag.
#include <fmt/format.h>
#include <rosbag/bag.h>

#include "cli/bag_file.h"
#include "faultline/signal/error.h"
#include "nodes/conversion.h"

namespace faultline {
namespace {

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

class RosbagSink : public BagSink {
 public:
  RosbagSink(const std::string& file, const std::string& shown, const Datasheet& sheet, const std::string& made_by,
             const ros::Time& first, BagCompression compression)
      : shown_(shown), rig_(sheet.rig), topic_("/" + sheet.rig + "/sample"), bag_(std::make_unique<rosbag::Bag>()) {
    try {
      bag_->open(file, rosbag::bagmode::Write);
      bag_->setCompression(of(compression));
      faultline_msgs::RigDescription description = to_message(sheet, made_by);
      description.header.stamp = first;
      bag_->write("/" + sheet.rig + "/description", first, description);
    } catch (const rosbag::BagException& error) {
      fail(error.what());
    }
  }

  ~RosbagSink() override {
    if (!bag_) return;
    try {
      bag_->close();
    } catch (const rosbag::BagException&) {
      static_cast<void>(bag_.release());
    }
  }

  void write(const Sample& sample, const ros::Time& stamp) override {
    message_.header.stamp = stamp;
    message_.header.frame_id = rig_;
    message_.header.seq = static_cast<std::uint32_t>(sample.sequence);
    message_.sequence = sample.sequence;
    message_.values = sample.values;
    try {
      bag_->write(topic_, stamp, message_);
    } catch (const rosbag::BagException& error) {
      fail(error.what());
    }
  }

  void close() override {
    try {
      bag_->close();
    } catch (const rosbag::BagException& error) {
      fail(error.what());
    }
    bag_.reset();
  }

 private:
  // A bag that failed once must not be closed again: its destructor would throw. What it holds is lost with the
  // program.
  [[noreturn]] void fail(const std::string& why) {
    static_cast<void>(bag_.release());
    throw InputError(
        fmt::format("{}: writing failed ({}); nothing is kept; make room or choose another place", shown_, why));
  }

  std::string shown_, rig_, topic_;
  std::unique_ptr<rosbag::Bag> bag_;
  faultline_msgs::Sample message_;
};

}  // namespace
}  // namespace faultline

extern "C" faultline::BagSink* faultline_make_bag_sink(const std::string& file, const std::string& shown,
                                                       const faultline::Datasheet& sheet, const std::string& made_by,
                                                       const ros::Time& first, faultline::BagCompression compression) {
  return new faultline::RosbagSink(file, shown, sheet, made_by, first, compression);
}
