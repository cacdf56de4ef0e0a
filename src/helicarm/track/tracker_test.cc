// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/tracker.h"

#include <random>

#include <gtest/gtest.h>

#include "helicarm/track/two_cameras_test.h"

namespace helicarm::track {
namespace tracker_test {

constexpr int size = 300;
constexpr double radius_px = 2;

const std::vector<Eigen::Vector3d> body{
    {-20, 0, -25}, {-12, 9, -8}, {-15, -1, 15}, {25, 0, 18}, {15, -10, 15}};

xray::XrayImage image_of(const geometry::View& view, const std::vector<Eigen::Vector3d>& places,
                         unsigned seed) {
  xray::XrayImage image{"A", image::Image<float>(size, size), 0, 255, {}, {}};
  std::mt19937 random(seed);
  std::normal_distribution<float> noise(120, 2);
  for (float& pixel : image.pixels.pixels()) pixel = noise(random);
  for (const Eigen::Vector3d& place : places) {
    const Eigen::Vector2d at = view.project(place);
    for (int v = int(at.y() - 4); v < int(at.y() + 5); ++v)
      for (int u = int(at.x() - 4); u < int(at.x() + 5); ++u) {
        int inside = 0;
        for (int part = 0; part < 64; ++part)
          inside +=
              (Eigen::Vector2d(u + (part % 8 - 3.5) / 8, v + (part / 8 - 3.5) / 8) - at).norm() < radius_px;
        image.pixels(u, v) -= float(60 * inside) / 64;
      }
  }
  return image;
}

TrackCase one_body() {
  TrackCase the_case;
  the_case.diameter_mm = 2;
  BodyPlan& plan = the_case.bodies.emplace_back();
  plan.name = "jaw";
  for (geometry::View camera : two_cameras()) {
    camera.intrinsics.u0 = camera.intrinsics.v0 = size / 2.0;
    TrackView& view = the_case.views.emplace_back();
    view.images.name = the_case.views.size() == 1 ? "A" : "B";
    view.camera = camera;
  }
  for (std::size_t m = 0; m < body.size(); ++m) {
    the_case.markers.push_back("j" + std::to_string(m + 1));
    plan.markers.push_back(m);
    for (std::size_t k = 0; k < 2; ++k)
      the_case.picks.push_back(
          {m, k, the_case.views[k].camera.project(body[m]) + Eigen::Vector2d(0.6, -0.4)});
  }
  return the_case;
}

TEST(Tracker, BodyIsFollowedThroughAFastFirstFrameWithAMarkerHidden) {
  const TrackCase the_case = one_body();
  const auto tracker = Tracker::begin(
      the_case, 1,
      {image_of(the_case.views[0].camera, body, 1), image_of(the_case.views[1].camera, body, 2)});
  ASSERT_TRUE(tracker) << tracker.error().message;
  constexpr std::size_t hidden = 2;  // in the second view
  std::vector<Eigen::Vector3d> places, without;
  for (const Eigen::Vector3d& place : body) places.push_back(place + Eigen::Vector3d(0, 0, 6));
  for (std::size_t m = 0; m < body.size(); ++m)
    if (m != hidden) without.push_back(places[m]);
  Tracker followed = *tracker;
  FrameSights seen = followed.look(
      2, {image_of(the_case.views[0].camera, places, 3), image_of(the_case.views[1].camera, without, 4)});
  followed.absorb(seen);
  const auto now = followed.snapshot(seen);
  ASSERT_TRUE(now.bodies[0].pose);
  EXPECT_EQ(now.bodies[0].markers, 5);
  EXPECT_LT((now.bodies[0].pose->pose * body[hidden] - places[hidden]).norm(), 0.3);
}

}  // namespace tracker_test
}  // namespace helicarm::track
