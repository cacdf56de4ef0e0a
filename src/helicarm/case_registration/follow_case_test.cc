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

pipeline::RegistrationCase sequence_of(const char* image) {
  pipeline::RegistrationCase given;
  pipeline::CaseView view;
  view.name = "AP";
  view.image = std::filesystem::path("/case") / image;
  given.base.views.push_back(view);
  return given;
}

TEST(Sequence, ImagesAreNumbered) {
  EXPECT_EQ(pipeline::at_frame(sequence_of("ap_{frame:04d}.tif"), 12)->base.views[0].image,
            "/case/ap_0012.tif");
  EXPECT_EQ(pipeline::at_frame(sequence_of("{frame}.png"), 7)->base.views[0].image, "/case/7.png");
  EXPECT_TRUE(pipeline::is_sequence(sequence_of("{frame}.png")));
}

TEST(Sequence, FilesWithoutANumberHaveFrames) {
  const auto made = pipeline::at_frame(sequence_of("ap.dcm"), 7);
  EXPECT_EQ(made->base.views[0].image, "/case/ap.dcm");
  EXPECT_EQ(made->base.views[0].frame, 7);
  EXPECT_FALSE(pipeline::is_sequence(sequence_of("ap.dcm")));
}

TEST(Sequence, OtherPlaceholdersAreRefused) {
  for (const char* name : {"{frame:d}.png", "{frame.png", "{frame:3d}.png", "{frame}{frame:x}.png"})
    EXPECT_FALSE(pipeline::at_frame(sequence_of(name), 1)) << name;
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
