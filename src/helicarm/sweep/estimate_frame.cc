// SPDX-License-Identifier: Apache-2.0
#include "helicarm/sweep/estimate_frame.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "helicarm/calibration/c_arm_maps.h"
#include "helicarm/pipeline/diagnosis/calibrator_checks.h"
#include "helicarm/pipeline/diagnosis/causes.h"
#include "helicarm/pipeline/prior.h"
#include "helicarm/pipeline/stages.h"
#include "helicarm/pipeline/view_image.h"
#include "helicarm/rectification/rectify.h"
#include "helicarm/rectification/usable.h"
#include "helicarm/xray/sidecar.h"

namespace helicarm::sweep {
namespace {

/// The image with what the view states of it.
xray::XrayImage image_of(const Frame& frame, const xray::ImageFile* file) {
  if (!file) return value_or_throw(pipeline::image_of(frame.view));
  xray::XrayImage image = value_or_throw(file->read(frame.view.name, frame.view.frame));
  value_or_throw(xray::state_geometry(
      image, {.pixel_mm = frame.view.pixel_mm, .source_detector_mm = frame.view.source_detector_mm},
      fmt::format("case.json: view {}", frame.run)));
  return image;
}

/// A stage's only view, or its refusal thrown.
template <class View>
std::vector<View> passed(pipeline::OrRefusal<std::vector<View>> views) {
  if (!views) throw BadInput(std::move(views.error().failure));
  return *std::move(views);
}

/// The map's covariance without the fiducials that were rejected.
void keep_used_rows(calibration::ViewFiducials& view, const std::vector<fiducials::Fiducial>& after) {
  if (view.map_covariance_px2.size() == 0) return;
  std::vector<Eigen::Index> kept;
  Eigen::Index row = 0;
  for (std::size_t k = 0; k < after.size(); ++k) {
    if (view.fiducials[k].status != fiducials::FiducialStatus::used) continue;
    if (after[k].status == fiducials::FiducialStatus::used) kept.push_back(row);
    ++row;
  }
  view.map_covariance_px2 = view.map_covariance_px2(kept, kept).eval();
}

pipeline::LabelledView labelled_near(pipeline::RectifiedView view, const fiducials::ExpectedView& expected,
                                     const pipeline::Case& one, const pipeline::RunOptions& options) {
  const fiducials::FiducialOptions how{options.method, {}, one.views.front().mirrored, expected};
  auto labels = value_or_throw(
      fiducials::label_fiducials(*view.xray_image, view.dots, view.rectification, one.calibrator, how));
  return {std::move(view), std::move(labels)};
}

void estimate_from(FrameEstimate& estimate, const Frame& frame, xray::XrayImage image,
                   const pipeline::Case& base, const pipeline::RunOptions& options,
                   const std::optional<fiducials::ExpectedView>& expected) {
  value_or_throw(rectification::check_usable(image));
  pipeline::Case one = base;
  one.views = {frame.view};
  pipeline::ReadView read{{frame.view.name}, std::make_shared<const xray::XrayImage>(std::move(image))};
  auto detected = passed(pipeline::detect_in_views({std::move(read)}, one, options));
  auto rectified = passed(pipeline::rectify_views(std::move(detected), one, options));
  const auto& map = rectified.front().rectification.map;
  if (map.rectified_plane == rectification::RectifiedPlane::detector || map.is_identity())
    estimate.pixel_mm = map.rectified_pixel_mm;
  if (!map.is_identity()) estimate.map = map;
  estimate.plate = calibration::plate_map_of(rectified.front().rectification);
  estimate.map_of_record = rectified.front().rectification.source == rectification::MapSource::record;
  const pipeline::LabelledView labelled =
      expected ? labelled_near(std::move(rectified.front()), *expected, one, options)
               : passed(pipeline::label_views(std::move(rectified), one, options)).front();
  estimate.fiducials = pipeline::fiducials_of(labelled);
  estimate.mirrored_without_statement =
      pipeline::is_mirrored_without_statement(labelled.fiducials.mirrored, *labelled.xray_image, frame.view);
  for (const Warning& warning : labelled.fiducials.warnings) estimate.warnings.push_back(warning);
  value_or_throw(calibrate_alone(estimate, base));
}

}  // namespace

const xray::ImageFile* file_of(const Frame& frame, const SweepCase& the_case) {
  const auto file = the_case.files.find(frame.view.image);
  return file == the_case.files.end() ? nullptr : file->second.get();
}

Failure with_cause(Failure failure, const Frame& frame, const SweepCase& the_case, unsigned threads) {
  pipeline::RunOptions options;
  options.maps = the_case.maps;
  options.threads = threads;
  pipeline::Case one = the_case.base;
  one.views = {frame.view};
  failure.view = frame.view.name;
  const auto explained = guarded([&] {
    const auto image = std::make_shared<const xray::XrayImage>(image_of(frame, file_of(frame, the_case)));
    pipeline::Refusal refusal{failure, pipeline::Stage::label, {}};
    pipeline::ViewResult& view = refusal.views.emplace_back();
    view.name = frame.view.name;
    view.xray_image = image;
    auto rectified =
        pipeline::detect_in_views({{{frame.view.name}, image}}, one, options).and_then([&](auto views) {
          return pipeline::rectify_views(std::move(views), one, options);
        });
    if (rectified) view.rectification = rectified->front().rectification;
    return pipeline::with_cause(refusal, one, options);
  });
  return explained ? *explained : failure;
}

bool has_distortion(const Frame& frame, const SweepCase& the_case) {
  return the_case.base.plate || frame.view.map || frame.view.plate_image || the_case.maps;
}

Expected<xray::XrayImage> rectified_image_of(const Frame& frame, const SweepCase& the_case) {
  return guarded([&] {
    xray::XrayImage image = image_of(frame, file_of(frame, the_case));
    if (!has_distortion(frame, the_case)) return image;
    pipeline::RunOptions options;
    options.maps = the_case.maps;
    options.threads = 1;
    pipeline::Case one = the_case.base;
    one.views = {frame.view};
    auto shared = std::make_shared<const xray::XrayImage>(image);
    auto detected = passed(pipeline::detect_in_views({{{frame.view.name}, std::move(shared)}}, one, options));
    const auto rectified = passed(pipeline::rectify_views(std::move(detected), one, options));
    image.pixels = rectification::resample(image, rectified.front().rectification.map);
    return image;
  });
}

Expected<void> calibrate_alone(FrameEstimate& estimate, const pipeline::Case& base) {
  calibration::CalibrationOptions options;
  options.common = pipeline::common_prior(base.calibrator);
  return calibration::calibrate({estimate.fiducials}, options)
      .map([&](calibration::CalibrationResult result) {
        keep_used_rows(estimate.fiducials, result.fiducials.front());
        estimate.fiducials.fiducials = std::move(result.fiducials.front());
        estimate.alone = std::move(result.views.front());
        estimate.variance_scale = result.variance_scale;
      });
}

Expected<FrameEstimate> estimate_frame(const Frame& frame, const xray::ImageFile* file,
                                       const pipeline::Case& base, const pipeline::RunOptions& options,
                                       const std::optional<fiducials::ExpectedView>& expected) {
  FrameEstimate estimate;
  const auto done = guarded([&] {
    xray::XrayImage image = image_of(frame, file);
    estimate.image_size = {image.pixels.width(), image.pixels.height()};
    estimate.primary_angle_deg = image.acquisition.primary_angle_deg;
    estimate.secondary_angle_deg = image.acquisition.secondary_angle_deg;
    estimate.source_detector_mm = image.acquisition.source_detector_mm;
    estimate.logarithmic = image.acquisition.logarithmic;
    estimate.image = image.acquisition.instance_key;
    estimate.warnings = image.warnings;
    pipeline::RunOptions alone = options;
    alone.threads = 1;
    estimate_from(estimate, frame, std::move(image), base, alone, expected);
  });
  if (done) return estimate;
  if (exit_code(done.error().reason) == 2) return tl::unexpected<Failure>(done.error());
  estimate.failure = done.error();
  estimate.failure->view = frame.view.name;
  return estimate;
}

void refuse(FrameEstimate& estimate, Failure failure, const std::string& view) {
  failure.view = view;
  estimate.failure = std::move(failure);
}

void calibrate_with(double factor, const pipeline::Case& base, FrameEstimate& at, const std::string& view) {
  constexpr double largest_ratio = 4;  // of a frame's residuals to the run's noise
  if (at.failure) return;
  for (fiducials::Fiducial& ball : at.fiducials.fiducials) ball.sigma_px *= factor;
  at.fiducials.map_covariance_px2 *= factor * factor;
  at.fiducials.start = at.alone->view;
  auto again = calibrate_alone(at, base);
  if (again) {
    const double ratio = std::sqrt(at.alone->chi2 / std::max(1, at.alone->dof));
    if (ratio > largest_ratio)
      again = fail(Reason::residual_too_large,
                   fmt::format("residuals are {:.1f} times those of the other images, limit {:g}: labels are "
                               "wrong, or a fiducial moved",
                               ratio, largest_ratio),
                   {{"ratio", ratio}, {"limit", largest_ratio}});
  }
  if (!again) refuse(at, again.error(), view);
}

}  // namespace helicarm::sweep
