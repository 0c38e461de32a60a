#include "faultline/networks/model.h"

#include <cmath>

#include <fmt/format.h>

#include "faultline/signal/error.h"

namespace faultline {
namespace {

constexpr const char* kType = "network";
constexpr int kVersion = 1;  // of the numbers

// What comes before the weights.
std::vector<std::string> head_names(const NetworkShape& shape) {
  std::vector<std::string> names = {"period", "cut_off", "feedback"};
  for (const NetworkInput& input : shape.inputs)
    names.insert(names.end(), {input.name + ".centre", input.name + ".scale"});
  for (const NetworkOutput& output : shape.outputs)
    names.insert(names.end(), {output.name + ".centre", output.name + ".scale", output.name + ".rms"});
  for (const NetworkUnit& unit : shape.units) names.push_back(shape.outputs[unit.outputs.front()].name + ".gain");
  return names;
}

std::vector<std::string> all_names(const NetworkShape& shape) {
  std::vector<std::string> names = head_names(shape);
  for (std::string& name : shape.weight_names()) names.push_back(std::move(name));
  return names;
}

[[noreturn]] void refuse(const std::string& what) { throw InputError(what + "; train it anew"); }

void check_same(const char* what, double given, double own) {
  if (std::abs(given - own) > 1e-6 * std::abs(own))
    refuse(fmt::format("the network was trained with {} = {:g}, this stage has {:g}", what, given, own));
}

}  // namespace

Reference to_reference(const NetworkModel& model) {
  Reference r;
  r.type = kType;
  r.version = kVersion;
  r.names = all_names(model.shape);
  r.numbers = {model.shape.period, model.shape.cut_off, static_cast<double>(model.trained)};
  for (std::size_t i = 0; i < model.shape.inputs.size(); ++i)
    r.numbers.insert(r.numbers.end(), {model.inputs.centre[i], model.inputs.scale[i]});
  for (std::size_t o = 0; o < model.shape.outputs.size(); ++o)
    r.numbers.insert(r.numbers.end(), {model.outputs.centre[o], model.outputs.scale[o], model.rms[o]});
  for (const NetworkUnit& unit : model.shape.units) r.numbers.push_back(unit.gain);
  r.numbers.insert(r.numbers.end(), model.weights.begin(), model.weights.end());
  return r;
}

NetworkModel to_model(const NetworkShape& shape, const Reference& given) {
  if (given.type != kType) refuse(fmt::format("this is a reference of type {}, not a network", given.type));
  if (given.version != kVersion)
    refuse(fmt::format("the network is of version {}, this program reads version {}", given.version, kVersion));
  const std::vector<std::string> names = all_names(shape);
  for (std::size_t i = 0; i < std::max(names.size(), given.names.size()); ++i)
    if (i >= names.size() || i >= given.names.size() || given.names[i] != names[i])
      refuse(fmt::format("the network is of another structure than this stage: it has {} where the stage has {}",
                         i < given.names.size() ? given.names[i] : "nothing", i < names.size() ? names[i] : "nothing"));
  NetworkModel model;
  model.shape = shape;
  const double* next = given.numbers.data();
  check_same("period", *next++, shape.period);
  check_same("cut_off", *next++, shape.cut_off);
  const double trained = *next++;
  if (trained != 0 && trained != 1 && trained != 2) refuse("the network's feedback is none of this program's");
  model.trained = static_cast<Feedback>(static_cast<int>(trained));
  const auto scaling = [&](Scaling& s, const std::string& name) {
    s.centre.push_back(*next++);
    s.scale.push_back(*next++);
    if (!(s.scale.back() > 0)) refuse(fmt::format("the network's scale of {} is not positive", name));
  };
  for (const NetworkInput& input : shape.inputs) scaling(model.inputs, input.name);
  for (const NetworkOutput& output : shape.outputs) {
    scaling(model.outputs, output.name);
    model.rms.push_back(*next++);
    if (!(model.rms.back() >= 0)) refuse(fmt::format("the network's error of {} is negative", output.name));
  }
  for (const NetworkUnit& unit : shape.units) check_same("gain", *next++, unit.gain);
  model.weights = Eigen::Map<const Eigen::VectorXd>(next, static_cast<Eigen::Index>(shape.weights()));
  return model;
}

NetworkModel read_network(const std::string& file, const std::string& rig, const std::string& stage,
                          const NetworkShape& shape) {
  for (const auto& [name, reference] : read_references(file, rig).stages) {
    if (name != stage) continue;
    try {
      return to_model(shape, reference);
    } catch (const InputError& error) {
      throw InputError(fmt::format("{}: {}: {}", file, stage, error.what()));
    }
  }
  throw InputError(fmt::format("{}: the file holds no network of the stage '{}'", file, stage));
}

}  // namespace faultline
