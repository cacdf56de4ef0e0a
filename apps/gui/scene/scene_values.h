// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "helicarm/devices/robot/kinematics.h"
#include "helicarm/phantom/calibrator.h"
#include "helicarm/phantom/mesh.h"
#include "helicarm/pipeline/result.h"

/// What is to be seen of an operation, as plain values in the calibrator's frame, mm.
namespace helicarm::gui {

struct Segment {
  Eigen::Vector3d from;
  Eigen::Vector3d to;
};

/// Where a point lies with a given probability.
struct Ellipsoid {
  Eigen::Vector3d centre;
  Eigen::Matrix3d axes;   ///< columns, a proper rotation
  Eigen::Vector3d radii;  ///< mm, along the columns
};

/// The 95 % quantile of chi-square with three degrees of freedom.
inline constexpr double chi2_95 = 7.815;

Ellipsoid ellipsoid_95(const Eigen::Vector3d& centre, const Eigen::Matrix3d& covariance);

/// A calibrated X-ray: its source, the edge of its image and its central ray.
struct ViewShape {
  std::string name;
  View view;
  Eigen::Vector2d size_px;
  std::array<Eigen::Vector3d, 4> detector;  ///< corners in order around the image
  Segment central_ray;                      ///< from the source to the detector
};

struct PointShape {
  std::string name;
  PointSource source;
  std::optional<Bone> moves_with;
  Ellipsoid error;            ///< about its place
  std::vector<Segment> rays;  ///< from the sources to the detectors
};

struct TunnelShape {
  std::string name;
  std::optional<Bone> moves_with;
  Segment axis;
  double radius_mm = 4;
};

/// All that a result shows; what was not reached is absent.
struct ResultScene {
  std::vector<CalibratorBall> balls;
  std::optional<TriangleMesh> body;  ///< of the calibrator, where its balls lie on a cone
  std::vector<ViewShape> views;
  std::vector<PointShape> points;
  std::vector<TunnelShape> tunnels;
};

ResultScene scene_of(const Result& result, const Calibrator& calibrator);

/// The outer wall of the cone that bears the balls; nothing where they lie on no cone.
std::optional<TriangleMesh> cone_of(const Calibrator& calibrator);

/// What moves. Absent: not known now, so not shown.
struct LiveScene {
  std::optional<RigidTransform> calibrator_from_tip;  ///< z along the tool, out of its tip
  /// Motion of the bones since the xray_image.
  std::optional<RigidTransform> calibrator_from_femur_now, calibrator_from_tibia_now;
  /// Where the bones' markers are.
  std::optional<RigidTransform> calibrator_from_femur_marker, calibrator_from_tibia_marker;
  std::optional<RigidTransform> calibrator_from_base;
  std::string robot_model = "UR5";
  std::optional<Joints> joints;
  std::vector<Eigen::Vector3d> path;  ///< of the tool's tip
};

/// The links of the arm from the base to the flange; empty where base, joints or model are not known.
std::vector<Segment> robot_links(const LiveScene& live);

}  // namespace helicarm::gui
