// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace helicarm::volume {

/// Whether the bytes begin with a header of NIfTI-1, NIfTI-2 or ANALYZE 7.5, by its magic or its size.
bool is_nifti_header(std::string_view bytes);

/// A field of the header: where and as what each version stores it.
struct NiftiField {
  enum class Type { uint8, int16, int32, int64, float32, float64 };
  struct Place {
    std::size_t offset;
    Type type;
  };
  const char* name;
  bool is_list;
  Place in_1, in_2;
};

/// Fields of a NIfTI header by name, in either version and byte order.
class NiftiHeader {
 public:
  /// Of a file, plain or packed by gzip. Throws BadInput: truncated, not_an_image (ANALYZE 7.5 too, which
  /// states no orientation), bad_value.
  NiftiHeader(std::string_view file, std::string origin);

  std::int64_t whole(const NiftiField& field, std::size_t index = 0) const;
  double number(const NiftiField& field, std::size_t index = 0) const;
  /// Throws BadInput (not_finite) that names the field.
  double finite(const NiftiField& field, std::size_t index = 0) const;

  bool swapped() const { return swap_; }
  /// Whether the voxels lie in a file of their own.
  bool is_pair() const { return pair_; }
  /// Of the header: 348 or 540.
  std::size_t size() const { return second_ ? 540 : 348; }
  const std::string& origin() const { return origin_; }

 private:
  template <class T>
  T stored(std::size_t offset) const;
  template <class Number>
  Number value(const NiftiField& field, std::size_t index) const;

  std::string bytes_, origin_;
  bool second_ = false, pair_ = false, swap_ = false;
};

/// Offsets of nifti1.h and nifti2.h (NIfTI Data Format Working Group).
namespace nifti {
using T = NiftiField::Type;
inline constexpr NiftiField sizeof_hdr{"sizeof_hdr", false, {0, T::int32}, {0, T::int32}};
inline constexpr NiftiField dim{"dim", true, {40, T::int16}, {16, T::int64}};
inline constexpr NiftiField datatype{"datatype", false, {70, T::int16}, {12, T::int16}};
inline constexpr NiftiField pixdim{"pixdim", true, {76, T::float32}, {104, T::float64}};
inline constexpr NiftiField vox_offset{"vox_offset", false, {108, T::float32}, {168, T::int64}};
inline constexpr NiftiField scl_slope{"scl_slope", false, {112, T::float32}, {176, T::float64}};
inline constexpr NiftiField scl_inter{"scl_inter", false, {116, T::float32}, {184, T::float64}};
inline constexpr NiftiField xyzt_units{"xyzt_units", false, {123, T::uint8}, {500, T::int32}};
inline constexpr NiftiField qform_code{"qform_code", false, {252, T::int16}, {344, T::int32}};
inline constexpr NiftiField sform_code{"sform_code", false, {254, T::int16}, {348, T::int32}};
inline constexpr NiftiField quatern_b{"quatern_b", false, {256, T::float32}, {352, T::float64}};
inline constexpr NiftiField quatern_c{"quatern_c", false, {260, T::float32}, {360, T::float64}};
inline constexpr NiftiField quatern_d{"quatern_d", false, {264, T::float32}, {368, T::float64}};
inline constexpr NiftiField qoffset_x{"qoffset_x", false, {268, T::float32}, {376, T::float64}};
inline constexpr NiftiField qoffset_y{"qoffset_y", false, {272, T::float32}, {384, T::float64}};
inline constexpr NiftiField qoffset_z{"qoffset_z", false, {276, T::float32}, {392, T::float64}};
inline constexpr NiftiField srow_x{"srow_x", true, {280, T::float32}, {400, T::float64}};
inline constexpr NiftiField srow_y{"srow_y", true, {296, T::float32}, {432, T::float64}};
inline constexpr NiftiField srow_z{"srow_z", true, {312, T::float32}, {464, T::float64}};
}  // namespace nifti

}  // namespace helicarm::volume
