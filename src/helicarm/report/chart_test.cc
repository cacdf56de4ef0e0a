// SPDX-License-Identifier: Apache-2.0
#include "helicarm/report/chart.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "helicarm/report/isoline.h"

namespace helicarm::report {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

TEST(Chart, HasAxesWithUnitsAndLegend) {
  Chart chart{"(a) FRE", "Number of points", "FRE, mm", {{"fresh noise", {{6, 0.6}, {12, 0.55}, {20, 0.5}}}}};
  chart.band = ChartBand{"printed", 0.68, 0.8};
  const std::string svg = chart_svg(std::array{chart});
  for (const char* word :
       {"(a) FRE", "Number of points", "FRE, mm", "fresh noise", "printed", ">12<", ">0.6<"})
    EXPECT_THAT(svg, HasSubstr(word));
}

TEST(Chart, EscapesText) {
  const std::string svg = chart_svg(std::array{Chart{"a < b & c", "<x>", "y"}});
  EXPECT_THAT(svg, HasSubstr("a &lt; b &amp; c"));
  EXPECT_THAT(svg, Not(HasSubstr("<x>")));
}

TEST(Chart, LeavesOutNonFiniteValues) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  const std::string svg = chart_svg(
      std::array{Chart{"t", "x", "y", {{"s", {{0, 1}, {1, nan}, {2, 3}}}, {"none", {{nan, nan}}}}}});
  EXPECT_THAT(svg, Not(HasSubstr("nan")));
  EXPECT_THAT(chart_svg(std::array{Chart{"nothing", "x", "y"}}), Not(HasSubstr("inf")));
}

TEST(Chart, ImageHasYDownAndEqualScales) {
  Chart chart{"t", "u, px", "v, px", {{"", {{0, 0}, {100, 0}, {100, 200}}}}};
  chart.image = true;
  // The frame of 460 x 360 px shows 200 units of v in 360 px, so 100 units of u take 180 px.
  EXPECT_THAT(chart_svg(std::array{chart}), HasSubstr("M204.0 56.0L384.0 56.0L384.0 416.0"));
}

TEST(Chart, LineBreaksWhereAPointIsMissing) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  const std::string svg =
      chart_svg(std::array{Chart{"t", "x", "y", {{"", {{0, 0}, {1, 1}, {nan, nan}, {2, 0}, {3, 1}}}}}});
  const auto path = svg.substr(svg.find("<path d=\"M64.0 416.0L"));
  EXPECT_EQ(std::ranges::count(path.substr(0, path.find("class")), 'M'), 2);
}

TEST(Chart, YNamesRunDownwardsBesideTheFrame) {
  Chart chart{"t", "x", "", {{"", {{1, 0}, {2, 1}}, true}}};
  chart.y_names = {"the first of two situations", "the second"};
  const std::string svg = chart_svg(std::array{chart});
  const auto first = svg.find(">the first of two situations</text>"), second = svg.find(">the second</text>");
  EXPECT_LT(first, second);
  EXPECT_LT(second, std::string::npos);
  EXPECT_THAT(svg, HasSubstr("cy=\"146.0\""));
  EXPECT_THAT(svg, HasSubstr("cy=\"326.0\""));
  EXPECT_THAT(svg, Not(HasSubstr("viewBox=\"0 0 552 ")));
}

TEST(Chart, FourChartsTakeTwoRows) {
  const std::vector<Chart> four(4, Chart{"t", "x", "y"});
  EXPECT_THAT(chart_svg(four), HasSubstr("viewBox=\"0 0 1104 944\""));
}

TEST(Chart, HatchedRowIsOnePathWithALegend) {
  Chart chart{"t", "x", "y"};
  chart.field = ChartField{0, 0, 1, 3, 2, {1, 1, 1, 1, 1, 1}, {}};
  chart.field->hatchings = {{"not seen", {false, true, true, false, false, false}}};
  const std::string svg = chart_svg(std::array{chart});
  EXPECT_THAT(svg, HasSubstr("<pattern id=\"hatch0-0\""));
  const auto path = svg.find("Z\" fill=\"url(#hatch0-0)\"");
  ASSERT_NE(path, std::string::npos);
  EXPECT_EQ(svg.substr(svg.rfind('"', path), path - svg.rfind('"', path)).find('Z'), std::string::npos);
  EXPECT_THAT(svg, HasSubstr(">not seen</text>"));
}

TEST(Isoline, OfAConeIsACircle) {
  const auto height = [](int column, int row) { return std::hypot(column - 20.0, row - 20.0); };
  const auto pieces = isoline(41, 41, height, 12.5);
  EXPECT_GT(pieces.size(), 60u);
  for (const auto& piece : pieces)
    for (const auto& [column, row] : piece) EXPECT_NEAR(std::hypot(column - 20, row - 20), 12.5, 0.02);
  EXPECT_TRUE(isoline(41, 41, height, 100).empty());
}

}  // namespace
}  // namespace helicarm::report
