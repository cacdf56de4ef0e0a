// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/calibrator_warnings.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "helicarm/calibration/ball_offsets.h"
#include "helicarm/calibration/strain.h"

namespace helicarm::calibration {

void warn_of_strain(CalibrationResult& result, const CleanFit& clean) {
  constexpr double chi2_at_3_sigma = 18.2;
  if (clean.problems.size() < 2 || clean.fit.dof < 6) return;
  const Strain strain = strain_of(clean.problems, clean.fit);
  result.strain_sigma = strain.sigma;
  const double left = std::max(1.0, (clean.fit.chi2 - strain.chi2_gain) / (clean.fit.dof - 5));
  if (strain.chi2_gain / left < chi2_at_3_sigma) return;
  result.contradicts_calibrator = true;
  result.warnings.push_back(
      {Reason::calibrator_strained,
       fmt::format(
           "the views fit a calibrator that is {:.2g} % {} along ({:.2f}, {:.2f}, {:.2f}) than in its file: "
           "measure it with `helicarm phantom measure`, or check the image's pixel aspect",
           100 * std::abs(strain.extension), strain.extension > 0 ? "longer" : "shorter", strain.axis.x(),
           strain.axis.y(), strain.axis.z()),
       {},
       {{"per_cent", 100 * strain.extension},
        {"x", strain.axis.x()},
        {"y", strain.axis.y()},
        {"z", strain.axis.z()},
        {"chi2_gain", strain.chi2_gain / left}}});
}

void report_offsets(CalibrationResult& result, const CleanFit& clean) {
  result.ball_rms_mm = rms_offset_mm(clean.problems, clean.fit);
  constexpr double least_reported_mm = 0.02;
  if (result.ball_rms_mm < least_reported_mm) return;
  Warning deviation{
      Reason::calibrator_deviates,
      fmt::format("the fiducials deviate by {:.2g} mm rms from the calibrator's file: check that "
                  "it is this calibrator's, and measure it with `helicarm phantom measure`",
                  result.ball_rms_mm),
      {},
      {{"rms_mm", result.ball_rms_mm}}};
  if (result.found_tolerance_mm > 0) deviation.figures["tolerance_found_mm"] = result.found_tolerance_mm;
  const bool beyond = result.found_tolerance_mm > 0;
  result.contradicts_calibrator |= beyond;
  (beyond ? result.warnings : result.notes).push_back(std::move(deviation));
}

}  // namespace helicarm::calibration
