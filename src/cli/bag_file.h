// Recordings as ROS bags (docs/bag_format.md): /RIG/description once, /RIG/sample for every sample.
//
// Bags that the program writes begin at a fixed instant, 2000-01-01T00:00:00Z plus the first sample's time, so that the
// same samples make the same bytes. Message stamps and receive times are the samples' own.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <ros/time.h>

#include "faultline/rig/datasheet.h"
#include "faultline/signal/sample.h"
#include "nodes/description.h"

namespace faultline {

constexpr double kBagEpoch = 946684800;  // s, 2000-01-01T00:00:00Z; time 0 of a simulation or of an imported file

// What becomes of a time counted from kBagEpoch on its way through a bag: what a live node would see, bit for bit.
double time_in_bag(double time);
std::int64_t stamp_in_bag(double time);  // ns since 1970

enum class BagCompression { none, lz4, bz2 };
BagCompression bag_compression(const std::string& name);  // InputError that lists them

class BagWriter {
 public:
  // Writes to `file`, which need not be the final name; messages name `shown`.
  BagWriter(const std::string& file, const std::string& shown, const Datasheet& sheet, const std::string& made_by,
            double first_time, BagCompression compression);
  ~BagWriter();
  void write(const Sample& sample);  // its time counts from kBagEpoch
  void close();

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

// One sample of a bag, as it stands there: time absolute, values in the order of the description.
struct BagSample {
  ros::Time received;
  std::int64_t stamp = 0;  // ns since 1970, exact
  Sample sample;           // its time in s since 1970, as a double: what the diagnosis sees
};

// Takes what a bag holds of one rig, in the order in which it was written.
class BagTaker {
 public:
  virtual ~BagTaker() = default;
  virtual void describe(const Description& description) = 0;
  virtual void take(const BagSample& sample) = 0;
};

// `rig`: whose samples to take; empty: those of the one rig that the bag holds. Returns its name. InputError if there
// are no samples, or of several rigs: in the end, when all were taken.
std::string read_bag(const std::string& file, const std::string& rig, BagTaker& taker);

// What a bag holds of one rig, as it stands there: times absolute, values in the order of the description.
struct BagContent {
  std::string rig;
  bool described = false;
  Description description;
  std::size_t width = 0;            // values per sample
  std::vector<double> time;         // s since 1970, as a double: what the diagnosis sees
  std::vector<std::int64_t> stamp;  // ns since 1970, exact
  std::vector<std::uint64_t> sequence;
  std::vector<double> values;
};

// All of it in memory, by receive time.
BagContent read_bag(const std::string& file, const std::string& rig);

}  // namespace faultline
