// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/first_markers.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>
#include <unistd.h>

#include "helicarm/core/files.h"
#include "helicarm/image/png.h"
#include "helicarm/track/half_map_test.h"
#include "helicarm/track/track.h"
#include "helicarm/track/two_cameras_test.h"

namespace helicarm::track {
namespace first_markers_test {

namespace fs = std::filesystem;

const std::vector<Eigen::Vector3d> beads{
    {-40, 12, 18}, {-21, -33, 41}, {8, 25, -30}, {30, -9, 7}, {52, 44, -52}};

Eigen::Vector3d bead_at(std::size_t bead, int frame) {
  return beads[bead] + Eigen::Vector3d(0.4 * frame, 0.2 * frame, 0.3 * double(bead) * frame);
}

/// Two views of discs of 2 mm; `hidden`: of a bead in a view.
class FirstMarkers : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("helicarm_first_markers_" + std::to_string(::getpid()));
    fs::create_directories(folder_);
    given_.folder = folder_;
    given_.diameter_mm = 2;
    for (const geometry::View& camera : two_cameras()) {
      TrackView& view = given_.views.emplace_back();
      view.images.name = given_.views.size() == 1 ? "A" : "B";
      view.images.image = folder_ / (view.images.name + "_{frame:02d}.png");
      view.camera = camera;
    }
  }
  void TearDown() override { fs::remove_all(folder_); }

  void draw(const std::vector<std::size_t>& hidden_in_second = {},
            const std::vector<Eigen::Vector2d>& still_in_first = {}) {
    std::mt19937 random(7);
    std::normal_distribution<double> normal;
    for (std::size_t k = 0; k < 2; ++k)
      for (int frame = 1; frame <= frames_; ++frame) {
        image::Image<std::uint16_t> pixels(size_, size_);
        for (auto& grey : pixels.pixels()) grey = std::uint16_t(2000 + 30 * normal(random));
        const auto disc = [&](const Eigen::Vector2d& at, double radius) {
          for (int v = int(at.y() - radius - 1); v <= int(at.y() + radius + 2); ++v)
            for (int u = int(at.x() - radius - 1); u <= int(at.x() + radius + 2); ++u)
              if (pixels.contains(u, v))
                pixels(u, v) = std::uint16_t(
                    pixels(u, v) -
                    900 * std::clamp(radius + 0.5 - (at - Eigen::Vector2d(u, v)).norm(), 0.0, 1.0));
        };
        for (std::size_t i = 0; i < beads.size(); ++i) {
          if (k == 1 && std::ranges::count(hidden_in_second, i)) continue;
          const Eigen::Vector3d at = bead_at(i, frame);
          disc(given_.views[k].camera.project(at), 1600 / given_.views[k].camera.depth(at));
        }
        if (k == 0)
          for (const Eigen::Vector2d& at : still_in_first) disc(at, 2);
        const auto name =
            given_.views[k].images.name + (frame < 10 ? "_0" : "_") + std::to_string(frame) + ".png";
        ASSERT_TRUE(write_file(folder_ / name, image::encode_png(pixels)));
      }
  }

  /// Name of the marker whose picks are a bead's images; empty if none is.
  std::string name_of(std::size_t bead) const {
    for (std::size_t m = 0; m < given_.markers.size(); ++m) {
      std::size_t right = 0;
      for (const MarkerPick& pick : given_.picks)
        right += pick.marker == m &&
                 (pick.uv_raw - given_.views[pick.view].camera.project(bead_at(bead, 1))).norm() < 0.3;
      if (right == 2) return given_.markers[m];
    }
    return "";
  }

  static constexpr int size_ = 500, frames_ = 6;
  const case_registration::FrameRange range_{1, frames_, 1};
  fs::path folder_;
  TrackCase given_;
};

TEST_F(FirstMarkers, AreFoundMatchedAndNamedByTheirColumn) {
  draw();
  complete_picks(given_, range_);
  EXPECT_EQ(given_.markers.size(), beads.size());
  for (std::size_t i = 0; i < beads.size(); ++i) EXPECT_EQ(name_of(i), "M" + std::to_string(i + 1));
}

TEST_F(FirstMarkers, MarkerHiddenInOneViewAndADotAreLeftOut) {
  draw({2}, {{120, 300}});
  complete_picks(given_, range_);
  EXPECT_EQ(given_.markers.size(), beads.size() - 1);
  EXPECT_EQ(name_of(2), "");
  EXPECT_EQ(name_of(3), "M3");
}

TEST_F(FirstMarkers, NothingOfThatSizeIsRefused) {
  draw({0, 1, 2, 3, 4});
  try {
    complete_picks(given_, range_);
    ADD_FAILURE();
  } catch (const BadInput& bad) {
    EXPECT_EQ(bad.failure().reason, Reason::not_seen);
  }
}

TEST_F(FirstMarkers, PartnerOfAPickInOneViewIsFound) {
  draw();
  for (std::size_t i = 0; i < 3; ++i) {
    given_.markers.push_back("J" + std::to_string(i));
    for (std::size_t k = 0; k < 2; ++k)
      if (i < 2 || k == 0)
        given_.picks.push_back(
            {i, k, given_.views[k].camera.project(bead_at(i, 1)) + Eigen::Vector2d(1, -1)});
  }
  complete_picks(given_, range_);
  ASSERT_EQ(given_.picks.size(), 6u);
  EXPECT_EQ(given_.picks.back().marker, 2u);
  EXPECT_EQ(given_.picks.back().view, 1u);
  EXPECT_LT((given_.picks.back().uv_raw - given_.views[1].camera.project(bead_at(2, 1))).norm(), 0.3);
  EXPECT_TRUE(given_.warnings.empty());
}

TEST_F(FirstMarkers, DiscsOutsideTheDistortionMapAreLeftOut) {
  draw();
  const double last = given_.views[0].camera.project(bead_at(3, 1)).x() + 20;
  given_.views[0].map = half_map(last, size_);
  complete_picks(given_, range_);
  EXPECT_EQ(given_.markers.size(), beads.size() - 1);
  ASSERT_EQ(given_.warnings.size(), 1u);
  EXPECT_EQ(given_.warnings[0].reason, Reason::not_seen);
  EXPECT_TRUE(given_.warnings[0].message.ends_with("outside the distortion map of A: left out"));
}

TEST_F(FirstMarkers, MarkerThatLeavesTheDistortionMapIsHiddenThere) {
  draw();
  complete_picks(given_, range_);
  ASSERT_EQ(given_.markers.size(), beads.size());
  // Between the last bead's images of the third and the fourth frame.
  const auto column = [&](int frame) { return given_.views[0].camera.project(bead_at(4, frame)).x(); };
  given_.views[0].map = half_map((column(3) + column(4)) / 2, size_);
  const auto followed = run_track(given_, range_, {}, {});
  ASSERT_TRUE(followed) << followed.error().message;
  for (std::size_t f = 0; f < std::size_t(frames_); ++f) {
    const bool is_shown = followed->images[f][4 * 2].has_value();
    EXPECT_EQ(is_shown, f < 3) << f;
  }
  EXPECT_EQ(followed->markers[5][4].status, MarkerStatus::lost);  // of no body, for too short a time
}

TEST_F(FirstMarkers, RepeatedImageShowsNoMarker) {
  draw();
  complete_picks(given_, range_);
  fs::copy_file(folder_ / "B_03.png", folder_ / "B_04.png", fs::copy_options::overwrite_existing);
  const auto followed = run_track(given_, range_, {}, {});
  ASSERT_TRUE(followed) << followed.error().message;
  for (std::size_t f = 0; f < std::size_t(frames_); ++f) {
    EXPECT_TRUE(followed->images[f][0]) << f;
    EXPECT_EQ(followed->images[f][1].has_value(), f != 3) << f;
  }
  ASSERT_FALSE(followed->warnings.empty());
  EXPECT_EQ(followed->warnings[0].reason, Reason::cameras_not_in_step);
}

TEST_F(FirstMarkers, SameImageInBothViewsIsRefused) {
  draw();
  fs::copy_file(folder_ / "A_01.png", folder_ / "B_01.png", fs::copy_options::overwrite_existing);
  try {
    complete_picks(given_, range_);
    ADD_FAILURE();
  } catch (const BadInput& bad) {
    EXPECT_EQ(bad.failure().reason, Reason::views_too_close);
    EXPECT_EQ(bad.failure().message, "frame 1: A and B are the same image");
  }
}

TEST_F(FirstMarkers, PickInOneViewWithoutAPartnerIsSaid) {
  draw({2});
  given_.markers = {"J1", "J2"};
  for (std::size_t k = 0; k < 2; ++k)
    given_.picks.push_back({0, k, given_.views[k].camera.project(bead_at(0, 1))});
  given_.picks.push_back({1, 0, given_.views[0].camera.project(bead_at(2, 1))});
  complete_picks(given_, range_);
  EXPECT_EQ(given_.picks.size(), 3u);
  ASSERT_EQ(given_.warnings.size(), 1u);
  EXPECT_EQ(given_.warnings[0].reason, Reason::target_not_found);
  EXPECT_NE(given_.warnings[0].message.find("\"J2\" is picked in A only"), std::string::npos);
}

}  // namespace first_markers_test
}  // namespace helicarm::track
