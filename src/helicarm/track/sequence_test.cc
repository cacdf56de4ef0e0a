// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/sequence.h"

#include <algorithm>
#include <array>
#include <random>

#include <gtest/gtest.h>

#include "helicarm/track/half_map_test.h"
#include "helicarm/track/two_bodies_test.h"

namespace helicarm::track {
namespace sequence_test {

using namespace two_bodies_test;

TEST(Sequence, PlacesAndPosesAreWithinTheirBands) {
  const TrackCase the_case = two_bodies();
  const Sequence sequence = estimate_sequence(the_case, drawn(the_case, none));
  int inside = 0, all = 0;
  for (std::size_t f = 1; f < sequence.frames.size(); ++f) {
    for (std::size_t m = 0; m < the_case.markers.size(); ++m) {
      const FramePlace& place = *sequence.markers[f][m].place;
      const Eigen::Vector3d off = place.place - place_of(m, int(f) + 1, none);
      for (int k = 0; k < 3; ++k, ++all)
        inside += std::abs(off[k]) < 1.96 * std::sqrt(place.covariance(k, k));
    }
    for (std::size_t b = 0; b < 2; ++b) {
      const TrackedBody& body = sequence.bodies[b].smoothed[f];
      const geometry::RigidTransform truth = pose_at(b, int(f) + 1) * pose_at(b, 1).inverse();
      EXPECT_LT((registration::step_about(body.pose->pose, truth, body.centre).tail<3>()).norm(), 0.08);
    }
  }
  EXPECT_NEAR(double(inside) / all, 0.95, 0.03);
  EXPECT_EQ(sequence.repaired, 0);
  EXPECT_FALSE(warning_of(sequence, Reason::markers_swapped));
}

TEST(Sequence, DiscOutsideTheDistortionMapCountsAsHidden) {
  TrackCase the_case = two_bodies();
  const auto sights = drawn(the_case, none);
  double last = 0;
  for (const FrameSights& frame : sights) last = std::max(last, frame.of[4][0]->uv_raw.x());
  const double limit = last - 1;
  the_case.views[0].map = half_map(limit, 500);
  const Sequence sequence = estimate_sequence(the_case, sights);
  std::size_t outside = 0;
  for (std::size_t f = 0; f < sights.size(); ++f) {
    const bool is_inside = sights[f].of[4][0]->uv_raw.x() <= limit;
    outside += !is_inside;
    EXPECT_EQ(sequence.markers[f][4].status, is_inside ? MarkerStatus::tracked : MarkerStatus::one_view) << f;
    EXPECT_LT((sequence.markers[f][4].place->place - place_of(4, int(f) + 1, none)).norm(), 0.3) << f;
  }
  EXPECT_GT(outside, 0u);
  EXPECT_TRUE(std::ranges::any_of(sequence.warnings, [](const Warning& warning) {
    return warning.reason == Reason::not_seen &&
           warning.message.starts_with("\"s1\" is outside the distortion map of A in");
  }));
}

TEST(Sequence, AMarkerOfOneViewIsPlacedByItsRaysAlongTheBodysPoses) {
  constexpr std::size_t rare = 5;  // of the skull
  TrackCase the_case = two_bodies();
  for (std::size_t k = 0; k < 2; ++k)
    the_case.picks.push_back(
        {rare, k, the_case.views[k].camera.project(place_of(rare, 1, none)) + Eigen::Vector2d(1, -1)});
  auto sights = drawn(the_case, none);
  for (std::size_t f = 0; f < sights.size(); ++f)
    if (f != 0 && f != 20) sights[f].of[rare][1].reset();
  // Noise that was taken for it, along the other view's ray: 4 mm off.
  const auto& view = the_case.views[1].camera;
  const Eigen::Vector3d wrong = place_of(rare, 1, none) + Eigen::Vector3d(0, 4, 0);
  sights[0].of[rare][1]->uv_raw = view.project(wrong);
  const Sequence sequence = estimate_sequence(the_case, sights);
  for (const std::size_t f : {std::size_t(5), std::size_t(20), std::size_t(39)}) {
    const TrackedMarker& marker = sequence.markers[f][rare];
    ASSERT_TRUE(marker.place);
    const Eigen::Vector3d off = marker.place->place - place_of(rare, int(f) + 1, none);
    EXPECT_LT(off.norm(), 0.5) << f;
    EXPECT_LT(off.dot(marker.place->covariance.ldlt().solve(off)), 16) << f;
  }
}

/// Each marker hidden in the second view, later in both, in turn; its images displaced alike in all frames,
/// as texture that moves with it does.
std::vector<FrameSights> drawn_with_texture(const TrackCase& the_case, unsigned seed) {
  constexpr int span = 4;
  constexpr double texture_px = 0.05;
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  auto sights = drawn(the_case, none);
  for (std::size_t m = 0; m < the_case.markers.size(); ++m) {
    std::array<Eigen::Vector2d, 2> texture;
    for (Eigen::Vector2d& off : texture) off = texture_px * normal_pair(normal, random);
    for (std::size_t f = 0; f < sights.size(); ++f) {
      auto& of = sights[f].of[m];
      for (std::size_t k = 0; k < 2; ++k)
        of[k]->uv_raw += texture[k] + noise_px * normal_pair(normal, random);
      const auto turn = f / span;
      if (turn == m || turn == m + 1) of[1].reset();
      if (turn == m + 1) of[0].reset();
    }
  }
  return sights;
}

TEST(Sequence, BandsHoldErrorsThatLastForAllFrames) {
  const TrackCase the_case = two_bodies();
  std::array<int, 3> inside{}, all{};
  for (unsigned seed = 1; seed <= 4; ++seed) {
    const Sequence sequence = estimate_sequence(the_case, drawn_with_texture(the_case, seed));
    for (std::size_t f = 0; f < sequence.frames.size(); ++f)
      for (std::size_t m = 0; m < the_case.markers.size(); ++m) {
        const TrackedMarker& marker = sequence.markers[f][m];
        ASSERT_TRUE(marker.place);
        const Eigen::Vector3d off = marker.place->place - place_of(m, int(f) + 1, none);
        for (int k = 0; k < 3; ++k) {
          inside[std::size_t(marker.status)] +=
              std::abs(off[k]) < 1.96 * std::sqrt(marker.place->covariance(k, k));
          ++all[std::size_t(marker.status)];
        }
      }
  }
  for (std::size_t status = 0; status < all.size(); ++status) {
    ASSERT_GT(all[status], 350);
    EXPECT_GT(double(inside[status]) / all[status], 0.92) << status_words[status];
    EXPECT_LT(double(inside[status]) / all[status], 0.99) << status_words[status];
  }
}

TEST(Sequence, ErrorsThatRayGapsDoNotShowWidenTheBand) {
  const TrackCase the_case = two_bodies();
  auto sights = drawn(the_case, none);
  const double usual = estimate_sequence(the_case, sights).markers[20][1].place->covariance.trace();
  // Horizontal: in the plane of both rays.
  for (FrameSights& frame : sights) frame.of[1][0]->uv_raw.x() += 0.5 * std::sin(0.5 * frame.frame);
  const Sequence sequence = estimate_sequence(the_case, sights);
  const auto trace = [&](std::size_t m) { return sequence.markers[20][m].place->covariance.trace(); };
  EXPECT_GT(trace(1), 1.5 * usual);
  EXPECT_LT(trace(2), 1.3 * usual);
}

TEST(Sequence, LoneDiscsAfterALongGapAreNoMarker) {
  const TrackCase the_case = two_bodies();
  auto sights = drawn(the_case, none);
  for (std::size_t f = 6; f < sights.size(); ++f)
    for (std::size_t m = 4; m < 8; ++m) {
      if (f == 39 && m == 5)
        for (std::size_t k = 0; k < 2; ++k)
          sights[f].of[m][k]->uv_raw =
              the_case.views[k].camera.project(place_of(m, int(f) + 1, none) + Eigen::Vector3d(20, -15, 10));
      else
        sights[f].of[m].assign(2, std::nullopt);
    }
  EXPECT_EQ(estimate_sequence(the_case, sights).markers[39][5].status, MarkerStatus::lost);
}

TEST(Sequence, MarkerSeenInFewFramesIsNotCarriedOn) {
  TrackCase the_case = two_bodies();
  the_case.bodies.clear();
  auto sights = drawn(the_case, none);
  for (FrameSights& frame : sights)
    if (frame.frame != 12 && frame.frame != 20 && frame.frame != 30) frame.of[0][1].reset();
  sights[29].of[0][1]->uv_raw.x() += 20;  // an outlier
  const Sequence sequence = estimate_sequence(the_case, sights);
  for (std::size_t f = 0; f < sequence.frames.size(); ++f)
    if (!sights[f].of[0][1]) {
      EXPECT_EQ(sequence.markers[f][0].status, MarkerStatus::lost) << f;
    }
}

TEST(Sequence, FrameWithoutAnImageOfItsMomentHasNoPose) {
  const TrackCase the_case = two_bodies();
  auto sights = drawn(the_case, none);
  for (const std::size_t f : {std::size_t(19), std::size_t(20)}) {
    sights[f].repeated = {{1, sights[18].frame, 1}};
    for (auto& of : sights[f].of) of[1].reset();
  }
  const Sequence sequence = estimate_sequence(the_case, sights);
  const BodySequence& jaw = sequence.bodies[0];
  EXPECT_EQ(jaw.frames[20].decision, PoseDecision::refuse);
  EXPECT_EQ(jaw.frames[20].reason, Reason::cameras_not_in_step);
  EXPECT_FALSE(jaw.frames[20].pose);
  EXPECT_EQ(jaw.frames[21].decision, PoseDecision::accept);
  EXPECT_EQ(jaw.smoothed[20].decision, PoseDecision::warn);
  EXPECT_EQ(sequence.markers[20][1].status, MarkerStatus::one_view);
  EXPECT_LT(farthest(sequence, none), 0.3);
  const Warning* warning = warning_of(sequence, Reason::cameras_not_in_step);
  ASSERT_TRUE(warning);
  EXPECT_TRUE(warning->message.starts_with("frame 20: the image of B is that of its frame 19 again"))
      << warning->message;
}

TEST(Sequence, DiscThatIsNotTheMarkersIsNotItsPlace) {
  const TrackCase the_case = two_bodies();
  auto sights = drawn(the_case, none);
  for (std::size_t k = 0; k < 2; ++k)
    sights[24].of[3][k]->uv_raw =
        the_case.views[k].camera.project(place_of(3, 25, none) + Eigen::Vector3d(4, -3, 2));
  const Sequence sequence = estimate_sequence(the_case, sights);
  EXPECT_EQ(sequence.markers[24][3].status, MarkerStatus::predicted);
  EXPECT_LT(farthest(sequence, none), 0.5);
  EXPECT_EQ(sequence.bodies[0].frames[24].decision, PoseDecision::warn);
}

TEST(Sequence, LoneDiscsOfABodyWithoutAPoseAreNoMarker) {
  const TrackCase the_case = two_bodies();
  auto sights = drawn(the_case, none);
  for (std::size_t f = 1; f < sights.size(); ++f)
    for (const std::size_t m : {0, 1, 2})
      for (auto& image : sights[f].of[m]) image.reset();
  const Sequence sequence = estimate_sequence(the_case, sights);
  EXPECT_TRUE(warning_of(sequence, Reason::body_ill_conditioned));
  EXPECT_EQ(std::ranges::count(statuses_of(sequence, 3), MarkerStatus::lost), frames - 1);
  EXPECT_EQ(std::ranges::count(statuses_of(sequence, 4), MarkerStatus::tracked), frames);
}

TEST(Sequence, LooseMarkerIsNamed) {
  const TrackCase the_case = two_bodies();
  const Shift loose = [](std::size_t marker, int frame) {
    return marker == 5 && frame >= 22 ? Eigen::Vector3d(0.6, -0.5, 0.2) : Eigen::Vector3d(0, 0, 0);
  };
  const Sequence sequence = estimate_sequence(the_case, drawn(the_case, loose));
  const Warning* warning = warning_of(sequence, Reason::marker_loose);
  ASSERT_TRUE(warning);
  EXPECT_NE(warning->message.find("\"s2\" moved in the body \"skull\""), std::string::npos);
  EXPECT_EQ(sequence.bodies[1].markers[1].moved_at, 22);
  EXPECT_LT(farthest(sequence, loose), 0.3);
  EXPECT_EQ(sequence.repaired, 0);
}

TEST(Sequence, MarkersThatMoveAgainstEachOtherAllTheTimeAreNoBody) {
  const TrackCase the_case = two_bodies();
  const Shift wobble = [](std::size_t marker, int frame) {
    return Eigen::Vector3d(marker == 5 ? 1.5 * std::sin(0.9 * frame) : 0, 0, 0);
  };
  const Sequence sequence = estimate_sequence(the_case, drawn(the_case, wobble));
  const Warning* warning = warning_of(sequence, Reason::marker_loose);
  ASSERT_TRUE(warning);
  EXPECT_NE(warning->message.find("\"skull\" move by"), std::string::npos) << warning->message;
  EXPECT_FALSE(warning_of(estimate_sequence(the_case, drawn(the_case, none)), Reason::marker_loose));
}

TEST(Sequence, SmoothMotionEndsWithItsPoses) {
  const TrackCase the_case = two_bodies();
  auto sights = drawn(the_case, none);
  for (std::size_t f = 30; f < sights.size(); ++f)
    for (std::size_t m = 4; m < 8; ++m) sights[f].of[m].assign(2, std::nullopt);
  const Sequence sequence = estimate_sequence(the_case, sights);
  const BodySequence& skull = sequence.bodies[1];
  EXPECT_TRUE(skull.smoothed[29].pose);
  for (std::size_t f = 30; f < sights.size(); ++f) {
    EXPECT_FALSE(skull.smoothed[f].pose);
    EXPECT_EQ(skull.smoothed[f].decision, PoseDecision::refuse);
    EXPECT_FALSE(sequence.relative[0][f].pose);
  }
  EXPECT_FALSE(sequence.failure);
}

TEST(Sequence, WhereNoBodyHasAPoseNothingWasFollowed) {
  const TrackCase the_case = two_bodies();
  auto sights = drawn(the_case, none);
  for (FrameSights& frame : sights)
    for (std::size_t m = 0; m < the_case.markers.size(); ++m)
      if (m % 4 >= 2) frame.of[m].assign(2, std::nullopt);
  const Sequence sequence = estimate_sequence(the_case, sights);
  ASSERT_TRUE(sequence.failure);
  EXPECT_EQ(sequence.failure->reason, Reason::marker_lost);
}

}  // namespace sequence_test
}  // namespace helicarm::track
