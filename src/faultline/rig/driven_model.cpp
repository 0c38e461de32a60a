#include "faultline/rig/driven_model.h"

#include <algorithm>
#include <cmath>

#include "faultline/rig/running_plant.h"

namespace faultline {

struct DrivenModel::Parts {
  Parts(std::shared_ptr<const Datasheet> datasheet, const SimulationSetup& setup)
      : sheet(std::move(datasheet)),
        plant(*sheet, setup, Use::model),
        now(sheet->channels.size()),
        next(sheet->channels.size()) {
    for (const EffectSpec& spec : setup.effects)
      if (spec.effect == "stuck" && sheet->port(spec.port).kind == PortKind::command)
        stuck.push_back(
            {static_cast<std::size_t>(sheet->channel(sheet->port(spec.port).channel)), spec.parameters.front()});
  }

  // What stuck before `row` holds since.
  void read_held_commands(const Recording& recording, std::size_t row) {
    for (const auto& [command, from] : stuck) {
      const auto begin = recording.time.begin();
      const auto after = std::lower_bound(begin, begin + static_cast<std::ptrdiff_t>(row), from + *begin);
      if (after == begin || after == begin + static_cast<std::ptrdiff_t>(row)) continue;
      const auto last_row = static_cast<std::size_t>(after - begin) - 1;
      plant.remember(command, recording.at(last_row, command), time(recording, last_row));
    }
  }

  // What reaches the plant: a sensor whose reading drives the model shows the true value through its effects.
  void take(const Recording& recording, std::size_t row, std::vector<double>& values) {
    std::copy_n(recording.row(row), values.size(), values.begin());
    for (const auto& [channel, chain] : plant.input_sensors()) {
      const double at = time(recording, row);
      const double value = look && chain->remembers() ? chain->undo(course(recording, row, channel), at).value
                                                      : chain->undo_signal(values[channel], at);
      if (!std::isnan(value)) values[channel] = value;
    }
  }
  Course course(const Recording& recording, std::size_t row, std::size_t channel) const {
    return [this, &recording, row, c = channel](double later) { return look(recording, row, c, later); };
  }
  static double time(const Recording& recording, std::size_t row) {
    return recording.time[row] - recording.time.front();
  }

  const std::shared_ptr<const Datasheet> sheet;
  // `later` counts from this row.
  CourseOf around(const Recording& recording, std::size_t row) const {
    if (!look) return {};
    return [this, &recording, row](std::size_t channel, double later) { return look(recording, row, channel, later); };
  }

  // `next` is the row that is there.
  void arrive(double time) {
    now.swap(next);
    plant.follow(time, now.data());
    last = time;
  }

  RunningPlant plant;
  std::vector<std::pair<std::size_t, double>> stuck;  // commands, and from when on, s
  Around look;
  // Of the next restart; null where nothing is known.
  const double* known() {
    if (hidden.empty()) return nullptr;
    return &hidden[(sheet->states.size() + plant.added()) * restarts++];
  }

  std::vector<double> hidden;  // set_hidden()
  std::size_t restarts = 0;
  std::vector<double> now, next, ended;
  std::vector<RunningPlant::Beside> plants;  // of those beside this one
  double last = 0;                           // s, time of the last row
};

DrivenModel::DrivenModel(const Datasheet& sheet, const SimulationSetup& setup)
    : DrivenModel(std::make_shared<const Datasheet>(sheet), setup) {}
DrivenModel::DrivenModel(std::shared_ptr<const Datasheet> sheet, const SimulationSetup& setup)
    : parts_(std::make_unique<Parts>(std::move(sheet), setup)) {}
DrivenModel::~DrivenModel() = default;

void DrivenModel::set_hidden(std::vector<double> hidden) { parts_->hidden = std::move(hidden); }
std::size_t DrivenModel::added_count() const { return parts_->plant.added(); }
void DrivenModel::added(double* off) { parts_->plant.read_added(parts_->now.data(), off); }

void DrivenModel::begin(const Recording& recording, std::size_t row, const double* state) {
  parts_->restarts = 0;
  parts_->take(recording, row, parts_->now);
  parts_->plant.start(Parts::time(recording, row), parts_->now.data(), state, state ? parts_->known() : nullptr,
                      parts_->around(recording, row));
  if (parts_->hidden.empty()) parts_->plant.integrate_inputs(recording, row);
  parts_->read_held_commands(recording, row);
  parts_->plant.follow(Parts::time(recording, row), parts_->now.data());
  parts_->last = Parts::time(recording, row);
  parts_->ended.assign(state_count() + added_count(), std::nan(""));
}

bool DrivenModel::remembers() const { return parts_->plant.remembers(); }

void DrivenModel::set_around(Around around) { parts_->look = std::move(around); }

bool DrivenModel::goes_beside(const DrivenModel& leader) const {
  return parts_->plant.goes_beside(leader.parts_->plant);
}

bool DrivenModel::moves_as(const DrivenModel& leader) const { return parts_->plant.moves_as(leader.parts_->plant); }

void DrivenModel::advance(const Recording& recording, std::size_t to_row, const std::vector<Beside>& beside) {
  const double time = Parts::time(recording, to_row - 1);
  parts_->take(recording, to_row, parts_->next);
  if (beside.empty()) {
    parts_->plant.advance(time, parts_->now.data(), parts_->next.data());
  } else {
    parts_->plants.clear();
    for (const Beside& other : beside) {
      Parts& parts = *other.model->parts_;
      parts.take(recording, to_row, parts.next);
      parts_->plants.push_back({&parts.plant, parts.now.data(), parts.next.data(), other.alike});
    }
    parts_->plant.advance(time, parts_->now.data(), parts_->next.data(), parts_->plants);
  }
  parts_->arrive(time + parts_->plant.period());
  for (const Beside& other : beside) other.model->parts_->arrive(time + parts_->plant.period());
}

void DrivenModel::restart(const Recording& recording, std::size_t row, const double* state) {
  std::copy_n(parts_->plant.state(), state_count(), parts_->ended.begin());
  added(parts_->ended.data() + state_count());
  parts_->plant.restart(parts_->last, parts_->now.data(), state, parts_->known(), parts_->around(recording, row), true);
}

const double* DrivenModel::predicted() const { return parts_->plant.seen().data(); }
const double* DrivenModel::state() const { return parts_->plant.state(); }
const double* DrivenModel::ended() const { return parts_->ended.data(); }
void DrivenModel::outputs(double* channels) const { parts_->plant.outputs(parts_->last, channels); }
Passed DrivenModel::passed(const std::string& port) const { return parts_->plant.passed(port); }
std::size_t DrivenModel::state_count() const { return parts_->sheet->states.size(); }

}  // namespace faultline
