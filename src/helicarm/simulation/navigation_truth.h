// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "helicarm/simulation/tracker_model.h"

namespace helicarm::simulation {

inline constexpr double tunnel_ball_mm = 3;

/// A ball at a tunnel's end, and its true position in every frame.
struct TunnelPoint {
  std::string name;  ///< FS, FE, TS, TE
  std::string bone;  ///< femur or tibia
  Eigen::Vector3d in_calibrator;
  Eigen::Vector3d in_bone;
  Eigen::Vector3d in_tool;
};

/// A tool line drilled or to be drilled, and its true distance from the tunnel's ends.
struct TrueToolLine {
  std::string name;
  std::string start;
  std::string end;
  Eigen::Vector3d p1_in_calibrator;
  Eigen::Vector3d p2_in_calibrator;
  double start_error_mm;
  double end_error_mm;
};

/// The operating room's tracker. Besides the markers' noise each body has a position-dependent error that a
/// short mean does not reduce. It changes over longer times than an approach takes and shorter ones than a
/// rehearsal, as a real one's does in an operation that lasts ten times as long.
TrackerModel virtual_tracker();

/// A reading is the mean of this many samples of bodies at rest, less lost samples.
inline constexpr int samples_per_reading = 6;
inline constexpr double tracker_rate_hz = 60;

/// An ACL navigation: true and measured tracker poses ("calibrator", "femur", "tibia", "tool") and the
/// tunnels.
struct NavigationTruth {
  double sigma_mm = 0;  ///< of a reading per axis: rms over axes and bodies
  double sigma_deg = 0;
  std::map<std::string, geometry::RigidTransform> tracker_from;  ///< true
  std::map<std::string, geometry::RigidTransform>
      read;                                    ///< one reading is used for every view and for the present
  std::map<std::string, Matrix6d> covariance;  ///< of `read`, in the convention of pose_covariance
  std::vector<TunnelPoint> points;
  std::vector<TrueToolLine> lines;
};

NavigationTruth set_up_navigation(std::uint64_t seed, const geometry::RigidTransform& calibrator_from_knee);

/// Distance of a point from the line through two others.
double distance_to_line(const Eigen::Vector3d& point, const Eigen::Vector3d& a, const Eigen::Vector3d& b);

}  // namespace helicarm::simulation
