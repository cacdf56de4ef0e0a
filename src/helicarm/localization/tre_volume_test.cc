// SPDX-License-Identifier: Apache-2.0
#include "helicarm/localization/tre_volume.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "helicarm/geometry/rotation.h"
#include "helicarm/localization/locate.h"

namespace helicarm::localization {
namespace {

/// Two exact views of f / pixel = 6000 px at 800 mm, across each other.
calibration::Calibration exact_pair() {
  calibration::Calibration calibration;
  for (const double angle : {0.0, std::numbers::pi / 2}) {
    calibration::CalibratedView view;
    view.view = {{6000, 6000, 512, 512, 0}, {geometry::rotation_from_euler(angle, 0, 0), {0, 0, 800}}};
    calibration.views.push_back(view);
  }
  return calibration;
}

TEST(PredictTre, CentreOfExactViewsHasThePixelsError) {
  const TreVolume volume = predict_tre(exact_pair(), {0, 0, 0}, 25, 10, 0.5, 1);
  ASSERT_EQ(volume.side, 5);
  ASSERT_EQ(volume.rms_mm.size(), 125u);
  EXPECT_TRUE(volume.place(2, 2, 2).isZero());
  // Two views share one axis; the others are seen in one view each.
  const double pixel_mm = 800.0 / 6000;
  constexpr double rounding_px = 0.05;  // of views without a covariance, as `locate` assumes
  EXPECT_NEAR(volume.at(2, 2, 2), std::hypot(0.5, rounding_px) * pixel_mm * std::sqrt(2.5), 1e-6);
}

TEST(PredictTre, DoesNotDependOnThreads) {
  EXPECT_EQ(predict_tre(exact_pair(), {5, 6, 7}, 30, 10, 0.5, 1).rms_mm,
            predict_tre(exact_pair(), {5, 6, 7}, 30, 10, 0.5, 3).rms_mm);
}

TEST(PredictTre, PointsBehindASourceHaveNone) {
  const TreVolume volume = predict_tre(exact_pair(), {0, 0, -850}, 10, 10, 0.5, 1);
  EXPECT_TRUE(std::isnan(volume.at(1, 1, 1)));
  EXPECT_NE(to_csv(volume).find("\n0,0,-850,\n"), std::string::npos);
}

TEST(TreVolumeVtk, ContainsEveryPoint) {
  const std::string text = to_vtk(predict_tre(exact_pair(), {0, 0, 0}, 10, 10, 0.5, 1));
  EXPECT_NE(text.find("DIMENSIONS 3 3 3\nORIGIN -10 -10 -10\nSPACING 10 10 10\nPOINT_DATA 27"),
            std::string::npos);
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 10 + 27);
}

}  // namespace
}  // namespace helicarm::localization
