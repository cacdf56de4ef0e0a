// SPDX-License-Identifier: Apache-2.0
#include "helicarm/sweep/sweep_findings.h"

#include <algorithm>
#include <cmath>
#include <map>

#include <fmt/format.h>

#include "helicarm/pipeline/diagnosis/calibrator_checks.h"
#include "helicarm/sweep/joint_estimate.h"

namespace helicarm::sweep {
void compare_distance(Sweep& sweep, const std::vector<FrameEstimate>& estimates) {
  constexpr double limit = 0.05;
  const auto stated = stated_distance_mm(estimates);
  if (!stated || !sweep.pixel_known || !sweep.path || !sweep.path->source_to_detector_mm) return;
  const double stated_mm = *stated, found_mm = *sweep.path->source_to_detector_mm;
  if (std::abs(found_mm / stated_mm - 1) <= limit) return;
  sweep.warnings.push_back(
      {Reason::intrinsics_inconsistent,
       fmt::format(
           "the images show a source distance of {:.0f} mm with the stated pixel size, and {:.0f} mm is "
           "stated: pixel size, source distance or the calibrator's size is wrong. Lengths along the central "
           "rays, and with them the source, are wrong too",
           found_mm, stated_mm),
       {},
       {{"found_mm", found_mm}, {"stated_mm", stated_mm}}});
}

std::optional<Failure> check_handedness(Sweep& sweep, const std::vector<FrameEstimate>& estimates) {
  std::size_t accepted = 0, mirrored = 0, unstated = 0;
  for (const FrameEstimate& at : estimates) {
    if (at.failure) continue;
    ++accepted;
    mirrored += at.alone->view.intrinsics.fx < 0;
    unstated += at.mirrored_without_statement;
  }
  if (mirrored < accepted) return std::nullopt;
  if (unstated == accepted) return pipeline::mirrored_without_statement(accepted);
  sweep.notes.push_back(pipeline::mirrored_as_stated());
  return std::nullopt;
}

std::optional<Failure> check_scale(Sweep& sweep, const std::vector<FrameEstimate>& estimates,
                                   const phantom::Calibrator& calibrator) {
  pipeline::DiameterEvidence diameters;
  for (const FrameEstimate& at : estimates)
    if (!at.failure) diameters.add(at.alone->view, at.fiducials.fiducials, calibrator, at.logarithmic);
  auto disagreement = pipeline::scale_disagreement(diameters.scale(), calibrator);
  if (!disagreement) return std::nullopt;
  if (disagreement->is_certain) return std::move(disagreement->failure);
  sweep.warnings.push_back(std::move(disagreement->failure));
  return std::nullopt;
}

void note_scale(Sweep& sweep, const phantom::Calibrator& calibrator) {
  if (calibrator.scale_sigma > 0 || !sweep.path || !(sweep.path->source_to_axis_mm > 0)) return;
  const double per_cent_mm = 0.01 * sweep.path->source_to_axis_mm;
  sweep.notes.push_back(
      {Reason::scale_unverified,
       fmt::format("images do not show the calibrator's absolute size: an error of 1 % of its file changes "
                   "all lengths by 1 %, the source's distance from the axis by {:.1f} mm. Measure it and "
                   "state scale_sigma, or compare that distance with a tape measure: {:.0f} mm",
                   per_cent_mm, sweep.path->source_to_axis_mm),
       {},
       {{"mm_per_per_cent", per_cent_mm}}});
}

void compare_angles(Sweep& sweep) {
  constexpr double limit_deg = 2;
  double widest = 0, stated_arc = 0, found_arc = 0;
  const SweepFrame* first = nullptr;
  for (const SweepFrame& frame : sweep.frames) {
    if (!frame.path_angle_deg || !frame.primary_angle_deg || !frame.secondary_angle_deg) continue;
    if (!first) first = &frame;
    // Angle between two positions of the C-arm: primary about the patient's axis, secondary across it.
    const auto direction = [](const SweepFrame& of) {
      const double p = *of.primary_angle_deg * EIGEN_PI / 180, s = *of.secondary_angle_deg * EIGEN_PI / 180;
      return Eigen::Vector3d(std::sin(p) * std::cos(s), std::cos(p) * std::cos(s), std::sin(s));
    };
    const double stated =
        std::acos(std::clamp(direction(*first).dot(direction(frame)), -1.0, 1.0)) * 180 / EIGEN_PI;
    const double turned = std::abs(*frame.path_angle_deg - *first->path_angle_deg);
    const double found = std::abs(turned - 360 * std::round(turned / 360));
    if (std::abs(stated - found) > widest)
      widest = std::abs(stated - found), stated_arc = stated, found_arc = found;
  }
  if (widest > limit_deg)
    sweep.warnings.push_back(
        {Reason::tag_disagrees,
         fmt::format(
             "the positioner angles of the file and the images disagree by up to {:.1f} degrees (the file "
             "states {:.1f} from the first frame, the images show {:.1f}); the images are used",
             widest, stated_arc, found_arc),
         {},
         {{"apart_deg", widest}, {"limit_deg", limit_deg}}});
}

void report_images(Sweep& sweep, const std::vector<FrameEstimate>& estimates) {
  std::map<Reason, std::pair<Warning, int>> kinds;
  for (const FrameEstimate& at : estimates)
    for (const Warning& warning : at.warnings)
      ++kinds.try_emplace(warning.reason, warning, 0).first->second.second;
  for (auto& [reason, kind] : kinds) {
    auto& [warning, count] = kind;
    if (count > 1) warning.message += fmt::format(" (in {} of {} images)", count, estimates.size());
    warning.figures["images"] = count;
    (reason == Reason::irregular_file ? sweep.notes : sweep.warnings).push_back(std::move(warning));
  }
}

void warn_of_unused_balls(Sweep& sweep, const std::vector<FrameEstimate>& estimates,
                          const phantom::Calibrator& calibrator) {
  constexpr int least_images = 3, most_share = 4;
  for (std::size_t k = 0; k < calibrator.balls.size(); ++k) {
    int images = 0, used = 0;
    for (const FrameEstimate& at : estimates) {
      if (at.failure) continue;
      const fiducials::FiducialStatus status = at.fiducials.fiducials[k].status;
      images += status != fiducials::FiducialStatus::outside;
      used += status == fiducials::FiducialStatus::used;
    }
    if (images < least_images || most_share * used >= images) continue;
    sweep.warnings.push_back({Reason::ball_displaced,
                              fmt::format("fiducial {} fits in {} of the {} images in whose field it lies: "
                                          "its coordinates or diameter in the "
                                          "calibrator's file are wrong, or it is lost or hidden",
                                          calibrator.balls[k].label, used, images),
                              {},
                              {{"used", double(used)}, {"images", double(images)}}});
  }
}

void warn_of_doubtful(Sweep& sweep) {
  std::vector<int> numbers;
  for (const SweepFrame& frame : sweep.frames)
    if (!frame.failure && frame.decision == Decision::warn) numbers.push_back(frame.number);
  if (numbers.empty()) return;
  sweep.warnings.push_back(
      {Reason::residual_too_large,
       fmt::format("{} of {} images are doubtful: {}: residuals larger than the noise, or a camera off the "
                   "path; they are "
                   "used, and those with large residuals are no acquisitions of the C-arm's record",
                   numbers.size(), sweep.frames.size(), fmt::join(numbers, ", ")),
       {},
       {{"doubtful", double(numbers.size())}, {"images", double(sweep.frames.size())}}});
}

void warn_of_refused(Sweep& sweep) {
  std::map<Reason, std::vector<int>> refused;
  for (const SweepFrame& frame : sweep.frames)
    if (frame.failure) refused[frame.failure->reason].push_back(frame.number);
  constexpr std::size_t most_named = 20;
  for (const auto& [reason, numbers] : refused) {
    const std::size_t named = std::min(most_named, numbers.size());
    sweep.warnings.push_back(
        {reason,
         fmt::format("{} of {} images are refused: {}{}", numbers.size(), sweep.frames.size(),
                     fmt::join(numbers.begin(), numbers.begin() + std::ptrdiff_t(named), ", "),
                     named < numbers.size() ? ", ..." : ""),
         {},
         {{"refused", double(numbers.size())}, {"images", double(sweep.frames.size())}}});
  }
}

}  // namespace helicarm::sweep
