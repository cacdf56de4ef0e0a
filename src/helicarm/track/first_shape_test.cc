// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/first_shape.h"

#include <gtest/gtest.h>

#include "helicarm/track/sequence.h"
#include "helicarm/track/two_bodies_test.h"

namespace helicarm::track {
namespace first_shape_test {

using namespace two_bodies_test;

TEST(FirstShape, MarkerThatContradictsItsPickInMostFramesDoesNotCount) {
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

TEST(FirstShape, HiddenMarkersContradictNothing) {
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

TEST(FirstShape, CorrectedMarkersAreNotTakenOut) {
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

TEST(FirstShape, WhereAllMarkersContradictTheFirstFrameNoneIsPlaced) {
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

}  // namespace first_shape_test
}  // namespace helicarm::track
