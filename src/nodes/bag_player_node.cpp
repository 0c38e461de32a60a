// bag_player_node: a recorded bag -> /RIG/sample in simulated time. Parameters and topics: docs/nodes.md.
#include "nodes/bag_player.h"
#include "nodes/node_main.h"

int main(int argc, char** argv) {
  using namespace faultline;
  return run_node(argc, argv, "bag_player_node", [](Parameters& parameters) {
    const BagPlayerSettings settings = read_player_settings(parameters);
    Listeners listeners(parameters);
    parameters.check_used();
    BagPlayer player(settings, std::move(listeners));
    player.run();
    return 0;
  });
}
