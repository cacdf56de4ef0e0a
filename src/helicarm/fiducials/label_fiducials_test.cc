// SPDX-License-Identifier: Apache-2.0
#include "helicarm/fiducials/label_fiducials.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "helicarm/fiducials/paper_circles.h"
#include "helicarm/rectification/simulated_image_test.h"

namespace helicarm::fiducials {
namespace {

using Eigen::Vector2d;
using simulation::CaseKind;
using simulation::Fault;
using simulation::SimulatedCase;
using simulation::SimulatedView;
using simulation::Visibility;

const SimulatedCase& sound_case() {
  static const SimulatedCase simulated_case = rectification::small_case(6, CaseKind::accuracy);
  return simulated_case;
}

/// Lateral view mirrored, two decoy balls, two fiducials missing.
const SimulatedCase& faulty_case() {
  static const SimulatedCase simulated_case =
      rectification::small_case(8, CaseKind::accuracy, {Fault::mirrored, Fault::decoys}, {"P4", "P9"});
  return simulated_case;
}

detection::ImageDots dots_in(const xray::XrayImage& xray_image,
                             detection::Polarity metal = detection::Polarity::dark) {
  auto dots = detection::unsearched(xray_image, 2);
  detection::dots_of(dots, xray_image, metal);
  return dots;
}

Expected<LabelledFiducials> label(const xray::XrayImage& xray_image,
                                  const rectification::Rectification& rectification,
                                  const phantom::Calibrator& calibrator,
                                  const FiducialOptions& options = {}) {
  return label_fiducials(xray_image, dots_in(xray_image, rectification.metal), rectification, calibrator,
                         options);
}

LabelledFiducials found_in(const SimulatedCase& simulated_case, const SimulatedView& view,
                           rectification::Method method = rectification::Method::best) {
  const xray::XrayImage xray_image = exposure_of(view);
  rectification::RectificationOptions options;
  options.method = method;
  const rectification::Rectification rectification =
      rectification::rectify(xray_image, *simulated_case.plate, options).value();
  return label(xray_image, rectification, simulated_case.calibrator, {method}).value();
}

/// Every used fiducial is within the tolerance of its true position, and every clear one is used.
void expect_right(const LabelledFiducials& found, const SimulatedView& view, double tolerance_px) {
  ASSERT_EQ(found.fiducials.size(), view.balls.size());
  for (std::size_t k = 0; k < view.balls.size(); ++k) {
    const Fiducial& fiducial = found.fiducials[k];
    EXPECT_EQ(fiducial.label, view.balls[k].name);
    if (view.balls[k].visibility == Visibility::clear) {
      EXPECT_EQ(fiducial.status, FiducialStatus::used) << fiducial.label;
    }
    if (fiducial.status != FiducialStatus::used) continue;
    EXPECT_LT((fiducial.uv_raw - view.balls[k].raw).norm(), tolerance_px) << fiducial.label;
    EXPECT_GT(fiducial.sigma_px, 0);
  }
}

TEST(LabelFiducials, FiducialBehindABonePlateIsOccludedAndOneThatIsAbsentIsNotFound) {
  const SimulatedView& view = faulty_case().views[0];
  xray::XrayImage xray_image = exposure_of(view);
  const rectification::Rectification rectification =
      rectification::rectify(xray_image, *faulty_case().plate, {}).value();
  const LabelledFiducials before = label(xray_image, rectification, faulty_case().calibrator).value();
  ASSERT_EQ(before.fiducials[0].status, FiducialStatus::used);
  EXPECT_EQ(before.fiducials[3].status, FiducialStatus::not_found);
  const auto pixel = [&](const Vector2d& uv, int u, int v) -> auto& {
    return xray_image.pixels(int(uv.x()) + u, int(uv.y()) + v);
  };
  const auto metal = pixel(before.fiducials[0].uv_raw, 0, 0);
  for (int v = -12; v <= 12; ++v)
    for (int u = -30; u <= 30; ++u) pixel(view.balls[3].raw, u, v) = metal;
  const LabelledFiducials after = label(xray_image, rectification, faulty_case().calibrator).value();
  EXPECT_EQ(after.fiducials[3].status, FiducialStatus::occluded);
  EXPECT_EQ(after.fiducials[8].status, FiducialStatus::not_found);
}

TEST(LabelFiducials, ApAndLateralViewLabelEveryFiducial) {
  for (const SimulatedView& view : sound_case().views) {
    const LabelledFiducials found = found_in(sound_case(), view);
    expect_right(found, view, 0.1);
    EXPECT_FALSE(found.mirrored);
    EXPECT_GT(found.view.intrinsics.fx, 0);
    EXPECT_GT(found.margin, 1);
  }
}

TEST(LabelFiducials, RectifiedPixelsMapToTheRawOnes) {
  const xray::XrayImage xray_image = exposure_of(sound_case().views[0]);
  const rectification::Rectification rectification =
      rectification::rectify(xray_image, phantom::plate48(), {}).value();
  const auto found = label(xray_image, rectification, sound_case().calibrator);
  ASSERT_TRUE(found);
  for (const Fiducial& fiducial : found->fiducials)
    if (fiducial.status == FiducialStatus::used) {
      EXPECT_LT((rectification.map.raw_from_rectified(fiducial.uv) - fiducial.uv_raw).norm(), 1e-8);
    }
}

TEST(LabelFiducials, MirroredLateralViewIsDetected) {
  const LabelledFiducials found = found_in(faulty_case(), faulty_case().views[1]);
  EXPECT_TRUE(found.mirrored);
  EXPECT_LT(found.view.intrinsics.fx, 0);
  expect_right(found, faulty_case().views[1], 0.1);
  EXPECT_FALSE(found_in(faulty_case(), faulty_case().views[0]).mirrored);
}

TEST(LabelFiducials, MissingBallsAreNotFoundAndDecoysAreUnlabelled) {
  for (const SimulatedView& view : faulty_case().views) {
    const LabelledFiducials found = found_in(faulty_case(), view);
    for (const Fiducial& fiducial : found.fiducials)
      if (fiducial.label == "P4" || fiducial.label == "P9") {
        EXPECT_NE(fiducial.status, FiducialStatus::used) << view.true_view.name << " " << fiducial.label;
      }
    EXPECT_GE(found.false_blobs.size(), 1u) << view.true_view.name;
    for (const detection::Dot& blob : found.false_blobs)
      for (const Fiducial& fiducial : found.fiducials)
        if (fiducial.status == FiducialStatus::used) {
          EXPECT_GT((blob.centre_px - fiducial.uv_raw).norm(), 2);
        }
  }
}

TEST(LabelFiducials, BallOutsideTheFieldIsOutside) {
  xray::XrayImage xray_image = exposure_of(sound_case().views[0]);
  const auto& lost = sound_case().views[0].balls[5];
  const rectification::Rectification rectification =
      rectification::rectify(xray_image, phantom::plate48(), {}).value();
  auto dots = dots_in(xray_image);
  for (int v = 0; v < 512; ++v)
    for (int u = 0; u < 512; ++u)
      if ((Vector2d(u, v) - lost.raw).norm() < 10) xray_image.pixels(u, v) = xray_image.lowest;
  std::erase_if(*dots.dark,
                [&](const detection::Dot& dot) { return (dot.centre_px - lost.raw).norm() < 20; });
  const auto found = label_fiducials(xray_image, dots, rectification, sound_case().calibrator, {});
  ASSERT_TRUE(found) << found.error().message;
  for (const Fiducial& fiducial : found->fiducials)
    EXPECT_EQ(fiducial.status == FiducialStatus::outside, fiducial.label == lost.name) << fiducial.label;
}

TEST(LabelFiducials, BallWithoutACandidateIsFittedAtItsPrediction) {
  const xray::XrayImage xray_image = exposure_of(sound_case().views[0]);
  const auto& ball = sound_case().views[0].balls[6];
  ASSERT_EQ(ball.visibility, Visibility::clear);
  const rectification::Rectification rectification =
      rectification::rectify(xray_image, phantom::plate48(), {}).value();
  auto dots = dots_in(xray_image);
  std::erase_if(*dots.dark, [&](const detection::Dot& dot) { return (dot.centre_px - ball.raw).norm() < 4; });
  const auto found = label_fiducials(xray_image, dots, rectification, sound_case().calibrator, {});
  ASSERT_TRUE(found);
  EXPECT_EQ(found->fiducials[6].status, FiducialStatus::used);
  EXPECT_LT((found->fiducials[6].uv_raw - ball.raw).norm(), 0.1);
}

TEST(LabelFiducials, NoCandidatesAreRefused) {
  const xray::XrayImage xray_image = exposure_of(sound_case().views[0]);
  const rectification::Rectification rectification =
      rectification::rectify(xray_image, phantom::plate48(), {}).value();
  auto dots = dots_in(xray_image);
  dots.dark->clear();
  const auto found = label_fiducials(xray_image, dots, rectification, sound_case().calibrator, {});
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().reason, Reason::too_few_fiducials);
}

TEST(LabelFiducials, FewCandidatesAreTheReason) {
  const SimulatedView& view = sound_case().views[0];
  const xray::XrayImage xray_image = exposure_of(view);
  const rectification::Rectification rectification =
      rectification::rectify(xray_image, phantom::plate48(), {}).value();
  auto dots = dots_in(xray_image);
  const std::size_t balls = view.balls.size();
  std::erase_if(*dots.dark, [&](const detection::Dot& dot) {
    return std::ranges::any_of(
        view.balls.begin() + 5, view.balls.end(),
        [&](const simulation::TruePoint& ball) { return (dot.centre_px - ball.raw).norm() < 4; });
  });
  const auto found = label_fiducials(xray_image, dots, rectification, sound_case().calibrator, {});
  ASSERT_FALSE(found);
  EXPECT_THAT(found.error().message, testing::HasSubstr(fmt::format(
                                         "that may be the calibrator's {} balls, which are from", balls)));
  EXPECT_GE(found.error().figures.at("found"), 4);
  EXPECT_LE(found.error().figures.at("found"), 0.6 * double(balls));
  EXPECT_EQ(found.error().figures.at("balls"), double(balls));
  EXPECT_GT(found.error().figures.at("ball_px"), 3);
  EXPECT_THAT(found.error().message, testing::Not(testing::HasSubstr("hardly found")));
}

TEST(LabelFiducials, PaperMethodMeasuresWithinAPixelAndAHalf) {
  const LabelledFiducials found = found_in(sound_case(), sound_case().views[0], rectification::Method::paper);
  int used = 0;
  for (std::size_t k = 0; k < found.fiducials.size(); ++k) {
    if (found.fiducials[k].status != FiducialStatus::used) continue;
    ++used;
    EXPECT_LT((found.fiducials[k].uv_raw - sound_case().views[0].balls[k].raw).norm(), 1.5);
  }
  EXPECT_GE(used, 6);
}

TEST(LabelFiducials, PaperMethodTakesTheCirclesOfTheRectifiedImage) {
  const xray::XrayImage xray_image = exposure_of(sound_case().views[0]);
  const auto map =
      rectification::rectify(xray_image, phantom::plate48(), {rectification::Method::paper, {}})->map;
  const LabelledFiducials found = found_in(sound_case(), sound_case().views[0], rectification::Method::paper);
  int checked = 0;
  for (const Fiducial& fiducial : found.fiducials) {
    if (fiducial.status != FiducialStatus::used || ++checked > 3) continue;
    const auto circle = circle_near(xray_image, map, fiducial.uv, fiducial.radius_px);
    ASSERT_TRUE(circle) << fiducial.label;
    EXPECT_LT((circle->uv - fiducial.uv).norm(), 1) << fiducial.label;  // other radii: another Hough image
    EXPECT_LT((map.raw_from_rectified(fiducial.uv) - fiducial.uv_raw).norm(), 1e-9);
  }
  const auto nowhere = circle_near(xray_image, map, {30, 30}, 12);
  ASSERT_FALSE(nowhere);
  EXPECT_EQ(nowhere.error().reason, Reason::target_not_found);
}

}  // namespace
}  // namespace helicarm::fiducials
