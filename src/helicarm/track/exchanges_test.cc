// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/exchanges.h"

#include <gtest/gtest.h>

#include "helicarm/track/sequence.h"
#include "helicarm/track/two_bodies_test.h"

namespace helicarm::track {
namespace exchanges_test {

using namespace two_bodies_test;

TEST(Exchanges, SwapOfTwoMarkersIsRepaired) {
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

TEST(Exchanges, NamesOfTheFirstFrameCountWhereMostFramesAreSwapped) {
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

TEST(Exchanges, SwapInOneViewIsRepaired) {
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

TEST(Exchanges, NamesExchangedBetweenBodiesAreRefusedByName) {
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

}  // namespace exchanges_test
}  // namespace helicarm::track
