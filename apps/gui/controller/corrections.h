// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <vector>

#include "helicarm/case_registration/follow_case.h"
#include "helicarm/track/track_case.h"

namespace helicarm::gui {

/// Picks of a sequence's frames that are made in the window, with those of its case.
class Corrections {
 public:
  Corrections() = default;
  /// Of a case as it was read.
  explicit Corrections(const track::TrackCase& the_case) : now_{the_case.picks, the_case.corrections} {}

  /// In place of one of the same marker, view and frame. In the range's first frame it is one of the picks
  /// that the sequence begins with.
  void set(const track::MarkerPick& pick, const case_registration::FrameRange& range);
  bool can_undo() const { return !earlier_.empty(); }
  void undo();
  /// Puts them into a case that is followed next.
  void put_into(track::TrackCase& the_case) const;
  /// Writes them into case.json in place of its picks of these frames; those of other frames stay. Fails as
  /// `read_json` and `write_file_in_folder`.
  Expected<void> save(const std::filesystem::path& case_folder, const track::TrackCase& the_case,
                      const case_registration::FrameRange& range) const;

 private:
  struct State {
    std::vector<track::MarkerPick> first, later;
  };
  State now_;
  std::vector<State> earlier_;
};

}  // namespace helicarm::gui
