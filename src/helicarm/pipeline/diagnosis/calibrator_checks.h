// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "helicarm/pipeline/calibrate_case.h"
#include "helicarm/pipeline/result.h"

namespace helicarm::pipeline {

/// Estimate of the calibrator's scale that is independent of its coordinates.
struct ScaleEvidence {
  double excess = 0;  ///< the file's coordinates over the true ones, less 1
  double sigma = 0;   ///< of `excess`; 0: not observable
};

/// Relative error of the diameters of balls' images with this radius, common to all balls: its mean and
/// standard deviation. In a logarithmic image the blur, which precedes the logarithm, makes balls appear
/// smaller; nothing: it is not known whether the image is one.
struct DiameterError {
  double bias = 0;
  double sigma = 0;
};
DiameterError diameter_error(double radius_px, std::optional<bool> logarithmic);

/// Of balls' images in any number of views: the mean of ln(measured / expected radius at the ball's
/// distance), over the fiducials in use.
class DiameterEvidence {
 public:
  /// `fiducials`: one per ball of the calibrator.
  void add(const geometry::View& view, std::span<const fiducials::Fiducial> fiducials,
           const phantom::Calibrator& calibrator, std::optional<bool> logarithmic);
  ScaleEvidence scale() const;

 private:
  double sum_ = 0, sigmas_ = 0, count_ = 0;
};

/// `scale_disagrees`; certain beyond ten sigma.
struct ScaleDisagreement {
  Failure failure;
  bool is_certain;
};

/// Where the file's scale deviates from the evidence by three sigma of both.
std::optional<ScaleDisagreement> scale_disagreement(const ScaleEvidence& scale,
                                                    const phantom::Calibrator& calibrator);

/// Of Distance Source to Patient as the distance of the calibrator from the source.
inline constexpr double patient_distance_sigma_mm = 60;

/// Mean of two independent estimates, or the one that is known.
ScaleEvidence combined(const ScaleEvidence& a, const ScaleEvidence& b);

/// From the fiducials' measured diameters and Distance Source to Patient (0018,1111).
ScaleEvidence scale_evidence(const calibration::CalibrationResult& calibration,
                             const std::vector<LabelledView>& images, const phantom::Calibrator& calibrator);

/// Whether neither the case nor a tag explains why an image is mirrored.
bool is_mirrored_without_statement(bool is_mirrored, const xray::XrayImage& xray_image, const CaseView& view);

/// Refusal `ambiguous_handedness` of images that are all so.
Failure mirrored_without_statement(std::size_t images);

/// Checks the calibrator's file against the images. Refuses `ambiguous_labels` if a third of the fiducials
/// and as many candidates are unexplained, `ambiguous_handedness` if every image is mirrored without a tag or
/// `mirrored` in the case, `scale_disagrees` if the scale deviates by ten sigma, `calibrator_mismatch` if
/// labels required an assumed tolerance and the offsets differ between views, or if the fiducials deviate
/// from the file and the scale by three sigma. Warns if the scale deviates by three sigma, and of displaced
/// or exchanged fiducials.
Expected<CaseCalibration> check_calibrator(CaseCalibration calibration,
                                           const std::vector<LabelledView>& images, const Case& the_case);

/// Note `ambiguous_handedness` if every image is mirrored: that the calibrator's file is not rests on a tag
/// or the case alone.
std::vector<Warning> handedness_notes(const CaseCalibration& calibration);

/// Note `ambiguous_handedness` of images that are all mirrored as stated.
Warning mirrored_as_stated();

/// Of one view: how well it determines its intrinsics and source without
/// a C-arm history (intrinsics_weak).
std::vector<Warning> one_view_notes(const CaseCalibration& calibration);

/// Effect of an error of the calibrator's scale, which the images do not constrain: mm per per cent at each
/// point, and the source distances for a comparison by tape measure. Empty if the file states scale_sigma.
std::vector<Warning> scale_notes(const Case& the_case, const CaseCalibration& calibration,
                                 const std::vector<PointResult>& points);

}  // namespace helicarm::pipeline
