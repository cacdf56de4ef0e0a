// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <map>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "helicarm/volume/in_memory.h"
#include "helicarm/volume/nifti_header.h"
#include "helicarm/volume/read_volume.h"
#include "helicarm/volume/voxels.h"

namespace helicarm::volume {
namespace {

using Eigen::Vector3d;

/// Not yet bounded: NIfTI-2 has 64 bits for each side.
Vector3d size_of(const NiftiHeader& header) {
  const std::int64_t dimensions = header.whole(nifti::dim);
  if (dimensions < 3 || dimensions > 7)
    throw BadInput(Reason::unsupported,
                   fmt::format("{}: dim[0] is {}, must be 3", header.origin(), dimensions));
  for (std::size_t i = 4; i <= std::size_t(dimensions); ++i)
    if (const std::int64_t more = header.whole(nifti::dim, i); more != 1)
      throw BadInput(Reason::unsupported,
                     fmt::format("{}: dim[{}] is {}, must be 1: a sequence of volumes; export one of them",
                                 header.origin(), i, more));
  return {header.number(nifti::dim, 1), header.number(nifti::dim, 2), header.number(nifti::dim, 3)};
}

VoxelFormat format_of(const NiftiHeader& header) {
  using Kind = VoxelFormat::Kind;
  static const std::map<std::int64_t, Kind> kinds = {
      {2, Kind::uint8},  {4, Kind::int16},    {8, Kind::int32},    {16, Kind::float32}, {64, Kind::float64},
      {256, Kind::int8}, {512, Kind::uint16}, {768, Kind::uint32}, {1024, Kind::int64}, {1280, Kind::uint64}};
  const auto found = kinds.find(header.whole(nifti::datatype));
  if (found == kinds.end())
    throw BadInput(Reason::unsupported, fmt::format("{}: datatype is {}, must be a whole or real number",
                                                    header.origin(), header.whole(nifti::datatype)));
  return {found->second, header.swapped()};
}

double millimetres(const NiftiHeader& header) {
  switch (const std::int64_t unit = header.whole(nifti::xyzt_units) & 7) {
    case 1:
      return 1000;
    case 3:
      return 1e-3;
    case 0:  // not given
    case 2:
      return 1;
    default:
      throw BadInput(
          Reason::bad_value,
          fmt::format("{}: xyzt_units states the unit of length {}, must be 1 (m), 2 (mm) or 3 (um)",
                      header.origin(), unit));
  }
}

Eigen::Matrix3d rotation_of(const NiftiHeader& header) {
  const Vector3d v(header.finite(nifti::quatern_b), header.finite(nifti::quatern_c),
                   header.finite(nifti::quatern_d));
  if (v.squaredNorm() > 1 + 1e-5)
    throw BadInput(Reason::bad_value,
                   fmt::format("{}: the quaternion's vector part has length {}, must be at most 1",
                               header.origin(), v.norm()));
  const double w = std::sqrt(std::max(0.0, 1 - v.squaredNorm()));
  return Eigen::Quaterniond(w, v.x(), v.y(), v.z()).normalized().toRotationMatrix();
}

Vector3d spacing_of(const NiftiHeader& header) {
  return {header.finite(nifti::pixdim, 1), header.finite(nifti::pixdim, 2), header.finite(nifti::pixdim, 3)};
}

Eigen::Affine3d sform_of(const NiftiHeader& header) {
  Eigen::Affine3d patient_from_index = Eigen::Affine3d::Identity();
  const NiftiField* rows[] = {&nifti::srow_x, &nifti::srow_y, &nifti::srow_z};
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 4; ++column)
      patient_from_index.matrix()(row, column) = header.finite(*rows[row], std::size_t(column));
  return patient_from_index;
}

Eigen::Affine3d qform_of(const NiftiHeader& header) {
  Eigen::Affine3d patient_from_index = Eigen::Affine3d::Identity();
  const double side = header.finite(nifti::pixdim) < 0 ? -1 : 1;
  patient_from_index.linear() =
      rotation_of(header) * spacing_of(header).cwiseProduct(Vector3d(1, 1, side)).asDiagonal();
  patient_from_index.translation() = Vector3d(
      header.finite(nifti::qoffset_x), header.finite(nifti::qoffset_y), header.finite(nifti::qoffset_z));
  return patient_from_index;
}

std::string listed(const Vector3d& v) { return fmt::format("{:.6g} {:.6g} {:.6g}", v.x(), v.y(), v.z()); }

/// Compares the spacing of the sform with pixdim, which states it a second time.
void check_spacing(const NiftiHeader& header, const Eigen::Affine3d& sform, std::vector<Warning>& warnings) {
  constexpr double rounded = 1e-3, most = 0.01;
  const Vector3d columns = sform.linear().colwise().norm(), stated = spacing_of(header);
  double off = 0;
  for (Eigen::Index axis = 0; axis < 3; ++axis)
    if (stated[axis] != 0) off = std::max(off, std::abs(columns[axis] / std::abs(stated[axis]) - 1));
  const std::string both = fmt::format("{}: the sform's columns have lengths {}, but pixdim is {}",
                                       header.origin(), listed(columns), listed(stated));
  if (off > most) throw BadInput(Reason::bad_value, both + "; set sform_code to 0 or correct the wrong one");
  if (off > rounded || (stated.array() <= 0).any())
    warnings.push_back({Reason::irregular_file, both + ": the sform is used"});
}

/// Compares the places of the volume's corners by both forms.
void check_forms(const NiftiHeader& header, const Vector3d& size, std::vector<Warning>& warnings) {
  const Eigen::Affine3d sform = sform_of(header), qform = qform_of(header);
  if (sform.linear().determinant() * qform.linear().determinant() < 0)
    throw BadInput(Reason::bad_value,
                   header.origin() +
                       ": sform and qform differ in handedness: one of them exchanges left and right; "
                       "set the code of the wrong one to 0");
  double apart = 0, across = 0;
  for (int corner = 0; corner < 8; ++corner) {
    const Vector3d voxel = (size.array() - 1) * Eigen::Array3d(corner & 1, corner >> 1 & 1, corner >> 2);
    apart = std::max(apart, (sform * voxel - qform * voxel).norm());
    across = std::max(across, (sform * voxel - sform.translation()).norm());
  }
  // The qform's rotation is rounded: near half a turn to 5e-4.
  if (const double unit = millimetres(header); unit * apart <= 0.1 + 1e-3 * unit * across) return;
  const std::int64_t sform_code = header.whole(nifti::sform_code),
                     qform_code = header.whole(nifti::qform_code);
  const std::string message =
      fmt::format("{}: sform (code {}) and qform (code {}) place the volume differently, by up to {:.4g} mm",
                  header.origin(), sform_code, qform_code, millimetres(header) * apart);
  // Of an aligned or template sform and a scanner's qform programs use either.
  if (sform_code != 1 && qform_code == 1)
    throw BadInput(Reason::bad_value,
                   message + "; set the code of the one that your plan is not drawn in to 0");
  warnings.push_back({Reason::irregular_file, message + ": the sform is used"});
}

/// The file's world frame is R, A, S.
Eigen::Affine3d place_of(const NiftiHeader& header, const Vector3d& size, std::vector<Warning>& warnings) {
  Eigen::Affine3d patient_from_index = Eigen::Affine3d::Identity();
  const bool has_sform = header.whole(nifti::sform_code) > 0, has_qform = header.whole(nifti::qform_code) > 0;
  if (!has_sform && (spacing_of(header).array() < 0).any())
    throw BadInput(Reason::bad_value,
                   fmt::format("{}: pixdim is {}, must be positive: programs mirror the volume or not; write "
                               "it again with its orientation in the sform",
                               header.origin(), listed(spacing_of(header))));
  if (has_sform) {
    patient_from_index = sform_of(header);
    value_or_throw(check_grid(Eigen::Scaling(millimetres(header)) * patient_from_index, header.origin()));
    check_spacing(header, patient_from_index, warnings);
    if (has_qform && (spacing_of(header).array() > 0).all()) check_forms(header, size, warnings);
  } else if (has_qform) {
    patient_from_index = qform_of(header);
  } else {
    patient_from_index.linear() = spacing_of(header).asDiagonal();
    warnings.push_back({Reason::spacing_missing,
                        header.origin() + ": neither sform nor qform: the patient's orientation is unknown"});
  }
  return Vector3d(-1, -1, 1).asDiagonal() * (Eigen::Scaling(millimetres(header)) * patient_from_index);
}

/// scl_slope and scl_inter; 0 or no number for a slope: none, as nibabel has it.
void scale_voxels(Volume& volume, const NiftiHeader& header) {
  const double slope = header.number(nifti::scl_slope);
  if (slope == 0 || !std::isfinite(slope)) return;
  const double intercept = header.finite(nifti::scl_inter);
  for (float& voxel : volume.voxels) voxel = static_cast<float>(voxel * slope + intercept);
}

/// Where the voxels begin in their file.
std::size_t offset_of(const NiftiHeader& header) {
  const double least = header.is_pair() ? 0 : double(header.size()), most = 1e6;
  const double start = header.finite(nifti::vox_offset);
  if (!(start >= least && start <= most && start == std::floor(start)))
    throw BadInput(Reason::bad_value, fmt::format("{}: vox_offset is {}, must be {} to {:.0f}",
                                                  header.origin(), start, least, most));
  return static_cast<std::size_t>(start);
}

/// `file`: the whole file with the voxels, plain or packed by gzip.
Volume volume_of(const NiftiHeader& header, std::string_view file, const std::string& origin) {
  Volume volume;
  const Vector3d size = size_of(header);
  const std::size_t count = value_or_throw(voxel_count(size, header.origin() + ": dim"));
  volume.size = size.cast<int>();
  volume.patient_from_voxel = place_of(header, size, volume.warnings);
  const VoxelFormat format = format_of(header);
  const std::size_t offset = offset_of(header), needed = count * format.bytes();
  const bool packed = file.starts_with("\x1f\x8b");
  std::size_t surplus = 0;
  std::string unpacked;
  if (packed) file = unpacked = inflate(file, offset + needed, origin, &surplus);
  file = file.substr(std::min(offset, file.size()));
  volume.voxels = decode_voxels(file, count, format, origin);
  if (packed)
    warn_of_surplus(volume, surplus, needed, origin);
  else
    warn_of_surplus(volume, file.substr(needed), needed, origin);
  scale_voxels(volume, header);
  return volume;
}

}  // namespace

Volume read_nifti(const std::filesystem::path& path, std::string_view bytes) {
  const NiftiHeader header(bytes, path.string());
  if (!header.is_pair()) return volume_of(header, bytes, path.string());
  const auto voxels = value_or_throw(other_of_pair(path));
  if (!voxels)
    throw BadInput(Reason::bad_value,
                   path.string() +
                       ": is the header of a NIfTI pair, but its name does not end with .hdr or "
                       ".hdr.gz: rename it as the .img with its voxels");
  return volume_of(header, read_volume_file(*voxels), voxels->string());
}

Expected<Volume> volume_of_nifti(const std::string& bytes, const std::string& origin) {
  return guarded([&] {
    const NiftiHeader header(bytes, origin);
    if (header.is_pair())
      throw BadInput(Reason::unsupported, origin + ": is the header of a NIfTI pair, without its voxels");
    Volume volume = volume_of(header, bytes, origin);
    value_or_throw(check_read(volume, origin));
    return volume;
  });
}

}  // namespace helicarm::volume
