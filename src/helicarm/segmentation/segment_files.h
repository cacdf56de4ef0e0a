// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "helicarm/core/json.h"
#include "helicarm/segmentation/segment.h"

namespace helicarm::segmentation {

/// What is asked for: bones at seeds, or of a label map.
struct SegmentRequest {
  std::filesystem::path ct;
  std::vector<Seed> seeds = {};
  SegmentOptions options = {};
  std::optional<std::filesystem::path> label_map = {};
  std::map<std::string, std::vector<int>> labels = {};  ///< of the map; empty: it has only one
  std::optional<Eigen::Vector3d> voxel_mm = {};         ///< of TIFF stacks
  double tiff_offset_hu = 0;
};

struct SegmentAnswer {
  std::string ct_name;
  std::vector<std::filesystem::path> inputs;
  volume::Volume ct;
  Segmentation segmentation;
  SegmentOptions options;
  bool of_label_map = false;
  double seconds = 0;
};

/// Reads the volumes and finds the bones. Fails as `read_volume`, `tiff_stack`, `segment` and
/// `segmentation_from`; usage: seeds and a label map, or neither.
Expected<SegmentAnswer> answer(const SegmentRequest& request, const pipeline::Progress& progress = {});

/// segment.json (docs/formats.md); `areas_cm2` of the bones, once their surfaces are made.
Json to_json(const SegmentAnswer& answer, const std::vector<double>& areas_cm2);
Json refused_json(const Failure& refusal);

/// Writes NAME.nrrd and NAME.stl of each bone, segment.png and segment.json, if a folder is given. Returns
/// the content of segment.json. Refuses (name_clash) to replace a file that was read.
Expected<Json> write_segmentation(const SegmentAnswer& answer,
                                  const std::optional<std::filesystem::path>& folder,
                                  const pipeline::Progress& progress = {});

/// Removes what `write_segmentation` wrote into the folder earlier; what the request reads stays.
void forget_segmentation(const std::filesystem::path& folder, const SegmentRequest& request);

}  // namespace helicarm::segmentation
