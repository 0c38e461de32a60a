// histogram_node: samples -> histograms of the rig's variables and what they say of each sample, by estimators of the
// family histogram. Parameters, topics and services: docs/nodes.md.
#include "nodes/estimator_host.h"

int main(int argc, char** argv) { return faultline::run_estimator_node(argc, argv, "histogram_node", {"histogram"}); }
