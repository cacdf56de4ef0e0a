// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/dropped_frames.h"

#include <gtest/gtest.h>

#include "helicarm/track/sequence.h"
#include "helicarm/track/two_bodies_test.h"

namespace helicarm::track {
namespace dropped_frames_test {

using namespace two_bodies_test;

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

TEST(DroppedFrames, FrameThatOneCameraDroppedIsNamedAndTakenIntoAccount) {
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

TEST(DroppedFrames, AfterAFrameDroppedBetweenThoseThatAreFollowedNoBodyHasAPose) {
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

TEST(DroppedFrames, FilmsInStepHaveNoDroppedFrame) {
  const TrackCase the_case = two_bodies();
  EXPECT_FALSE(warning_of(estimate_sequence(the_case, drawn(the_case, none)), Reason::cameras_not_in_step));
}

}  // namespace dropped_frames_test
}  // namespace helicarm::track
