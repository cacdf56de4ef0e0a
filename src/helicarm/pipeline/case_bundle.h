// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "helicarm/core/json.h"
#include "helicarm/pipeline/result.h"
#include "helicarm/pipeline/tar_gz.h"

namespace helicarm::pipeline {

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
/// with their files and start, notes, names of files and dates left out. Text within the images' pixels
/// stays. `log.txt` states what was read and measured. The same case gives the same bytes. Fails as
/// `read_case`; an image that cannot be read is left out.
Expected<CaseBundle> bundle_case(const std::filesystem::path& path, const BundleOptions& options);

/// The result with numbers, booleans and the texts that `known` holds; any other text is replaced.
Json without_texts(const Json& result, const std::map<std::string, std::string>& known);

}  // namespace helicarm::pipeline
