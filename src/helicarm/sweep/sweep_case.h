// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "helicarm/calibration/c_arm_history.h"
#include "helicarm/pipeline/case.h"
#include "helicarm/xray/image_file.h"

namespace helicarm::calibration {
struct CArmMaps;
}

namespace helicarm::sweep {

/// One image of a run.
struct Frame {
  pipeline::CaseView view;  ///< NAME/12, with its file and frame; a view of one image keeps its name
  std::string run;          ///< name of the view in case.json
  int number = 1;           ///< in the file, or of the numbered file
};

/// A case whose views are runs of images.
struct SweepCase {
  pipeline::Case base;  ///< its views as in case.json
  std::vector<Frame> frames;
  std::map<std::filesystem::path, std::shared_ptr<const xray::ImageFile>> files;  ///< of several frames
  /// Distortion by the positioner's angles, for frames without plate and map; nothing: they have none.
  std::shared_ptr<const calibration::CArmMaps> maps = {};
};

/// Reads a case, in which a view may have "frames": "all" or "A-B[:STEP]", of a file with several frames or
/// pages, or of an "image" with {frame} or {frame:04d}. Images are not read, but for the number of frames.
/// Fails as `read_case`; missing_file where a numbered file does not exist, bad_value for more than 1000
/// frames, for frames that a file does not have and for angles of another number of frames.
Expected<SweepCase> read_sweep_case(const std::filesystem::path& path);

/// Frames without plate and map take their distortion from what a C-arm's record holds of its positions, if
/// it does.
void take_maps(SweepCase& the_case, const calibration::CArmHistory& record);

/// As `pipeline::read_phantom_case`, of runs too: each of their images is a view of the case.
Expected<pipeline::Case> read_phantom_case(const std::filesystem::path& path);

}  // namespace helicarm::sweep
