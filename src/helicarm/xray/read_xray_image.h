// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "helicarm/xray/sidecar.h"
#include "helicarm/xray/xray_image.h"

namespace helicarm::xray {

/// Limit for an image file.
inline constexpr std::uintmax_t max_image_file_bytes = 256u << 20;

/// Reads a DICOM, PNG, TIFF, JPEG or BMP X-ray image, or a frame of a film (`Film`); the format is detected
/// by content. `frame` is 1-based and needed only if the file has several. `pixel_mm` and
/// `source_detector_mm` may stand in a sidecar
/// (`sidecar_of`), either as null; what the file itself states must agree with it. Without a pixel size the
/// image has the warning spacing_missing, of a JPEG file or a film compressed with loss lossy_image. Pixels
/// stay as stored, neither flipped nor rotated. Failures name file and view; codes: missing_file,
/// not_an_image, truncated, bad_size, bad_value, unsupported, and those of the sidecar's JSON. Thread-safe.
Expected<XrayImage> read_xray_image(const std::filesystem::path& path, const std::string& view_name,
                                    std::optional<int> frame);

/// An image that is no view of a case: named by its file. Failures name the file in their message alone.
Expected<XrayImage> read_xray_image(const std::filesystem::path& path, std::optional<int> frame);

/// Frames or pages of an image file; fails as `read_xray_image`.
Expected<int> count_frames(const std::filesystem::path& path);

}  // namespace helicarm::xray
