// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/diagnosis/advice.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace helicarm::pipeline {
namespace {

using testing::HasSubstr;

Result refused(Reason reason, std::map<std::string, double> figures = {}) {
  Result result;
  result.failure = Failure{reason, "because", "AP", std::move(figures)};
  return result;
}

TEST(Advice, OfAMeasuredCaseIsEmpty) {
  EXPECT_TRUE(advice_for({}).causes.empty());
  EXPECT_TRUE(advice_for({}).next.empty());
}

TEST(Advice, EveryRefusalOfARunHasCausesAndANextStep) {
  for (const Reason reason :
       {Reason::blank_image, Reason::saturated, Reason::unequal_pixels, Reason::plate_not_found,
        Reason::plate_mismatch, Reason::too_few_fiducials, Reason::ambiguous_labels,
        Reason::calibrator_mismatch, Reason::coplanar_fiducials, Reason::views_too_close,
        Reason::residual_too_large, Reason::ambiguous_handedness, Reason::scale_disagrees,
        Reason::patient_mismatch, Reason::uncertain}) {
    const Advice advice = advice_for(refused(reason));
    EXPECT_FALSE(advice.causes.empty()) << code(reason);
    EXPECT_FALSE(advice.next.empty()) << code(reason);
  }
}

TEST(Advice, UnknownHandednessComesFirstWhereTheRivalIsMirrored) {
  EXPECT_THAT(advice_for(refused(Reason::ambiguous_labels, {{"mirror_differs", 1}})).causes.front(),
              HasSubstr("mirrored"));
  EXPECT_THAT(advice_for(refused(Reason::ambiguous_labels, {{"mirror_differs", 0}})).causes.front(),
              Not(HasSubstr("mirrored")));
}

TEST(Advice, WrongTagsComeFirstWhereOthersFit) {
  for (const Reason reason : {Reason::plate_mismatch, Reason::calibrator_mismatch, Reason::too_few_fiducials})
    EXPECT_THAT(advice_for(refused(reason, {{"fitting_pixel_mm", 0.3}})).causes.front(),
                HasSubstr("pixel size"));
}

TEST(Advice, WrongDiametersComeFirstWhereOthersFit) {
  for (const Reason reason : {Reason::calibrator_mismatch, Reason::too_few_fiducials})
    EXPECT_THAT(advice_for(refused(reason, {{"fitting_diameters", 2}})).causes.front(),
                HasSubstr("diameter"));
}

TEST(Advice, PlateThatTheMapDoesNotStraightenIsMissingInTheCase) {
  EXPECT_THAT(advice_for(refused(Reason::plate_mismatch, {{"residual_rms_px", 2}})).causes.front(),
              HasSubstr("names no plate"));
}

TEST(Advice, MismatchStatesHowManyBallsTheGuessExplains) {
  Result result = refused(Reason::calibrator_mismatch);
  result.calibrator.balls.resize(12);
  result.views.resize(1);
  result.views[0].name = "AP";
  result.views[0].guessed.resize(7);
  EXPECT_THAT(advice_for(result).next, HasSubstr("7 of 12 balls"));
}

}  // namespace
}  // namespace helicarm::pipeline
