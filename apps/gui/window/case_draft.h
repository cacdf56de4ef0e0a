// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "gui/window/c_arm_presets.h"
#include "helicarm/pipeline/new_case.h"

namespace helicarm::gui {

/// The decisions on a new case.
struct CaseDraft {
  struct Image : pipeline::NewImage {
    ViewPlate plate = {};
    int number = 0;  ///< stays its own when others are removed
  };
  std::vector<Image> images;
  std::string calibrator;                    ///< a built-in or a file; empty: not chosen
  std::optional<std::string> plate = {};     ///< a built-in, a file, or "none"; nothing: by the images
  std::filesystem::path folder = {};         ///< of the case
  std::string c_arm = {}, intensifier = {};  ///< for the notes
};

/// A draft with what its images show.
struct CheckedDraft {
  struct Image {
    int frames = 1;
    std::optional<int> frame = {};  ///< in use; nothing of a file with one
    std::string view = {};          ///< its name
    std::string found = {};
    std::optional<Failure> failure = {};  ///< why the file is not usable
  };
  std::vector<Image> images;
  pipeline::PlateChoice plate;  ///< by the images; empty as long as they are not all read
  /// Sentences on what is missing, by part.
  std::string images_lack = {}, calibrator_lacks = {}, plate_lacks = {}, folder_lacks = {};
  std::optional<Expected<pipeline::NewCase>> made;  ///< if nothing is missing

  bool is_complete() const { return made && *made; }
};

/// Checks drafts; files are read once. Thread-safe.
class DraftChecker {
 public:
  CheckedDraft check(const CaseDraft& draft);
  /// Writes the case into the draft's folder. Fails as `new_case` and `write_new_case`.
  Expected<void> write(const CaseDraft& draft);

 private:
  using Key = std::pair<std::filesystem::path, int>;  ///< file and frame

  std::vector<pipeline::InspectedImage> inspect(const CaseDraft& draft, CheckedDraft& checked);
  /// The plate that they show; they are asked once.
  const pipeline::PlateChoice& plate_by(const std::vector<pipeline::InspectedImage>& images);
  Expected<pipeline::NewCase> make(const CaseDraft& draft, const pipeline::PlateChoice& choice,
                                   std::vector<pipeline::InspectedImage> images);

  std::mutex mutex_;
  std::map<std::filesystem::path, Expected<int>> frames_;
  std::map<Key, Expected<pipeline::InspectedImage>> inspected_;
  std::vector<Key> chosen_for_;
  pipeline::PlateChoice choice_;
};

/// A folder beside the first image that does not exist.
std::filesystem::path folder_beside(const std::filesystem::path& image);

}  // namespace helicarm::gui
