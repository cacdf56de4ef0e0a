// SPDX-License-Identifier: Apache-2.0
#include "helicarm/migration/migrate.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <random>

#include <gtest/gtest.h>

#include "helicarm/geometry/rotation.h"

namespace helicarm::migration {
namespace {

const std::vector<Eigen::Vector3d> bone{
    {-14, 3, -20}, {11, 9, -26}, {2, -13, -12}, {-6, 12, -8}, {13, -5, -15}};
const std::vector<Eigen::Vector3d> implant{{-9, -4, 14}, {10, -2, 19}, {0, 9, 25}, {4, -8, 30}};

/// A motion about the implant's centre.
geometry::RigidTransform implant_motion(const Eigen::Vector3d& turn_deg, const Eigen::Vector3d& shift) {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& place : implant) centre += place / double(implant.size());
  const Eigen::Matrix3d rotation = geometry::rotation_from_vector(turn_deg * EIGEN_PI / 180);
  return {rotation, centre + shift - rotation * centre};
}

struct Noise {
  double sigma_mm = 0;
  unsigned seed = 1;
  bool is_stated = true;
};

/// Both segments in a laboratory, the implant moved.
Exam exam_of(const char* name, const geometry::RigidTransform& laboratory,
             const geometry::RigidTransform& moved, Noise noise) {
  std::mt19937 random(noise.seed);
  std::normal_distribution<double> normal(0, noise.sigma_mm > 0 ? noise.sigma_mm : 1);
  Exam exam{name, {}, {{"bone", {}}, {"implant", {}}}};
  const auto add = [&](std::size_t segment, const Eigen::Vector3d& place) {
    Marker marker{name + std::to_string(exam.markers.size()), laboratory * place, {}, {}};
    if (noise.sigma_mm > 0) marker.place += Eigen::Vector3d(normal(random), normal(random), normal(random));
    if (noise.is_stated)
      marker.covariance = std::pow(std::max(noise.sigma_mm, 1e-3), 2) * Eigen::Matrix3d::Identity();
    exam.segments[segment].markers.push_back(marker.name);
    exam.markers.push_back(marker);
  };
  for (const Eigen::Vector3d& place : bone) add(0, place);
  for (const Eigen::Vector3d& place : implant) add(1, moved * place);
  return exam;
}

const geometry::RigidTransform elsewhere{geometry::rotation_from_vector({0.1, -0.2, 0.05}), {12, -30, 8}};

Exam later_exam(const geometry::RigidTransform& moved, Noise noise = {}) {
  Exam exam = exam_of("b", elsewhere, moved, noise);
  exam.segments.clear();
  return exam;
}

TEST(Migration, OfExactMarkersIsTheMotion) {
  const auto motion = implant_motion({0.5, -1, 2}, {0.3, -0.7, 1.1});
  const auto made = migrate(exam_of("a", {}, {}, {}), later_exam(motion), {});
  ASSERT_TRUE(made) << made.error().message;
  const BodyMigration& body = made->bodies.at(0);
  EXPECT_TRUE(body.translation_mm.isApprox(Eigen::Vector3d(0.3, -0.7, 1.1), 1e-9));
  EXPECT_TRUE(body.motion.matrix().isApprox(motion.matrix(), 1e-9));
  EXPECT_NEAR(body.turn_deg, std::sqrt(0.25 + 1 + 4), 1e-6);
  double most = 0;
  for (const Eigen::Vector3d& place : implant) most = std::max(most, (motion * place - place).norm());
  EXPECT_NEAR(body.mtpm_mm, most, 1e-9);
  EXPECT_TRUE(made->warnings.empty());
}

TEST(Migration, AxesTurnTheSixNumbers) {
  MigrationOptions options;
  options.axes << 0, 0, 1, 1, 0, 0, 0, 1, 0;  // x is the laboratory's y, y its z, z its x
  const auto made =
      migrate(exam_of("a", {}, {}, {}), later_exam(implant_motion({2, 0, 0}, {0.3, -0.7, 1.1})), options);
  ASSERT_TRUE(made) << made.error().message;
  EXPECT_TRUE(made->bodies[0].translation_mm.isApprox(Eigen::Vector3d(-0.7, 1.1, 0.3), 1e-9));
  EXPECT_TRUE(made->bodies[0].rotation_deg.isApprox(Eigen::Vector3d(0, 0, 2), 1e-9));
}

struct Shares {
  double rms_mm = 0, inside = 0, inside_region = 0;
};

/// 400 migrations of 0 to 2 mm and 0 to 2 degrees with noise of 0.02 mm per axis.
Shares simulated(bool is_stated) {
  constexpr int trials = 400;
  Shares shares;
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform(-1, 1), length(0, 2);
  const auto any = [&] {
    return Eigen::Vector3d(length(random) *
                           Eigen::Vector3d(uniform(random), uniform(random), uniform(random)).normalized());
  };
  for (unsigned trial = 0; trial < trials; ++trial) {
    const Eigen::Vector3d shift = any();
    const auto motion = implant_motion(any(), shift);
    const auto exact = migrate(exam_of("a", {}, {}, {}), later_exam(motion), {});
    const auto made = migrate(exam_of("a", {}, {}, {0.02, 2 * trial + 1, is_stated}),
                              later_exam(motion, {0.02, 2 * trial + 2, is_stated}), {});
    EXPECT_TRUE(exact && made);
    const BodyMigration& body = made->bodies[0];
    Eigen::Matrix<double, 6, 1> off;
    off << (body.rotation_deg - exact->bodies[0].rotation_deg) * EIGEN_PI / 180, body.translation_mm - shift;
    shares.rms_mm += off.tail<3>().squaredNorm() / (3 * trials);
    for (int i = 0; i < 6; ++i)
      shares.inside += std::abs(off[i]) < made->width_of_95 * std::sqrt(body.covariance(i, i));
    constexpr double chi2_95_of_6 = 12.592;
    shares.inside_region += off.dot(body.covariance.ldlt().solve(off)) < chi2_95_of_6;
  }
  return {std::sqrt(shares.rms_mm), shares.inside / (6 * trials), shares.inside_region / trials};
}

TEST(Migration, SimulatedMigrationsAreFoundAndTheirRegionsHoldTheTruth) {
  const Shares shares = simulated(true);
  RecordProperty("rms_mm", std::to_string(shares.rms_mm));
  RecordProperty("inside", std::to_string(shares.inside));
  RecordProperty("inside_region", std::to_string(shares.inside_region));
  EXPECT_LT(shares.rms_mm, 0.05);
  EXPECT_NEAR(shares.inside, 0.95, 0.015);
  EXPECT_NEAR(shares.inside_region, 0.95, 0.03);
}

TEST(Migration, IntervalsFollowFromTheResidualsWhereNoErrorsAreStated) {
  EXPECT_NEAR(simulated(false).inside, 0.95, 0.015);
}

TEST(Migration, ALooseMarkerIsNamedAndLeftOut) {
  Exam second = later_exam({});
  second.markers[1].place.z() += 1.4;
  const auto made = migrate(exam_of("a", {}, {}, {}), second, {});
  ASSERT_TRUE(made) << made.error().message;
  EXPECT_EQ(made->segments[0].loose, std::vector<std::string>{"a1"});
  EXPECT_EQ(made->warnings.at(0).reason, Reason::marker_loose);
  EXPECT_LT(made->bodies[0].mtpm_mm, 1e-6);
}

TEST(Migration, ASegmentThatIsNotRigidIsRefused) {
  MigrationOptions options;
  options.matching = Matching::name;
  Exam first = exam_of("m", {}, {}, {}), second = exam_of("m", elsewhere, {}, {});
  second.segments.clear();
  second.markers[1].place.z() += 2.5;
  second.markers[3].place.x() += 2.5;
  const auto made = migrate(first, second, options);
  ASSERT_FALSE(made);
  EXPECT_EQ(made.error().reason, Reason::residual_too_large);
}

TEST(Migration, MarkersOnALineAreRefused) {
  Exam first = exam_of("a", {}, {}, {});
  for (int i = 0; i < 4; ++i)
    first.markers[std::size_t(5 + i)].place = Eigen::Vector3d(3.0 * i * i, 0, 0.01 * i);
  const auto made = migrate(first, later_exam({}), {});
  ASSERT_FALSE(made);
  EXPECT_EQ(made.error().reason, Reason::body_ill_conditioned);
}

TEST(Migration, AHighConditionNumberIsWarnedOf) {
  Exam first = exam_of("m", {}, {}, {}), second = exam_of("m", {}, {}, {});
  for (std::size_t i = 5; i < 9; ++i)
    for (Exam* exam : {&first, &second}) exam->markers[i].place *= 0.2;
  for (Marker& marker : second.markers) marker.place.x() += 1;
  const auto made = migrate(first, second, {});
  ASSERT_TRUE(made) << made.error().message;
  EXPECT_GT(made->segments[1].condition_per_m, 120);
  EXPECT_EQ(made->warnings.at(0).reason, Reason::body_ill_conditioned);
}

TEST(Migration, AMissingMarkerIsNamed) {
  Exam second = later_exam({});
  second.markers.erase(second.markers.begin());
  const auto made = migrate(exam_of("a", {}, {}, {}), second, {});
  ASSERT_TRUE(made) << made.error().message;
  EXPECT_EQ(made->segments[0].missing, std::vector<std::string>{"a0"});
}

TEST(Migration, AMarkerWithoutAPlaceInTheFirstExaminationIsNamed) {
  Exam first = exam_of("a", {}, {}, {});
  first.markers.erase(first.markers.begin() + 5);
  const auto made = migrate(first, later_exam({}), {});
  ASSERT_TRUE(made) << made.error().message;
  EXPECT_EQ(made->segments[1].missing, std::vector<std::string>{"a5"});
  ASSERT_EQ(made->warnings.size(), 1u);
  EXPECT_EQ(made->warnings[0].reason, Reason::marker_lost);
  EXPECT_NE(made->warnings[0].message.find("1 of 4 markers have no place in a: a5"), std::string::npos);
  const auto asked_for = migrate(first, later_exam({}), {.segments = first.segments});
  ASSERT_FALSE(asked_for);
  EXPECT_EQ(asked_for.error().reason, Reason::bad_value);
  first.markers.erase(first.markers.begin() + 5);
  EXPECT_NE(migrate(first, later_exam({}), {}).error().message.find("2 of its 4 markers have a place in a"),
            std::string::npos);
}

/// Of 400 migrations without motion, those whose residuals are said to exceed the stated errors.
int widened_of_400(const std::function<Eigen::Vector3d(std::size_t)>& sigma_of) {
  int widened = 0;
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  const Exam exact = exam_of("m", {}, {}, {});
  for (int trial = 0; trial < 400; ++trial) {
    std::array<Exam, 2> exams{exact, exact};
    for (Exam& exam : exams)
      for (std::size_t i = 0; i < exam.markers.size(); ++i) {
        const Eigen::Vector3d sigma = sigma_of(i);
        exam.markers[i].covariance = sigma.cwiseAbs2().asDiagonal().toDenseMatrix();
        exam.markers[i].place +=
            sigma.cwiseProduct(Eigen::Vector3d(normal(random), normal(random), normal(random)));
      }
    const auto made = migrate(exams[0], exams[1], {.matching = Matching::name});
    EXPECT_TRUE(made);
    if (!made) continue;
    widened += int(std::ranges::count(made->warnings, Reason::residual_too_large, &Warning::reason));
  }
  return widened;
}

TEST(Migration, UnequalErrorsThatAreStatedRightAreNotWidened) {
  EXPECT_LE(widened_of_400([](std::size_t) { return Eigen::Vector3d(0.03, 0.03, 0.03); }), 2);
  EXPECT_LE(widened_of_400([](std::size_t) { return Eigen::Vector3d(0.02, 0.02, 0.1); }), 2);
  EXPECT_LE(widened_of_400([](std::size_t marker) {
              return Eigen::Vector3d(Eigen::Vector3d::Constant(marker == 6 ? 0.2 : 0.02));
            }),
            2);
}

TEST(RigidFit, StatesMeanAndVarianceOfTheSquares) {
  std::mt19937 random(4);
  std::normal_distribution<double> normal;
  constexpr int trials = 20000;
  double sum = 0, of_squares = 0;
  RigidFit fit;
  for (int trial = 0; trial < trials; ++trial) {
    std::vector<Pair> pairs;
    for (std::size_t i = 0; i < bone.size(); ++i) {
      const Eigen::Vector3d sigma(0.02, 0.03, i == 1 ? 0.2 : 0.05);
      pairs.push_back({bone[i], bone[i], sigma.cwiseAbs2().asDiagonal().toDenseMatrix()});
      pairs.back().second +=
          sigma.cwiseProduct(Eigen::Vector3d(normal(random), normal(random), normal(random)));
    }
    fit = fit_rigid(pairs);
    sum += fit.squares_mm2;
    of_squares += fit.squares_mm2 * fit.squares_mm2;
  }
  const double mean = sum / trials;
  EXPECT_NEAR(mean / fit.expected_squares_mm2, 1, 0.03);
  EXPECT_NEAR((of_squares / trials - mean * mean) / fit.squares_variance_mm4, 1, 0.1);
}

TEST(Migration, ResidualsBeyondTheStatedErrorsWidenThem) {
  const auto stated = migrate(exam_of("a", {}, {}, {0.03, 1}), later_exam({}, {0.03, 2}), {});
  Exam first = exam_of("a", {}, {}, {0.03, 1}), second = later_exam({}, {0.03, 2});
  for (Exam* exam : {&first, &second})
    for (Marker& marker : exam->markers) *marker.covariance /= 100;
  const auto widened = migrate(first, second, {});
  ASSERT_TRUE(stated && widened);
  EXPECT_EQ(widened->warnings.at(0).reason, Reason::residual_too_large);
  EXPECT_NEAR(std::sqrt(widened->bodies[0].covariance(3, 3) / stated->bodies[0].covariance(3, 3)), 1, 0.4);
}

Exam stretched(Exam exam, const Eigen::Vector3d& by) {
  for (Marker& marker : exam.markers) marker.place = by.cwiseProduct(marker.place);
  return exam;
}

TEST(Migration, AnExaminationThatCannotCorrespondNamesTheCause) {
  const Noise noise{0.02, 3, false};
  const Exam first = exam_of("a", {}, {}, noise);
  Exam second = exam_of("b", elsewhere, implant_motion({1, 0, 0}, {0.4, 0, 0}), {0.02, 4, false});
  const auto message = [](const Exam& a, const Exam& b, Matching matching = Matching::geometry) {
    const auto made = migrate(a, b, {.matching = matching});
    return made ? "" : made.error().message;
  };
  const Eigen::Vector3d all(1, 1, 1);
  EXPECT_NE(message(first, stretched(second, 0.1 * all)).find("if b is in cm"), std::string::npos);
  EXPECT_NE(message(first, stretched(second, 0.001 * all)).find("if b is in m:"), std::string::npos);
  EXPECT_NE(message(stretched(first, 0.1 * all), second).find("if the first examination is in cm"),
            std::string::npos);
  EXPECT_NE(message(first, stretched(second, {1, -1, 1})).find("the mirror image of b"), std::string::npos);
  EXPECT_NE(message(stretched(first, 0.001 * all), stretched(second, 0.001 * all)).find("coordinates in mm?"),
            std::string::npos);
  const auto in_cm = migrate(stretched(first, 0.1 * all), stretched(second, 0.1 * all), {});
  ASSERT_TRUE(in_cm) << in_cm.error().message;
  EXPECT_NE(in_cm->warnings.at(0).message.find("coordinates in mm?"), std::string::npos);
  std::swap(second.segments[0].name, second.segments[1].name);
  EXPECT_NE(message(first, second).find("the segments' names are exchanged"), std::string::npos);
}

TEST(Migration, AnotherScaleOfOneExaminationIsWarnedOf) {
  const Exam first = exam_of("a", {}, {}, {0.02, 5, false});
  const Exam second = exam_of("b", elsewhere, implant_motion({1, 0, 0}, {0.4, 0, 0}), {0.02, 6, false});
  const auto usual = migrate(first, second, {});
  ASSERT_TRUE(usual) << usual.error().message;
  EXPECT_TRUE(usual->warnings.empty());
  const auto made = migrate(first, stretched(second, {1.008, 1.008, 1.008}), {});
  ASSERT_TRUE(made) << made.error().message;
  ASSERT_EQ(made->warnings.size(), 1u);
  EXPECT_EQ(made->warnings[0].reason, Reason::scale_disagrees);
  EXPECT_NEAR(made->warnings[0].figures.at("scale"), 1.008, 0.003);
}

TEST(Migration, TheSameExaminationTwiceIsRefused) {
  const Exam first = exam_of("a", {}, {}, {}), again = exam_of("copy", {}, {}, {});
  const auto refused = migrate(first, again, {});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().reason, Reason::bad_value);
  EXPECT_NE(refused.error().message.find("a and copy are the same examination"), std::string::npos);
  EXPECT_TRUE(migrate(first, later_exam({}), {}));
}

TEST(Migration, SegmentsAndReferenceAreChecked) {
  Exam first = exam_of("a", {}, {}, {});
  MigrationOptions options;
  options.reference = "cup";
  EXPECT_EQ(migrate(first, later_exam({}), options).error().reason, Reason::bad_value);
  options.reference = "implant";
  EXPECT_EQ(migrate(first, later_exam({}), options)->segments[0].name, "implant");
  first.segments.pop_back();
  EXPECT_EQ(migrate(first, later_exam({}), {}).error().reason, Reason::bad_value);
}

TEST(Student, QuantilesAreThoseOfTables) {
  EXPECT_NEAR(student_975(1), 12.706, 1e-3);
  EXPECT_NEAR(student_975(4), 2.776, 0.01);
  EXPECT_NEAR(student_975(9), 2.262, 1e-3);
  EXPECT_NEAR(student_975(1e6), 1.95996, 1e-4);
}

}  // namespace
}  // namespace helicarm::migration
