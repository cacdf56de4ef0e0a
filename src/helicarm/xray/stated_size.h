// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>

#include <Eigen/Core>

namespace helicarm::xray {

/// Columns and rows as the header of a PNG, TIFF (first page) or DICOM file states them; its pixels are not
/// decoded. Nothing for other files, and for damaged ones, whose reader says why.
std::optional<Eigen::Vector2i> stated_size(const std::filesystem::path& path);

}  // namespace helicarm::xray
