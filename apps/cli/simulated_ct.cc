// SPDX-License-Identifier: Apache-2.0
#include "simulated_ct.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <fmt/format.h>

#include "command_line.h"
#include "helicarm/volume/hounsfield.h"
#include "helicarm/volume/read_volume.h"

namespace helicarm::cli {
namespace {

Eigen::Vector3d three(const std::vector<double>& numbers, const char* option) {
  if (numbers.size() != 3) throw BadInput(Reason::usage, fmt::format("{} takes three numbers", option));
  return Eigen::Vector3d::Map(numbers.data());
}

void check_inside(const volume::Volume& volume, const Eigen::Vector3d& centre) {
  const Eigen::Vector3d last = (volume.size.cast<double>().array() - 1).matrix();
  const Eigen::Array3d voxel = (volume.patient_from_voxel.inverse() * centre).array();
  if ((voxel >= -0.5).all() && (voxel <= last.array() + 0.5).all()) return;
  const Eigen::AlignedBox3d block =
      Eigen::AlignedBox3d(Eigen::Vector3d::Zero(), last).transformed(volume.patient_from_voxel);
  throw BadInput(
      Reason::bad_value,
      fmt::format("--ct-centre: {:g},{:g},{:g} lies outside the CT, which extends from {:g},{:g},{:g} to "
                  "{:g},{:g},{:g} mm",
                  centre.x(), centre.y(), centre.z(), block.min().x(), block.min().y(), block.min().z(),
                  block.max().x(), block.max().y(), block.max().z()));
}

}  // namespace

std::shared_ptr<const simulation::CtOptions> ct_from(const CtArguments& arguments, const Console& console) {
  if (arguments.path.empty()) {
    if (!arguments.centre_mm.empty() || !arguments.turn_deg.empty())
      throw BadInput(Reason::usage, "--ct-centre and --ct-turn require --ct");
    return nullptr;
  }
  simulation::CtOptions ct;
  ct.volume = value_or_throw(volume::read_volume(arguments.path));
  const std::filesystem::path whole = std::filesystem::absolute(arguments.path).lexically_normal();
  ct.name = (whole.has_filename() ? whole : whole.parent_path()).filename().string();
  for (Warning& warning : value_or_throw(volume::check_hounsfield(ct.volume, ct.name)))
    ct.volume.warnings.push_back(std::move(warning));
  for (const Warning& warning : ct.volume.warnings)
    console.progress << fmt::format("helicarm: {}: {}\n", code(warning.reason), warning.message);
  if (!arguments.centre_mm.empty()) {
    ct.centre = three(arguments.centre_mm, "--ct-centre");
    check_inside(ct.volume, *ct.centre);
  }
  if (!arguments.turn_deg.empty()) ct.turn_deg = three(arguments.turn_deg, "--ct-turn");
  return std::make_shared<simulation::CtOptions>(std::move(ct));
}

void add_ct(CLI::App& command, CtArguments& a) {
  command.add_option("--ct", a.path,
                     "A CT instead of the synthetic knee: MHA, NRRD, NIfTI or a folder of DICOM slices");
  command
      .add_option("--ct-centre", a.centre_mm,
                  "x,y,z (L, P, S; mm) of the CT at the knee's origin; default: its centre")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->check(within(-1e5, 1e5));
  command
      .add_option("--ct-turn", a.turn_deg,
                  "x,y,z: rotation of the CT about the knee's distal, lateral and anterior axis, degrees")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->check(within(-360, 360));
}

}  // namespace helicarm::cli
