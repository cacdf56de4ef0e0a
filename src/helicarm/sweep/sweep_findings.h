// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "helicarm/phantom/calibrator.h"
#include "helicarm/sweep/estimate_frame.h"
#include "helicarm/sweep/sweep.h"

/// Warnings and notes of a run.
namespace helicarm::sweep {

/// Warns where the source distance that the images show with the stated pixel size is not the stated one.
void compare_distance(Sweep& sweep, const std::vector<FrameEstimate>& estimates);

/// The refusal `ambiguous_handedness` where all accepted images are mirrored, and neither a tag nor the case
/// says so; a note where one does.
std::optional<Failure> check_handedness(Sweep& sweep, const std::vector<FrameEstimate>& estimates);

/// Warns where the diameters of the balls' images contradict the calibrator's size; returns the refusal where
/// they are certain to. By each accepted image alone.
std::optional<Failure> check_scale(Sweep& sweep, const std::vector<FrameEstimate>& estimates,
                                   const phantom::Calibrator& calibrator);

/// Notes what an error of the calibrator's size, which the images do not show, does to the run.
void note_scale(Sweep& sweep, const phantom::Calibrator& calibrator);

/// Warns where the angles that the file states are not those of the images.
void compare_angles(Sweep& sweep);

/// What was odd in the images' files and their labels: of each kind the first, with the number of images.
void report_images(Sweep& sweep, const std::vector<FrameEstimate>& estimates);

/// Balls of the file that the accepted images hardly use.
void warn_of_unused_balls(Sweep& sweep, const std::vector<FrameEstimate>& estimates,
                          const phantom::Calibrator& calibrator);

/// Images that are used although their residuals are larger than the noise, or their camera is off the path.
void warn_of_doubtful(Sweep& sweep);

/// Names the refused images, by reason.
void warn_of_refused(Sweep& sweep);

}  // namespace helicarm::sweep
