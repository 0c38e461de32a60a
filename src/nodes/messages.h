// The package's ROS messages, for C++ that also uses the core. ROS puts generated messages into a namespace called like
// the package, which is the core's namespace too, and Sample, Estimate, Alarm and Quantity exist in both. So this one
// header reads the generated headers under another namespace, faultline_msgs; type names and checksums on the wire stay
// faultline/Sample and so on. Never include faultline/Sample.h and its like anywhere else.
#pragma once

// What the generated headers include must come first, outside the renaming.
#include <map>
#include <memory>
#include <string>
#include <vector>

#include <ros/builtin_message_traits.h>
#include <ros/message_operations.h>
#include <ros/serialization.h>
#include <ros/types.h>
#include <std_msgs/Header.h>

#define faultline faultline_msgs
// clang-format off
#include <faultline/Alarm.h>
#include <faultline/AlarmArray.h>
#include <faultline/ChannelDescription.h>
#include <faultline/Detections.h>
#include <faultline/Estimate.h>
#include <faultline/Gap.h>
#include <faultline/Histogram.h>
#include <faultline/Hypotheses.h>
#include <faultline/Quantity.h>
#include <faultline/RankedHypothesis.h>
#include <faultline/Ranking.h>
#include <faultline/RigDescription.h>
#include <faultline/Sample.h>
#include <faultline/Scalar.h>
// clang-format on
#undef faultline
