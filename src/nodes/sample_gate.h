// Lets samples through once it is known what their values mean. Descriptions and samples travel on separate paths, so a
// sample may come first: it is held until a description comes, at most `wait` seconds; then the datasheet's own order
// is taken for granted, which is said in `trouble`. After a description that does not fit the datasheet no sample
// passes until one that does. Time is an argument: any clock that runs evenly.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <string>
#include <vector>

#include "faultline/rig/datasheet.h"
#include "faultline/signal/sample.h"
#include "nodes/description.h"

namespace faultline {

class SampleGate {
 public:
  struct Held {
    Sample sample;
    double arrival;  // s
  };
  using Deliver = std::function<void(const Sample& sample, double arrival)>;

  // Holds at most `capacity` samples; when more come, the oldest are refused.
  SampleGate(const Datasheet& sheet, double wait, std::size_t capacity, Deliver deliver);

  void describe(const Description& description);
  void push(Sample sample, double now);
  void tick(double now);  // the wait may be over without a further sample

  const std::string& trouble() const { return trouble_; }  // one line, while it lasts; empty if all is well
  const std::string& refusal() const { return refusal_; }  // why the last sample was refused that did not fit
  bool refusing() const { return state_ == State::refusing; }
  std::uint64_t refused() const { return refused_; }

 private:
  enum class State { waiting, open, refusing };
  void pass(Sample& sample, double arrival);
  void release();

  const Datasheet& sheet_;
  double wait_;
  std::size_t capacity_;
  Deliver deliver_;
  State state_ = State::waiting;
  std::vector<std::size_t> places_;
  std::size_t described_ = 0;
  std::deque<Held> held_;
  std::string trouble_, refusal_;
  std::uint64_t refused_ = 0;
};

}  // namespace faultline
