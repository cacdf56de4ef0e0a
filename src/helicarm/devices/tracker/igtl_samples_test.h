// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/devices/tracker/igtl_message.h"

namespace helicarm::tracker {

/// One message of each kind; the first is a TRANSFORM.
inline std::vector<IgtlMessage> sample_messages() {
  Eigen::Matrix4d pose = Eigen::Matrix4d::Identity();
  pose.topRightCorner<3, 1>() << 12.5, -3, 800;
  const std::uint64_t stamp = 0x6543210012345678u;
  return {{"femur", stamp, IgtlTransform{pose}},
          {"tracker", stamp, IgtlTracking{{{"femur", 1, pose}, {"tibia", 2, pose}}}},
          {"tracker", stamp, IgtlTracking{}},
          {"tracker", stamp, IgtlQuaternions{{{"tool", 1, {1, 2, 3}, {0, 0, 0.5, 0.5}}}}},
          {"tool", stamp, IgtlPosition{{1, 2, 3}, Eigen::Vector4d(0, 1, 0, 0)}},
          {"tracker", stamp, IgtlStatus{18, -5, "Hardware", "temperature"}},
          {"", stamp, IgtlStart{"TDATA", 50, "tracker"}},
          {"", stamp, IgtlStop{"TDATA"}},
          {"", stamp, IgtlGet{"STATUS"}},
          {"", stamp, IgtlReply{"TDATA", 1}},
          {"other", stamp, IgtlUnknown{"RTS_SOMETHIN", "abc"}}};
}

}  // namespace helicarm::tracker
