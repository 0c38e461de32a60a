#include "nodes/sample_gate.h"

#include <numeric>
#include <utility>

#include <fmt/format.h>

#include "faultline/signal/error.h"

namespace faultline {

SampleGate::SampleGate(const Datasheet& sheet, double wait, std::size_t capacity, Deliver deliver)
    : sheet_(sheet), wait_(wait), capacity_(capacity), deliver_(std::move(deliver)) {}

void SampleGate::describe(const Description& description) {
  try {
    places_ = match_channels(sheet_, description);
    described_ = description.names.size();
    trouble_.clear();
    state_ = State::open;
    release();
  } catch (const InputError& error) {
    trouble_ = error.what();
    state_ = State::refusing;
    refused_ += held_.size();
    held_.clear();
  }
}

void SampleGate::push(Sample sample, double now) {
  tick(now);
  switch (state_) {
    case State::open:
      pass(sample, now);
      break;
    case State::refusing:
      ++refused_;
      break;
    case State::waiting:
      if (held_.size() >= capacity_) {
        held_.pop_front();
        ++refused_;
      }
      held_.push_back({std::move(sample), now});
      break;
  }
}

void SampleGate::tick(double now) {
  if (state_ != State::waiting || held_.empty() || now - held_.front().arrival <= wait_) return;
  described_ = sheet_.channels.size();
  places_.resize(described_);
  std::iota(places_.begin(), places_.end(), std::size_t{0});
  trouble_ = fmt::format("no description came within {:g} s; the channels are taken to be in the order of {}", wait_,
                         sheet_.file);
  state_ = State::open;
  release();
}

void SampleGate::release() {
  std::deque<Held> held;
  held.swap(held_);
  for (Held& entry : held) pass(entry.sample, entry.arrival);
}

void SampleGate::pass(Sample& sample, double arrival) {
  if (arrange(places_, described_, sample)) {
    deliver_(sample, arrival);
    return;
  }
  ++refused_;
  refusal_ = fmt::format("a sample has {} values, its description names {} channels; mend what writes it",
                         sample.values.size(), described_);
}

}  // namespace faultline
