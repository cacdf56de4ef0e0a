// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "helicarm/rectification/rectify.h"
#include "helicarm/rectification/simulated_image_test.h"

namespace helicarm::rectification {
namespace {

const phantom::Plate perforated{
    "perforated", phantom::DotKind::holes, phantom::Lattice::hexagonal, 16.0, 5.0, {}, 15.0};

const simulation::SimulatedCase& perforated_case() {
  static const simulation::SimulatedCase simulated = [] {
    simulation::SimulationOptions options;
    options.seed = 3;
    options.size = 512;
    options.plate = perforated;
    return simulation::simulate_case(options).value();
  }();
  return simulated;
}

xray::XrayImage image_of_view(std::size_t view) { return exposure_of(perforated_case().views[view]); }

const DistortionMap& map_of_view(std::size_t view) {
  static const std::vector<DistortionMap> maps = {rectify(image_of_view(0), perforated, {}).value().map,
                                                  rectify(image_of_view(1), perforated, {}).value().map};
  return maps[view];
}

TEST(WithMapOfHoles, OwnMapIsConfirmedWithAndWithoutTheDescriptionOfThePlate) {
  for (const std::size_t view : {0U, 1U})
    for (const auto& plate : {std::optional(perforated), std::optional<phantom::Plate>()}) {
      const auto result = with_map(image_of_view(view), map_of_view(view), plate);
      ASSERT_TRUE(result) << result.error().message;
      EXPECT_TRUE(result->map_confirmed);
    }
}

TEST(WithMapOfHoles, DistortionIsStatedAsByItsOwnDots) {
  const Rectification by_dots = rectify(image_of_view(0), perforated, {}).value(),
                      known = with_map(image_of_view(0), by_dots.map, {}).value();
  EXPECT_NEAR(known.raw_mean_px, by_dots.raw_mean_px, 0.4 * by_dots.raw_mean_px);
  EXPECT_NEAR(known.raw_max_px, by_dots.raw_max_px, 0.4 * by_dots.raw_max_px);
}

TEST(WithMapOfHoles, MapOfTheOtherViewIsAMismatch) {
  const auto result = with_map(image_of_view(1), map_of_view(0), perforated);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().reason, Reason::plate_mismatch);
}

TEST(WithMap, MapOfTheOtherViewIsAMismatchThoughItBendsByAFifthOfAPixel) {
  const simulation::SimulatedCase simulated = small_case(2, simulation::CaseKind::accuracy);
  const xray::XrayImage images[] = {exposure_of(simulated.views[0]), exposure_of(simulated.views[1])};
  const phantom::Plate plate = phantom::plate48();
  const DistortionMap maps[] = {rectify(images[0], plate, {}).value().map,
                                rectify(images[1], plate, {}).value().map};
  for (const int view : {0, 1}) {
    EXPECT_TRUE(with_map(images[view], maps[view], plate));
    const auto exchanged = with_map(images[view], maps[1 - view], plate);
    ASSERT_FALSE(exchanged);
    EXPECT_EQ(exchanged.error().reason, Reason::plate_mismatch);
    EXPECT_LT(exchanged.error().figures.at("residual_rms_px"), 0.3);
  }
}

TEST(WithMapOfHoles, BentPlateWithoutAMapIsAMismatch) {
  const xray::XrayImage image = image_of_view(0);
  const auto result = with_map(image, flat_panel_map(image), {});
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().reason, Reason::plate_mismatch);
}

}  // namespace
}  // namespace helicarm::rectification
