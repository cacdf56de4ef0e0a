// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "helicarm/pipeline/case.h"
#include "helicarm/rectification/round_field.h"
#include "helicarm/xray/sidecar.h"
#include "helicarm/xray/xray_image.h"

namespace helicarm::pipeline {

/// An image for a new case.
struct NewImage {
  std::filesystem::path file;
  std::optional<int> frame = {};  ///< 1-based
  std::string view = {};          ///< its name; empty: chosen by `name_views`
};

/// [VIEW=]FILE[:FRAME]. The name of an existing file is taken whole.
NewImage new_image_from(const std::string& word);

/// An image with what it shows.
struct InspectedImage : NewImage {
  xray::XrayImage xray_image;
  std::optional<rectification::RoundField> field;
};

/// Reads an image. Fails as `read_xray_image`; of a file with several frames, one must be chosen (`usage`).
Expected<InspectedImage> inspect_image(const NewImage& image);

/// Names the views without a name: AP and LAT by positioner angles that differ, else by the files' names.
void name_views(std::vector<InspectedImage>& images);

/// A decision on the plate.
struct PlateChoice {
  std::optional<std::string> plate;  ///< "plate48" or "none"; nothing: the images do not decide it
  std::string why;
};

/// By the lattice of dots and the field: "plate48" where every image shows it, "none" where no image shows a
/// lattice or the round field of an intensifier.
PlateChoice choose_plate(const std::vector<InspectedImage>& images);

struct NewCaseOptions {
  std::string calibrator;                                                ///< a built-in or a file
  std::optional<std::string> plate = {};                                 ///< a built-in, a file, or "none"
  std::vector<std::pair<std::string, std::filesystem::path>> maps = {};  ///< view, map.json
  std::vector<std::pair<std::string, std::filesystem::path>> plate_images = {};  ///< view, image of the plate
  xray::StatedGeometry stated = {};  ///< of every view, where the images do not state it
  /// View, primary and secondary positioner angle, likewise.
  std::vector<std::pair<std::string, std::array<double, 2>>> angles_deg = {};
};

/// case.json, the files to be copied beside it, and what the user should know.
struct NewCase {
  struct Copy {
    std::filesystem::path from, to;  ///< `to` is relative to the case's folder
  };
  Case the_case;  ///< without the contents of its calibrator and plate
  std::vector<Copy> copies;
  std::vector<std::string> findings;
  std::vector<Warning> warnings;
};

/// A case in `folder`. Images that lie in the folder are named where they are, others are copied unchanged,
/// with their patient data. Refuses `usage` (fewer than two images, no calibrator, no decision on the plate),
/// `name_clash` (a view's name), `bad_value` (an image contradicts what is stated of it), and images that
/// `read_views` refuses; fails as the readers of its files.
Expected<NewCase> new_case(std::vector<InspectedImage> images, const NewCaseOptions& options,
                           const std::filesystem::path& folder);

/// Writes the files, case.json last. Refuses `cannot_write`, also where the folder holds a case.
Expected<void> write_new_case(const NewCase& draft, const std::filesystem::path& folder);

}  // namespace helicarm::pipeline
