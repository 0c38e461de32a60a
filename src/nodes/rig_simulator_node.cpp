// rig_simulator_node: stands in for a rig and its DAQ. Parameters, topics and LCM channels: docs/nodes.md.
#include "nodes/node_main.h"
#include "nodes/rig_simulator.h"

int main(int argc, char** argv) {
  using namespace faultline;
  return run_node(argc, argv, "rig_simulator_node", [](Parameters& parameters) {
    const Datasheet sheet = read_rig(parameters);
    const RigSimulatorSettings settings = read_simulator_settings(sheet, parameters);
    Listeners listeners(parameters);
    parameters.check_used();
    RigSimulator simulator(sheet, settings, std::move(listeners));
    simulator.run();
    return 0;
  });
}
