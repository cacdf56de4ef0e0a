// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "helicarm/core/json.h"
#include "helicarm/pipeline/result.h"
#include "helicarm/pipeline/tar_gz.h"

namespace helicarm::pipeline {

/// What of case.json and its views is packed, and what is left out as it may name a person or a file, or has
/// no meaning without what is left out. Together they are all keys.
inline constexpr std::array<std::string_view, 11> packed_keys{
    "format", "calibrator", "plate",     "bones",   "diameters_mm", "views",
    "picks",  "tunnels",    "poses_now", "tracker", "tool_lines"};
inline constexpr std::array<std::string_view, 6> unpacked_keys{"models", "notes",       "markers",
                                                               "bodies", "calibration", "frame_rate_hz"};
inline constexpr std::array<std::string_view, 11> packed_view_keys{
    "name",         "image", "frame",    "plate_image",        "map",
    "mirrored",     "poses", "pixel_mm", "source_detector_mm", "primary_deg",
    "secondary_deg"};
/// Of cases of a run or of given cameras, which are not measured.
inline constexpr std::array<std::string_view, 4> unpacked_view_keys{"camera", "calibration", "frames",
                                                                    "frame_offset"};

/// A case that may be sent to others.
struct CaseBundle {
  std::vector<ArchivedFile> files;
  std::vector<std::string> left_out;  ///< what is not packed, by its new name, and why
};

struct BundleOptions {
  RunOptions run = {};
  bool measure = true;              ///< add result.json of the bundled case
  std::optional<Json> result = {};  ///< the user's own result: added without its texts
};

/// The case with everything removed that may identify a person: of the images only pixels and geometry, as
/// DICOM; views, picks, tunnels, tool lines and bones numbered (V1, pick1, tunnel1, line1, bone1); models
/// with their files, start and tunnels, notes, names of files and dates left out. Text within the images'
/// pixels stays. `log.txt` states what was read and measured. The same case gives the same bytes. Fails as
/// `read_case`; an image that cannot be read is left out.
Expected<CaseBundle> bundle_case(const std::filesystem::path& path, const BundleOptions& options);

/// Refuses (name_clash) a file for the bundle that is one of its sources: case.json, a file that it names, or
/// that of the result (a file or its folder).
Expected<void> check_bundle_file(const std::filesystem::path& out, const std::filesystem::path& path,
                                 const std::optional<std::filesystem::path>& result);

/// The result with numbers, booleans and the texts that `known` holds; any other text is replaced.
Json without_texts(const Json& result, const std::map<std::string, std::string>& known);

}  // namespace helicarm::pipeline
