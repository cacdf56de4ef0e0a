// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cmath>
#include <numbers>
#include <optional>

#include "helicarm/calibration/calibrated_view.h"
#include "helicarm/core/output.h"

namespace helicarm::pipeline {

inline constexpr std::array parameter_names{"fx_px",
                                            "fy_px",
                                            "u0",
                                            "v0",
                                            "rotation_x_rad",
                                            "rotation_y_rad",
                                            "rotation_z_rad",
                                            "translation_x_mm",
                                            "translation_y_mm",
                                            "translation_z_mm",
                                            "skew_px"};
static_assert(parameter_names.size() == calibration::view_parameters);

/// Standard deviations.
template <int n>
Eigen::Vector<double, n> sigmas(const Eigen::Matrix<double, n, n>& covariance) {
  return covariance.diagonal().cwiseMax(0).cwiseSqrt();
}

/// As in result.json's "parameters" (core/output.h).
template <class Output>
void describe_parameters(Output& output, const calibration::CalibratedView& view) {
  output.value("order", parameter_names, "of the covariance");
  output.value("covariance", view.covariance, "of the view's parameters");
  output.object("sigma", true, "standard deviations", [&](auto& sigma) {
    static constexpr std::array of_intrinsics{"fx_px", "fy_px", "u0", "v0"};
    const auto all = sigmas<calibration::view_parameters>(view.covariance);
    for (std::size_t i = 0; i < of_intrinsics.size(); ++i)
      sigma.value(of_intrinsics[i], all[Eigen::Index(i)], "");
    sigma.value(
        "source_mm", [&] { return sigmas<3>(calibration::source_covariance(view)); },
        "of the source in the calibrator's frame");
    const double deg2 = std::pow(180 / std::numbers::pi, 2);
    sigma.value(
        "rotation_deg", [&] { return sigmas<3>(view.covariance.block<3, 3>(4, 4) * deg2); },
        "about the camera's axes");
  });
}

/// "parameters" of a view; null without a covariance.
template <class Output>
void describe_parameters(Output& output, const std::optional<calibration::CalibratedView>& view,
                         const char* help) {
  output.object("parameters", view && !view->covariance.isZero(0), help, [&](auto& row) {
    static const calibration::CalibratedView none{};
    describe_parameters(row, view ? *view : none);
  });
}

}  // namespace helicarm::pipeline
