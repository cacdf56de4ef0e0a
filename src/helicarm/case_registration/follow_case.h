// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "helicarm/case_registration/register_case.h"

namespace helicarm::case_registration {

/// Frames of a sequence: first, first + step, ... up to last.
struct FrameRange {
  int first = 1, last = 1, step = 1;

  int count() const { return (last - first) / step + 1; }
};

/// Reads A-B or A-B:STEP. Fails with bad_value: numbers from 0 to 999999, A at most B, STEP at least 1.
Expected<FrameRange> frame_range_from(const std::string& text);

/// The models' poses in one frame, in the order of the case.
struct RegisteredFrame {
  int frame = 0;
  std::vector<registration::Registration> models;
};

struct CaseSequence {
  std::optional<Failure> failure;  ///< of the whole: the views are refused
  std::vector<Warning> warnings;
  std::vector<RegisteredFrame> frames;
  double seconds = 0;  ///< of the registrations and of reading their images

  /// A model that is refused in some frame: the first one's reason, its message the number of frames.
  std::optional<Failure> refusal() const;
};

/// Follows a case's models through a sequence of images; the first frame calibrates the views and is
/// registered from the models' starts. `on_frame`: after each, with the share done. One frame's images are in
/// memory at a time. Unreadable input and a model of landmarks alone are failures; refusals are in the
/// result.
Expected<CaseSequence> follow_case(const pipeline::RegistrationCase& given, const FrameRange& range,
                                   const RegisterOptions& options,
                                   const std::function<void(double share)>& on_frame,
                                   const Progress& progress = {});

/// registration.csv: frame, model, decision, world_from_model, sigmas, code (docs/formats.md).
std::string poses_csv(const CaseSequence& sequence);
/// relative.csv: the second and further models in the first one's coordinates.
std::string relative_csv(const CaseSequence& sequence);

/// Writes registration.csv and, of two or more models, relative.csv.
Expected<void> write_sequence(const CaseSequence& sequence, const std::filesystem::path& folder);

}  // namespace helicarm::case_registration
