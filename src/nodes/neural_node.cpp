// neural_node: samples -> estimates of channels by trained networks, estimators of the family neural. Parameters,
// topics and services: docs/nodes.md.
#include "nodes/estimator_host.h"

int main(int argc, char** argv) { return faultline::run_estimator_node(argc, argv, "neural_node", {"neural"}); }
