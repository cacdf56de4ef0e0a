// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/case_frames.h"

#include <gtest/gtest.h>

namespace helicarm::pipeline {
namespace {

CaseView view_of(const char* image) {
  CaseView view;
  view.name = "AP";
  view.image = std::filesystem::path("/case") / image;
  return view;
}

TEST(CaseFrames, ImagesAreNumbered) {
  EXPECT_EQ(at_number(view_of("ap_{frame:04d}.tif"), 12)->image, "/case/ap_0012.tif");
  EXPECT_EQ(at_number(view_of("{frame}.png"), 7)->image, "/case/7.png");
  EXPECT_TRUE(is_numbered(view_of("{frame}.png")));
}

TEST(CaseFrames, FilesWithoutANumberHaveFrames) {
  const auto view = at_number(view_of("ap.dcm"), 7);
  EXPECT_EQ(view->image, "/case/ap.dcm");
  EXPECT_EQ(view->frame, 7);
  EXPECT_FALSE(is_numbered(view_of("ap.dcm")));
}

TEST(CaseFrames, OtherPlaceholdersAreRefused) {
  for (const char* name : {"{frame:d}.png", "{frame.png", "{frame:3d}.png", "{frame}{frame:x}.png"})
    EXPECT_FALSE(at_number(view_of(name), 1)) << name;
}

TEST(CaseFrames, AViewsImagesMayStartAtAnotherNumber) {
  Case sequence;
  sequence.views = {view_of("a{frame:03d}.png"), view_of("b{frame}.png")};
  sequence.views[1].frame_offset = -3;
  const auto frame = at_frame(sequence, 10);
  EXPECT_EQ(frame->views[0].image.filename(), "a010.png");
  EXPECT_EQ(frame->views[1].image.filename(), "b7.png");
}

}  // namespace
}  // namespace helicarm::pipeline
