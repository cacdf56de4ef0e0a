// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "helicarm/case_registration/follow_case.h"
#include "helicarm/core/json.h"
#include "helicarm/track/sequence.h"

namespace helicarm::track {

/// The models of a case through a sequence of images.
struct ModelSequence {
  std::vector<int> frames;
  std::vector<std::string> names;                              ///< of the models
  std::vector<case_registration::RegisteredFrame> registered;  ///< each frame by itself
  std::vector<BodySequence> bodies;                            ///< [model], poses against the first frame
  std::vector<std::vector<TrackedBody>> relative;              ///< [model - 1][frame], to the first model
  std::vector<Warning> warnings;
  double seconds = 0;  ///< of this run, without the calibration of the views

  std::optional<Failure> refusal() const { return case_registration::refusal_of(registered); }
};

/// Poses of every frame to smooth motion: refused frames are gaps, and the part of the registrations'
/// covariances that is smoothed is what the frames scatter by.
void estimate_motion(ModelSequence& sequence, const std::vector<Eigen::Vector3d>& centres_in_model);

struct FollowOptions {
  std::optional<std::filesystem::path> out;  ///< folder for rows as they are computed; nothing: none are kept
  bool resume = false;                       ///< goes on after the frames in `out`
  /// Told why frames of an interrupted run are computed again.
  std::function<void(const std::string&)> on_note = {};
};

/// Follows a case's models through a sequence; the first frame calibrates the views and is registered from
/// the models' starts. Rows are written to `out` frame by frame: frames.jsonl, registration.csv and
/// bodies.csv. With `resume` the frames in frames.jsonl are not registered again, up to one whose image has
/// changed, and the result is that of a run without an interruption; bad_value where they are of another
/// case. `on_frame`: after each frame, with the share done. Fails as `SequenceImages` and `CaseFollower`;
/// refusals are in the result.
Expected<ModelSequence> follow_models(const pipeline::Case& the_case,
                                      const case_registration::FrameRange& range,
                                      const case_registration::RegisterOptions& options,
                                      const FollowOptions& follow,
                                      const std::function<void(double share)>& on_frame,
                                      const case_registration::Progress& progress = {});

/// A line of frames.jsonl, to the last bit, and back: the frames in the text that are complete, in order, up
/// to the first that is not of `frames`.
std::string frame_line(const case_registration::RegisteredFrame& frame);
std::vector<case_registration::RegisteredFrame> frames_from(const std::string& lines,
                                                            const std::vector<std::string>& names,
                                                            const std::vector<int>& frames);

/// sequence.json (docs/formats.md).
Json to_json(const ModelSequence& sequence);

/// report.html as one page.
std::string model_report(const ModelSequence& sequence);

/// Writes registration.csv, bodies.csv, smoothed.csv, relative.csv, smoothed.seq.mha, report.html and
/// sequence.json.
Expected<void> write_models(const ModelSequence& sequence, const std::filesystem::path& folder);

}  // namespace helicarm::track
