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
      throw BadInput(Reason::unsupported, fmt::format("{}: dim[{}] is {}, must be 1 (one volume per file)",
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
  switch (header.at<std::uint8_t>(123) & 7) {
    case 1:
      return 1000;
    case 3:
      return 1e-3;
    default:  // mm, or unit not given
      return 1;
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

/// The file's world frame is R, A, S.
Eigen::Affine3d place_of(const NiftiHeader& header, std::vector<Warning>& warnings) {
  Eigen::Affine3d place = Eigen::Affine3d::Identity();
  const bool has_sform = header.at<std::int16_t>(254) > 0, has_qform = header.at<std::int16_t>(252) > 0;
  if (has_sform && has_qform &&
      sform_of(header).linear().determinant() * qform_of(header).linear().determinant() < 0)
    throw BadInput(Reason::bad_value,
                   header.origin +
                       ": sform and qform differ in handedness: one of them exchanges left and right; "
                       "set the code of the wrong one to 0");
  if (has_sform) {
    place = sform_of(header);
  } else if (has_qform) {
    place = qform_of(header);
  } else {
    place.linear() = spacing_of(header).asDiagonal();
    warnings.push_back({Reason::spacing_missing,
                        header.origin + ": neither sform nor qform: the patient's orientation is unknown"});
  }
  return Vector3d(-1, -1, 1).asDiagonal() * (Eigen::Scaling(millimetres(header)) * place);
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
  volume.patient_from_voxel = place_of(header, volume.warnings);
  const VoxelFormat format = format_of(header);
  const double start = header.real(108, "vox_offset");
  if (!(start >= header_bytes && start <= 1e6 && start == std::floor(start)))
    throw BadInput(Reason::bad_value,
                   fmt::format("{}: vox_offset is {}, must be {} to 1e6", origin, start, header_bytes));
  const auto offset = static_cast<std::size_t>(start);
  std::string unpacked;
  std::string_view all = bytes;
  if (packed) all = unpacked = inflate(bytes, offset + count * format.bytes(), origin);
  volume.voxels = decode_voxels(all.substr(std::min(offset, all.size())), count, format, origin);
  const auto slope = static_cast<float>(header.real(112, "scl_slope"));
  const auto intercept = static_cast<float>(header.real(116, "scl_inter"));
  if (slope != 0)
    for (float& voxel : volume.voxels) voxel = voxel * slope + intercept;
  return volume;
}

}  // namespace helicarm::volume
