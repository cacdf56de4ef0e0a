// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/sequence.h"

#include <algorithm>
#include <array>
#include <functional>
#include <limits>
#include <optional>
#include <random>

#include <gtest/gtest.h>

#include "helicarm/geometry/rotation.h"
#include "helicarm/track/half_map_test.h"
#include "helicarm/track/two_cameras_test.h"

namespace helicarm::track {
namespace sequence_test {

constexpr double noise_px = 0.05;
constexpr int frames = 40;

const std::vector<std::vector<Eigen::Vector3d>> bodies{
    {{10, 0, 3}, {-8, 7, -4}, {2, -9, 8}, {-5, -6, -9}},
    {{9, 12, 25}, {-12, 3, 31}, {4, -11, 22}, {-3, 14, 36}}};

TrackCase two_bodies() {
  TrackCase the_case;
  for (const geometry::View& camera : two_cameras()) {
    TrackView& view = the_case.views.emplace_back();
    view.images.name = the_case.views.size() == 1 ? "A" : "B";
    view.camera = camera;
  }
  for (const auto& body : bodies) {
    BodyPlan& plan = the_case.bodies.emplace_back();
    plan.name = the_case.bodies.size() == 1 ? "jaw" : "skull";
    for (std::size_t i = 0; i < body.size(); ++i) {
      plan.markers.push_back(the_case.markers.size());
      the_case.markers.push_back(plan.name[0] + std::to_string(i + 1));
    }
  }
  return the_case;
}

geometry::RigidTransform pose_at(std::size_t body, int frame) {
  const double t = 0.1 * frame, sign = body == 0 ? 1 : -1;
  return {geometry::rotation_from_vector({0.1 * std::sin(t), sign * 0.05 * t, 0}),
          {3 * std::sin(t), sign * 2 * t, std::cos(t)}};
}

using Shift = std::function<Eigen::Vector3d(std::size_t marker, int frame)>;

Eigen::Vector3d place_of(std::size_t marker, int frame, const Shift& shift) {
  const std::size_t body = marker / 4;
  return pose_at(body, frame) * (bodies[body][marker % 4] + shift(marker, frame));
}

Eigen::Vector2d normal_pair(std::normal_distribution<double>& normal, std::mt19937& random) {
  const double y = normal(random), x = normal(random);
  return {x, y};
}

std::vector<FrameSights> drawn(const TrackCase& the_case, const Shift& shift) {
  std::mt19937 random(4);
  std::normal_distribution<double> normal;
  std::vector<FrameSights> made;
  for (int f = 1; f <= frames; ++f) {
    FrameSights& sights = made.emplace_back();
    sights.frame = f;
    for (std::size_t m = 0; m < the_case.markers.size(); ++m) {
      auto& of = sights.of.emplace_back();
      for (const TrackView& view : the_case.views)
        of.push_back(
            MarkerImage{view.camera.project(place_of(m, f, shift)) + noise_px * normal_pair(normal, random),
                        noise_px, 2, 60, 120});
    }
  }
  return made;
}

Eigen::Vector3d none(std::size_t, int) { return Eigen::Vector3d::Zero(); }

/// Of all places; infinite where one is missing, but of a marker that is to have none.
double farthest(const Sequence& sequence, const Shift& shift, std::optional<std::size_t> lost = {}) {
  double most = 0;
  for (std::size_t f = 0; f < sequence.frames.size(); ++f)
    for (std::size_t m = 0; m < sequence.markers[f].size(); ++m)
      if (const auto& place = sequence.markers[f][m].place; m != lost)
        most = std::max(most, place ? (place->place - place_of(m, int(f) + 1, shift)).norm()
                                    : std::numeric_limits<double>::infinity());
  return most;
}

const Warning* warning_of(const Sequence& sequence, Reason reason) {
  const auto found = std::ranges::find(sequence.warnings, reason, &Warning::reason);
  return found == sequence.warnings.end() ? nullptr : &*found;
}

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

/// Errors of the cameras that leave no ray gap: the world's scale, by 0.5 %, and its axes, by 0.003 rad each.
Eigen::MatrixXd errors_without_gaps(const TrackCase& the_case) {
  Eigen::MatrixXd errors = Eigen::MatrixXd::Zero(22, 4);
  for (std::size_t k = 0; k < the_case.views.size(); ++k) {
    const geometry::RigidTransform& pose = the_case.views[k].camera.camera_from_world;
    errors.block<3, 3>(11 * Eigen::Index(k) + 4, 1) = 0.003 * pose.rotation;
    errors.block<3, 1>(11 * Eigen::Index(k) + 7, 0) = 0.005 * pose.translation;
  }
  return errors;
}

TrackCase off_by_draw(TrackCase the_case, int seed) {
  const Eigen::MatrixXd errors = errors_without_gaps(the_case);
  the_case.camera_covariance = errors * errors.transpose();
  std::mt19937 random(static_cast<unsigned>(seed));
  std::normal_distribution<double> normal;
  Eigen::Vector4d draw;
  for (double& value : draw) value = normal(random);
  const Eigen::VectorXd off = errors * draw;
  for (std::size_t k = 0; k < the_case.views.size(); ++k) {
    geometry::RigidTransform& pose = the_case.views[k].camera.camera_from_world;
    const auto at = 11 * Eigen::Index(k);
    pose = {geometry::rotation_from_vector(off.segment<3>(at + 4)) * pose.rotation,
            pose.translation + off.segment<3>(at + 7)};
  }
  return the_case;
}

TEST(Sequence, ErrorsOfTheCamerasAreInTheBandsOfMotion) {
  constexpr double chi2_at_95 = 12.59;  // six degrees of freedom
  constexpr int draws = 40;
  const auto sights = drawn(two_bodies(), none);
  int inside = 0, inside_as_exact = 0, inside_between = 0;
  for (int seed = 0; seed < draws; ++seed) {
    TrackCase the_case = off_by_draw(two_bodies(), seed);
    const Sequence sequence = estimate_sequence(the_case, sights);
    the_case.camera_covariance.resize(0, 0);
    const Sequence as_exact = estimate_sequence(the_case, sights);
    const auto chi2 = [](const TrackedBody& body, const geometry::RigidTransform& truth) {
      const registration::RigidStep off = registration::step_about(body.pose->pose, truth, body.centre);
      return off.dot(body.pose->covariance.ldlt().solve(off));
    };
    const geometry::RigidTransform jaw = pose_at(0, frames) * pose_at(0, 1).inverse(),
                                   skull = pose_at(1, frames) * pose_at(1, 1).inverse();
    inside += chi2(sequence.bodies[0].smoothed.back(), jaw) < chi2_at_95;
    inside_as_exact += chi2(as_exact.bodies[0].smoothed.back(), jaw) < chi2_at_95;
    inside_between += chi2(sequence.relative[0].back(), jaw.inverse() * skull) < chi2_at_95;
  }
  EXPECT_GE(inside, 35);
  EXPECT_GE(inside_between, 35);
  EXPECT_LT(inside_as_exact, 20);
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

TEST(Sequence, SwapOfTwoMarkersIsRepaired) {
  const TrackCase the_case = two_bodies();
  for (const std::size_t other : {std::size_t(2), std::size_t(6)}) {  // of the same body, of the other
    auto sights = drawn(the_case, none);
    std::swap(sights[19].of[1], sights[19].of[other]);
    const Sequence sequence = estimate_sequence(the_case, sights);
    EXPECT_EQ(sequence.repaired, 1);
    EXPECT_LT(farthest(sequence, none), 0.3);
    const Warning* warning = warning_of(sequence, Reason::markers_swapped);
    ASSERT_TRUE(warning);
    EXPECT_NE(warning->message.find("frame 20: the images of \"j2\" and"), std::string::npos);
  }
}

TEST(Sequence, NamesOfTheFirstFrameCountWhereMostFramesAreSwapped) {
  constexpr std::size_t begin = 11;
  const TrackCase the_case = two_bodies();
  auto sights = drawn(the_case, none);
  for (std::size_t f = begin; f < sights.size(); ++f) std::swap(sights[f].of[1], sights[f].of[3]);
  const Sequence sequence = estimate_sequence(the_case, sights);
  EXPECT_EQ(sequence.repaired, int(sights.size() - begin));
  EXPECT_LT(farthest(sequence, none), 0.2);
  const Warning* warning = warning_of(sequence, Reason::markers_swapped);
  ASSERT_TRUE(warning);
  EXPECT_TRUE(warning->message.starts_with("frame 12: ")) << warning->message;
}

TEST(Sequence, SwapInOneViewIsRepaired) {
  const TrackCase the_case = two_bodies();
  auto sights = drawn(the_case, none);
  std::swap(sights[11].of[4][1], sights[11].of[7][1]);
  const Sequence sequence = estimate_sequence(the_case, sights);
  EXPECT_EQ(sequence.repaired, 1);
  EXPECT_LT(farthest(sequence, none), 0.3);
  const Warning* warning = warning_of(sequence, Reason::markers_swapped);
  ASSERT_TRUE(warning);
  EXPECT_EQ(warning->view, "B");
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

/// The second view's images from a frame on are those of later frames; earlier ones for negative numbers.
std::vector<FrameSights> with_dropped(const std::vector<FrameSights>& sights, std::size_t from, int dropped) {
  auto made = sights;
  for (std::size_t f = from; f < sights.size(); ++f)
    for (std::size_t m = 0; m < sights[f].of.size(); ++m) {
      const int moment = int(f) + dropped;
      made[f].of[m][1] = moment < int(sights.size()) ? sights[std::size_t(moment)].of[m][1] : std::nullopt;
    }
  return made;
}

TEST(Sequence, FrameThatOneCameraDroppedIsNamedAndTakenIntoAccount) {
  const TrackCase the_case = two_bodies();
  for (const int dropped : {1, -2}) {
    const Sequence sequence = estimate_sequence(the_case, with_dropped(drawn(the_case, none), 21, dropped));
    const Warning* warning = warning_of(sequence, Reason::cameras_not_in_step);
    ASSERT_TRUE(warning) << dropped;
    EXPECT_EQ(warning->view, "B");
    EXPECT_NEAR(warning->figures.at("frame"), 22, 1) << warning->message;
    EXPECT_NEAR(warning->figures.at("jump_frames"), dropped, 0.2) << warning->message;
    EXPECT_NE(warning->message.find(dropped > 0 ? "B dropped a frame" : "A dropped a frame"),
              std::string::npos)
        << warning->message;
    EXPECT_LT(farthest(sequence, none), 0.5) << dropped;
    EXPECT_LT(std::abs(sequence.delays[1].frames), 0.1) << dropped;
  }
}

TEST(Sequence, AfterAFrameDroppedBetweenThoseThatAreFollowedNoBodyHasAPose) {
  const TrackCase the_case = two_bodies();
  const auto all = with_dropped(drawn(the_case, none), 20, 1);
  std::vector<FrameSights> every_second;
  for (std::size_t f = 0; f < all.size(); f += 2) every_second.push_back(all[f]);
  const Sequence sequence = estimate_sequence(the_case, every_second);
  ASSERT_TRUE(warning_of(sequence, Reason::cameras_not_in_step));
  EXPECT_EQ(sequence.bodies[0].frames[5].decision, PoseDecision::accept);
  EXPECT_EQ(sequence.bodies[0].frames[15].reason, Reason::cameras_not_in_step);
  EXPECT_FALSE(sequence.bodies[0].frames[15].pose);
}

TEST(Sequence, FilmsInStepHaveNoDroppedFrame) {
  const TrackCase the_case = two_bodies();
  EXPECT_FALSE(warning_of(estimate_sequence(the_case, drawn(the_case, none)), Reason::cameras_not_in_step));
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

std::vector<MarkerStatus> statuses_of(const Sequence& sequence, std::size_t marker) {
  std::vector<MarkerStatus> made;
  for (const auto& frame : sequence.markers) made.push_back(frame[marker].status);
  return made;
}

TEST(Sequence, MarkerThatContradictsItsPickInMostFramesDoesNotCount) {
  const TrackCase the_case = two_bodies();
  const Shift to_another = [](std::size_t marker, int frame) {
    return marker == 3 && frame > 1 ? Eigen::Vector3d(8, -6, 9) : Eigen::Vector3d(0, 0, 0);
  };
  const auto sights = drawn(the_case, to_another);
  const Sequence sequence = estimate_sequence(the_case, sights);
  const Warning* warning = warning_of(sequence, Reason::marker_lost);
  ASSERT_TRUE(warning);
  EXPECT_NE(warning->message.find("\"j4\" is not where frame 1 has it in the body \"jaw\" in 39 of 39 "
                                  "frames, first in frame 2, and counts in none"),
            std::string::npos)
      << warning->message;
  EXPECT_EQ(std::ranges::count(statuses_of(sequence, 3), MarkerStatus::lost), frames);
  EXPECT_EQ(std::ranges::count(statuses_of(sequence, 0), MarkerStatus::tracked), frames);
  EXPECT_LT(farthest(sequence, none, 3), 0.5);
  for (const BodySequence& body : sequence.bodies)
    EXPECT_EQ(body.smoothed[20].decision, PoseDecision::accept);
  TrackCase of_file = the_case;  // whose first row is no surer than others
  of_file.points.assign(sights.size(), {});
  EXPECT_FALSE(warning_of(estimate_sequence(of_file, sights), Reason::marker_lost));
}

TEST(Sequence, HiddenMarkersContradictNothing) {
  const TrackCase the_case = two_bodies();
  const Shift to_another = [](std::size_t marker, int frame) {
    return marker == 3 && frame > 1 ? Eigen::Vector3d(8, -6, 9) : Eigen::Vector3d(0, 0, 0);
  };
  auto sights = drawn(the_case, to_another);
  for (const std::size_t f : {20, 21, 22})
    for (const std::size_t m : {0, 1})
      for (auto& image : sights[f].of[m]) image.reset();
  const Sequence sequence = estimate_sequence(the_case, sights);
  EXPECT_EQ(sequence.markers[21][2].status, MarkerStatus::tracked);
  EXPECT_EQ(sequence.markers[21][0].status, MarkerStatus::predicted);
  EXPECT_LT(farthest(sequence, none, 3), 0.5);
}

TEST(Sequence, CorrectedMarkersAreNotTakenOut) {
  TrackCase the_case = two_bodies();
  const Shift to_another = [](std::size_t marker, int frame) {
    return marker == 3 && frame > 1 ? Eigen::Vector3d(8, -6, 9) : Eigen::Vector3d(0, 0, 0);
  };
  for (int f = 2; f <= frames; ++f) the_case.corrections.push_back({3, 0, {0, 0}, f});
  const Sequence sequence = estimate_sequence(the_case, drawn(the_case, to_another));
  const Warning* warning = warning_of(sequence, Reason::body_ill_conditioned);
  ASSERT_TRUE(warning);
  EXPECT_NE(warning->message.find("frame 1: \"j4\" is 13."), std::string::npos) << warning->message;
}

TEST(Sequence, WhereAllMarkersContradictTheFirstFrameNoneIsPlaced) {
  const TrackCase the_case = two_bodies();
  // A rigid body of other discs, in the frames behind the first.
  const Shift to_others = [](std::size_t marker, int frame) {
    static const std::vector<Eigen::Vector3d> others{{8, -6, 9}, {-9, 7, 5}, {6, 8, -9}, {-7, -8, 6}};
    return marker < 4 && frame > 1 ? others[marker] : Eigen::Vector3d(0, 0, 0);
  };
  const Sequence sequence = estimate_sequence(the_case, drawn(the_case, to_others));
  const Warning* warning = warning_of(sequence, Reason::body_ill_conditioned);
  ASSERT_TRUE(warning);
  EXPECT_NE(warning->message.find("of its markers are located"), std::string::npos) << warning->message;
  EXPECT_EQ(sequence.bodies[0].smoothed[20].decision, PoseDecision::refuse);
  EXPECT_EQ(sequence.bodies[1].smoothed[20].decision, PoseDecision::accept);
  for (std::size_t m = 0; m < 4; ++m)
    EXPECT_EQ(std::ranges::count(statuses_of(sequence, m), MarkerStatus::tracked), 1) << m;
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

TEST(Sequence, NamesExchangedBetweenBodiesAreRefusedByName) {
  TrackCase the_case = two_bodies();
  std::swap(the_case.bodies[0].markers[2], the_case.bodies[1].markers[1]);
  const Sequence sequence = estimate_sequence(the_case, drawn(the_case, none));
  ASSERT_TRUE(sequence.failure);
  EXPECT_EQ(sequence.failure->reason, Reason::markers_swapped);
  EXPECT_TRUE(sequence.failure->message.starts_with(
      "\"s2\" of the body \"jaw\" and \"j3\" of \"skull\" have each other's names"))
      << sequence.failure->message;
  for (const BodySequence& body : sequence.bodies) {
    EXPECT_EQ(body.frames[20].decision, PoseDecision::refuse);
    EXPECT_EQ(body.smoothed[20].decision, PoseDecision::refuse);
  }
  EXPECT_EQ(sequence.markers[20][2].status, MarkerStatus::lost);
  EXPECT_EQ(sequence.markers[20][0].status, MarkerStatus::tracked);
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
