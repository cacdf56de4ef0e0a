// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "helicarm/core/failure.h"
#include "helicarm/core/json.h"
#include "helicarm/geometry/view.h"
#include "helicarm/image/image.h"
#include "helicarm/phantom/calibrator.h"
#include "helicarm/phantom_calibration/hand_distance.h"
#include "helicarm/phantom_calibration/scale.h"
#include "helicarm/pipeline/case.h"

namespace helicarm::phantom_calibration {

/// Today's date (UTC), YYYY-MM-DD, for what is measured or verified now.
std::string today();

struct PhantomOptions {
  bool from_scratch = false;
  std::vector<HandDistance> distances;
  double distance_sigma_mm = 0.05;
  bool outer = false;  ///< the distances are over both balls, not between the centres
  unsigned threads = 0;
  std::string date;  ///< as the calibrator's file will state it
  /// As RunOptions': read, rectify, detect, adjust.
  std::function<void(std::string_view stage)> on_stage = {};
  std::function<void()> on_view = {};
};

struct MeasuredBall {
  std::string label;
  Eigen::Vector3d centre;          ///< mm, in the nominal frame, or in that of the balls' principal axes
  Eigen::Matrix3d covariance_mm2;  ///< with the scale's; see `PhantomResult::calibrator`
  std::optional<Eigen::Vector3d> from_nominal;  ///< mm
  int views = 0;
};

struct MeasuredView {
  std::string name;
  std::string digest;  ///< of the pixels
  geometry::View view;
  double rms_px = 0;  ///< per axis
  std::optional<double> left_out_rms_px;
  std::vector<std::pair<std::size_t, Eigen::Vector2d>> residuals_px;  ///< ball, projection less image
  std::vector<Eigen::Vector2d> images_px;                             ///< rectified, in the same order
  std::vector<double> sigmas_px;                                      ///< per axis, without the map's
  int width = 0, height = 0;                                          ///< of the image, px
  image::Image<std::uint8_t> shown;  ///< the rectified image for display, of half the size if it is large
};

/// The measured scale over another one, and the relative error of this ratio.
struct ScaleAgreement {
  double ratio = 1;
  double sigma = 0;
};

struct PhantomScale {
  std::string source;                                 ///< distances or diameters
  double relative_sigma = 0;                          ///< with the contradictions that are warned of
  std::optional<ScaleAgreement> over_diameters = {};  ///< where distances give the scale
  std::optional<ScaleAgreement> over_nominal = {};
};

/// What `helicarm phantom measure` finds. With a failure it holds what was known until then.
struct PhantomResult {
  std::optional<Failure> failure;
  std::vector<Warning> warnings;
  std::vector<Warning> notes;  ///< limitations that hold for any such measurement
  /// As measured. Its covariances are errors after the best rigid fit of all balls to their true centres.
  phantom::Calibrator calibrator;
  std::optional<phantom::Calibrator> nominal;
  std::vector<MeasuredBall> balls;
  std::vector<MeasuredView> views;
  PhantomScale scale;
  PairToMeasure pair;  ///< worth measuring by hand, indices of balls
  double rms_px = 0;   ///< per axis, all views
  double chi2 = 0;
  int dof = 0;
  double solve_ms = 0;  ///< after detection
};

/// Measures the phantom of a case by bundle adjustment of its views (docs/method.md). Refusals are results;
/// only unusable input fails.
Expected<PhantomResult> measure_phantom(const pipeline::Case& the_case, const PhantomOptions& options);

/// result.json, `helicarm-phantom/1` (docs/formats.md).
Json to_json(const PhantomResult& result);

}  // namespace helicarm::phantom_calibration
