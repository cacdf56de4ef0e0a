// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/joint_angles.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include <Eigen/LU>
#include <fmt/format.h>

#include "helicarm/case_registration/plan.h"
#include "helicarm/core/csv.h"
#include "helicarm/geometry/rotation.h"
#include "helicarm/track/track_case.h"

namespace helicarm::track {
namespace {

constexpr std::array axis_names{"x", "y", "z", "origin"};

using Pose6 = Eigen::Matrix<double, 6, 1>;
using Joint6 = Eigen::Matrix<double, 6, 1>;

/// Axes and origin in one frame.
struct AxesNow {
  Eigen::Matrix3d axes;
  Eigen::Vector3d origin;
};

/// `off`: rotation vector and shift of the pose, world axes, about the body's centroid.
AxesNow axes_now(const TrackedBody& body, const BodyAxes& axes, const Pose6& off) {
  const Eigen::Matrix3d turn = geometry::rotation_from_vector(off.head<3>());
  const Eigen::Vector3d origin = body.pose->pose * axes.origin.value_or(Eigen::Vector3d::Zero());
  return {turn * body.pose->pose.rotation * axes.axes,
          body.centre + turn * (origin - body.centre) + off.tail<3>()};
}

/// Angles, of reference_from_body = Rx(-flexion) Ry(adduction) Rz(-external rotation), and shifts; nothing
/// near their singularity.
std::optional<Joint6> joint_of(const AxesNow& reference, const AxesNow& body) {
  constexpr double least_cosine = 0.1;
  const Eigen::Matrix3d r = reference.axes.transpose() * body.axes;
  const double cosine = std::hypot(r(0, 0), r(0, 1));
  if (cosine < least_cosine) return std::nullopt;
  const Eigen::Vector3d x = reference.axes.col(0), z = body.axes.col(2), floating = z.cross(x).normalized(),
                        between = body.origin - reference.origin;
  Joint6 joint;
  joint << std::atan2(r(1, 2), r(2, 2)), std::atan2(r(0, 2), cosine), std::atan2(r(0, 1), r(0, 0)),
      between.dot(x), between.dot(floating), (reference.origin - body.origin).dot(z);
  return joint;
}

/// Of BODY_AXIS the body's index and the axis; nothing where no body has that name.
std::optional<std::pair<std::size_t, std::string>> axis_named(const std::string& name,
                                                              const TrackCase& the_case) {
  const auto at = name.rfind('_');
  if (at == std::string::npos) return std::nullopt;
  const auto body = std::ranges::find(the_case.bodies, name.substr(0, at), &BodyPlan::name);
  if (body == the_case.bodies.end()) return std::nullopt;
  return std::pair(std::size_t(body - the_case.bodies.begin()), name.substr(at + 1));
}

struct AxisPoints {
  std::size_t body;
  std::map<std::string, Eigen::Vector3d> places;
};

/// In the order in which the file names the bodies.
std::vector<AxisPoints> axis_points(const std::filesystem::path& file, const TrackCase& the_case) {
  std::vector<AxisPoints> all;
  for (const case_registration::PlanPoint& point : case_registration::read_landmarks(file)) {
    const auto named = axis_named(point.name, the_case);
    if (!named || (named->second != "origin" && named->second != "x" && named->second != "z"))
      throw BadInput(Reason::bad_value,
                     fmt::format("{}: the point \"{}\" is none of BODY_origin, BODY_z and BODY_x of a body "
                                 "of the case",
                                 file.filename().string(), point.name));
    auto of = std::ranges::find(all, named->first, &AxisPoints::body);
    if (of == all.end()) of = all.insert(all.end(), {named->first, {}});
    of->places[named->second] = point.in_model;
  }
  return all;
}

std::vector<BodyAxes> axes_by_points(const std::filesystem::path& file, const TrackCase& the_case) {
  constexpr double least_mm = 1;
  const std::string origin = file.filename().string();
  std::vector<BodyAxes> made;
  for (const AxisPoints& of : axis_points(file, the_case)) {
    const std::string& name = the_case.bodies[of.body].name;
    for (const char* point : {"origin", "z", "x"})
      if (!of.places.contains(point))
        throw BadInput(Reason::bad_value,
                       fmt::format("{}: the point \"{}_{}\" is missing", origin, name, point));
    const Eigen::Vector3d& at = of.places.at("origin");
    const Eigen::Vector3d up = of.places.at("z") - at, z = up.normalized();
    const Eigen::Vector3d side = (of.places.at("x") - at) - z * z.dot(of.places.at("x") - at);
    if (!(up.norm() > least_mm) || !(side.norm() > least_mm))
      throw BadInput(Reason::bad_value,
                     fmt::format("{}: \"{}\": its points are on one line: they are to span {:g} mm", origin,
                                 name, least_mm));
    const Eigen::Vector3d x = side.normalized();
    Eigen::Matrix3d axes;
    axes << x, z.cross(x), z;
    made.push_back({of.body, axes, at});
  }
  return made;
}

}  // namespace

void check_body_axes(const std::vector<BodyAxes>& axes, const TrackCase& the_case,
                     const std::string& origin) {
  constexpr double tolerance = 1e-3;
  for (const BodyAxes& of : axes) {
    const double off = (of.axes.transpose() * of.axes - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
    if (!(off < tolerance))
      throw BadInput(Reason::bad_value,
                     fmt::format("{}: the axes of \"{}\" are no perpendicular unit vectors: they are off by "
                                 "{:.2g}, limit {:g}",
                                 origin, the_case.bodies[of.body].name, off, tolerance));
    if (of.axes.determinant() < 0)
      throw BadInput(Reason::bad_value,
                     fmt::format("{}: the axes of \"{}\" are left-handed: z is the cross product of x and y",
                                 origin, the_case.bodies[of.body].name));
  }
  if (axes.size() < 2)
    throw BadInput(Reason::bad_value,
                   fmt::format("{}: axes of {} body, a joint has two", origin, axes.size()));
}

Expected<std::vector<BodyAxes>> read_body_axes(const std::filesystem::path& file, const TrackCase& the_case) {
  return guarded([&] {
    const std::string origin = file.filename().string();
    if (file.extension() != ".csv") {
      std::vector<BodyAxes> made = axes_by_points(file, the_case);
      check_body_axes(made, the_case, origin);
      return made;
    }
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
      if (column == std::ssize(axis_names))
        refuse(fmt::format("axis \"{}\" is none of x, y, z, origin", axis));
      const auto b = std::size_t(body - the_case.bodies.begin());
      if (seen[b] & (1 << column)) refuse(fmt::format("axis {} of \"{}\" is given twice", axis, name));
      if (seen[b] == 0) all.push_back({b, Eigen::Matrix3d::Zero()});
      seen[b] |= 1 << column;
      const auto of = std::ranges::find(all, b, &BodyAxes::body);
      const Eigen::Vector3d value(table.number(row, "x"), table.number(row, "y"), table.number(row, "z"));
      if (column == 3)
        of->origin = value;
      else
        of->axes.col(column) = value;
    }
    for (const auto& [body, axes] : seen)
      if ((axes & 7) != 7)
        refuse(fmt::format("axes of \"{}\" are missing: x, y and z", the_case.bodies[body].name));
    check_body_axes(all, the_case, origin);
    return all;
  });
}

std::optional<JointAngles> joint_angles(const TrackedBody& reference, const BodyAxes& reference_axes,
                                        const TrackedBody& body, const BodyAxes& axes) {
  constexpr double step = 1e-5;  // rad, mm
  if (!reference.pose || !body.pose) return std::nullopt;
  const Pose6 none = Pose6::Zero();
  const auto at = joint_of(axes_now(reference, reference_axes, none), axes_now(body, axes, none));
  if (!at) return std::nullopt;
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  for (const bool is_body : {false, true}) {
    const auto moved = [&](const Pose6& off) {
      return joint_of(axes_now(reference, reference_axes, is_body ? none : off),
                      axes_now(body, axes, is_body ? off : none));
    };
    Eigen::Matrix<double, 6, 6> slope;
    for (int k = 0; k < 6; ++k) {
      const auto above = moved(step * Pose6::Unit(k)), below = moved(-step * Pose6::Unit(k));
      if (!above || !below) return std::nullopt;
      slope.col(k) = (*above - *below) / (2 * step);
      for (int i = 0; i < 3; ++i)
        slope(i, k) = std::remainder((*above)[i] - (*below)[i], 2 * EIGEN_PI) / (2 * step);
    }
    covariance += slope * (is_body ? body : reference).pose->covariance * slope.transpose();
  }
  JointAngles made{at->head<3>(), covariance.topLeftCorner<3, 3>()};
  if (reference_axes.origin && axes.origin)
    made.shift = at->tail<3>(), made.shift_covariance = covariance.bottomRightCorner<3, 3>();
  return made;
}

}  // namespace helicarm::track
