// The model driven by what a recording holds: commands and inputs are taken from it, outputs are predicted row by row
// without noise and rounding. At given rows the rig's states may be put back to given values, and the effects of the
// sensors that show them to what they show; other effects on signals keep their memory: the segments of an integrating
// plant.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <type_traits>
#include <vector>

#include "faultline/rig/effect.h"
#include "faultline/rig/simulation_setup.h"
#include "faultline/signal/sample.h"

namespace faultline {

class DrivenModel {
 public:
  DrivenModel(const Datasheet& sheet, const SimulationSetup& setup);
  DrivenModel(std::shared_ptr<const Datasheet> sheet, const SimulationSetup& setup);  // for many models of one rig
  ~DrivenModel();
  DrivenModel(const DrivenModel&) = delete;
  DrivenModel& operator=(const DrivenModel&) = delete;

  // Predicts rows first .. first + count - 1, one sample period apart. `restarts`: rows (rising, from `first` on) at
  // which the nominal states are set to start_states + i * (number of the datasheet's states); before the first restart
  // the rig's own initial state runs. A restart acts after its row was predicted: the row still shows where the segment
  // before it ended. Calls row(index, channels) with one value per channel for each of them. Effects forget what was
  // before `first`, but for a command that is stuck: it holds what the recording says. Their time counts from the
  // recording's first row. Where row returns a bool, false ends the run.
  template <class Row>
  void run(const Recording& recording, std::size_t first, std::size_t count, const std::vector<std::size_t>& restarts,
           const double* start_states, Row&& row) {
    run(recording, first, count, restarts, start_states, {},
        [&row](std::size_t k, std::size_t, const double* channels) { return row(k, channels); });
  }

  // The same with others beside it (integrator.h), each from start states of its own. Calls row(index, which, channels)
  // for each model: 0 is this one, then in the order of `beside`.
  struct Beside {
    DrivenModel* model;
    const double* start_states;
    bool alike = false;  // moves_as() this one
  };
  bool goes_beside(const DrivenModel& leader) const;
  bool moves_as(const DrivenModel& leader) const;  // RunningPlant
  template <class Row>
  void run(const Recording& recording, std::size_t first, std::size_t count, const std::vector<std::size_t>& restarts,
           const double* start_states, const std::vector<Beside>& beside, Row&& row) {
    std::size_t next = !restarts.empty() && restarts.front() == first ? 1 : 0;
    begin(recording, first, next > 0 ? start_states : nullptr);
    for (const Beside& other : beside) other.model->begin(recording, first, next > 0 ? other.start_states : nullptr);
    const auto show = [&row](std::size_t k, std::size_t which, const double* channels) {
      if constexpr (std::is_same_v<decltype(row(k, which, channels)), bool>) {
        return row(k, which, channels);
      } else {
        row(k, which, channels);
        return true;
      }
    };
    for (std::size_t k = first; k < first + count; ++k) {
      if (k > first) {
        advance(recording, k, beside);
        if (next < restarts.size() && restarts[next] == k) {
          restart(recording, k, start_states + next * state_count());
          for (const Beside& other : beside)
            other.model->restart(recording, k, other.start_states + next * state_count());
          ++next;
        }
      }
      bool go_on = show(k, 0, predicted());
      for (std::size_t i = 0; i < beside.size(); ++i) go_on = show(k, i + 1, beside[i].model->predicted()) && go_on;
      if (!go_on) return;
    }
  }

  // What a channel of the recording shows without its noise `later` s after a row, for sensors whose effects have
  // memory, those of inputs too. Without it they are taken to have stood still.
  using Around = std::function<Shown(const Recording& recording, std::size_t row, std::size_t channel, double later)>;
  void set_around(Around around);

  // What no channel shows, for the next run, a row per restart: of each state what is behind the memory of its sensor,
  // then the states that effects added, as what they are off from rest at the rig's states. NaN: what the effects make
  // of what is shown, and what they are.
  void set_hidden(std::vector<double> hidden);
  std::size_t added_count() const;
  void added(double* off);  // after the last row

  // Whether effects have memories or states of their own, which a run must first fill.
  bool remembers() const;

  // The rig's states after the last row, in the datasheet's order; and what they were there before a restart put them
  // back, those that effects added after them, as in set_hidden().
  const double* state() const;
  const double* ended() const;
  // Output channels at state() before sensors, written into `channels`.
  void outputs(double* channels) const;
  std::size_t state_count() const;
  // What passed a port before the last row, where the last effect there takes note (Effect::passed).
  Passed passed(const std::string& port) const;

 private:
  void begin(const Recording& recording, std::size_t row, const double* state);
  void advance(const Recording& recording, std::size_t to_row, const std::vector<Beside>& beside);
  void restart(const Recording& recording, std::size_t row, const double* state);
  const double* predicted() const;

  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace faultline
