// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "studies/biplane.h"
#include "studies/biplane_images.h"
#include "studies/calibration_study.h"
#include "studies/centres.h"
#include "studies/design.h"
#include "studies/limit.h"
#include "studies/location.h"
#include "studies/number.h"
#include "studies/rectification_study.h"
#include "studies/uniformity_study.h"

namespace helicarm::study {

/// For tests: the smallest study with several blocks in each setting.
struct SmallStudy {
  std::string name;
  std::size_t blocks;  ///< of each setting
  std::size_t stop;    ///< number of blocks after which a run is unfinished
  /// All output of the study; empty at ranks other than the leader. The folder is for its temporary files.
  std::function<std::string(const EngineOptions&, const Ranks&, const std::filesystem::path& folder)> bytes;
};

template <auto study, class Options>
SmallStudy small(const char* name, std::size_t blocks, std::size_t stop, std::size_t groups,
                 Options options) {
  options.groups = groups;
  options.seed = 4;
  const auto bytes = [options](const EngineOptions& engine, const Ranks& ranks,
                               const std::filesystem::path& folder) {
    Options quick_options =
        options;  // NOLINT(performance-unnecessary-copy-initialization): some have a folder
    if constexpr (requires { quick_options.folder; }) quick_options.folder = folder;
    const auto answer = study(quick_options, engine, ranks).value();
    if (!ranks.leads()) return std::string();
    const StudyFiles files = files_of(answer, quick_options);
    return files.csv + to_text(files.json) + files.svg + files.summary;
  };
  return {name, blocks, stop, bytes};
}

inline std::vector<SmallStudy> small_studies() {
  return {
      small<study_number>("number", 12, 14, 3000, NumberOptions{.balls = {6, 12}}),
      small<study_uniformity>("uniformity", 3, 2, 70, UniformityOptions{.draws = 3}),
      small<study_location>("location", 3, 2, 300, LocationOptions{.balls = {}, .step_mm = 50}),
      small<study_biplane>("biplane", 3, 2, 150, BiplaneOptions{}),
      small<study_biplane_images>("biplane_images", 2, 1, 2,
                                  BiplaneImagesOptions{.size_px = 512, .folder = {}}),
      small<study_calibration>("calibration", 2, 1, 2, CalibrationStudyOptions{.size_px = 512, .folder = {}}),
      small<study_rectification>("rectification", 2, 1, 2,
                                 RectificationStudyOptions{.size_px = 512, .distances_mm = {45}}),
      small<study_design>("design", 3, 4, 150, DesignOptions{.restarts = 3, .steps = 30}),
      small<study_limit>("limit", 2, 21, 51, LimitOptions{.balls = {8}}),
      small<study_centres>("centres", 2, 3, 14,
                           CentreOptions{.only = {"scatter over direct"}, .squares = 3})};
}

}  // namespace helicarm::study
