// SPDX-License-Identifier: Apache-2.0
#include "helicarm/sweep/sweep_case.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "helicarm/core/temporary_folder.h"
#include "helicarm/sweep/drawn_run_test.h"

namespace helicarm::sweep {
namespace {

class SweepCaseFile : public testing::Test {
 protected:
  void SetUp() override {
    DrawnRun run;
    run.frames = 4;
    run.size = 16;
    run.write(folder_.path());
  }

  Expected<SweepCase> read(const std::string& frames, const std::string& image = "run_{frame:03d}.png") {
    Json json = *read_json(folder_.path() / "case.json");
    json["views"][0]["frames"] = frames;
    json["views"][0]["image"] = image;
    EXPECT_TRUE(write_file(folder_.path() / "case.json", json.dump()));
    return read_sweep_case(folder_.path());
  }
  std::vector<std::string> names(const std::string& frames) {
    std::vector<std::string> names;
    const SweepCase the_case = *read(frames);
    for (const Frame& frame : the_case.frames) names.push_back(frame.view.name);
    return names;
  }

  TemporaryFolder folder_;
};

TEST_F(SweepCaseFile, AllNumberedFilesAreFrames) {
  EXPECT_THAT(names("all"), testing::ElementsAre("RUN/1", "RUN/2", "RUN/3", "RUN/4"));
  EXPECT_EQ(read("all")->frames[2].view.image.filename(), "run_003.png");
}

TEST_F(SweepCaseFile, AGapInTheNumbersIsWarnedOf) {
  EXPECT_TRUE(read("all")->base.warnings.empty());
  std::filesystem::remove(folder_.path() / "run_003.png");
  const auto the_case = read("all");
  ASSERT_TRUE(the_case);
  EXPECT_EQ(the_case->frames.size(), 3U);
  ASSERT_EQ(the_case->base.warnings.size(), 1U);
  EXPECT_EQ(the_case->base.warnings[0].reason, Reason::frames_missing);
  EXPECT_THAT(the_case->base.warnings[0].message,
              testing::HasSubstr("1 of 4 numbers of the run have no image: 3"));
}

TEST_F(SweepCaseFile, ARangeMayHaveAStep) {
  EXPECT_THAT(names("2-4:2"), testing::ElementsAre("RUN/2", "RUN/4"));
}

TEST_F(SweepCaseFile, AllItsImagesAreViewsOfAPhantomsCase) {
  ASSERT_TRUE(read("1-4:3"));
  const auto the_case = read_phantom_case(folder_.path());
  ASSERT_TRUE(the_case) << the_case.error().message;
  ASSERT_EQ(the_case->views.size(), 2U);
  EXPECT_EQ(the_case->views[1].name, "RUN/4");
  EXPECT_EQ(the_case->views[1].image.filename(), "run_004.png");
}

TEST_F(SweepCaseFile, MissingFilesAreNamed) {
  const auto failed = read("3-6");
  ASSERT_FALSE(failed);
  EXPECT_EQ(failed.error().reason, Reason::missing_file);
  EXPECT_THAT(failed.error().message,
              testing::HasSubstr("2 of 4 images do not exist, the first: run_005.png; the frames "));
}

TEST_F(SweepCaseFile, FramesThatAFileDoesNotHaveAreRefused) {
  const auto failed = read("1-3", "run_001.png");
  ASSERT_FALSE(failed);
  EXPECT_EQ(failed.error().reason, Reason::bad_value);
  EXPECT_THAT(failed.error().message, testing::HasSubstr("has the frames 1 to 1"));
}

TEST_F(SweepCaseFile, AnythingElseIsNoRange) {
  for (const char* frames : {"every", "4-1", "1-4:0", ""}) {
    const auto failed = read(frames);
    ASSERT_FALSE(failed) << frames;
    EXPECT_EQ(failed.error().reason, Reason::bad_value);
  }
}

TEST_F(SweepCaseFile, OtherCommandsNameTheCommandForRuns) {
  ASSERT_TRUE(read("all"));
  const auto failed = pipeline::read_case(folder_.path());
  ASSERT_FALSE(failed);
  EXPECT_EQ(failed.error().reason, Reason::bad_value);
  EXPECT_THAT(failed.error().message, testing::HasSubstr("helicarm sweep"));
}

}  // namespace
}  // namespace helicarm::sweep
