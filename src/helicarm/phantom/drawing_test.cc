// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom/drawing.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace helicarm::phantom {
namespace {

using testing::HasSubstr;

std::size_t count(const std::string& text, const std::string& part) {
  std::size_t found = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++found;
  return found;
}

TEST(DrawingOfPlate, EveryDotIsToScaleWithDimensions) {
  const std::string svg = *drawing_of(plate48());
  EXPECT_EQ(count(svg, "<circle"), 48u);
  EXPECT_EQ(count(svg, "r=\"1.250\""), 48u);
  EXPECT_EQ(count(svg, ">150</text>"), 2u);
  EXPECT_THAT(svg, HasSubstr("width=\"225.000mm\""));
}

TEST(DrawingOfPlate, UnboundedLatticeIsRefused) {
  EXPECT_EQ(drawing_of(Plate{}).error().reason, Reason::bad_value);
}

TEST(DrawingOfCalibrator, ShowsEveryBallTwiceAndItsCoordinatesInATable) {
  const std::string svg = drawing_of(udcsc());
  EXPECT_EQ(count(svg, "<circle"), 24u);
  EXPECT_EQ(count(svg, ">P12</text>"), 3u);
  for (const CalibratorBall& ball : udcsc().balls)
    for (const double number : ball.centre_in_calibrator)
      EXPECT_THAT(svg, HasSubstr(fmt::format(">{:.3f}</text>", number)));
}

TEST(DrawingOfCalibrator, NamesAreEscaped) {
  Calibrator calibrator = udcsc();
  calibrator.name = "<script>&";
  EXPECT_THAT(drawing_of(calibrator), HasSubstr("&lt;script&gt;&amp;"));
}

}  // namespace
}  // namespace helicarm::phantom
