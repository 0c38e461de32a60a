#include "cli/load_recording.h"

#include <algorithm>
#include <cstdio>
#include <functional>
#include <memory>
#include <utility>

#include <fmt/format.h>

#include "cli/bag_file.h"
#include "cli/output_file.h"
#include "cli/share_folder.h"
#include "faultline/segments/own_samples.h"
#include "faultline/signal/csv.h"
#include "faultline/signal/error.h"
#include "faultline/signal/run_start.h"
#include "faultline/signal/text.h"
#include "nodes/rig_packages.h"

namespace faultline {
namespace {

// Where the values of a bag's samples stand in the datasheet's order; empty: where they are.
class Arrangement {
 public:
  Arrangement(const std::string& file, const Datasheet& sheet, const Description* description,
              std::vector<std::string>& remarks)
      : file_(file), sheet_(sheet) {
    if (description == nullptr) {
      remarks.push_back(fmt::format("{}: no /{}/description in the bag; channels are taken in the datasheet's order",
                                    file, sheet.rig));
      return;
    }
    described_ = description->names.size();
    try {
      places_ = match_channels(sheet, *description);
    } catch (const InputError& error) {
      throw InputError(fmt::format("{}: {}", file, error.what()));
    }
    bool same = places_.size() == described_;
    for (std::size_t i = 0; same && i < places_.size(); ++i) same = places_[i] == i;
    if (same) places_.clear();
  }

  void check(std::size_t width) const {
    if (described_ == 0 && width != sheet_.channels.size())
      throw InputError(
          fmt::format("{}: samples have {} values, {} has {} channels, and the bag holds no /{}/description that would "
                      "tell which is which",
                      file_, width, sheet_.rig, sheet_.channels.size(), sheet_.rig));
    if (described_ > 0 && width != described_)
      throw InputError(
          fmt::format("{}: samples have {} values, the description names {} channels", file_, width, described_));
  }

  bool changes() const { return !places_.empty(); }
  void arrange(const double* from, std::vector<double>& to) const {
    to.clear();
    for (const std::size_t place : places_) to.push_back(from[place]);
  }

 private:
  const std::string& file_;
  const Datasheet& sheet_;
  std::size_t described_ = 0;
  std::vector<std::size_t> places_;
};

void take_bag(const std::string& file, const std::string& rig, const std::string& config, LoadedRecording& loaded) {
  BagContent content = read_bag(file, rig);
  loaded.sheet = load_datasheet(content.described && rig.empty() ? content.description.rig : content.rig, config);
  loaded.run_start = content.description.start;
  loaded.recording.rig = loaded.sheet.rig;
  loaded.recording.channels = loaded.sheet.channels;
  loaded.made_by = content.description.made_by;
  const Arrangement arrangement(file, loaded.sheet, content.described ? &content.description : nullptr, loaded.remarks);
  arrangement.check(content.width);
  loaded.recording.time = std::move(content.time);
  loaded.stamp = std::move(content.stamp);
  loaded.recording.sequence = std::move(content.sequence);
  if (!arrangement.changes()) {
    loaded.recording.values = std::move(content.values);
    return;
  }
  loaded.recording.values.reserve(loaded.recording.time.size() * loaded.sheet.channels.size());
  std::vector<double> row;
  for (std::size_t at = 0; at < content.values.size(); at += content.width) {
    arrangement.arrange(content.values.data() + at, row);
    loaded.recording.values.insert(loaded.recording.values.end(), row.begin(), row.end());
  }
}

void take_csv(const std::string& file, const std::string& rig, const std::string& config, LoadedRecording& loaded) {
  if (rig.empty() && config.empty())
    throw InputError(fmt::format("{}: a CSV file does not say its rig; name it with --rig", file));
  loaded.sheet = load_datasheet(rig, config);
  CsvContent content = read_csv(read_text(file), file, loaded.sheet.rig, loaded.sheet.channels);
  loaded.recording = std::move(content.recording);
  loaded.stamp.reserve(loaded.recording.rows());
  for (double& time : loaded.recording.time) {
    loaded.stamp.push_back(stamp_in_bag(time));
    time = time_in_bag(time);
  }
  for (const std::string& name : content.filled)
    loaded.remarks.push_back(fmt::format("{}: no column '{}'; it is taken as 0", file, name));
}

constexpr double kLargestRatio = 20;  // of a run's sample period to the datasheet's: beyond, times are in another unit

// What a recording must stand before it is believed, sample by sample.
class RecordingCheck {
 public:
  RecordingCheck(const std::string& file, const Datasheet& sheet)
      : file_(file),
        sheet_(sheet),
        check_(sheet.sample_period),
        run_start_(sheet.sample_period),
        outside_(sheet.channels.size()) {}

  void begin_run(double start) { run_start_.describe(start); }

  void add(const Sample& sample) {
    run_start_.add(sample);
    if (samples_++ == 0) start_ = end_ = sample.time;
    end_ = std::max(end_, sample.time);
    check_.add(sample);
    for (std::size_t c = 0; c < outside_.size(); ++c)
      outside_[c] += sample.values[c] < sheet_.channels[c].minimum || sample.values[c] > sheet_.channels[c].maximum;
  }

  void finish(RecordingFacts& facts, Period period = Period::of_rig) const {
    facts.findings = check_.findings();
    facts.missed_at_start = run_start_.missed();
    facts.start = start_;
    facts.end = end_;
    const double ratio = facts.findings.period / sheet_.sample_period;
    const bool fits = period_fits(facts.findings, sheet_.sample_period);
    if (!fits) {
      if (period != Period::of_run || ratio >= kLargestRatio || ratio <= 1 / kLargestRatio)
        throw InputError(
            fmt::format("{}: samples come every {:.4g} s, {} says {:.4g} s; bring them to that ({}faultline import "
                        "--resample rig) or give the right datasheet with --config",
                        file_, facts.findings.period, sheet_.file, sheet_.sample_period,
                        ends_with(file_, ".bag") ? "faultline export, then " : ""));
      facts.remarks.push_back(fmt::format("{}: samples come every {:.4g} s, {} says {:.4g} s; the run keeps its own",
                                          file_, facts.findings.period, sheet_.file, sheet_.sample_period));
    }
    // What is uneven in a run of its own period is told with what of it is used (segments/segmented_run.h).
    if (fits)
      for (const std::string& line : describe(facts.findings, sheet_.sample_period, start_))
        facts.remarks.push_back(file_ + ": " + line);
    // Numbers in another unit than the datasheet's lie outside its ranges.
    for (std::size_t c = 0; c < outside_.size(); ++c) {
      const Channel& channel = sheet_.channels[c];
      if (2 * outside_[c] > samples_)
        facts.remarks.push_back(
            fmt::format("{}: {} of {} numbers of '{}' are outside {:g} to {:g} {}: is that its unit?", file_,
                        outside_[c], samples_, channel.name, channel.minimum, channel.maximum, channel.unit));
    }
  }

 private:
  const std::string& file_;
  const Datasheet& sheet_;
  SampleCheck check_;
  RunStart run_start_;
  std::vector<std::size_t> outside_;
  std::size_t samples_ = 0;
  double start_ = 0, end_ = 0;
};

void for_each_sample(const Recording& recording, const std::function<void(const Sample&)>& take) {
  Sample sample;
  sample.values.resize(recording.columns());
  for (std::size_t row = 0; row < recording.rows(); ++row) {
    sample.time = recording.time[row];
    sample.sequence = recording.sequence[row];
    std::copy_n(recording.row(row), recording.columns(), sample.values.begin());
    take(sample);
  }
}

struct OutOfOrder {};

// A bag's samples, checked and handed on. Those before the description wait for it.
class BagStream : public BagTaker {
 public:
  BagStream(const std::string& file, const std::string& rig, const std::string& config, RecordingFacts& facts,
            SampleTaker& taker)
      : file_(file), rig_(rig), config_(config), facts_(facts), taker_(taker) {}

  void describe(const Description& description) override {
    if (check_) {
      if (description.names != description_.names || description.units != description_.units) throw OutOfOrder();
      check_->begin_run(description.start);
      return;
    }
    description_ = description;
    begin(rig_.empty() ? description.rig : rig_, &description_);
  }

  void take(const BagSample& taken) override {
    if (any_ && taken.received < last_) throw OutOfOrder();
    last_ = taken.received;
    any_ = true;
    if (check_)
      hand_on(taken.sample);
    else
      waiting_.push_back(taken.sample);
  }

  void finish(const std::string& rig) {
    if (!check_) begin(rig, nullptr);
    check_->finish(facts_);
  }

 private:
  void begin(const std::string& rig, const Description* description) {
    facts_.sheet = load_datasheet(rig, config_);
    if (description != nullptr) facts_.made_by = description->made_by;
    arrangement_ = std::make_unique<Arrangement>(file_, facts_.sheet, description, facts_.remarks);
    check_ = std::make_unique<RecordingCheck>(file_, facts_.sheet);
    if (description != nullptr) check_->begin_run(description->start);
    for (const Sample& sample : waiting_) hand_on(sample);
    waiting_ = {};
  }

  void hand_on(const Sample& given) {
    if (!begun_) {
      arrangement_->check(given.values.size());
      taker_.begin(facts_.sheet, given.time);
      begun_ = true;
    }
    const Sample* sample = &given;
    if (arrangement_->changes()) {
      arranged_.time = given.time;
      arranged_.sequence = given.sequence;
      arrangement_->arrange(given.values.data(), arranged_.values);
      sample = &arranged_;
    }
    check_->add(*sample);
    taker_.take(*sample);
  }

  const std::string &file_, &rig_, &config_;
  RecordingFacts& facts_;
  SampleTaker& taker_;
  Description description_;
  std::unique_ptr<Arrangement> arrangement_;
  std::unique_ptr<RecordingCheck> check_;
  std::vector<Sample> waiting_;
  Sample arranged_;
  ros::Time last_;
  bool any_ = false, begun_ = false;
};

}  // namespace

Datasheet load_datasheet(const std::string& rig, const std::string& config) {
  if (config.empty()) {
    note_left_out(rig);
    return find_datasheet(share_folder() + "/config", outside_rigs(), rig);
  }
  Datasheet sheet = read_datasheet(config, outside_rigs());
  if (!rig.empty() && sheet.rig != rig)
    throw InputError(fmt::format("{}: the datasheet is of the rig '{}', the recording of '{}'; give the right one",
                                 config, sheet.rig, rig));
  return sheet;
}

void keep_own_samples(const std::string& file, LoadedRecording& loaded) {
  const OwnSamples own = own_samples(loaded.recording);
  if (own.every == 1) return;
  loaded.recording = at_own_samples(loaded.recording, own);
  std::vector<std::int64_t> stamps;
  for (std::size_t k = own.first; k < loaded.stamp.size(); k += own.every) stamps.push_back(loaded.stamp[k]);
  loaded.stamp = std::move(stamps);
  loaded.remarks.push_back(fmt::format(
      "{}: its readings lie on straight lines, as interpolation leaves them; the samples between which they "
      "run are taken, one in {} rows",
      file, own.every));
}

LoadedRecording load_recording(const std::string& file, const std::string& rig, const std::string& config,
                               Period period) {
  LoadedRecording loaded;
  if (ends_with(file, ".bag"))
    take_bag(file, rig, config, loaded);
  else if (ends_with(file, ".csv"))
    take_csv(file, rig, config, loaded);
  else
    throw InputError(fmt::format("{}: a recording is a .bag or a .csv file", file));

  RecordingCheck check(file, loaded.sheet);
  check.begin_run(loaded.run_start);
  for_each_sample(loaded.recording, [&](const Sample& sample) { check.add(sample); });
  check.finish(loaded, period);
  return loaded;
}

void note_left_out(const std::string& asked_for) {
  static bool told = false;
  if (!std::exchange(told, true))
    for (const std::string& line : left_out(asked_for))
      std::fprintf(stderr, "faultline: note: %s\n", printable(line).c_str());
}

RecordingFacts stream_recording(const std::string& file, const std::string& rig, const std::string& config,
                                SampleTaker& taker) {
  if (ends_with(file, ".bag")) {
    try {
      RecordingFacts facts;
      BagStream stream(file, rig, config, facts, taker);
      stream.finish(read_bag(file, rig, stream));
      return facts;
    } catch (const OutOfOrder&) {  // it must be sorted, so all of it must be there
    }
  }
  LoadedRecording loaded = load_recording(file, rig, config);
  taker.begin(loaded.sheet, loaded.start);
  for_each_sample(loaded.recording, [&](const Sample& sample) { taker.take(sample); });
  return std::move(loaded);
}

void print_remarks(const std::string& subcommand, const std::vector<std::string>& remarks) {
  for (const std::string& remark : remarks)
    std::fprintf(stderr, "faultline %s: note: %s\n", subcommand.c_str(), printable(remark).c_str());
}

}  // namespace faultline
