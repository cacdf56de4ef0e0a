// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "helicarm/case_registration/register_case.h"
#include "helicarm/core/json.h"
#include "helicarm/devices/robot/plan_approach.h"
#include "helicarm/devices/tracker/check_point.h"
#include "helicarm/devices/tracker/facets.h"
#include "helicarm/devices/tracker/tracker_source.h"
#include "helicarm/guidance/poses.h"
#include "helicarm/pipeline/case.h"
#include "helicarm/pipeline/result.h"

namespace helicarm::operation {

/// A calibrated pointer (`tracker pivot`).
struct Pointer {
  std::string name;
  Eigen::Vector3d tip_in_pointer;  ///< mm
};

/// A divot in a bone, touched before the first X-ray image and again before the robot moves: detects a
/// displaced marker and exchanged markers.
struct PlannedCheck {
  std::string name;
  guidance::Bone bone;
  double limit_mm = tracker::CheckPoint{}.limit_mm;
};

/// Address of the tracker and its names for the markers.
struct TrackerPlan {
  std::string address = "127.0.0.1";
  std::uint16_t port = 18944;
  double rate_hz = 60;  ///< requested from the tracker
  std::map<guidance::Bone, std::string> markers = {{"femur", "femur"}, {"tibia", "tibia"}};  ///< of the bones
  std::string tool = "tool";
  std::vector<tracker::Facet> facets;  ///< of the calibrator; a single marker is one facet
  /// Definitions (.rom) of the passive tools of an NDI tracker, by the markers' names; in the plan's folder.
  std::map<std::string, std::filesystem::path> definitions = {};
  std::optional<Pointer> pointer;
  double sigma_mm = 0.12;  ///< error of a pose averaged over 1 s, per axis
  double sigma_deg = 0.05;

  /// Greatest age of a pose that guides a robot or a drill, s: three frames may be lost, and a busy machine
  /// may be 0.1 s late. Not above 0.25 s, in which an approach at 10 mm/s covers 2.5 mm.
  double oldest_pose_s() const { return std::min(0.25, 0.1 + 3 / rate_hz); }

  /// Of every reading, with the largest error of a facet's mount: it acts as one of the calibrator's reading.
  guidance::TrackerNoise noise() const;

  const std::string& marker_of(const guidance::Bone& bone) const { return markers.at(bone); }
};

struct RobotPlan {
  std::string model = "UR5";
  std::string address = "127.0.0.1";
  std::uint16_t rtde_port = 30004;
  std::uint16_t dashboard_port = 29999;
  std::uint16_t script_port = 30002;
  robot::RobotTool tool;
  robot::ApproachOptions approach;
};

/// A tracked drill in a person's hand, instead of a robot: two points of its axis in the frame of its marker,
/// each by pivoting (a long and a short bit) or touched by the pointer.
struct HandDrill {
  Eigen::Vector3d tip_in_tool;   ///< mm
  Eigen::Vector3d back_in_tool;  ///< mm, at least 20 mm behind the tip
  double sigma_mm = 0.2;         ///< of each point, per axis
  double tolerance_mm = 1;       ///< of the tip's distance from the tunnel's axis
  double tolerance_deg = 2;      ///< of the angle between drill and axis
};

using pipeline::TunnelEnd;

struct OperationTunnel {
  std::string name;
  guidance::Bone bone;
  std::string start;  ///< names of picks, or of points of the model's plan
  std::string end;
  TunnelEnd enter_at = TunnelEnd::start;  ///< where the drill enters
  /// Of a model's plan; `start` and `end` are then the ends of its line.
  std::optional<pipeline::ModelLine> of_model = {};
};

/// Where the search for a model of the plan begins.
struct ModelStart {
  std::string model;
  geometry::RigidTransform world_from_model;
};

/// Limits beyond which an order is not carried out or is stopped (plan_stale).
struct PlanLimits {
  double distance_mm = 1;  ///< motion of bone, robot base or tool since planning
  double turn_deg = 1;
  double age_s = 60;  ///< from planning until the order is sent
};

/// Settings of an operation (plan.json, docs/formats.md).
struct OperationPlan {
  std::string calibrator = "udcsc";  ///< name of a built-in, or a file by its path from `folder`
  std::optional<std::string> plate = "plate48";
  std::vector<std::string> views{"AP", "LAT"};  ///< in order of acquisition
  std::vector<guidance::Bone> bones = guidance::knee_bones();
  TrackerPlan tracker;
  RobotPlan robot;
  std::optional<HandDrill> drill;  ///< if given, no robot is used
  std::vector<OperationTunnel> tunnels;
  std::vector<PlannedCheck> check_points;
  std::vector<pipeline::Pick> picks;  ///< may be set after the acquisition
  double max_error_mm = 2;            ///< limit of a point's 95 % error for robot motion: there is always one
  /// The other options of the measurement and of the models' registration; `threads` and `cache` are not in
  /// the file.
  case_registration::RegisterOptions measuring = {};
  PlanLimits limits;
  std::vector<pipeline::CaseModel> models = {};  ///< registered after the measurement
  std::filesystem::path folder = {};             ///< of the plan's files
};

/// Of the plan's tracker, the definitions of its tools in the plan's folder.
tracker::TrackerAddress tracker_address(const OperationPlan& plan);

/// Of the plan's measurements, with its limit.
case_registration::RegisterOptions measuring_options(const OperationPlan& plan);

/// Strict; fails as JsonReader and `picks_of`, and with name_clash for two tunnels of one name and for two
/// bodies with one marker.
/// `folder`: of the models' files; that of `origin` unless given.
Expected<OperationPlan> plan_from(const Json& json, const std::string& origin,
                                  const std::filesystem::path& folder = {});
Json to_json(const OperationPlan& plan);
/// JSON Schema of plan.json.
Json plan_schema();

/// Picks in the plan's views, as case.json's. Fails as `picks_from`.
Expected<std::vector<pipeline::Pick>> picks_of(const OperationPlan& plan, const Json& picks,
                                               const std::string& origin);

}  // namespace helicarm::operation
