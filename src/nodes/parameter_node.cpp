// parameter_node: samples -> estimates, by estimators of the family parameter (recursive least squares). Parameters,
// topics and services: docs/nodes.md.
#include "nodes/estimator_host.h"

int main(int argc, char** argv) { return faultline::run_estimator_node(argc, argv, "parameter_node", {"parameter"}); }
