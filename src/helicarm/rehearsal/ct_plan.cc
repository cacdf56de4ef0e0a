// SPDX-License-Identifier: Apache-2.0
#include "helicarm/rehearsal/ct_plan.h"

#include <algorithm>
#include <cstdint>
#include <numbers>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/core/json.h"
#include "helicarm/geometry/view_json.h"
#include "helicarm/simulation/knee.h"

namespace helicarm::rehearsal {
namespace {

using Eigen::Vector3d;
using geometry::RigidTransform;

constexpr double water_per_mm = 0.0206;  // at 60 keV
constexpr double into_joint_mm = 10;
const Eigen::Vector3i size(150, 100, 100);
const Vector3d first_in_knee(-95, -50, -50);  // of the voxels, which are 1 mm wide

Eigen::Matrix3d turned(double degrees, const Vector3d& axis) {
  return Eigen::AngleAxisd(degrees * std::numbers::pi / 180, axis.normalized()).toRotationMatrix();
}

/// The patient lies in the CT otherwise than on the table.
RigidTransform model_from_knee() { return {turned(25, {1, 2, -1}), {30, -60, 210}}; }

std::string nrrd(const char* type, const std::string& voxels) {
  const RigidTransform placed = model_from_knee();
  const auto list = [](const Vector3d& v) { return fmt::format("({},{},{})", v.x(), v.y(), v.z()); };
  return fmt::format(
             "NRRD0005\ntype: {}\ndimension: 3\nspace: left-posterior-superior\nsizes: {} {} {}\n"
             "space directions: {} {} {}\nspace origin: {}\nendian: little\nencoding: raw\n\n",
             type, size.x(), size.y(), size.z(), list(placed.rotation.col(0)), list(placed.rotation.col(1)),
             list(placed.rotation.col(2)), list(placed * first_in_knee)) +
         voxels;
}

bool holds(const simulation::Body& body, const Vector3d& point) {
  return std::ranges::any_of(body.solids, [&](const simulation::Solid& solid) {
    return simulation::signed_distance(solid, point) <= 0;
  });
}

/// Hounsfield units, and 1 for the femur, 2 for what moves with the tibia.
void write_ct(const std::filesystem::path& folder, bool wrong_bone) {
  const simulation::Scene knee = simulation::knee_body();
  std::string hu, femur, tibia;
  for (int z = 0; z < size.z(); ++z)
    for (int y = 0; y < size.y(); ++y)
      for (int x = 0; x < size.x(); ++x) {
        const Vector3d at = first_in_knee + Vector3d(x, y, z);
        double per_mm = 0;
        std::string bone;
        for (const simulation::Body& body : knee)
          if (holds(body, at)) {
            per_mm += body.attenuation[1];
            if (body.name != "skin") bone = body.name;
          }
        const auto value = static_cast<std::int16_t>(std::lround(1000 * (per_mm / water_per_mm - 1)));
        hu += static_cast<char>(value & 0xff);
        hu += static_cast<char>(value >> 8 & 0xff);
        femur += static_cast<char>(bone == "femur");
        tibia += static_cast<char>(!bone.empty() && bone != "femur");
      }
  value_or_throw(write_file(folder / "ct.nrrd", nrrd("int16", hu)));
  value_or_throw(write_file(folder / "femur.nrrd", nrrd("uint8", wrong_bone ? tibia : femur)));
  value_or_throw(write_file(folder / "tibia.nrrd", nrrd("uint8", tibia)));
}

Json line_of(const std::string& name, const Vector3d& start, const Vector3d& end) {
  Json points = Json::array();
  for (const Vector3d& at : {start, end}) points.push_back({{"position", geometry::json_list(at)}});
  return {{"type", "Line"}, {"name", name}, {"coordinateSystem", "LPS"}, {"controlPoints", points}};
}

}  // namespace

operation::OperationPlan with_ct_plan(operation::OperationPlan plan,
                                      const simulation::SimulatedCase& simulated,
                                      const std::filesystem::path& folder, const CtPlanOptions& options) {
  write_ct(folder, options.wrong_bone);
  const RigidTransform calibrator_from_model = *simulated.calibrator_from_knee * model_from_knee().inverse();
  const auto in_model = [&](const std::string& ball) -> Vector3d {
    return calibrator_from_model.inverse() *
           std::ranges::find(simulated.navigation->points, ball, &simulation::TunnelPoint::name)
               ->in_calibrator;
  };
  plan.folder = folder;
  plan.picks.clear();
  plan.tunnels.clear();
  for (const auto& [bone, start, end, enter] : {std::tuple{"femur", "FS", "FE", operation::TunnelEnd::end},
                                                {"tibia", "TS", "TE", operation::TunnelEnd::start}}) {
    // Into the joint, where the balls lie below the surface.
    const Vector3d from = in_model(start), to = in_model(end), along = (to - from).normalized();
    const bool starts_in_joint = enter == operation::TunnelEnd::end;
    const Json line = line_of(bone, starts_in_joint ? from - into_joint_mm * along : from,
                              starts_in_joint ? to : to + into_joint_mm * along);
    const std::filesystem::path lines = folder / fmt::format("{}.mrk.json", bone);
    value_or_throw(write_file(lines, to_text({{"markups", Json::array({line})}})));
    pipeline::CaseModel model;
    model.name = bone;
    model.volume = folder / "ct.nrrd";
    model.mask.file = folder / fmt::format("{}.nrrd", bone);
    model.moves_with = bone;
    model.scale_sigma = 0;
    model.plan = lines;
    // About the knee, which the CT's frame is far from.
    const RigidTransform off{turned(options.off_deg, {1, -1, 1}), Vector3d(1, -1, 1) * options.off_mm};
    model.world_from_model = *simulated.calibrator_from_knee * off * model_from_knee().inverse();
    plan.models.push_back(std::move(model));
    pipeline::ModelLine tunnel{bone, bone, bone, options.diameter_mm};
    tunnel.enter_at = enter;
    plan.tunnels.push_back(
        {bone, bone, fmt::format("{}_start", bone), fmt::format("{}_end", bone), enter, tunnel});
  }
  return plan;
}

}  // namespace helicarm::rehearsal
