// SPDX-License-Identifier: Apache-2.0
#include "studies/rectification_study.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace helicarm::study {
namespace {

RectificationStudyOptions small() {
  RectificationStudyOptions options;
  options.groups = 2;
  options.size_px = 512;
  options.distances_mm = {45};
  return options;
}

EngineOptions engine(unsigned threads) {
  EngineOptions options;
  options.threads = threads;
  return options;
}

TEST(RectificationStudy, IntensifierDoesNotDependOnOthersOrThreadsAndTheBestMapHasSmallErrors) {
  const Ranks ranks;
  RectificationStudyOptions alone = small();
  alone.groups = 1;
  const auto one = study_rectification(alone, engine(1), ranks);
  const auto two = study_rectification(small(), engine(2), ranks);
  ASSERT_TRUE(one && two);
  const StudyFiles files = files_of(*two, small());
  const StudyFiles of_one = files_of(*one, alone);
  EXPECT_THAT(files.csv, testing::StartsWith(of_one.csv));
  EXPECT_EQ(to_text(files.json["first_intensifier"]), to_text(of_one.json["first_intensifier"]));
  EXPECT_THAT(files.svg, testing::HasSubstr("Fig. 10"));
  EXPECT_THAT(files.summary, testing::HasSubstr("Published ("));
  for (const Intensifier& intensifier : *two) {
    const GridImage& image = intensifier.images.at(0);
    EXPECT_GT(image.crosses, 65);
    EXPECT_LT(image.finder_rms, 0.15);
    EXPECT_LT(image.nine.best_mean, 0.1 * image.nine.raw_mean);
    EXPECT_LT(image.all.raw_mean, image.nine.raw_mean);
    int seen = 0;
    for (const GridCross& cross : intensifier.crosses) seen += std::isfinite(cross.raw_error);
    EXPECT_EQ(seen, image.crosses);
  }
}

TEST(RectificationStudy, InvalidOptionsAreRefused) {
  const Ranks ranks;
  RectificationStudyOptions options = small();
  options.groups = 0;
  EXPECT_EQ(study_rectification(options, engine(1), ranks).error().reason, Reason::bad_value);
  options = small();
  options.distances_mm = {60};  // Figs. 9 and 10 use 45 mm
  EXPECT_EQ(study_rectification(options, engine(1), ranks).error().reason, Reason::bad_value);
  options = small();
  options.distances_mm = {45, 10};  // behind the plate
  EXPECT_EQ(study_rectification(options, engine(1), ranks).error().reason, Reason::bad_value);
}

}  // namespace
}  // namespace helicarm::study
