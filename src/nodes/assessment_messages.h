// An Assessment as the two messages Detections and Hypotheses, and back, number for number: pure functions, and the
// join of the two topics.
#pragma once

#include <deque>
#include <optional>

#include "faultline/isolation/assessment.h"
#include "nodes/messages.h"

namespace faultline {

faultline_msgs::Detections detections_of(const Assessment& assessment, const std::string& rig);
faultline_msgs::Hypotheses hypotheses_of(const Assessment& assessment, const std::string& rig);
// InputError where the messages hold words that there are not.
Assessment to_assessment(const faultline_msgs::Detections& detections, const faultline_msgs::Hypotheses& hypotheses);

// Brings the two messages of a sample together again. Each topic keeps its order; what has no partner when a later pair
// is whole is dropped and counted.
class AssessmentJoin {
 public:
  void add(const boost::shared_ptr<const faultline_msgs::Detections>& message) { detections_.push_back(message); }
  void add(const boost::shared_ptr<const faultline_msgs::Hypotheses>& message) { hypotheses_.push_back(message); }
  // The next whole pair, in the order in which they came.
  std::optional<Assessment> next();
  std::uint64_t dropped() const { return dropped_; }

 private:
  std::deque<boost::shared_ptr<const faultline_msgs::Detections>> detections_;
  std::deque<boost::shared_ptr<const faultline_msgs::Hypotheses>> hypotheses_;
  std::uint64_t dropped_ = 0;
};

}  // namespace faultline
