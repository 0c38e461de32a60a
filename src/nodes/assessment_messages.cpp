#include "nodes/assessment_messages.h"

#include <map>
#include <utility>

#include <fmt/format.h>

#include "faultline/signal/error.h"
#include "nodes/conversion.h"

namespace faultline {
namespace {

constexpr std::size_t kMostWaiting = 200000;  // messages of one topic without the other's: 20 s at 10 kHz

static_assert(static_cast<int>(Reason::told) == faultline_msgs::Detection::TOLD &&
              static_cast<int>(Reason::absent) == faultline_msgs::Detection::ABSENT &&
              static_cast<int>(Reason::transducer_in_doubt) == faultline_msgs::Detection::TRANSDUCER_IN_DOUBT &&
              static_cast<int>(Reason::explained) == faultline_msgs::Detection::EXPLAINED &&
              static_cast<int>(Reason::judgement_awaited) == faultline_msgs::Detection::JUDGEMENT_AWAITED &&
              static_cast<int>(Reason::told_by_another) == faultline_msgs::Detection::TOLD_BY_ANOTHER &&
              static_cast<int>(Reason::model_does_not_fit) == faultline_msgs::Detection::MODEL_DOES_NOT_FIT);

Reason to_reason(std::uint8_t word) {
  if (word > faultline_msgs::Detection::MODEL_DOES_NOT_FIT)
    throw InputError(fmt::format("reason {} is unknown; 0 to {} are allowed", static_cast<int>(word),
                                 static_cast<int>(faultline_msgs::Detection::MODEL_DOES_NOT_FIT)));
  return static_cast<Reason>(word);
}

}  // namespace

faultline_msgs::Detections detections_of(const Assessment& a, const std::string& rig) {
  faultline_msgs::Detections message;
  message.header.stamp = to_stamp(a.time);
  message.header.frame_id = rig;
  message.sequence = a.sequence;
  message.judged = a.judged;
  message.undecided_since = a.undecided_since;
  for (const ChannelStatus status : a.channel_status)
    message.channel_status.push_back(static_cast<std::uint8_t>(status));
  message.detections.resize(a.detectors.size());
  for (std::size_t i = 0; i < a.detectors.size(); ++i) {
    const DetectorResult& from = a.detectors[i];
    faultline_msgs::Detection& to = message.detections[i];
    to.name = from.name;
    to.evidence = from.evidence;
    to.active = from.detection.active;
    to.blind = from.detection.blind;
    to.since = from.detection.since;
    to.has_size = from.detection.has_size;
    to.size_name = from.size_name;
    to.size_unit = from.size_unit;
    to.size = from.detection.size;
    to.size_low = from.detection.low;
    to.size_high = from.detection.high;
    to.per_effect = from.detection.per_effect;
    to.confidence = from.detection.confidence;
    to.reason = static_cast<std::uint8_t>(from.reason);
    to.takes_over = from.takes_over;
  }
  return message;
}

faultline_msgs::Hypotheses hypotheses_of(const Assessment& a, const std::string& rig) {
  faultline_msgs::Hypotheses message;
  message.header.stamp = to_stamp(a.time);
  message.header.frame_id = rig;
  message.sequence = a.sequence;
  message.hypotheses.resize(a.isolators.size());
  for (std::size_t i = 0; i < a.isolators.size(); ++i) {
    const IsolatorResult& from = a.isolators[i];
    const Finding& f = from.finding;
    faultline_msgs::Hypothesis& to = message.hypotheses[i];
    to.name = from.name;
    to.active = f.active;
    to.since = f.since;
    to.kind = to_string(f.kind);
    to.effect = f.effect;
    to.port = f.port;
    to.equivalent = f.equivalent;
    to.text = f.text;
    to.has_size = f.has_size;
    to.size_name = f.size_name;
    to.size_unit = f.size_unit;
    to.size = f.size;
    to.size_low = f.low;
    to.size_high = f.high;
    to.none = f.none;
    to.confidence = f.confidence;
    to.reason = static_cast<std::uint8_t>(from.reason);
    to.detector = from.detector;
  }
  return message;
}

Assessment to_assessment(const faultline_msgs::Detections& detections, const faultline_msgs::Hypotheses& hypotheses) {
  Assessment a;
  a.time = to_seconds(detections.header.stamp);
  a.sequence = detections.sequence;
  a.judged = detections.judged != 0;
  a.undecided_since = detections.undecided_since;
  for (const std::uint8_t status : detections.channel_status) a.channel_status.push_back(to_channel_status(status));
  for (const faultline_msgs::Detection& from : detections.detections) {
    DetectorResult to;
    to.name = from.name;
    to.evidence = from.evidence;
    to.size_name = from.size_name;
    to.size_unit = from.size_unit;
    to.detection.active = from.active != 0;
    to.detection.blind = from.blind != 0;
    to.detection.since = from.since;
    to.detection.has_size = from.has_size != 0;
    to.detection.size = from.size;
    to.detection.low = from.size_low;
    to.detection.high = from.size_high;
    to.detection.per_effect = from.per_effect;
    to.detection.confidence = from.confidence;
    to.reason = to_reason(from.reason);
    to.takes_over = from.takes_over;
    a.detectors.push_back(std::move(to));
  }
  for (const faultline_msgs::Hypothesis& from : hypotheses.hypotheses) {
    IsolatorResult to;
    to.name = from.name;
    Finding& f = to.finding;
    f.active = from.active != 0;
    f.since = from.since;
    f.kind = parse_alarm_kind(from.kind, "hypotheses");
    f.effect = from.effect;
    f.port = from.port;
    f.equivalent = from.equivalent;
    f.text = from.text;
    f.has_size = from.has_size != 0;
    f.size_name = from.size_name;
    f.size_unit = from.size_unit;
    f.size = from.size;
    f.low = from.size_low;
    f.high = from.size_high;
    f.none = from.none;
    f.confidence = from.confidence;
    to.reason = to_reason(from.reason);
    to.detector = from.detector;
    a.isolators.push_back(std::move(to));
  }
  return a;
}

std::optional<Assessment> AssessmentJoin::next() {
  // Each topic keeps its order: where the first ones are no pair, all before the next pair have lost their partners.
  // Until that pair is there nobody knows which of the two was passed over.
  const auto key = [](const auto& message) {
    return std::pair(static_cast<std::uint64_t>(message->sequence), message->header.stamp.toNSec());
  };
  std::size_t skipped = 0, passed = 0;
  bool found = !detections_.empty() && !hypotheses_.empty() && key(detections_.front()) == key(hypotheses_.front());
  if (!found && !detections_.empty() && !hypotheses_.empty()) {
    std::map<decltype(key(hypotheses_.front())), std::size_t> places;
    for (std::size_t i = 0; i < hypotheses_.size(); ++i) places.emplace(key(hypotheses_[i]), i);
    for (; skipped < detections_.size() && !found; skipped += !found) {
      const auto place = places.find(key(detections_[skipped]));
      found = place != places.end();
      if (found) passed = place->second;
    }
  }
  if (found) {
    dropped_ += skipped + passed;
    const auto detections = detections_[skipped];
    const auto hypotheses = hypotheses_[passed];
    detections_.erase(detections_.begin(), detections_.begin() + static_cast<std::ptrdiff_t>(skipped + 1));
    hypotheses_.erase(hypotheses_.begin(), hypotheses_.begin() + static_cast<std::ptrdiff_t>(passed + 1));
    return to_assessment(*detections, *hypotheses);
  }
  const auto bound = [this](auto& waiting) {
    for (; waiting.size() > kMostWaiting; ++dropped_) waiting.pop_front();
  };
  bound(detections_);
  bound(hypotheses_);
  return {};
}

}  // namespace faultline
