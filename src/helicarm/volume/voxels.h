// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "helicarm/core/text.h"
#include "helicarm/volume/volume.h"

namespace helicarm::volume {

/// Voxel type and byte order in a file.
struct VoxelFormat {
  enum class Kind { int8, uint8, int16, uint16, int32, uint32, int64, uint64, float32, float64 };
  Kind kind = Kind::int16;
  bool big_endian = false;

  std::size_t bytes() const;
};

/// `count` voxels from the start of `bytes`. Throws BadInput: truncated, not_finite.
std::vector<float> decode_voxels(std::string_view bytes, std::size_t count, const VoxelFormat& format,
                                 const std::string& origin);

/// The first `size` bytes of zlib or gzip data, which may have several members; memory is bounded by the
/// deflate ratio. `surplus` receives the number of bytes behind them, counted up to `most_surplus`; without
/// it decompression stops at `size`. Throws BadInput: truncated, bad_value (damaged), bad_size (above the
/// limit of an uncompressed file).
std::string inflate(std::string_view packed, std::size_t size, const std::string& origin,
                    std::size_t* surplus = nullptr);
inline constexpr std::size_t most_surplus = std::size_t{1} << 24;

/// The last `size` bytes of zlib or gzip data. Fails as `inflate`.
std::string inflate_end(std::string_view packed, std::size_t size, const std::string& origin);

/// Warns (surplus_data) of bytes behind the voxels, `needed` bytes. A line end there is not counted.
void warn_of_surplus(Volume& volume, std::size_t surplus, std::size_t needed, const std::string& origin);
void warn_of_surplus(Volume& volume, std::string_view behind, std::size_t needed, const std::string& origin);

/// By how much the distance of two slices may differ from the `usual_mm` of the others: positions are decimal
/// text. A missing slice is more than that however thin the slices are.
double uneven_mm(double usual_mm);

/// Throws BadInput (bad_value) unless all are positive: programs mirror the volume or not.
void check_spacings(const Eigen::Vector3d& spacings, const std::string& field);

/// 1 mm is assumed for voxels whose size is not stated.
Warning size_not_stated(const std::string& field);

/// Whether two lengths differ by more than the part of the larger.
bool differ(double a, double b, double part);

/// `count` finite numbers separated by blanks or `separators`. Throws BadInput: bad_value, not_finite.
std::vector<double> read_numbers(std::string_view text, std::size_t count, const std::string& origin,
                                 std::string_view separators = "");

/// Content of a volume file, or of the data file `name` beside `header` that the header names.
std::string read_volume_file(const std::filesystem::path& path);
std::string read_data_file(const std::filesystem::path& header, const std::string& name);

/// Removes the first line from `rest` and returns it without its line end.
std::string_view take_line(std::string_view& rest);

// Readers of the formats; all throw BadInput. `bytes` is the whole file.
Volume read_metaimage(const std::filesystem::path& path, std::string_view bytes);
Volume read_nrrd(const std::filesystem::path& path, std::string_view bytes);
Volume read_nifti(const std::filesystem::path& path, std::string_view bytes);
Volume read_ct_series(const std::filesystem::path& folder);
/// Segment numbers as voxels, in the slices that hold a segment; nothing for another file.
std::optional<Volume> read_segmentation(const std::filesystem::path& path, std::string_view bytes);

}  // namespace helicarm::volume
