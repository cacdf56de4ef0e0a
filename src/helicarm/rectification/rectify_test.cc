// SPDX-License-Identifier: Apache-2.0
#include "helicarm/rectification/rectify.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numeric>

#include <gtest/gtest.h>

#include "helicarm/detection/drawn_image_test.h"
#include "helicarm/rectification/lattice.h"
#include "helicarm/rectification/models/polynomial.h"
#include "helicarm/rectification/simulated_image_test.h"

namespace helicarm::rectification {
namespace {

using namespace std::complex_literals;
using Eigen::Vector2d;
using simulation::SimulatedCase;
using simulation::SimulatedView;

const SimulatedCase& simulated_case() {
  static const SimulatedCase simulated = small_case(7, simulation::CaseKind::accuracy);
  return simulated;
}

const Rectification& rectified_ap() {
  static const Rectification result =
      rectify(exposure_of(simulated_case().views[0]), phantom::plate48(), {}).value();
  return result;
}

/// Rectified and ideal pixels differ by a similarity; distances from the best-fitting one at positions inside
/// the plate.
struct Misfit {
  double rms, max;
};
Misfit misfit_of(const DistortionMap& map, const SimulatedView& view) {
  const auto& distortion = view.true_view.detector.distortion;
  std::vector<std::complex<double>> ideal;
  std::vector<std::complex<double>> rectified;
  for (int v = 0; v < 512; v += 16)
    for (int u = 0; u < 512; u += 16) {
      if ((Vector2d(u, v) - distortion.centre_px).norm() > 170) continue;
      const Vector2d a = distortion.ideal_from_raw({u, v});
      const Vector2d b = map.rectified_from_raw({u, v}).value();
      ideal.emplace_back(a.x(), a.y());
      rectified.emplace_back(b.x(), b.y());
    }
  // With complex numbers a similarity is an affine function.
  const auto middle = [](const auto& z) {
    return std::accumulate(z.begin(), z.end(), 0i) / double(z.size());
  };
  const std::complex<double> from = middle(ideal);
  const std::complex<double> to = middle(rectified);
  std::complex<double> mixed;
  double squares = 0;
  for (std::size_t k = 0; k < ideal.size(); ++k) {
    mixed += std::conj(ideal[k] - from) * (rectified[k] - to);
    squares += std::norm(ideal[k] - from);
  }
  Misfit misfit{0, 0};
  for (std::size_t k = 0; k < ideal.size(); ++k) {
    const double miss = std::abs(rectified[k] - to - mixed / squares * (ideal[k] - from));
    misfit.rms += miss * miss / double(ideal.size());
    misfit.max = std::max(misfit.max, miss);
  }
  misfit.rms = std::sqrt(misfit.rms);
  return misfit;
}

TEST(Rectify, FindsEveryClearDotOfThePlate) {
  const auto& dots = simulated_case().views[0].plate_dots;
  const auto clear = std::count_if(dots.begin(), dots.end(), [](const auto& dot) {
    return dot.visibility == simulation::Visibility::clear;
  });
  EXPECT_GE(rectified_ap().dots_found, clear - 2);
  EXPECT_EQ(rectified_ap().dots_expected, 48);
  EXPECT_EQ(rectified_ap().metal, detection::Polarity::dark);
}

TEST(Rectify, DotsAreWithinATenthOfAPixelOfTheTruth) {
  int near = 0;
  for (const detection::Dot& dot : rectified_ap().plate_dots)
    for (const auto& truth : simulated_case().views[0].plate_dots)
      if (truth.visibility == simulation::Visibility::clear && (truth.raw - dot.centre_px).norm() < 0.1)
        ++near;
  EXPECT_GE(near, 0.9 * rectified_ap().dots_found);
}

TEST(Rectify, ResidualsAreSmallAndConsistent) {
  const Rectification& result = rectified_ap();
  ASSERT_EQ(result.residual_px.size(), result.plate_dots.size());
  double squares = 0;
  for (const double r : result.residual_px) squares += r * r;
  EXPECT_NEAR(result.map.residual_rms_px, std::sqrt(squares / double(result.residual_px.size())), 1e-9);
  EXPECT_LT(result.map.residual_rms_px, 0.15);
  EXPECT_GT(result.map.held_out_rms_px, result.map.residual_rms_px);
  EXPECT_GT(result.raw_mean_px, 1);
  EXPECT_GT(result.raw_max_px, result.raw_mean_px);
}

TEST(Rectify, RectifiedImageIsIdealUpToASimilarity) {
  const Misfit best = misfit_of(rectified_ap().map, simulated_case().views[0]);
  EXPECT_LT(best.rms, 0.2);
  EXPECT_LT(best.max, 0.6);
}

TEST(Rectify, PixelSizeIsThatOfTheDetector) {
  ASSERT_TRUE(rectified_ap().map.rectified_pixel_mm);
  EXPECT_EQ(rectified_ap().map.rectified_plane, RectifiedPlane::detector);
  EXPECT_NEAR(*rectified_ap().map.rectified_pixel_mm / simulated_case().views[0].true_view.pixel_mm(), 1,
              0.01);
}

TEST(Rectify, WithoutDistancePixelSizeIsThatOfThePlate) {
  xray::XrayImage xray_image = exposure_of(simulated_case().views[0]);
  xray_image.acquisition.source_detector_mm.reset();
  const auto result = rectify(xray_image, phantom::plate48(), {});
  ASSERT_TRUE(result);
  EXPECT_EQ(result->map.rectified_plane, RectifiedPlane::plate);
  EXPECT_NEAR(*result->map.rectified_pixel_mm * 997 / (997 - 15) / *rectified_ap().map.rectified_pixel_mm, 1,
              1e-3);
}

TEST(Rectify, InvertedImageGivesTheSameMap) {
  xray::XrayImage inverted = exposure_of(simulated_case().views[0]);
  for (float& grey : inverted.pixels.pixels()) grey = inverted.highest - grey;
  const auto result = rectify(inverted, phantom::plate48(), {});
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_EQ(result->metal, detection::Polarity::bright);
  double most = 0;
  for (const auto& dot : simulated_case().views[0].plate_dots)
    if (const auto seen = rectified_ap().map.rectified_from_raw(dot.raw);
        seen && (dot.raw - Vector2d(256, 256)).norm() < 200)
      most = std::max(most, (result->map.raw_from_rectified(*seen) - dot.raw).norm());
  EXPECT_LT(most, 0.04);
}

TEST(Rectify, PaperMethodIsAQuadraticAndLessAccurate) {
  RectificationOptions options;
  options.method = Method::paper;
  const auto result = rectify(exposure_of(simulated_case().views[0]), phantom::plate48(), options);
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_EQ(result->map.model->name(), "polynomial of order 2");
  EXPECT_GE(result->dots_found, 25);
  EXPECT_GT(misfit_of(result->map, simulated_case().views[0]).rms,
            2 * misfit_of(rectified_ap().map, simulated_case().views[0]).rms);
}

TEST(Rectify, OrderIsTheRequestedOne) {
  RectificationOptions options;
  options.order = 4;
  const auto result = rectify(exposure_of(simulated_case().views[0]), phantom::plate48(), options);
  ASSERT_TRUE(result);
  EXPECT_EQ(result->map.model->name(), "polynomial of order 4");
}

TEST(Rectify, PlateOfAnotherPitchIsAMismatch) {
  phantom::Plate other = phantom::plate48();
  other.pitch_mm = 20;
  for (Vector2d& place : other.dots_mm) place *= 0.8;
  const auto result = rectify(exposure_of(simulated_case().views[0]), other, {});
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().reason, Reason::plate_mismatch);
  EXPECT_NEAR(result.error().figures.at("pitch_mm"), 25, 0.5);
}

TEST(Rectify, PlateOfTheOtherLatticeIsAMismatch) {
  phantom::Plate hexagonal = phantom::plate48();
  hexagonal.lattice = phantom::Lattice::hexagonal;
  hexagonal.dots_mm.clear();
  const auto result = rectify(exposure_of(simulated_case().views[0]), hexagonal, {});
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().reason, Reason::plate_mismatch);

  detection::drawn::Shade shade(384, 384);
  for (int row = -3; row <= 3; ++row)
    for (int column = -3; column <= 3; ++column)
      detection::drawn::add_ball(
          shade,
          Vector2d(191, 193) + 50 * lattice_point({column - row / 2, row}, phantom::Lattice::hexagonal), 5,
          0.9, 3);
  image::Image<float> image = detection::drawn::grey(shade, 1200);
  RandomStream random(1, 1);
  detection::drawn::add_noise(image, 10, random);
  const auto square = rectify(detection::drawn::xray_image(std::move(image)), phantom::plate48(), {});
  ASSERT_FALSE(square);
  EXPECT_EQ(square.error().reason, Reason::plate_mismatch);
}

TEST(Rectify, BallsOfThePhantomAreNotAmongThePlatesDots) {
  for (const auto& ball : simulated_case().views[0].balls) {
    if (ball.visibility != simulation::Visibility::clear) continue;
    EXPECT_TRUE(std::ranges::none_of(rectified_ap().plate_dots, [&](const detection::Dot& dot) {
      return (dot.centre_px - ball.raw).norm() < 1;
    })) << ball.name;
  }
}

/// Some dots on no lattice.
xray::XrayImage uniform(const detection::drawn::Shade& shade) {
  image::Image<float> image = detection::drawn::grey(shade, 1200);
  RandomStream random(1, 1);
  for (int v = 0; v < image.height(); ++v)
    for (int u = 0; u < image.width(); ++u) image(u, v) -= 2 * float(u);
  detection::drawn::add_noise(image, 10, random);
  return detection::drawn::xray_image(std::move(image));
}

TEST(Rectify, ImageWithoutPlateIsRefused) {
  detection::drawn::Shade shade(256, 256);
  for (const Vector2d& place : {Vector2d(60, 70), Vector2d(190, 40), Vector2d(140, 199), Vector2d(77, 150)})
    detection::drawn::add_ball(shade, place, 5, 0.9, 3);
  const auto result = rectify(uniform(shade), phantom::plate48(), {});
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().reason, Reason::plate_not_found);
}

Expected<Rectification> flat_panel(const xray::XrayImage& xray_image) {
  return with_map(xray_image, flat_panel_map(xray_image), {});
}

TEST(Rectify, BlankAndSaturatedImagesAreRefused) {
  EXPECT_EQ(rectify(detection::drawn::xray_image(image::Image<float>(256, 256, 1800)), phantom::plate48(), {})
                .error()
                .reason,
            Reason::blank_image);
  EXPECT_EQ(rectify(detection::drawn::xray_image(image::Image<float>(256, 256, 4095)), phantom::plate48(), {})
                .error()
                .reason,
            Reason::saturated);
  EXPECT_EQ(flat_panel(detection::drawn::xray_image(image::Image<float>(256, 256, 1800))).error().reason,
            Reason::blank_image);
}

TEST(Rectify, PlateOfHoles) {
  phantom::Plate plate = phantom::plate48();
  plate.kind = phantom::DotKind::holes;
  plate.diameter_mm = 5;
  detection::drawn::Shade shade(384, 384);
  for (const Vector2d& place : plate.dots_mm)
    detection::drawn::add_ball(shade, Vector2d(191, 193) + 2 * place, 5, 0.9, 30);
  image::Image<float> image = detection::drawn::grey(shade, -1200);
  RandomStream random(1, 1);
  detection::drawn::add_noise(image, 10, random);
  const auto result = rectify(detection::drawn::xray_image(std::move(image)), plate, {});
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_EQ(result->dots_found, 48);
  EXPECT_EQ(result->metal, detection::Polarity::dark);
  EXPECT_LT(result->map.residual_rms_px, 0.03);
  EXPECT_LT(result->raw_max_px, 0.1);
}

TEST(WithMap, OwnMapIsConfirmed) {
  const auto result =
      with_map(exposure_of(simulated_case().views[0]), rectified_ap().map, phantom::plate48());
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_EQ(to_json(result->map), to_json(rectified_ap().map));
  EXPECT_TRUE(result->map_confirmed);
  EXPECT_GE(result->confirming_dots.size(), 40u);
}

TEST(WithMap, MapOfAnotherAngleIsAMismatch) {
  // Three pixels more of S distortion at the edge, as the earth's field causes when the arm rotates.
  Json json = to_json(rectified_ap().map);
  Json& coefficients = json["coefficients"];
  for (const std::size_t row : {6, 8}) {
    coefficients[row][1] = coefficients[row][1].get<double>() + 3;
    coefficients[row + 1][0] = coefficients[row + 1][0].get<double>() - 3;
  }
  const DistortionMap turned = distortion_map_from_json(json, "map.json").value();
  const auto result = with_map(exposure_of(simulated_case().views[0]), turned, phantom::plate48());
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().reason, Reason::plate_mismatch);
}

TEST(WithMap, MapOfAnotherSizeIsAMismatch) {
  const auto result = with_map(exposure_of(simulated_case().views[0]), identity_map(1024, 1024, {}), {});
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().reason, Reason::plate_mismatch);
}

TEST(FlatPanel, CurvedPlateInTheImageIsAMismatch) {
  const auto result = flat_panel(exposure_of(simulated_case().views[0]));
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().reason, Reason::plate_mismatch);
}

TEST(WithMap, UndescribedPlateIsDetected) {
  const auto result = with_map(exposure_of(simulated_case().views[0]), rectified_ap().map, {});
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_GE(result->confirming_dots.size(), 40u);
}

TEST(FlatPanel, MapIsTheIdentityWithTheDetectorsPixelSize) {
  const SimulatedCase flat = small_case(5, simulation::CaseKind::flat);
  const auto result = flat_panel(exposure_of(flat.views[0]));
  ASSERT_TRUE(result);
  EXPECT_TRUE(result->map.is_identity());
  EXPECT_NEAR(*result->map.rectified_pixel_mm, flat.views[0].true_view.pixel_mm(), 1e-12);
  EXPECT_FALSE(result->dots_expected);
}

TEST(Resample, SamplesEachPixelAtItsMappedPosition) {
  xray::XrayImage ramp = exposure_of(simulated_case().views[0]);
  for (int v = 0; v < 512; ++v)
    for (int u = 0; u < 512; ++u) ramp.pixels(u, v) = 1000 + 3 * float(u) - 2 * float(v);
  const DistortionMap& map = rectified_ap().map;
  const image::Image<float> image = resample(ramp, map);
  for (int v = 60; v < 450; v += 13)
    for (int u = 60; u < 450; u += 13) {
      const Vector2d raw = map.raw_from_rectified({u, v});
      EXPECT_NEAR(image(u, v), 1000 + 3 * raw.x() - 2 * raw.y(), 0.15);  // remap steps by 1/32 px
    }
}

TEST(Resample, OutsideTheRawImageIsBlack) {
  xray::XrayImage white = exposure_of(simulated_case().views[0]);
  white.lowest = 7;
  std::fill(white.pixels.pixels().begin(), white.pixels.pixels().end(), 3000.f);
  DistortionMap shifted = identity_map(512, 512, {});
  Eigen::MatrixX2d coefficients(3, 2);
  coefficients << 100, 0, 1, 0, 0, 1;
  shifted.model = polynomial_model(1, {}, coefficients);
  const image::Image<float> image = resample(white, shifted);
  EXPECT_EQ(image(500, 100), 7);
  EXPECT_EQ(image(300, 100), 3000);
}

TEST(Resample, IdentityLeavesThePixels) {
  const xray::XrayImage xray_image = exposure_of(simulated_case().views[0]);
  const image::Image<float> image = resample(xray_image, identity_map(512, 512, {}));
  EXPECT_TRUE(std::equal(image.pixels().begin(), image.pixels().end(), xray_image.pixels.pixels().begin()));
}

}  // namespace
}  // namespace helicarm::rectification
