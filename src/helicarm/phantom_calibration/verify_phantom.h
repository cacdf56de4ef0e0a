// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "helicarm/core/failure.h"
#include "helicarm/core/json.h"
#include "helicarm/pipeline/case.h"
#include "helicarm/pipeline/diagnosis/calibrator_checks.h"

namespace helicarm::phantom_calibration {

enum class BallState {
  as_in_file,
  moved,        ///< off by more than its 95 % bound allows, corrected for the number of balls
  swapped,      ///< it lies where another ball of another size should
  lost,         ///< two views or more show its place without it
  not_verified  ///< too few views show its place, or one alone shows it off by less than a hidden part
                ///< explains
};
std::string_view word(BallState state);

struct VerifiedBall {
  std::string label;
  std::optional<double> distance_mm;  ///< from its place in the file
  double bound_mm = 0;                ///< 95 % of distances of an unmoved ball are less
  BallState state = BallState::as_in_file;
  int views = 0;
};

struct PhantomVerification {
  std::optional<Failure> failure;
  std::vector<Warning> warnings;
  std::vector<Warning> notes;  ///< what is not verified
  std::string date;
  std::string calibrator;  ///< digest of the file's coordinates
  std::vector<VerifiedBall> balls;
  double within_mm = 0;  ///< the largest distance or bound
  /// What the diameters of the balls' images and Distance Source to Patient show of the file's scale; the
  /// balls' places do not show it. Sigma 0: nothing.
  pipeline::ScaleEvidence scale;
  double rms_px = 0;
};

/// Whether the balls lie as in the case's calibrator file, from two views or more: each ball is intersected
/// from views that the others calibrate. The scale is not verified: it is compared with the balls' diameters
/// as a run does (`scale_disagrees`). A refusal (`calibrator_mismatch`, `too_few_views`, ...) is a result;
/// only unusable input fails.
Expected<PhantomVerification> verify_phantom(const pipeline::Case& the_case, unsigned threads);

Json to_json(const PhantomVerification& verification);

/// Of labels, coordinates and diameters.
std::string digest_of(const phantom::Calibrator& calibrator);

/// Adds to the history, a JSON file that is made where there is none.
Expected<void> add_to_history(const std::filesystem::path& path, const PhantomVerification& verification);

}  // namespace helicarm::phantom_calibration
