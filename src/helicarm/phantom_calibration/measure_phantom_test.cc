// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom_calibration/measure_phantom.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "helicarm/phantom_calibration/gauge.h"
#include "helicarm/phantom_calibration/phantom_report.h"
#include "helicarm/phantom_calibration/simulated_phantom_test.h"

namespace helicarm::phantom_calibration {
namespace {

using Eigen::Vector3d;

const simulation::SimulatedCase& five_views() {
  static const simulation::SimulatedCase simulated = simulated_phantom({0, 12, 24, 36, 48});
  return simulated;
}

/// What the file would say of a glued phantom: all balls 0.2 mm off, P3 by 3 mm.
void misplace(PhantomFolder& folder) {
  for (phantom::CalibratorBall& ball : folder.the_case.calibrator.balls) {
    const double turn = 2.4 * double(&ball - folder.the_case.calibrator.balls.data());
    ball.centre_in_calibrator += 0.2 * Vector3d(std::cos(turn), std::sin(turn), std::cos(3 * turn));
  }
  folder.ball("P3").centre_in_calibrator += Vector3d(2, -1, 2);
}

double largest_error(const PhantomResult& result, const phantom::Calibrator& truth) {
  std::vector<Vector3d> found, places;
  for (std::size_t i = 0; i < truth.balls.size(); ++i) {
    found.push_back(result.balls[i].centre);
    places.push_back(truth.balls[i].centre_in_calibrator);
  }
  const auto fit = similarity_between(found, places, Eigen::VectorXd::Ones(Eigen::Index(found.size())), true);
  double largest = 0;
  for (std::size_t i = 0; i < found.size(); ++i)
    largest = std::max(largest, (fit * found[i] - places[i]).norm());
  return largest;
}

PhantomResult measured(const pipeline::Case& the_case, PhantomOptions options = {}) {
  options.threads = 2;
  const auto result = measure_phantom(the_case, options);
  EXPECT_TRUE(result) << result.error().message;
  return result.value_or(PhantomResult{});
}

TEST(MeasurePhantom, BallsThatTheFileMisplacesAreMeasured) {
  PhantomFolder folder(five_views());
  const phantom::Calibrator truth = folder.the_case.calibrator;
  misplace(folder);
  PhantomOptions options;
  options.distances = {
      {"P1", "P3", (truth.balls[0].centre_in_calibrator - truth.balls[2].centre_in_calibrator).norm()}};
  const auto result = measured(folder.the_case, options);
  ASSERT_FALSE(result.failure) << result.failure->message;
  ASSERT_EQ(result.balls.size(), 12u);
  EXPECT_LT(largest_error(result, truth), 0.2);  // a third of a pixel
  EXPECT_NEAR(result.balls[2].from_nominal->norm(), 3, 0.5);
  EXPECT_EQ(result.scale.source, "distances");
}

PhantomResult measured_from_scratch(const simulation::SimulatedCase& simulated,
                                    std::vector<double> diameters_mm = {4}, PhantomOptions options = {}) {
  PhantomFolder folder(simulated);
  folder.the_case.calibrator = {};
  folder.the_case.diameters_mm = std::move(diameters_mm);
  for (pipeline::CaseView& view : folder.the_case.views) view.mirrored = false;
  options.from_scratch = true;
  return measured(folder.the_case, options);
}

const Warning* find_reason(const std::vector<Warning>& warnings, Reason reason) {
  const auto found = std::ranges::find(warnings, reason, &Warning::reason);
  return found == warnings.end() ? nullptr : &*found;
}

/// P1 to P3 as a caliper shows it over both balls, or its multiple.
PhantomResult with_distance(const PhantomFolder& folder, double factor, bool outer) {
  const auto& balls = folder.the_case.calibrator.balls;
  const double centres_mm = (balls[0].centre_in_calibrator - balls[2].centre_in_calibrator).norm();
  PhantomOptions options;
  options.outer = outer;
  options.distances = {{"P1", "P3", factor * (centres_mm + balls[0].diameter_mm)}};
  return measured(folder.the_case, options);
}

TEST(MeasurePhantom, OuterDistanceTakenAsThatOfTheCentresIsWarnedOf) {
  const PhantomFolder folder(five_views());
  const PhantomResult right = with_distance(folder, 1, true);
  EXPECT_FALSE(find_reason(right.warnings, Reason::scale_disagrees));
  EXPECT_NEAR(right.pair.distance_mm,
              (right.balls[right.pair.a].centre - right.balls[right.pair.b].centre).norm(), 1e-9);
  const PhantomResult wrong = with_distance(folder, 1, false);
  const Warning* warning = find_reason(wrong.warnings, Reason::scale_disagrees);
  ASSERT_TRUE(warning);
  EXPECT_NE(warning->message.find("the nominal file"), std::string::npos) << warning->message;
}

TEST(MeasurePhantom, ContradictedScaleEntersTheScaleSigma) {
  const PhantomFolder folder(five_views());
  const PhantomResult wrong = with_distance(folder, 1, false);
  ASSERT_FALSE(wrong.failure) << wrong.failure->message;
  EXPECT_GT(wrong.calibrator.scale_sigma, 0.03);  // 4 mm of 110 mm
  EXPECT_LT(with_distance(folder, 1, true).calibrator.scale_sigma, 0.003);
}

TEST(MeasurePhantom, OneDistanceIsNotedAsUnchecked) {
  const PhantomResult result = with_distance(PhantomFolder(five_views()), 1, true);
  ASSERT_FALSE(result.failure) << result.failure->message;
  EXPECT_TRUE(find_reason(result.notes, Reason::scale_unverified));
  ASSERT_TRUE(result.scale.over_diameters && result.scale.over_nominal);
  EXPECT_NEAR(result.scale.over_diameters->ratio, 1, 3 * result.scale.over_diameters->sigma);
  EXPECT_NEAR(result.scale.over_nominal->ratio, 1, 0.01);
}

TEST(MeasurePhantom, DistancesOfTheOtherKindAreNamed) {
  const PhantomFolder folder(five_views());
  const auto& balls = folder.the_case.calibrator.balls;
  PhantomOptions options;
  for (const auto& [a, b] : {std::pair(0, 2), {0, 1}}) {
    const double centres_mm =
        (balls[std::size_t(a)].centre_in_calibrator - balls[std::size_t(b)].centre_in_calibrator).norm();
    options.distances.push_back(
        {balls[std::size_t(a)].label, balls[std::size_t(b)].label, centres_mm + balls[0].diameter_mm});
  }
  const PhantomResult wrong = measured(folder.the_case, options);
  ASSERT_TRUE(wrong.failure);
  EXPECT_EQ(wrong.failure->reason, Reason::distances_disagree);
  EXPECT_NE(wrong.failure->message.find("--distance-is"), std::string::npos) << wrong.failure->message;
  options.outer = true;
  const PhantomResult right = measured(folder.the_case, options);
  EXPECT_FALSE(right.failure) << right.failure->message;
  EXPECT_FALSE(find_reason(right.notes, Reason::scale_unverified));
}

TEST(MeasurePhantom, SimilarDistancesOfTheOtherKindEnterTheScaleSigma) {
  const PhantomFolder folder(five_views());
  const auto& balls = folder.the_case.calibrator.balls;
  PhantomOptions options;
  for (const auto& [a, b] : {std::pair(0, 2), {1, 3}}) {
    const phantom::CalibratorBall &from = balls[std::size_t(a)], &to = balls[std::size_t(b)];
    options.distances.push_back(
        {from.label, to.label, (from.centre_in_calibrator - to.centre_in_calibrator).norm() + 4});
  }
  const PhantomResult result = measured(folder.the_case, options);
  ASSERT_FALSE(result.failure) << result.failure->message;
  const Warning* warning = find_reason(result.warnings, Reason::scale_disagrees);
  ASSERT_TRUE(warning);
  EXPECT_NE(warning->message.find("taken as outer distances"), std::string::npos) << warning->message;
  EXPECT_GT(result.calibrator.scale_sigma, 0.03);
}

TEST(MeasurePhantom, MirroredNominalFileIsRefused) {
  for (const bool stated : {false, true}) {
    PhantomFolder folder(five_views());
    for (phantom::CalibratorBall& ball : folder.the_case.calibrator.balls)
      ball.centre_in_calibrator.x() *= -1;
    if (stated)
      for (pipeline::CaseView& view : folder.the_case.views) view.mirrored = false;
    const PhantomResult result = measured(folder.the_case);
    ASSERT_TRUE(result.failure);
    if (!stated) {
      EXPECT_EQ(result.failure->reason, Reason::ambiguous_handedness) << result.failure->message;
    }
  }
}

TEST(MeasurePhantom, DistanceInAnotherUnitIsRefused) {
  const PhantomResult result = with_distance(PhantomFolder(five_views()), 0.1, true);
  ASSERT_TRUE(result.failure);
  EXPECT_EQ(result.failure->reason, Reason::scale_disagrees);
}

TEST(MeasurePhantom, FromScratchNothingButTheDiameterIsNeeded) {
  const auto result = measured_from_scratch(five_views());
  ASSERT_FALSE(result.failure) << result.failure->message;
  EXPECT_EQ(result.balls.size(), 12u);
  EXPECT_EQ(result.balls.front().label, "B1");
  EXPECT_EQ(result.warnings.back().reason, Reason::scale_weak);
}

TEST(MeasurePhantom, FromScratchWithoutDiametersIsRefused) {
  const PhantomFolder folder(five_views());
  PhantomOptions options;
  options.from_scratch = true;
  const auto result = measure_phantom(folder.the_case, options);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().reason, Reason::bad_value);
  EXPECT_NE(result.error().message.find("diameters_mm"), std::string::npos) << result.error().message;
}

TEST(MeasurePhantom, NullCalibratorIsRefusedUnlessFromScratch) {
  PhantomFolder folder(five_views());
  folder.the_case.calibrator = {};
  folder.the_case.diameters_mm = {4};
  const auto result = measure_phantom(folder.the_case, {});
  ASSERT_FALSE(result);
  EXPECT_NE(result.error().message.find("\"calibrator\""), std::string::npos) << result.error().message;
}

TEST(MeasurePhantom, StagesAreAnnouncedAndAnExceptionBetweenViewsEndsIt) {
  const PhantomFolder folder(five_views());
  std::vector<std::string> stages;
  PhantomOptions options;
  options.threads = 1;
  options.on_stage = [&](std::string_view stage) { stages.emplace_back(stage); };
  int views = 0;
  options.on_view = [&] {
    if (++views > 7) throw std::runtime_error("stop");
  };
  EXPECT_THROW(measure_phantom(folder.the_case, options), std::runtime_error);
  EXPECT_EQ(stages, (std::vector<std::string>{"read", "detect"}));
}

TEST(MeasurePhantom, ListedSizeThatNoBallHasIsNotTakenForTheOthers) {
  const auto result = measured_from_scratch(five_views(), {4, 5});
  ASSERT_TRUE(result.failure);
  EXPECT_EQ(result.failure->reason, Reason::uncertain) << result.failure->message;
  EXPECT_NE(result.failure->message.find("4, 5 mm"), std::string::npos) << result.failure->message;
}

TEST(MeasurePhantom, DistanceDecidesWhichListedSizeTheBallsHave) {
  const auto first = measured_from_scratch(five_views());
  ASSERT_FALSE(first.failure) << first.failure->message;
  const auto& pair = first.pair;
  PhantomOptions options;
  options.distances = {{first.balls[pair.a].label, first.balls[pair.b].label, pair.distance_mm}};
  const auto result = measured_from_scratch(five_views(), {4, 5}, options);
  ASSERT_FALSE(result.failure) << result.failure->message;
  for (const phantom::CalibratorBall& ball : result.calibrator.balls) EXPECT_EQ(ball.diameter_mm, 4);
  // The ball of a check target, 3 mm, is of a size that is not listed.
  const Warning* other = find_reason(result.warnings, Reason::scale_disagrees);
  ASSERT_TRUE(other);
  EXPECT_NE(other->message.find("appears 2.9"), std::string::npos) << other->message;
  const Warning* missing = find_reason(result.warnings, Reason::not_seen);
  ASSERT_TRUE(missing);
  EXPECT_NE(missing->message.find("no ball of this size"), std::string::npos) << missing->message;
}

TEST(MeasurePhantom, FromScratchViewsOfSmallImagesMayBeTwentyDegreesApart) {
  const auto result = measured_from_scratch(simulated_phantom({0, 20, 40, 60, 80}));
  ASSERT_FALSE(result.failure) << result.failure->message;
  EXPECT_EQ(result.balls.size(), 12u);
  EXPECT_LT(result.rms_px, 0.05);
}

TEST(MeasurePhantom, BallThatMovedBetweenTheViewsIsPhantomChanged) {
  simulation::SimulatedCase simulated = five_views();
  simulation::SimulatedView& last = simulated.views[4];
  const auto ball = std::ranges::find(last.balls, "P4", &simulation::TruePoint::name);
  ASSERT_EQ(ball->visibility, simulation::Visibility::clear);
  // Its image 4 px (about 1.6 mm) to the right; the background is flat.
  const auto u = int(ball->raw.x()), v = int(ball->raw.y());
  for (int y = v - 12; y <= v + 12; ++y)
    for (int x = u + 16; x >= u - 12; --x) last.pixels(x, y) = last.pixels(x - 4, y);
  PhantomFolder folder(simulated);
  const auto result = measured(folder.the_case);
  ASSERT_TRUE(result.failure);
  EXPECT_EQ(result.failure->reason, Reason::phantom_changed);
  EXPECT_EQ(result.failure->message.substr(0, 2), "P4") << result.failure->message;
}

TEST(MeasurePhantom, ViewsAFewDegreesApartAreTooClose) {
  PhantomFolder folder(simulated_phantom({0, 3, 6}));
  const auto result = measured(folder.the_case);
  ASSERT_TRUE(result.failure);
  EXPECT_EQ(result.failure->reason, Reason::views_too_close) << result.failure->message;
}

TEST(MeasurePhantom, TwoViewsAreTooFew) {
  PhantomFolder folder(five_views());
  folder.the_case.views.resize(2);
  EXPECT_EQ(measured(folder.the_case).failure->reason, Reason::too_few_views);
}

TEST(MeasurePhantom, UnknownLabelOfADistanceIsUnusableInput) {
  PhantomFolder folder(five_views());
  PhantomOptions options;
  options.distances = {{"P1", "Q7", 80}};
  const auto result = measure_phantom(folder.the_case, options);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().reason, Reason::bad_value);
}

TEST(MeasurePhantom, ReportShowsTheImagesWithTheBallsLabels) {
  PhantomFolder folder(five_views());
  const auto result = measured(folder.the_case);
  ASSERT_FALSE(result.failure) << result.failure->message;
  const std::string html = phantom_report_html(result);
  const auto count = [&](const std::string& text) {
    int found = 0;
    for (std::size_t at = html.find(text); at != std::string::npos; at = html.find(text, at + 1)) ++found;
    return found;
  };
  EXPECT_EQ(count("data:image/png"), 5);
  EXPECT_GE(count(">P7</text>"), 5);
}

TEST(HandDistance, LabelsAndPixelsAreRead) {
  const auto labels = hand_distance_from("P1,P7=83.42");
  ASSERT_TRUE(labels) << labels.error().message;
  EXPECT_EQ(std::get<std::string>(labels->b), "P7");
  EXPECT_EQ(labels->mm, 83.42);
  const auto pixels = hand_distance_from("174.5,373;812,366=110.3");
  ASSERT_TRUE(pixels) << pixels.error().message;
  EXPECT_EQ(std::get<Eigen::Vector2d>(pixels->a), Eigen::Vector2d(174.5, 373));
}

TEST(HandDistance, WrongOnesAreRefused) {
  for (const char* text : {"P1,P7", "P1=83", "P1,P7,P8=83", "P1,P7=-3", "P1,P7=nan", "P1,P7=1e9", "P1,P7=8x",
                           "1,2;3=4", "1;2,3=4", "1,2;3,4="})
    EXPECT_FALSE(hand_distance_from(text)) << text;
}

}  // namespace
}  // namespace helicarm::phantom_calibration
