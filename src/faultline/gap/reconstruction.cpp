#include "faultline/gap/reconstruction.h"

#include <cmath>
#include <utility>

#include "faultline/rig/effect_unit.h"

namespace faultline {
namespace {

constexpr int kExpectations = 6;          // steps of EM: process noise beside the signal
constexpr double kLeastVariance = 1e-18;  // of the process noise, in sizes squared

void open_only(const ResidualModel& residuals, const ModelChange& change, const std::string& port, int jobs,
               StochasticModel& model) {
  model.ports.clear();
  model.shows.clear();
  model.shown.clear();
  model.unit.clear();
  open_ports(residuals, change, jobs, model, port);
}

void settle_process(Reconstruction& at, int jobs) {
  for (int i = 0; i < kExpectations; ++i) {
    at.course = smooth(at.model, at.q, at.signal, jobs);
    at.q = at.course.q.cwiseMax(kLeastVariance);
  }
  at.course = smooth(at.model, at.q, at.signal, jobs);
}

bool reads_input(const Datasheet& sheet, const Port& port) {
  return port.kind == PortKind::sensor &&
         sheet.channels[static_cast<std::size_t>(sheet.channel(port.channel))].role == Role::input;
}

}  // namespace

Reconstruction reconstruct(const ResidualModel& residuals, const ModelChange& change, const FreePlace& place,
                           const std::vector<std::size_t>& runs, int jobs) {
  FittedProcess process = fit_process(residuals, change, runs, jobs);
  Reconstruction at;
  at.model = std::move(process.model);
  at.q = std::move(process.q);
  open_only(residuals, change, place.port, jobs, at.model);
  at.signal.port = 0;
  at.signal.memory = place.memory;
  at.signal.level = place.level / at.unit();
  settle_process(at, jobs);
  const double unit = at.unit();
  move_reference(residuals, change, at.course.states, at.course.known, jobs, at.model);
  open_only(residuals, change, place.port, jobs, at.model);
  at.signal.level *= unit / at.unit();
  settle_process(at, jobs);
  return at;
}

StochasticModel with_signal(StochasticModel model, const SignalCourses& known) {
  for (std::size_t n = 0; n < model.stretches.size(); ++n) {
    StochasticStretch& stretch = model.stretches[n];
    const Eigen::MatrixXd& drive = stretch.port_drives.front();
    for (std::size_t i = 0; i < stretch.rows.size(); ++i) {
      const auto at = static_cast<Eigen::Index>(i);
      if (drive.size() > 0 && i + 1 < stretch.rows.size()) stretch.defect[i] += drive.col(at) * known[n][at];
      if (model.shows.front() >= 0) stretch.misfit[i][model.shows.front()] -= model.shown.front() * known[n][at];
    }
  }
  return model;
}

std::vector<SignalVariable> find_variables(const ResidualModel& residuals, const ModelChange& change,
                                           const Reconstruction& at) {
  const Datasheet& sheet = residuals.sheet();
  const Port& port = sheet.port(at.model.ports.front());
  const std::size_t stretches = at.model.stretches.size();
  std::vector<SignalVariable> result;
  const auto add = [&](SignalVariable variable) {
    if (!settle_variable(variable)) return;
    for (SignalVariable& known : result)
      if (known.same(variable)) {  // the states' names are known to those who wrote the datasheet
        known.name = variable.name;
        return;
      }
    result.push_back(std::move(variable));
  };
  const std::vector<Eigen::MatrixXd> passed = passing_along(residuals, change, at.model, 0);
  const std::vector<PassingQuantity> quantities = passing(port.kind);
  for (std::size_t p = 0; p < quantities.size(); ++p) {
    SignalVariable variable;
    variable.name = port.kind == PortKind::command || port.kind == PortKind::sensor ? port.channel : quantities[p].name;
    variable.unit = effect_unit(sheet, port, quantities[p].unit);
    variable.passes = static_cast<int>(p);
    for (std::size_t n = 0; n < stretches; ++n) {
      variable.values.emplace_back(passed[n].col(static_cast<Eigen::Index>(p)));
      // A reading that drives the model is what the sensor makes of the truth.
      if (reads_input(sheet, port)) variable.values.back() -= at.model.unit.front() * at.course.signal[n];
    }
    add(std::move(variable));
  }
  for (std::size_t s = 0; s < sheet.states.size(); ++s) {
    SignalVariable variable{sheet.states[s].name, sheet.states[s].unit, -1, {}, 1, 0, 0};
    for (const StochasticStretch& stretch : at.model.stretches) {
      variable.values.emplace_back(static_cast<Eigen::Index>(stretch.rows.size()));
      for (std::size_t i = 0; i < stretch.rows.size(); ++i)
        variable.values.back()[static_cast<Eigen::Index>(i)] = stretch.reference[i][static_cast<Eigen::Index>(s)];
    }
    add(std::move(variable));
  }
  for (std::size_t c = 0; c < sheet.channels.size(); ++c) {
    const Channel& channel = sheet.channels[c];
    if (channel.role != Role::command && channel.role != Role::input) continue;
    SignalVariable variable{channel.name, channel.unit, -1, {}, 1, 0, 0};
    for (const StochasticStretch& stretch : at.model.stretches) {
      variable.values.emplace_back(static_cast<Eigen::Index>(stretch.rows.size()));
      for (std::size_t i = 0; i < stretch.rows.size(); ++i)
        variable.values.back()[static_cast<Eigen::Index>(i)] =
            residuals.runs()[stretch.run].recording.at(stretch.rows[i], c);
    }
    add(std::move(variable));
  }
  return result;
}

}  // namespace faultline
