// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/localization/locate.h"
#include "helicarm/pipeline/calibrate_case.h"
#include "helicarm/pipeline/case.h"
#include "helicarm/pipeline/result.h"

namespace helicarm::pipeline {

/// The image of a pick in its calibrated view: of the ball that it snaps to, else of the click. `centre`: of
/// the calibrator, at whose depth the ball is. Fails as `snap_to_ball` and `point_of_click`.
Expected<fiducials::ImagePoint> observe_pick(const Pick& pick, const xray::XrayImage& image,
                                             const rectification::DistortionMap& map,
                                             const detection::NoiseCorrelation& noise,
                                             const calibration::CalibratedView& calibrated,
                                             const Eigen::Vector3d& centre);

/// Observes picks, then check targets, in the calibrated images. `bad_value` for a pick outside its image.
Expected<std::vector<PointResult>> observe_points(const Case& the_case, const CaseCalibration& calibration,
                                                  unsigned threads);

/// Locates each point (Eq. 8), in the frame of the bone with which it moves, and transforms it to bones and
/// tool (Eq. 16). `motion_sigma_mm`: of picks without a tracked bone. A bone with missing poses is taken as
/// fixed, with a warning.
std::vector<Warning> locate_points(const Case& the_case, const calibration::Calibration& calibration,
                                   std::vector<PointResult>& points, double motion_sigma_mm = 0);

/// A note `unobservable_motion` for each located pick without tracked motion; also added to
/// `PointResult::notes`.
std::vector<Warning> note_motion(const Case& the_case, const calibration::Calibration& calibration,
                                 std::vector<PointResult>& points, double motion_sigma_mm);

/// Picks on fiducials in all their views, or in some while the rays miss each other, are not located
/// (pick_on_fiducial).
std::vector<Warning> picks_on_fiducials(const Case& the_case, const calibration::Calibration& calibration,
                                        std::vector<PointResult>& points);

}  // namespace helicarm::pipeline
