// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/calibrate_case.h"

#include <algorithm>
#include <iterator>

#include "helicarm/calibration/c_arm_maps.h"
#include "helicarm/pipeline/c_arm.h"
#include "helicarm/pipeline/diagnosis/calibrator_checks.h"
#include "helicarm/pipeline/diagnosis/causes.h"
#include "helicarm/pipeline/diagnosis/residuals.h"
#include "helicarm/pipeline/prior.h"
#include "helicarm/pipeline/stopwatch.h"

namespace helicarm::pipeline {
namespace {

using LabelledViews = std::vector<LabelledView>;

/// The prior of these views from a C-arm history, without entries of these images.
Expected<calibration::LearnedIntrinsics> prior_from_history(const LabelledViews& views,
                                                            const calibration::CArmHistory& history,
                                                            const std::string& calibrator) {
  const geometry::IntrinsicsPrior nominal = fiducials_of(views.front()).prior;
  for (const LabelledView& view : views)
    if (!fiducials_of(view).prior.focal_px)
      return fail(
          Reason::bad_value,
          "a C-arm history (--machine) requires images with pixel size and source distance: where the "
          "files lack them, state \"pixel_mm\" and \"source_detector_mm\" of the views in case.json");
  std::vector<calibration::HistoryEntry> earlier;
  std::ranges::copy_if(history.entries, std::back_inserter(earlier),
                       [&](const calibration::HistoryEntry& entry) {
                         return std::ranges::none_of(views, [&](const LabelledView& view) {
                           return view.xray_image->acquisition.instance_key == entry.image;
                         });
                       });
  return calibration::learn_intrinsics(earlier, {*nominal.focal_px / nominal.unit_px, 0, 0}, unknown_c_arm(),
                                       calibrator);
}

/// What each view says of the C-arm alone, for a history; views that determine nothing alone are left out.
std::vector<calibration::HistoryEntry> entries_of(const LabelledViews& views,
                                                  const std::vector<calibration::ViewFiducials>& fiducials,
                                                  const calibration::CommonPrior& common) {
  std::vector<calibration::HistoryEntry> entries;
  for (std::size_t i = 0; i < views.size(); ++i) {
    const xray::Acquisition& acquisition = views[i].xray_image->acquisition;
    if (auto entry = calibration::history_entry_of(fiducials[i], acquisition.instance_key, common)) {
      entry->primary_deg = acquisition.primary_angle_deg;
      entry->secondary_deg = acquisition.secondary_angle_deg;
      entry->plate = calibration::plate_map_of(views[i].rectification);
      entries.push_back(*std::move(entry));
    }
  }
  return entries;
}

/// Entries of these views for the C-arm history; none if their residuals are inconsistent with the noise
/// model or with the calibrator's file.
std::vector<calibration::HistoryEntry> new_entries(const CaseCalibration& calibration,
                                                   const calibration::CommonPrior& common) {
  if (calibration.variance_scale != 1 || calibration.contradicts_calibrator ||
      std::ranges::any_of(calibration.images, [](const LabelledView& view) {
        return view.rectification.source == rectification::MapSource::record;  // it told this itself
      }))
    return {};
  std::vector<calibration::ViewFiducials> fiducials;
  for (std::size_t i = 0; i < calibration.images.size(); ++i) {
    fiducials.push_back(fiducials_of(calibration.images[i]));
    fiducials.back().fiducials = calibration.fiducials[i];
  }
  return entries_of(calibration.images, fiducials, common);
}

/// c_arm_changed as a warning where the views alone contradict the history; nothing where they say nothing.
std::optional<Warning> contradiction_of(const LabelledViews& views,
                                        const std::vector<calibration::ViewFiducials>& fiducials,
                                        const calibration::CArmHistory& history,
                                        const calibration::CommonPrior& common) {
  const auto check = check_against_record(entries_of(views, fiducials, common), history, "--machine");
  auto change = check ? c_arm_change(*check) : std::nullopt;
  if (change) change->message += ". The record is neither used nor added to";
  return change;
}

/// Mean position of the used fiducials over all views.
Eigen::Vector3d centre_of(const calibration::CalibrationResult& calibration) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double count = 0;
  for (const auto& of_view : calibration.fiducials)
    for (const fiducials::Fiducial& ball : of_view)
      if (ball.status == fiducials::FiducialStatus::used) {
        sum += ball.centre_in_calibrator;
        ++count;
      }
  return sum / count;
}

/// As `check_views_apart`, in the calibrator's frame or in the tracker's: a calibrator on the receiver turns
/// with the C-arm and looks alike in all views.
Expected<void> check_apart(const calibration::CalibrationResult& calibration, const Case& the_case) {
  if (calibration.views.size() < 2) return {};
  const Eigen::Vector3d centre = centre_of(calibration);
  auto apart = calibration::check_views_apart(calibration.views, centre);
  const auto pose = [](const CaseView& view) { return view.poses.tracker_from_calibrator; };
  if (apart ||
      !std::ranges::all_of(the_case.views, [&](const CaseView& view) { return pose(view).has_value(); }))
    return apart;
  std::vector<calibration::CalibratedView> views = calibration.views;
  for (std::size_t i = 0; i < views.size(); ++i) {
    geometry::RigidTransform& camera_from_world = views[i].view.camera_from_world;
    camera_from_world = camera_from_world * pose(the_case.views[i])->inverse();
  }
  return calibration::check_views_apart(views, *pose(the_case.views.front()) * centre);
}

Expected<CaseCalibration> calibrated(const LabelledViews& views, const Case& the_case,
                                     const RunOptions& options) {
  std::vector<calibration::ViewFiducials> fiducials;
  for (const LabelledView& view : views) fiducials.push_back(fiducials_of(view));
  calibration::CalibrationOptions calibration_options;
  calibration_options.common = common_prior(the_case.calibrator);
  std::optional<calibration::LearnedIntrinsics> history;
  std::optional<Warning> change;
  if (options.history) {
    const auto prior = prior_from_history(views, *options.history, calibration_options.common.calibrator);
    if (!prior) return tl::unexpected<Failure>(prior.error());
    change = contradiction_of(views, fiducials, *options.history, calibration_options.common);
    if (!change) history = *prior;
  }
  if (history) {
    calibration_options.common.c_arm = history->of_calibrator.prior;
    for (std::size_t i = 0; i < views.size(); ++i)
      fiducials[i].prior = calibration::learned_prior(fiducials[i].prior, history->of_calibrator.mm,
                                                      views[i].fiducials.mirrored);
  }
  return (options.method == rectification::Method::paper
              ? calibration::calibrate_paper(fiducials, calibration_options)
              : calibration::calibrate(fiducials, calibration_options))
      .and_then([&](calibration::CalibrationResult result) {
        return check_apart(result, the_case).map([&] {
          CaseCalibration calibrated_case{std::move(result), {}, history, {}, {}};
          if (change) {
            calibrated_case.is_record_contradicted = true;
            calibrated_case.warnings.push_back(*change);
          }
          return calibrated_case;
        });
      });
}

/// Warns of image changes that explain the residuals. Refuses if one view's magnification explains them,
/// which otherwise require offsets of the fiducials: a wrong tag is the simpler cause.
Expected<CaseCalibration> with_explanations(CaseCalibration calibration, const LabelledViews& views,
                                            const Case& the_case, const RunOptions& options) {
  if (options.method == rectification::Method::paper) return calibration;
  for (Warning& warning : explain_residuals(views, calibration, common_prior(the_case.calibrator))) {
    if (warning.reason == Reason::intrinsics_inconsistent && calibration.found_tolerance_mm > 0) {
      warning.reason = Reason::calibrator_mismatch;
      return tl::unexpected<Failure>(std::move(warning));
    }
    calibration.warnings.push_back(std::move(warning));
  }
  for (Warning& warning : doubtful_intrinsics(views, calibration, common_prior(the_case.calibrator)))
    calibration.warnings.push_back(std::move(warning));
  return calibration;
}

/// 2.2, Eq. 4-7: all views jointly, or each alone by the paper's method.
OrRefusal<CaseCalibration> calibrate_views(LabelledViews views, const Case& the_case,
                                           const RunOptions& options) {
  auto calibration =
      calibrated(views, the_case, options)
          .and_then([&](CaseCalibration done) { return check_calibrator(std::move(done), views, the_case); })
          .and_then([&](CaseCalibration done) {
            return with_explanations(std::move(done), views, the_case, options);
          });
  if (!calibration) {
    Refusal refusal{calibration.error(), Stage::calibrate, {}};
    for (const LabelledView& view : views) refusal.views.push_back(reported(view));
    return tl::unexpected(std::move(refusal));
  }
  calibration->images = std::move(views);
  calibration->entries = new_entries(*calibration, common_prior(the_case.calibrator));
  return *std::move(calibration);
}

/// The best labels of the views that were not labelled, to be shown.
void add_guesses(Refusal& refusal, const Case& the_case, const RunOptions& options) {
  for (std::size_t i = 0; i < refusal.views.size(); ++i) {
    ViewResult& view = refusal.views[i];
    if (!view.found && view.rectification)
      view.guessed =
          fiducials::guess_labels(*view.xray_image, *view.dots, *view.rectification, the_case.calibrator,
                                  {options.method, {}, the_case.views[i].mirrored});
  }
}

}  // namespace

OrRefusal<CaseCalibration> calibrate_case(const Case& the_case, const RunOptions& options,
                                          const Progress& progress) {
  Timing time;
  const auto stage = [&](std::string_view name, std::optional<double>& ms, auto work) {
    return [&, name, work](auto views) {
      progress.begin(name);
      const Stopwatch watch(ms);
      return work(std::move(views), the_case, options, progress);
    };
  };
  const auto calibrate_all = [](LabelledViews views, const Case& of, const RunOptions& by, const Progress&) {
    return calibrate_views(std::move(views), of, by);
  };
  progress.begin("read");
  return timed(time.read, [&] { return read_views(the_case, options, progress); })
      .and_then(stage("detect", time.detect, detect_in_views))      // 2.1
      .and_then(stage("rectify", time.rectify, rectify_views))      // 2.1, Eq. 1-3
      .and_then(stage("label", time.label, label_views))            // 2.3.4
      .and_then(stage("calibrate", time.calibrate, calibrate_all))  // 2.2, Eq. 4-7
      .map([&](CaseCalibration calibration) {
        calibration.timing_ms = time;
        return calibration;
      })
      .map_error([&](Refusal refusal) {
        refusal.failure = with_cause(refusal, the_case, options);
        add_guesses(refusal, the_case, options);
        refusal.timing_ms = time;
        return refusal;
      });
}

}  // namespace helicarm::pipeline
