// SPDX-License-Identifier: Apache-2.0
#include "gui/xray/layers.h"

#include <cmath>

#include <gtest/gtest.h>

#include "gui/xray/simulated_result_test.h"

namespace helicarm::gui {
namespace {

/// Mean grey value within two pixels of a position.
double grey_at(const image::Image<float>& view_image, const Eigen::Vector2d& place) {
  double sum = 0;
  for (int dv = -2; dv <= 2; ++dv)
    for (int du = -2; du <= 2; ++du)
      sum += double(view_image(int(std::lround(place.x())) + du, int(std::lround(place.y())) + dv));
  return sum / 25;
}

TEST(LayerOf, RawIsTheImageItself) {
  const pipeline::ViewResult& view = simulated_result()->views[0];
  const image::Image<float> raw = layer_of(view, Layer::raw);
  EXPECT_TRUE(std::ranges::equal(raw.pixels(), view.xray_image->pixels.pixels()));
}

TEST(LayerOf, RectifiedShowsTheFiducialsAtTheirMeasuredPositions) {
  const pipeline::ViewResult& view = simulated_result()->views[0];
  const image::Image<float> rectified = layer_of(view, Layer::rectified);
  for (const fiducials::Fiducial& ball : view.found->fiducials) {
    if (ball.status != fiducials::FiducialStatus::used) continue;
    const double around = std::max(grey_at(rectified, ball.uv + Eigen::Vector2d(14, 0)),
                                   grey_at(rectified, ball.uv - Eigen::Vector2d(14, 0)));
    EXPECT_LT(grey_at(rectified, ball.uv), around) << ball.label;
  }
}

TEST(LayerOf, InpaintedRemovesThePlateAndKeepsTheFiducials) {
  const pipeline::ViewResult& view = simulated_result()->views[0];
  const image::Image<float> rectified = layer_of(view, Layer::rectified),
                            bare = layer_of(view, Layer::inpainted);
  ASSERT_FALSE(view.rectification->plate_dots.empty());
  double lifted = 0;
  for (const detection::Dot& dot : view.rectification->plate_dots) {
    const auto at = view.rectification->map.rectified_from_raw(dot.centre_px).value();
    lifted += grey_at(bare, at) - grey_at(rectified, at);
  }
  EXPECT_GT(lifted / double(view.rectification->plate_dots.size()), 10);
  int untouched = 0;
  for (const fiducials::Fiducial& ball : view.found->fiducials) {
    const bool beside_a_dot = std::ranges::any_of(
        view.rectification->plate_dots,
        [&](const detection::Dot& dot) { return (dot.centre_px - ball.uv_raw).norm() < dot.radius_px + 12; });
    if (ball.status != fiducials::FiducialStatus::used || beside_a_dot) continue;
    ++untouched;
    EXPECT_NEAR(grey_at(bare, ball.uv), grey_at(rectified, ball.uv), 1e-3) << ball.label;
  }
  EXPECT_GT(untouched, 3);
}

TEST(LayerOf, ViewThatIsNotRectifiedHasOnlyItsRawLayer) {
  xray::XrayImage xray_image;
  xray_image.pixels = image::Image<float>(4, 3, 7);
  const pipeline::ViewResult view{
      "AP", std::make_shared<const xray::XrayImage>(std::move(xray_image)), {}, {}, {}};
  for (const Layer layer : {Layer::raw, Layer::rectified, Layer::inpainted}) {
    EXPECT_EQ(layer_at_hand(view, layer), Layer::raw);
    EXPECT_EQ(layer_of(view, layer).width(), 4);
  }
  EXPECT_TRUE(layer_of(pipeline::ViewResult{}, Layer::rectified).empty());
}

TEST(Windowed, KeepsThePixelsAtAnyWidth) {
  image::Image<float> view_image(5, 2);
  for (int u = 0; u < 5; ++u) view_image(u, 1) = float(u);
  const QImage image = windowed(view_image, {0, 4});
  ASSERT_EQ(image.size(), QSize(5, 2));
  for (int u = 0; u < 5; ++u) EXPECT_EQ(image.pixelColor(u, 1).red(), 255 * u / 4) << u;
  EXPECT_EQ(image.pixelColor(3, 0).red(), 0);
  EXPECT_TRUE(windowed({}, {0, 1}).isNull());
}

}  // namespace
}  // namespace helicarm::gui
