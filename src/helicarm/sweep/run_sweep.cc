// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <chrono>
#include <cmath>
#include <map>
#include <mutex>

#include <fmt/format.h>

#include "helicarm/core/parallel.h"
#include "helicarm/core/statistics.h"
#include "helicarm/pipeline/prior.h"
#include "helicarm/sweep/estimate_frame.h"
#include "helicarm/sweep/joint_estimate.h"
#include "helicarm/sweep/label_by_neighbours.h"
#include "helicarm/sweep/refused_run.h"
#include "helicarm/sweep/sweep.h"
#include "helicarm/sweep/sweep_findings.h"

namespace helicarm::sweep {
namespace {

constexpr std::size_t least_smooth = 16;  // frames of a smooth path

/// Each frame's estimate; unreadable input is thrown.
std::vector<FrameEstimate> estimates_of(const SweepCase& the_case, const SweepOptions& options,
                                        const std::function<void(double)>& progress) {
  const std::size_t count = the_case.frames.size();
  std::vector<Expected<FrameEstimate>> estimated(count, FrameEstimate{});
  pipeline::RunOptions run;
  run.maps = the_case.maps;
  std::mutex guard;
  std::size_t done = 0;
  parallel_for(count, options.threads, [&](std::size_t i) {
    estimated[i] =
        estimate_frame(the_case.frames[i], file_of(the_case.frames[i], the_case), the_case.base, run);
    const std::lock_guard lock(guard);
    if (progress) progress(double(++done) / double(count));
  });
  std::vector<FrameEstimate> estimates;
  for (auto& estimate : estimated) estimates.push_back(value_or_throw(std::move(estimate)));
  return estimates;
}

/// A repeated image is no second measurement: its noise is the same.
void refuse_copies(const SweepCase& the_case, std::vector<FrameEstimate>& estimates) {
  std::map<std::string, std::size_t> first;
  for (std::size_t i = 0; i < estimates.size(); ++i) {
    if (estimates[i].failure || estimates[i].image.empty()) continue;
    const auto [same, is_new] = first.try_emplace(estimates[i].image, i);
    if (!is_new)
      refuse(estimates[i],
             {Reason::views_too_close,
              fmt::format("the image is a copy of {}", the_case.frames[same->second].view.name),
              {},
              {}},
             the_case.frames[i].view.name);
  }
}

/// The detector of all frames. Throws bad_value where they state different ones.
Detector detector_of(const SweepCase& the_case, const std::vector<FrameEstimate>& estimates,
                     bool& pixel_known) {
  constexpr double tolerance = 0.01;
  const FrameEstimate* first = nullptr;
  const std::string* name = nullptr;
  std::vector<double> focals;
  for (std::size_t i = 0; i < estimates.size(); ++i) {
    const FrameEstimate& at = estimates[i];
    if (at.image_size.isZero()) continue;
    if (at.alone) focals.push_back(at.alone->view.intrinsics.fy);
    if (!first) {
      first = &at;
      name = &the_case.frames[i].view.name;
    }
    const auto differ = [&](const char* what) {
      throw BadInput(Reason::bad_value, fmt::format("{} and {} state different {}: one run has one detector",
                                                    *name, the_case.frames[i].view.name, what));
    };
    if (at.image_size != first->image_size) differ("image sizes");
    if (at.pixel_mm.has_value() != first->pixel_mm.has_value() && !at.failure && !first->failure)
      differ("pixel sizes");
    if (at.pixel_mm && first->pixel_mm && std::abs(*at.pixel_mm / *first->pixel_mm - 1) > tolerance)
      differ("pixel sizes");
  }
  Detector detector;
  if (!first) return detector;
  detector.image_size = first->image_size;
  for (const FrameEstimate& at : estimates)
    if (at.pixel_mm && !pixel_known) {
      detector.pixel_mm = *at.pixel_mm;
      pixel_known = true;
    }
  constexpr double plausible_mm = 1000;  // of source and detector
  if (!pixel_known && !focals.empty()) detector.pixel_mm = plausible_mm / median(std::move(focals));
  return detector;
}

/// Square pixels, or the stated aspect, and the handedness of most frames; the others are refused.
void take_handedness(const SweepCase& the_case, std::vector<FrameEstimate>& estimates, Detector& detector) {
  int mirrored = 0, plain = 0;
  for (const FrameEstimate& at : estimates)
    if (at.alone) {
      ++(at.alone->view.intrinsics.fx < 0 ? mirrored : plain);
      if (const auto& aspect = at.fiducials.prior.aspect) detector.aspect = aspect->value;
    }
  const bool is_mirrored = mirrored > plain;
  if (is_mirrored) detector.aspect *= -1;
  for (std::size_t i = 0; i < estimates.size(); ++i)
    if (!estimates[i].failure && (estimates[i].alone->view.intrinsics.fx < 0) != is_mirrored)
      refuse(estimates[i],
             {Reason::ambiguous_handedness,
              fmt::format("the image is {}, most of the run's are {}",
                          is_mirrored ? "not mirrored" : "mirrored", is_mirrored ? "mirrored" : "not"),
              {},
              {}},
             the_case.frames[i].view.name);
}

/// Ratio of the residuals to the fiducials' standard deviations, by all frames together.
double noise_factor(const std::vector<FrameEstimate>& estimates) {
  constexpr double least = 0.3, enough_dof = 100, most_of_median = 4;
  std::vector<double> ratios;
  for (const FrameEstimate& at : estimates)
    if (!at.failure && at.alone->dof > 0) ratios.push_back(at.alone->chi2 / at.alone->dof);
  if (ratios.empty()) return 1;
  const double typical = median(std::move(ratios));
  double chi2 = 0, dof = 0;
  for (const FrameEstimate& at : estimates)
    if (!at.failure && at.alone->dof > 0 && at.alone->chi2 / at.alone->dof <= most_of_median * typical)
      chi2 += at.alone->chi2, dof += at.alone->dof;
  const double factor = std::sqrt(chi2 / dof);
  return dof < enough_dof ? std::max(1.0, factor) : std::max(least, factor);
}

/// One run tells of its own noise many times over: more of its frames would crowd out other days. What the
/// record rectified tells it nothing.
std::vector<calibration::HistoryEntry> acquisitions_of(const std::vector<FrameEstimate>& estimates,
                                                       const SweepCase& the_case,
                                                       const std::vector<SweepFrame>& frames) {
  constexpr std::size_t most = 40;
  std::vector<std::size_t> told;
  for (std::size_t i = 0; i < estimates.size(); ++i)
    if (!frames[i].failure && estimates[i].variance_scale == 1 && !estimates[i].map_of_record)
      told.push_back(i);
  std::vector<calibration::HistoryEntry> entries;
  const calibration::CommonPrior common = pipeline::common_prior(the_case.base.calibrator);
  const std::size_t count = std::min(most, told.size());
  for (std::size_t k = 0; k < count; ++k) {
    const FrameEstimate& at = estimates[told[k * told.size() / count]];
    auto entry = calibration::history_entry_of(at.fiducials, at.image, common);
    if (!entry) continue;
    entry->primary_deg = at.primary_angle_deg;
    entry->secondary_deg = at.secondary_angle_deg;
    entry->plate = at.plate;
    entries.push_back(*std::move(entry));
  }
  return entries;
}

bool is_one_run(const SweepCase& the_case) {
  return std::ranges::all_of(the_case.frames,
                             [&](const Frame& frame) { return frame.run == the_case.frames.front().run; });
}

SweepFrame reported(const Frame& frame, const FrameEstimate& estimate) {
  SweepFrame sweep_frame;
  sweep_frame.number = frame.number;
  sweep_frame.view = frame.view.name;
  sweep_frame.failure = estimate.failure;
  sweep_frame.primary_angle_deg = estimate.primary_angle_deg;
  sweep_frame.secondary_angle_deg = estimate.secondary_angle_deg;
  sweep_frame.fiducials_used = int(std::ranges::count(
      estimate.fiducials.fiducials, fiducials::FiducialStatus::used, &fiducials::Fiducial::status));
  sweep_frame.fiducials = estimate.fiducials.fiducials;
  sweep_frame.alone = estimate.alone;
  if (!estimate.failure) {
    sweep_frame.best = estimate.alone;
    sweep_frame.decision = estimate.variance_scale > 1 ? Decision::warn : Decision::accept;
  }
  return sweep_frame;
}

Sweep swept(const SweepCase& the_case, const SweepOptions& options,
            const std::function<void(double)>& progress) {
  Sweep sweep;
  sweep.warnings = the_case.base.warnings;
  std::vector<FrameEstimate> estimates = estimates_of(the_case, options, progress);
  refuse_copies(the_case, estimates);
  sweep.detector = detector_of(the_case, estimates, sweep.pixel_known);
  take_handedness(the_case, estimates, sweep.detector);
  sweep.noise_factor = noise_factor(estimates);
  parallel_for(estimates.size(), options.threads, [&](std::size_t i) {
    calibrate_with(sweep.noise_factor, the_case.base, estimates[i], the_case.frames[i].view.name);
  });
  // Those in the middle of several follow from those beside them, labelled before.
  while (is_one_run(the_case) &&
         label_by_neighbours(sweep.noise_factor, the_case, estimates, options.threads) > 0) {
  }
  const auto accepted =
      std::size_t(std::ranges::count_if(estimates, [](const auto& at) { return !at.failure; }));
  for (std::size_t i = 0; i < estimates.size(); ++i)
    sweep.frames.push_back(reported(the_case.frames[i], estimates[i]));
  if (accepted == 0) {
    sweep.failure = nothing_accepted(estimates, the_case, options.threads);
    return sweep;
  }
  if (is_one_run(the_case))
    sweep.failure = unconfirmed(estimates, accepted, sweep.noise_factor, the_case, options.threads);
  if (!sweep.failure) sweep.failure = check_handedness(sweep, estimates);
  if (!sweep.failure) sweep.failure = check_scale(sweep, estimates, the_case.base.calibrator);
  if (sweep.failure) {
    for (SweepFrame& frame : sweep.frames) frame.best.reset();
    return sweep;
  }
  const PathKind kind = options.path.value_or(
      accepted >= least_smooth && is_one_run(the_case) ? PathKind::smooth : PathKind::free);
  report_images(sweep, estimates);
  warn_of_unused_balls(sweep, estimates, the_case.base.calibrator);
  sweep.failure = estimate_path(sweep, the_case.base, estimates, kind);
  if (!sweep.failure) sweep.acquisitions = acquisitions_of(estimates, the_case, sweep.frames);
  compare_angles(sweep);
  compare_distance(sweep, estimates);
  note_scale(sweep, the_case.base.calibrator);
  warn_of_refused(sweep);
  warn_of_doubtful(sweep);
  return sweep;
}

}  // namespace

Expected<PathKind> path_kind(const std::string& word) {
  const auto found = std::ranges::find(path_words, word);
  if (found == path_words.end())
    return fail(Reason::bad_value,
                fmt::format("path: \"{}\" is none of: {}", word, fmt::join(path_words, ", ")));
  return static_cast<PathKind>(found - path_words.begin());
}

Expected<Sweep> run_sweep(const SweepCase& the_case, const SweepOptions& options,
                          const std::function<void(double share)>& progress) {
  return guarded([&] {
    const auto begun = std::chrono::steady_clock::now();
    if (!is_one_run(the_case) &&
        std::ranges::any_of(the_case.frames, [](const Frame& frame) { return frame.run != frame.view.name; }))
      throw BadInput(Reason::bad_value,
                     "views: \"frames\" makes a view a run of its own: make a case of each run");
    Sweep sweep = swept(the_case, options, progress);
    sweep.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
    return sweep;
  });
}

}  // namespace helicarm::sweep
