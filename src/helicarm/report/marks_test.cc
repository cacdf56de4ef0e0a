// SPDX-License-Identifier: Apache-2.0
#include "helicarm/report/marks.h"

#include <gtest/gtest.h>

#include "helicarm/rectification/models/polynomial.h"

namespace helicarm::report {
namespace {

using Eigen::Vector2d;

/// A scaling about the image's corner, with simple expected values.
rectification::DistortionMap doubling_map() {
  rectification::DistortionMap map = rectification::identity_map(200, 200, {});
  Eigen::MatrixX2d coefficients(3, 2);
  coefficients << 0, 0, 400, 0, 0, 400;
  map.model = rectification::polynomial_model(1, {{0, 0}, 200}, coefficients);
  return map;
}

pipeline::Result one_view() {
  pipeline::Result result;
  pipeline::ViewResult view;
  view.name = "AP";
  view.rectification = rectification::Rectification{};
  view.rectification->map = doubling_map();
  view.rectification->plate_dots = {detection::Dot{.centre_px = {100, 40}, .radius_px = 3}};
  view.found = fiducials::LabelledFiducials{};
  view.found->false_blobs = {detection::Dot{.centre_px = {20, 60}, .radius_px = 5}};
  fiducials::Fiducial used{"P1", {0, 0, 0}}, rejected{"P2", {0, 0, 0}}, hidden{"P3", {0, 0, 0}};
  used.status = fiducials::FiducialStatus::used;
  used.uv = {30.5, 40.25};
  used.sigma_px = 0.02;
  rejected.status = fiducials::FiducialStatus::rejected;
  rejected.uv = {50, 40};
  hidden.status = fiducials::FiducialStatus::occluded;
  view.found->fiducials = {used, rejected, hidden};
  view.calibrated = calibration::CalibratedView{};
  view.calibrated->view = {{400, 400, 30, 40, 0}, {Eigen::Matrix3d::Identity(), {0, 0, 800}}};
  result.views.push_back(std::move(view));
  const auto seen = [](double u, double v) { return fiducials::ImagePoint{{2 * u, 2 * v}, {u, v}, 0.1}; };
  result.points = {
      {"start", localization::PointSource::pick, {}, {seen(10, 20)}, guidance::PointInFrames{}, 0, {}},
      {"end",
       localization::PointSource::pick,
       {},
       {seen(60, 20)},
       {},
       0,
       Failure{Reason::not_seen, "alone", "", {}}},
      {"T1", localization::PointSource::target, {}, {{}}, {}, 0, {}}};
  result.tunnel_ends = {{0, 1}};
  result.tool_lines = {{"drill", "t", {0, 0, 0}, {2, 0, 0}}, {"behind", "t", {0, 0, -900}, {2, 0, 0}}};
  return result;
}

TEST(MarksOf, HoldDetectionsInRectifiedPixels) {
  const ViewMarks marks = marks_of(one_view(), 0);
  ASSERT_EQ(marks.balls.size(), 2u);
  EXPECT_TRUE(marks.balls[0].used);
  EXPECT_FALSE(marks.balls[1].used);
  EXPECT_TRUE(marks.balls[0].residual->isApprox(Vector2d(0.5, 0.25), 1e-12));
  EXPECT_NEAR(largest_residual(marks), std::hypot(0.5, 0.25), 1e-12);
  EXPECT_TRUE(marks.plate_dots.at(0).place.isApprox(Vector2d(50, 20), 1e-9));
  EXPECT_TRUE(marks.false_blobs.at(0).place.isApprox(Vector2d(10, 30), 1e-9));
  ASSERT_EQ(marks.points.size(), 2u);
  EXPECT_TRUE(marks.points[0].error_95_mm);
  EXPECT_FALSE(marks.points[1].error_95_mm);
  EXPECT_EQ(marks.points[1].reason, "alone");
  EXPECT_EQ(marks.tunnels.size(), 1u);
  ASSERT_EQ(marks.tool_lines.size(), 1u);
  EXPECT_TRUE(marks.tool_lines[0].front().isApprox(Vector2d(27, 40), 1e-12));
  EXPECT_TRUE(marks.tool_lines[0].back().isApprox(Vector2d(34, 40), 1e-12));
}

TEST(RawMarks, AreMappedByTheDistortionMap) {
  const ViewMarks raw = raw_marks(marks_of(one_view(), 0), doubling_map());
  EXPECT_TRUE(raw.balls[0].place.isApprox(Vector2d(61, 80.5), 1e-9));
  EXPECT_TRUE(raw.balls[0].residual->isApprox(Vector2d(1, 0.5), 1e-9));
  EXPECT_TRUE(raw.plate_dots[0].place.isApprox(Vector2d(100, 40), 1e-9));
  EXPECT_TRUE(raw.tunnels.at(0).back().isApprox(Vector2d(120, 40), 1e-9));
}

TEST(MarksOf, ImageWithoutDetectionsHasNone) {
  pipeline::Result result;
  result.views.push_back({"AP", std::make_shared<const xray::XrayImage>(), {}, {}, {}});
  const ViewMarks marks = marks_of(result, 0);
  EXPECT_TRUE(marks.balls.empty() && marks.plate_dots.empty() && marks.points.empty());
}

}  // namespace
}  // namespace helicarm::report
