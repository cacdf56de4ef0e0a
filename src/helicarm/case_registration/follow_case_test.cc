// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/follow_case.h"

#include <gtest/gtest.h>

namespace helicarm::case_registration {
namespace {

TEST(FrameRange, IsReadWithAndWithoutStep) {
  EXPECT_EQ(frame_range_from("3-7")->count(), 5);
  const auto range = frame_range_from("0-10:4");
  ASSERT_TRUE(range);
  EXPECT_EQ(range->count(), 3);
  EXPECT_EQ(range->first, 0);
}

TEST(FrameRange, RefusesWhatIsNoRange) {
  for (const char* text : {"", "5", "7-3", "1-5:0", "-1-5", "1-5:", "1-9999999", "a-b", "1-5 "}) {
    const auto range = frame_range_from(text);
    ASSERT_FALSE(range) << text;
    EXPECT_EQ(range.error().reason, Reason::bad_value);
  }
}

TEST(FrameRange, NumberOverTheLimitIsNamedAsSuch) {
  const auto range = frame_range_from("1-100000000");
  ASSERT_FALSE(range);
  EXPECT_EQ(range.error().message, "frames: \"1-100000000\": a number is over the limit, 999999");
}

RegisteredFrame two_models() {
  RegisteredFrame frame{4, {}};
  for (const char* name : {"femur", "tibia, left"}) {
    registration::Registration model;
    model.name = name;
    model.decision = registration::Decision::accept;
    model.covariance.setZero();
    model.covariance.diagonal().setConstant(0.01);
    frame.models.push_back(model);
  }
  frame.models[1].world_from_model.translation.x() = 25;
  frame.models[1].centre.x() = 25;
  return frame;
}

TEST(Sequence, RowsHoldThePoses) {
  const std::string poses = poses_rows(two_models());
  EXPECT_TRUE(poses.starts_with("4,femur,accept,1,0,0,0,")) << poses;
  EXPECT_NE(poses.find("\n4,\"tibia, left\",accept,1,0,0,25,"), std::string::npos) << poses;
}

TEST(Sequence, APoseThatIsNotDeterminedHasEmptySigmas) {
  RegisteredFrame frame = two_models();
  frame.models[1].covariance = registration::Registration{}.covariance;
  EXPECT_NE(poses_rows(frame).find(",0,0,0,1,,,,,,,\n"), std::string::npos) << poses_rows(frame);
}

TEST(Sequence, OneRefusalIsNamedWithItsFrame) {
  std::vector<RegisteredFrame> frames{two_models()};
  EXPECT_FALSE(refusal_of(frames));
  frames[0].models[1].failure = Failure{Reason::wrong_model, "tibia: another bone", {}, {}};
  const auto refusal = refusal_of(frames);
  ASSERT_TRUE(refusal);
  EXPECT_EQ(refusal->reason, Reason::wrong_model);
  EXPECT_EQ(refusal->message, "1 of 2 registrations are refused, the first in frame 4: tibia: another bone");
}

}  // namespace
}  // namespace helicarm::case_registration
