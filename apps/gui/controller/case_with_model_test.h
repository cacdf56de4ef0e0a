// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "helicarm/core/files.h"
#include "helicarm/core/json.h"
#include "helicarm/simulation/ct_body.h"
#include "helicarm/simulation/write_case.h"

namespace helicarm::gui {

/// A CT, 1.2 mm voxels about the origin, of a lopsided bone with a marrow cavity in soft tissue.
inline volume::Volume bone_in_tissue() {
  volume::Volume volume;
  volume.size = {72, 64, 80};
  volume.patient_from_voxel = Eigen::Scaling(1.2) * Eigen::Translation3d(-36, -32, -40);
  const auto inside = [](const Eigen::Vector3d& at, const Eigen::Vector3d& c, const Eigen::Vector3d& r) {
    return (at - c).cwiseQuotient(r).squaredNorm() < 1;
  };
  for (int z = 0; z < 80; ++z)
    for (int y = 0; y < 64; ++y)
      for (int x = 0; x < 72; ++x) {
        const Eigen::Vector3d at(x, y, z);
        const bool marrow = inside(at, {34, 30, 38}, {5, 7, 30});
        const bool bone = inside(at, {34, 30, 38}, {9, 12, 35}) || inside(at, {46, 35, 18}, {15, 10, 11}) ||
                          inside(at, {24, 44, 60}, {13, 8, 7});
        const bool tissue = inside(at, {36, 32, 40}, {34, 30, 60});
        volume.voxels.push_back(marrow ? 100 : bone ? 1200 : tissue ? 30 : -1024);
      }
  return volume;
}

/// NRRD, 16 bits.
inline std::string to_nrrd(const volume::Volume& volume) {
  const Eigen::Vector3d first = volume.patient_from_voxel.translation();
  std::string bytes = fmt::format(
      "NRRD0004\ntype: short\ndimension: 3\nspace: left-posterior-superior\nsizes: {} {} {}\n"
      "space directions: ({},0,0) (0,{},0) (0,0,{})\nspace origin: ({},{},{})\nendian: little\n"
      "encoding: raw\n\n",
      volume.size.x(), volume.size.y(), volume.size.z(), volume.patient_from_voxel(0, 0),
      volume.patient_from_voxel(1, 1), volume.patient_from_voxel(2, 2), first.x(), first.y(), first.z());
  for (const float voxel : volume.voxels) {
    const auto value = std::uint16_t(std::int16_t(voxel));
    bytes += {char(value & 0xff), char(value >> 8)};
  }
  return bytes;
}

/// Writes a simulated case of that bone with its CT and a planned tunnel of 20 mm as the model "bone". The
/// start is 2 mm off. Returns calibrator_from_patient, the model's true pose.
inline geometry::RigidTransform write_case_with_model(const std::filesystem::path& folder) {
  simulation::CtOptions ct;
  ct.volume = bone_in_tissue();
  simulation::SimulationOptions options;
  options.kind = simulation::CaseKind::flat;
  options.size = 512;
  options.seed = 7;
  options.ct = std::make_shared<const simulation::CtOptions>(ct);
  const auto simulated = simulation::simulate_case(options).value();
  EXPECT_TRUE(simulation::write_case(folder, simulated));
  EXPECT_TRUE(write_file(folder / "ct.nrrd", to_nrrd(ct.volume)));
  const Json ends = {{{"label", "in"}, {"position", {0, 0, 10}}},
                     {{"label", "out"}, {"position", {0, 0, 30}}}};
  const Json line = {
      {"type", "Line"}, {"name", "tunnel"}, {"coordinateSystem", "LPS"}, {"controlPoints", ends}};
  EXPECT_TRUE(write_file(folder / "plan.mrk.json", to_text({{"markups", Json::array({line})}})));
  const geometry::RigidTransform truth = simulated.calibrator_from_ct.value();
  Json start = Json::array();
  for (int row = 0; row < 3; ++row) {
    const Eigen::RowVector3d turn = truth.rotation.row(row);
    start.push_back({turn.x(), turn.y(), turn.z(), truth.translation[row] + (row == 0 ? 2 : 0)});
  }
  start.push_back({0, 0, 0, 1});
  Json json = read_json(folder / "case.json").value();
  json["models"] = Json::array({{{"name", "bone"},
                                 {"volume", "ct.nrrd"},
                                 {"window_hu", {150, 3000}},
                                 {"plan", "plan.mrk.json"},
                                 {"start", {{"world_from_model", start}}}}});
  EXPECT_TRUE(write_file(folder / "case.json", to_text(json)));
  return truth;
}

}  // namespace helicarm::gui
