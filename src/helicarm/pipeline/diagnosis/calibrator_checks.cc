// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/diagnosis/calibrator_checks.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "helicarm/pipeline/diagnosis/displaced_balls.h"

namespace helicarm::pipeline {
namespace {

using Eigen::Vector3d;

constexpr double warn_sigmas = 3, refuse_sigmas = 10;

std::optional<Failure> check_handedness(const std::vector<LabelledView>& images, const Case& the_case) {
  for (std::size_t i = 0; i < images.size(); ++i)
    if (!is_mirrored_without_statement(images[i].fiducials.mirrored, *images[i].xray_image,
                                       the_case.views[i]))
      return std::nullopt;
  return mirrored_without_statement(images.size());
}

/// Unlabelled candidates within the used fiducials' largest distance from their centroid.
int unlabelled_among(const std::vector<fiducials::Fiducial>& balls, const LabelledView& image) {
  std::vector<Eigen::Vector2d> used;
  for (const fiducials::Fiducial& ball : balls)
    if (ball.status == fiducials::FiducialStatus::used) used.push_back(ball.uv_raw);
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
  for (const Eigen::Vector2d& uv : used) middle += uv / double(used.size());
  double reach = 0;
  for (const Eigen::Vector2d& uv : used) reach = std::max(reach, (uv - middle).norm());
  return int(std::ranges::count_if(image.fiducials.false_blobs, [&](const detection::Dot& dot) {
    return (dot.centre_px - middle).norm() <= reach;
  }));
}

/// Refuses labels that leave at least a third of the fiducials, and as many candidates among them,
/// unexplained.
std::optional<Failure> check_labels(const CaseCalibration& calibration,
                                    const std::vector<LabelledView>& images) {
  for (std::size_t i = 0; i < images.size(); ++i) {
    const auto count = [&](fiducials::FiducialStatus status) {
      return int(std::ranges::count(calibration.fiducials[i], status, &fiducials::Fiducial::status));
    };
    const int used = count(fiducials::FiducialStatus::used);
    const int rejected = count(fiducials::FiducialStatus::rejected),
              missing = count(fiducials::FiducialStatus::not_found);
    const int unlabelled = unlabelled_among(calibration.fiducials[i], images[i]);
    const int unexplained = rejected + missing;
    if (2 * unexplained < used || unlabelled < unexplained) continue;
    return Failure{
        Reason::ambiguous_labels,
        fmt::format("the labels explain {} fiducials, but {} are rejected and {} not found, while {} "
                    "candidates of their size among them have no label",
                    used, rejected, missing, unlabelled),
        images[i].name,
        {{"matched", double(used)},
         {"rejected", double(rejected)},
         {"not_found", double(missing)},
         {"left_over", double(unlabelled)}}};
  }
  return std::nullopt;
}

}  // namespace

bool is_mirrored_without_statement(bool is_mirrored, const xray::XrayImage& xray_image,
                                   const CaseView& view) {
  return is_mirrored && !view.mirrored && !xray_image.acquisition.flip_hint;
}

DiameterError diameter_error(double radius_px, std::optional<bool> logarithmic) {
  constexpr double of_diameter = 0.01;  // edge model, tolerance
  // Fitted to simulated images of 512 and 1024 pixels, whose blur is 0.9 px: docs/method.md.
  constexpr double blurred_px = 1.43;
  const double loss = std::pow(blurred_px / radius_px, 3);
  const double share = logarithmic ? double(*logarithmic) : 0.5;
  return {-share * loss, std::hypot(of_diameter, loss / 2)};
}

Failure mirrored_without_statement(std::size_t images) {
  return {
      Reason::ambiguous_handedness,
      "every image is labelled as mirrored, without a tag or \"mirrored\" in the case. If the C-arm stores "
      "mirrored images, state \"mirrored\": true for each view; if the calibrator's file is a mirror "
      "image of the calibrator (the sign of one axis, or two axes exchanged), correct the file. The "
      "located points differ",
      {},
      {{"views", double(images)}}};
}

void DiameterEvidence::add(const geometry::View& view, std::span<const fiducials::Fiducial> fiducials,
                           const phantom::Calibrator& calibrator, std::optional<bool> logarithmic) {
  for (std::size_t k = 0; k < calibrator.balls.size(); ++k) {
    const fiducials::Fiducial& ball = fiducials[k];
    if (ball.status != fiducials::FiducialStatus::used || !(ball.radius_px > 0)) continue;
    const double expected = 0.5 * calibrator.balls[k].diameter_mm * view.intrinsics.fy /
                            view.depth(calibrator.balls[k].centre_in_calibrator);
    const DiameterError error = diameter_error(ball.radius_px, logarithmic);
    sum_ += std::log(ball.radius_px / (1 + error.bias) / expected);
    sigmas_ += error.sigma;
    ++count_;
  }
}

ScaleEvidence DiameterEvidence::scale() const {
  if (count_ == 0) return {};
  return {sum_ / count_, sigmas_ / count_};
}

std::optional<ScaleDisagreement> scale_disagreement(const ScaleEvidence& scale,
                                                    const phantom::Calibrator& calibrator) {
  const double sigma = std::hypot(scale.sigma, calibrator.scale_sigma);
  if (!(scale.sigma > 0) || std::abs(scale.excess) <= warn_sigmas * sigma) return std::nullopt;
  return ScaleDisagreement{
      {Reason::scale_disagrees,
       fmt::format("the fiducials' diameters imply that the calibrator is {:.1f} % {} than in its file "
                   "(+-{:.1f} %): check coordinates, diameters and pixel size",
                   100 * std::abs(scale.excess), scale.excess > 0 ? "smaller" : "larger", 100 * sigma),
       {},
       {{"file_over_true", 1 + scale.excess}, {"sigma", sigma}}},
      std::abs(scale.excess) > refuse_sigmas * sigma};
}

ScaleEvidence combined(const ScaleEvidence& a, const ScaleEvidence& b) {
  if (!(a.sigma > 0)) return b;
  if (!(b.sigma > 0)) return a;
  const double of_a = 1 / (a.sigma * a.sigma), of_b = 1 / (b.sigma * b.sigma);
  return {(of_a * a.excess + of_b * b.excess) / (of_a + of_b), 1 / std::sqrt(of_a + of_b)};
}

ScaleEvidence scale_evidence(const calibration::CalibrationResult& calibration,
                             const std::vector<LabelledView>& images, const phantom::Calibrator& calibrator) {
  if (calibration.joint_covariance.size() == 0) return {};  // `--method paper`: its circles' radii are rough
  DiameterEvidence diameters;
  for (std::size_t i = 0; i < calibration.views.size(); ++i)
    diameters.add(calibration.views[i].view, calibration.fiducials[i], calibrator,
                  images[i].xray_image->acquisition.logarithmic);
  ScaleEvidence evidence = diameters.scale();
  for (std::size_t i = 0; i < images.size(); ++i)
    if (const auto& stated = images[i].xray_image->acquisition.source_patient_mm)
      evidence =
          combined(evidence, {calibration.views[i].view.depth(phantom::middle_of(calibrator)) / *stated - 1,
                              patient_distance_sigma_mm / *stated});
  return evidence;
}

Expected<CaseCalibration> check_calibrator(CaseCalibration calibration,
                                           const std::vector<LabelledView>& images, const Case& the_case) {
  if (auto refused = check_labels(calibration, images)) return tl::unexpected<Failure>(*std::move(refused));
  if (auto refused = check_handedness(images, the_case)) return tl::unexpected<Failure>(*std::move(refused));
  const auto assumed = std::ranges::find_if(
      images, [](const LabelledView& image) { return image.fiducials.assumed_tolerance_mm > 0; });
  if (assumed != images.end() && calibration.found_tolerance_mm == 0 && calibration.variance_scale != 1)
    return tl::unexpected<Failure>({Reason::calibrator_mismatch,
                                    "the fiducials are displaced from the calibrator's coordinates by "
                                    "different amounts in the views",
                                    assumed->name,
                                    {{"variance_scale", calibration.variance_scale}}});
  if (auto scale =
          scale_disagreement(scale_evidence(calibration, images, the_case.calibrator), the_case.calibrator)) {
    Failure& disagreement = scale->failure;
    if (scale->is_certain) return tl::unexpected<Failure>(std::move(disagreement));
    if (calibration.found_tolerance_mm > 0)
      return tl::unexpected<Failure>(
          {Reason::calibrator_mismatch,
           fmt::format(
               "the fiducials deviate by {:.2g} mm rms from the calibrator's file, and {}: the case names "
               "another calibrator than the one in the images, or its file is wrong",
               calibration.ball_rms_mm, disagreement.message),
           {},
           disagreement.figures});
    calibration.contradicts_calibrator = true;
    calibration.warnings.push_back(std::move(disagreement));
  }
  for (Warning& warning : displaced_balls(calibration, images, the_case.calibrator))
    calibration.warnings.push_back(std::move(warning));
  return calibration;
}

std::vector<Warning> handedness_notes(const CaseCalibration& calibration) {
  for (const LabelledView& image : calibration.images)
    if (!image.fiducials.mirrored) return {};
  return {mirrored_as_stated()};
}

std::vector<Warning> one_view_notes(const CaseCalibration& calibration) {
  if (calibration.views.size() != 1 || calibration.history || calibration.views.front().covariance.isZero(0))
    return {};
  const calibration::CalibratedView& view = calibration.views.front();
  const auto sigma = [&](Eigen::Index i) { return std::sqrt(view.covariance(i, i)); };
  const double focal_percent = 100 * sigma(0) / std::abs(view.view.intrinsics.fx);
  const double principal_px = std::hypot(sigma(2), sigma(3));
  const double source_mm = std::sqrt(calibration::source_covariance(view).trace());
  return {
      {Reason::intrinsics_weak,
       fmt::format("one view alone determines its focal length to {:.2g} %, its principal point to {:.2g} px "
                   "and its source to {:.2g} mm (one standard deviation). These errors belong together: "
                   "what it projects near the calibrator is known far better. A second view or the C-arm's "
                   "history (--machine) determines them",
                   focal_percent, principal_px, source_mm),
       view.name,
       {{"focal_percent", focal_percent}, {"principal_px", principal_px}, {"source_mm", source_mm}}}};
}

Warning mirrored_as_stated() {
  return {
      Reason::ambiguous_handedness,
      "every image is mirrored, as its tag or the case states. Images do not show whether the statement "
      "is true: if it is wrong, the calibrator's file is a mirror image of the calibrator, and all points "
      "are mirrored. Check by a view that is not mirrored, or by a point whose side is known",
      {},
      {}};
}

std::vector<Warning> scale_notes(const Case& the_case, const CaseCalibration& calibration,
                                 const std::vector<PointResult>& points) {
  if (the_case.calibrator.scale_sigma > 0) return {};
  const Vector3d middle = phantom::middle_of(the_case.calibrator);
  Warning note{Reason::scale_unverified, {}, {}, {}};
  const ScaleEvidence evidence = scale_evidence(calibration, calibration.images, the_case.calibrator);
  if (evidence.sigma > 0) {
    note.figures["file_over_true"] = 1 + evidence.excess;
    note.figures["sigma"] = evidence.sigma;
  }
  double most = 0;
  for (const PointResult& point : points) {
    if (!point.place) continue;
    const double per_cent_mm = 0.01 * (point.place->in_calibrator - middle).norm();
    note.figures["mm_per_per_cent " + point.name] = per_cent_mm;
    most = std::max(most, per_cent_mm);
  }
  std::string distances;
  for (const calibration::CalibratedView& view : calibration.views) {
    const double distance = (view.view.camera_from_world * middle).norm();
    note.figures["source_distance_mm " + view.name] = distance;
    distances += fmt::format("{}{} {:.0f} mm", distances.empty() ? "" : ", ", view.name, distance);
  }
  std::string strain;
  if (calibration.strain_sigma > 0) {
    note.figures["strain_limit_per_cent"] = 100 * warn_sigmas * calibration.strain_sigma;
    strain = fmt::format(", nor strains of it below {:.2g} %", 100 * warn_sigmas * calibration.strain_sigma);
  }
  note.message = fmt::format(
      "images do not show the calibrator's absolute size{}: an error of 1 % of its file moves points by {}. "
      "Measure "
      "it and state scale_sigma, or compare the distances of the fiducials' centre from the source with a "
      "tape "
      "measure: {}",
      strain, most == 0 ? "1 % of their distance from its middle" : fmt::format("up to {:.2g} mm", most),
      distances);
  return {note};
}

}  // namespace helicarm::pipeline
