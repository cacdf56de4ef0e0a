// SPDX-License-Identifier: Apache-2.0
#include "helicarm/volume/write_nrrd.h"

#include <fmt/format.h>

#include "helicarm/volume/gzip.h"

namespace helicarm::volume {
namespace {

std::string nrrd_vector(const Eigen::Vector3d& v) { return fmt::format("({},{},{})", v.x(), v.y(), v.z()); }

}  // namespace

std::string to_nrrd(const Eigen::Vector3i& size, const Eigen::Affine3d& patient_from_voxel,
                    std::span<const std::uint8_t> values) {
  const Eigen::Matrix3d step = patient_from_voxel.linear();
  // A mask packs to a hundredth at any level: the fastest.
  constexpr int fast = 1;
  return fmt::format(
             "NRRD0004\ntype: uint8\ndimension: 3\nspace: left-posterior-superior\nsizes: {} {} {}\n"
             "space directions: {} {} {}\nkinds: domain domain domain\nencoding: gzip\n"
             "space units: \"mm\" \"mm\" \"mm\"\nspace origin: {}\n\n",
             size.x(), size.y(), size.z(), nrrd_vector(step.col(0)), nrrd_vector(step.col(1)),
             nrrd_vector(step.col(2)), nrrd_vector(patient_from_voxel.translation())) +
         gzip({reinterpret_cast<const char*>(values.data()), values.size()}, fast);
}

}  // namespace helicarm::volume
