// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QFlags>
#include <array>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "gui/scene/tre_slice.h"
#include "helicarm/case_registration/register_case.h"
#include "helicarm/devices/robot/kinematics.h"
#include "helicarm/phantom/calibrator.h"
#include "helicarm/phantom/mesh.h"
#include "helicarm/pipeline/result.h"

/// The displayed parts of an operation as plain values in the calibrator's frame, mm.
namespace helicarm::gui {

struct Segment {
  Eigen::Vector3d from;
  Eigen::Vector3d to;
};

/// Confidence region of a point.
struct Ellipsoid {
  Eigen::Vector3d centre;
  Eigen::Matrix3d axes;   ///< columns, a proper rotation
  Eigen::Vector3d radii;  ///< mm, along the columns
};

/// The 95 % quantile of chi-square with three degrees of freedom.
inline constexpr double chi2_95 = 7.815;

/// A covariance that is not known gives a point.
Ellipsoid ellipsoid_95(const Eigen::Vector3d& centre, const Eigen::Matrix3d& covariance);

/// A calibrated view: source, edge of the image and central ray.
struct ViewShape {
  std::string name;
  geometry::View view;
  Eigen::Vector2d size_px;
  std::array<Eigen::Vector3d, 4> detector;  ///< corners in order around the image
  Segment central_ray;                      ///< from the source to the detector
};

struct PointShape {
  std::string name;
  localization::PointSource source;
  std::optional<guidance::Bone> moves_with;
  Ellipsoid error;            ///< about its position
  std::vector<Segment> rays;  ///< from the sources to the detectors
};

struct TunnelShape {
  std::string name;
  std::optional<guidance::Bone> moves_with;
  Segment axis;
  double radius_mm = 4;
  bool is_breach = false, is_thin = false;  ///< of a plan, against the bone
};

/// `depth_mm`: of the drawn image from the source, along the central ray.
ViewShape view_shape(const std::string& name, const geometry::View& view, const Eigen::Vector2d& size_px,
                     double depth_mm);

/// The displayed parts of a result; missing ones are absent.
struct ResultScene {
  std::vector<phantom::CalibratorBall> balls;
  std::optional<phantom::TriangleMesh> body;  ///< of the calibrator, if its balls lie on a cone
  std::vector<ViewShape> views;
  std::vector<PointShape> points;
  std::vector<TunnelShape> tunnels;
};

ResultScene scene_of(const pipeline::Result& result, const phantom::Calibrator& calibrator);

/// A model of the case at its registered pose, or at one tried by hand.
struct ModelShape {
  enum class State { registered, refused, by_hand, not_registered, out_of_date };

  std::string name;
  State state = State::registered;
  Colour colour{};
  std::shared_ptr<const registration::Model> model;
  geometry::RigidTransform calibrator_from_model;
  std::optional<guidance::Bone> moves_with;
  std::vector<PointShape> points;  ///< of its plan; only of a registered one
  std::vector<TunnelShape> tunnels;
};

/// `by_hand`: the pose that is tried instead of the registered one. Nothing for a model without a volume or
/// surface whose registration is refused or, of any model, before it has a pose.
std::optional<ModelShape> shape_of(const case_registration::RegisteredModel& model,
                                   const std::optional<geometry::RigidTransform>& by_hand,
                                   const Colour& colour);

/// What is shown or hidden together.
enum class ScenePart { calibrator = 1, rays = 2, points = 4, models = 8, bones = 16, robot = 32 };
Q_DECLARE_FLAGS(SceneParts, ScenePart)
Q_DECLARE_OPERATORS_FOR_FLAGS(SceneParts)
inline constexpr SceneParts all_parts{ScenePart::calibrator | ScenePart::rays | ScenePart::points |
                                      ScenePart::models | ScenePart::bones | ScenePart::robot};

/// How opaque the parts are drawn, 0 to 1; large ellipsoids are drawn less opaque.
struct SceneOpacity {
  double calibrator = 0.16;  ///< its body
  double points = 1;         ///< and tunnels
  double models = 0.45;      ///< those not named
  double bones = 0.38;
  double robot = 1;
  std::map<std::string, double> model = {};

  double of_model(const std::string& name) const {
    const auto own = model.find(name);
    return own == model.end() ? models : own->second;
  }
};

/// The scene of these parts; the camera still looks at all of it.
ResultScene only(SceneParts parts, ResultScene scene);

/// How many times ellipsoids are drawn enlarged, at most `largest`: no radius above 20 mm is enlarged to.
double error_scale_of(const ResultScene& scene, double largest);

/// With the points and tunnels of the models' plans.
ResultScene with_plans(ResultScene scene, const std::vector<ModelShape>& models);

/// The outer wall of the cone that carries the balls; empty if they do not lie on a cone.
std::optional<phantom::TriangleMesh> cone_of(const phantom::Calibrator& calibrator);

/// The moving parts. Absent: unknown at present and not drawn.
struct LiveScene {
  std::optional<geometry::RigidTransform> calibrator_from_tip;     ///< z along the tool, out of its tip
  std::map<guidance::Bone, geometry::RigidTransform> bones_moved;  ///< since the acquisition
  std::map<guidance::Bone, geometry::RigidTransform> calibrator_from_bone_marker;  ///< now
  std::optional<geometry::RigidTransform> calibrator_from_base;
  std::string robot_model = "UR5";
  std::optional<robot::Joints> joints;
  std::vector<Eigen::Vector3d> path;  ///< of the tool's tip
};

/// A link as drawn: a tube, and at its end a ball of `joint_radius_mm`.
struct DrawnLink {
  Segment axis;
  double radius_mm, joint_radius_mm;
};

/// The links of the arm and its foot; empty as `robot_links`.
std::vector<DrawnLink> drawn_links(const LiveScene& live);

/// A bone that has moved since the acquisition: the middle of its points now, and how far it has moved, mm.
struct MovedBone {
  Eigen::Vector3d place;
  double moved_mm;
};
/// Nothing for a motion below 0.5 mm, the tracker's noise, and without points that move with the bone.
std::optional<MovedBone> moved_bone(const ResultScene& scene, const guidance::Bone& bone,
                                    const geometry::RigidTransform& motion);

/// The links of the arm from the base to the flange; empty if base, joints or model are unknown.
std::vector<Segment> robot_links(const LiveScene& live);

}  // namespace helicarm::gui
