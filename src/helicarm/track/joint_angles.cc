// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/joint_angles.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include <Eigen/LU>
#include <fmt/format.h>

#include "helicarm/core/csv.h"
#include "helicarm/geometry/rotation.h"
#include "helicarm/track/track_case.h"

namespace helicarm::track {
namespace {

constexpr std::array axis_names{"x", "y", "z"};

/// Of reference_from_body = Rx(-flexion) Ry(adduction) Rz(-external rotation); nothing near its singularity.
std::optional<Eigen::Vector3d> angles_of(const Eigen::Matrix3d& reference_from_body) {
  const Eigen::Matrix3d& r = reference_from_body;
  constexpr double least_cosine = 0.1;
  const double cosine = std::hypot(r(0, 0), r(0, 1));
  if (cosine < least_cosine) return std::nullopt;
  return Eigen::Vector3d(std::atan2(r(1, 2), r(2, 2)), std::atan2(r(0, 2), cosine),
                         std::atan2(r(0, 1), r(0, 0)));
}

}  // namespace

void check_body_axes(const std::vector<BodyAxes>& axes, const TrackCase& the_case,
                     const std::string& origin) {
  constexpr double tolerance = 1e-3;
  for (const BodyAxes& of : axes) {
    const double off = (of.axes.transpose() * of.axes - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
    if (!(off < tolerance) || of.axes.determinant() < 0)
      throw BadInput(Reason::bad_value,
                     fmt::format("{}: the axes of \"{}\" are no right-handed, perpendicular unit vectors: "
                                 "they are off by {:.2g}, limit {:g}",
                                 origin, the_case.bodies[of.body].name, off, tolerance));
  }
  if (axes.size() < 2)
    throw BadInput(Reason::bad_value,
                   fmt::format("{}: axes of {} body, a joint has two", origin, axes.size()));
}

Expected<std::vector<BodyAxes>> read_body_axes(const std::filesystem::path& file, const TrackCase& the_case) {
  return guarded([&] {
    const std::string origin = file.filename().string();
    const CsvTable table = value_or_throw(read_csv(file, {"body", "axis", "x", "y", "z"}, {}));
    std::vector<BodyAxes> all;
    std::map<std::size_t, int> seen;  // bits of the axes
    const auto refuse = [&](const std::string& problem) {
      throw BadInput(Reason::bad_value, fmt::format("{}: {}", origin, problem));
    };
    for (std::size_t row = 0; row < table.rows(); ++row) {
      const std::string &name = table.text(row, "body"), &axis = table.text(row, "axis");
      const auto body = std::ranges::find(the_case.bodies, name, &BodyPlan::name);
      if (body == the_case.bodies.end()) refuse(fmt::format("\"{}\" is no body of the case", name));
      const auto column = std::ranges::find(axis_names, axis) - axis_names.begin();
      if (column == 3) refuse(fmt::format("axis \"{}\" is none of x, y, z", axis));
      const auto b = std::size_t(body - the_case.bodies.begin());
      if (seen[b] & (1 << column)) refuse(fmt::format("axis {} of \"{}\" is given twice", axis, name));
      if (seen[b] == 0) all.push_back({b, Eigen::Matrix3d::Zero()});
      seen[b] |= 1 << column;
      const auto of = std::ranges::find(all, b, &BodyAxes::body);
      of->axes.col(column) << table.number(row, "x"), table.number(row, "y"), table.number(row, "z");
    }
    for (const auto& [body, axes] : seen)
      if (axes != 7)
        refuse(fmt::format("axes of \"{}\" are missing: x, y and z", the_case.bodies[body].name));
    check_body_axes(all, the_case, origin);
    return all;
  });
}

std::optional<JointAngles> joint_angles(const TrackedBody& reference, const Eigen::Matrix3d& reference_axes,
                                        const TrackedBody& body, const Eigen::Matrix3d& axes) {
  constexpr double step_rad = 1e-5;
  if (!reference.pose || !body.pose) return std::nullopt;
  const Eigen::Matrix3d left = reference_axes.transpose() * reference.pose->pose.rotation.transpose(),
                        right = body.pose->pose.rotation * axes;
  const auto angles = angles_of(left * right);
  if (!angles) return std::nullopt;
  Eigen::Matrix3d by_turn;
  for (int k = 0; k < 3; ++k) {
    const Eigen::Vector3d turn = step_rad * Eigen::Vector3d::Unit(k);
    const auto above = angles_of(left * geometry::rotation_from_vector(turn) * right),
               below = angles_of(left * geometry::rotation_from_vector(-turn) * right);
    if (!above || !below) return std::nullopt;
    for (int i = 0; i < 3; ++i)
      by_turn(i, k) = std::remainder((*above)[i] - (*below)[i], 2 * EIGEN_PI) / (2 * step_rad);
  }
  const Eigen::Matrix3d turns =
      reference.pose->covariance.topLeftCorner<3, 3>() + body.pose->covariance.topLeftCorner<3, 3>();
  return JointAngles{*angles, by_turn * turns * by_turn.transpose()};
}

}  // namespace helicarm::track
