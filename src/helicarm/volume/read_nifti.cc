// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "helicarm/volume/voxels.h"

namespace helicarm::volume {
namespace {

using Eigen::Vector3d;

constexpr std::size_t header_bytes = 348;

/// Header fields by offset, in the file's byte order.
struct NiftiHeader {
  std::string_view bytes;
  bool swap = false;
  std::string origin;

  template <class T>
  T at(std::size_t offset) const {
    char word[sizeof(T)];
    std::memcpy(word, bytes.data() + offset, sizeof word);
    if (swap) std::reverse(word, word + sizeof word);
    T value;
    std::memcpy(&value, word, sizeof word);
    return value;
  }
  double real(std::size_t offset, const char* name) const {
    const double value = at<float>(offset);
    if (!std::isfinite(value))
      throw BadInput(Reason::not_finite, fmt::format("{}: {} is {}", origin, name, value));
    return value;
  }
};

Vector3d size_of(const NiftiHeader& header) {
  const int dimensions = header.at<std::int16_t>(40);
  if (dimensions < 3 || dimensions > 7)
    throw BadInput(Reason::unsupported,
                   fmt::format("{}: dim[0] is {}, must be 3", header.origin, dimensions));
  for (int i = 4; i <= dimensions; ++i)
    if (const int more = header.at<std::int16_t>(40 + 2 * static_cast<std::size_t>(i)); more != 1)
      throw BadInput(Reason::unsupported,
                     fmt::format("{}: dim[{}] is {}, must be 1: a sequence of volumes; export one of them",
                                 header.origin, i, more));
  return Vector3d(header.at<std::int16_t>(42), header.at<std::int16_t>(44), header.at<std::int16_t>(46));
}

VoxelFormat format_of(const NiftiHeader& header) {
  using Kind = VoxelFormat::Kind;
  static const std::map<int, Kind> kinds = {
      {2, Kind::uint8},  {4, Kind::int16},    {8, Kind::int32},    {16, Kind::float32}, {64, Kind::float64},
      {256, Kind::int8}, {512, Kind::uint16}, {768, Kind::uint32}, {1024, Kind::int64}, {1280, Kind::uint64}};
  const auto found = kinds.find(header.at<std::int16_t>(70));
  if (found == kinds.end())
    throw BadInput(Reason::unsupported, fmt::format("{}: datatype is {}, must be a whole or real number",
                                                    header.origin, header.at<std::int16_t>(70)));
  return {found->second, header.swap};
}

double millimetres(const NiftiHeader& header) {
  switch (const int unit = header.at<std::uint8_t>(123) & 7) {
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
                      header.origin, unit));
  }
}

Eigen::Matrix3d rotation_of(const NiftiHeader& header) {
  const Vector3d v(header.real(256, "quatern_b"), header.real(260, "quatern_c"),
                   header.real(264, "quatern_d"));
  if (v.squaredNorm() > 1 + 1e-5)
    throw BadInput(Reason::bad_value,
                   fmt::format("{}: the quaternion's vector part has length {}, must be at most 1",
                               header.origin, v.norm()));
  const double w = std::sqrt(std::max(0.0, 1 - v.squaredNorm()));
  return Eigen::Quaterniond(w, v.x(), v.y(), v.z()).normalized().toRotationMatrix();
}

Vector3d spacing_of(const NiftiHeader& header) {
  return {header.real(80, "pixdim[1]"), header.real(84, "pixdim[2]"), header.real(88, "pixdim[3]")};
}

Eigen::Affine3d sform_of(const NiftiHeader& header) {
  Eigen::Affine3d place = Eigen::Affine3d::Identity();
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 4; ++column)
      place.matrix()(row, column) = header.real(
          280 + 16 * static_cast<std::size_t>(row) + 4 * static_cast<std::size_t>(column), "srow");
  return place;
}

Eigen::Affine3d qform_of(const NiftiHeader& header) {
  Eigen::Affine3d place = Eigen::Affine3d::Identity();
  const double side = header.real(76, "pixdim[0]") < 0 ? -1 : 1;
  place.linear() = rotation_of(header) * spacing_of(header).cwiseProduct(Vector3d(1, 1, side)).asDiagonal();
  place.translation() =
      Vector3d(header.real(268, "qoffset_x"), header.real(272, "qoffset_y"), header.real(276, "qoffset_z"));
  return place;
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
                                       header.origin, listed(columns), listed(stated));
  if (off > most) throw BadInput(Reason::bad_value, both + "; set sform_code to 0 or correct the wrong one");
  if (off > rounded || (stated.array() <= 0).any())
    warnings.push_back({Reason::irregular_file, both + ": the sform is used"});
}

/// Compares the places of the volume's corners by both forms.
void check_forms(const NiftiHeader& header, const Vector3d& size, std::vector<Warning>& warnings) {
  const Eigen::Affine3d sform = sform_of(header), qform = qform_of(header);
  if (sform.linear().determinant() * qform.linear().determinant() < 0)
    throw BadInput(Reason::bad_value,
                   header.origin +
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
  const int sform_code = header.at<std::int16_t>(254), qform_code = header.at<std::int16_t>(252);
  const std::string message =
      fmt::format("{}: sform (code {}) and qform (code {}) place the volume differently, by up to {:.4g} mm",
                  header.origin, sform_code, qform_code, millimetres(header) * apart);
  // Of an aligned or template sform and a scanner's qform programs use either.
  if (sform_code != 1 && qform_code == 1)
    throw BadInput(Reason::bad_value,
                   message + "; set the code of the one that your plan is not drawn in to 0");
  warnings.push_back({Reason::irregular_file, message + ": the sform is used"});
}

/// The file's world frame is R, A, S.
Eigen::Affine3d place_of(const NiftiHeader& header, const Vector3d& size, std::vector<Warning>& warnings) {
  Eigen::Affine3d place = Eigen::Affine3d::Identity();
  const bool has_sform = header.at<std::int16_t>(254) > 0, has_qform = header.at<std::int16_t>(252) > 0;
  if (!has_sform && (spacing_of(header).array() < 0).any())
    throw BadInput(Reason::bad_value,
                   fmt::format("{}: pixdim is {}, must be positive: programs mirror the volume or not; write "
                               "it again with its orientation in the sform",
                               header.origin, listed(spacing_of(header))));
  if (has_sform) {
    place = sform_of(header);
    value_or_throw(check_grid(Eigen::Scaling(millimetres(header)) * place, header.origin));
    check_spacing(header, place, warnings);
    if (has_qform && (spacing_of(header).array() > 0).all()) check_forms(header, size, warnings);
  } else if (has_qform) {
    place = qform_of(header);
  } else {
    place.linear() = spacing_of(header).asDiagonal();
    warnings.push_back({Reason::spacing_missing,
                        header.origin + ": neither sform nor qform: the patient's orientation is unknown"});
  }
  return Vector3d(-1, -1, 1).asDiagonal() * (Eigen::Scaling(millimetres(header)) * place);
}

/// scl_slope and scl_inter; 0 or no number for a slope: none, as nibabel has it.
void scale_voxels(Volume& volume, const NiftiHeader& header) {
  const float slope = header.at<float>(112);
  if (slope == 0 || !std::isfinite(slope)) return;
  const auto intercept = static_cast<float>(header.real(116, "scl_inter"));
  for (float& voxel : volume.voxels) voxel = voxel * slope + intercept;
}

}  // namespace

Volume read_nifti(const std::filesystem::path& path, std::string_view bytes) {
  const std::string origin = path.string();
  const bool packed = bytes.starts_with("\x1f\x8b");
  const std::string unpacked_header = packed ? inflate(bytes, header_bytes, origin) : "";
  const auto nifti_2 = [](std::string_view head) { return head.size() >= 8 && head.substr(4, 3) == "n+2"; };
  if (nifti_2(packed ? std::string_view(unpacked_header) : bytes))
    throw BadInput(Reason::unsupported, origin + ": is NIfTI-2; convert it to NIfTI-1");
  NiftiHeader header{packed ? std::string_view(unpacked_header) : bytes, false, origin};
  if (header.bytes.size() < header_bytes)
    throw BadInput(Reason::truncated,
                   fmt::format("{}: {} bytes, the header has {}", origin, header.bytes.size(), header_bytes));
  const std::string_view magic = header.bytes.substr(344, 4);
  if (magic == std::string_view("ni1\0", 4))
    throw BadInput(Reason::unsupported,
                   origin + ": header and voxels are in two files; convert them to one .nii");
  if (magic != std::string_view("n+1\0", 4))
    throw BadInput(Reason::not_an_image, origin + ": not a NIfTI-1 file");
  header.swap = header.at<std::int32_t>(0) != static_cast<std::int32_t>(header_bytes);
  if (header.at<std::int32_t>(0) != static_cast<std::int32_t>(header_bytes))
    throw BadInput(Reason::bad_value, fmt::format("{}: sizeof_hdr is not {}", origin, header_bytes));

  Volume volume;
  const Vector3d size = size_of(header);
  const std::size_t count = value_or_throw(voxel_count(size, origin + ": dim"));
  volume.size = size.cast<int>();
  volume.patient_from_voxel = place_of(header, size, volume.warnings);
  const VoxelFormat format = format_of(header);
  const double start = header.real(108, "vox_offset");
  if (!(start >= header_bytes && start <= 1e6 && start == std::floor(start)))
    throw BadInput(Reason::bad_value,
                   fmt::format("{}: vox_offset is {}, must be {} to 1e6", origin, start, header_bytes));
  const auto offset = static_cast<std::size_t>(start);
  const std::size_t needed = count * format.bytes();
  std::size_t surplus = 0;
  std::string unpacked;
  std::string_view all = bytes;
  if (packed) all = unpacked = inflate(bytes, offset + needed, origin, &surplus);
  all = all.substr(std::min(offset, all.size()));
  volume.voxels = decode_voxels(all, count, format, origin);
  if (packed)
    warn_of_surplus(volume, surplus, needed, origin);
  else
    warn_of_surplus(volume, all.substr(needed), needed, origin);
  scale_voxels(volume, header);
  return volume;
}

}  // namespace helicarm::volume
