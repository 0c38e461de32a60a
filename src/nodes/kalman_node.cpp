// kalman_node: samples -> estimates, by estimators of the families kalman and response. Parameters, topics and
// services: docs/nodes.md. Both in one process: what a response says of a sample must come before the others' words on
// it (estimate_join.h).
#include "nodes/estimator_host.h"

int main(int argc, char** argv) {
  return faultline::run_estimator_node(argc, argv, "kalman_node", {"kalman", "response"});
}
