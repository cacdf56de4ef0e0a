// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "helicarm/core/failure.h"
#include "helicarm/track/tracked.h"

namespace helicarm::track {

struct TrackCase;

/// Anatomical axes of a body in the world of the first frame, as columns: x to the right, y anterior, z
/// proximal.
struct BodyAxes {
  std::size_t body;
  Eigen::Matrix3d axes;
  std::optional<Eigen::Vector3d> origin = {};  ///< mm, world of the first frame
};

/// Axes of two bodies or more, the first of which is the reference of the others. CSV `body,axis,x,y,z`: unit
/// vectors x, y and z, and optionally `origin` in mm. Or 3D Slicer's markups (.mrk.json, .fcsv) with points
/// BODY_origin, BODY_z in the direction of z from it, and BODY_x, whose part perpendicular to z is x.
/// bad_value for axes that are not right-handed and perpendicular to 0.001, points that do not determine
/// them, unknown bodies, and axes that are missing or given twice.
Expected<std::vector<BodyAxes>> read_body_axes(const std::filesystem::path& file, const TrackCase& the_case);

/// Refuses axes as `read_body_axes` does; `origin`: named in the message.
void check_body_axes(const std::vector<BodyAxes>& axes, const TrackCase& the_case, const std::string& origin);

/// Joint coordinate system of Grood and Suntay (1983) between two bodies.
struct JointAngles {
  /// rad. Flexion about x of the reference; adduction about the floating axis, positive where the body's
  /// distal end moves against x; external rotation about z of the body, positive where y turns towards x.
  Eigen::Vector3d angles = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  ///< rad^2, by the poses; the axes are exact
  /// Where both bodies have an origin: the body's origin from the reference's, mm, along x of the reference,
  /// the floating axis (anterior), and against z of the body (distraction).
  std::optional<Eigen::Vector3d> shift = {};
  Eigen::Matrix3d shift_covariance = Eigen::Matrix3d::Zero();  ///< mm^2
};

/// Nothing without both poses, and where the floating axis is undefined: adduction within 6 degrees of 90.
std::optional<JointAngles> joint_angles(const TrackedBody& reference, const BodyAxes& reference_axes,
                                        const TrackedBody& body, const BodyAxes& axes);

/// A joint through the sequence, by the smoothed poses.
struct Joint {
  std::size_t reference, body;
  std::vector<std::optional<JointAngles>> frames;
};

}  // namespace helicarm::track
