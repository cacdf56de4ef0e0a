// SPDX-License-Identifier: Apache-2.0
#include "helicarm/migration/double_examinations.h"

#include <array>
#include <random>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "helicarm/core/files.h"
#include "helicarm/core/temporary_folder.h"
#include "helicarm/migration/migration_files.h"

namespace helicarm::migration {
namespace double_examinations_test {

using testing::HasSubstr;

/// A migration whose translation along x is the number.
NamedMigration moved_by(double shift) {
  NamedMigration made{"a", "b", {}};
  made.migration.segments.resize(2);
  made.migration.segments[0].name = "tibia";
  made.migration.segments[1].name = "tray";
  BodyMigration body{.segment = 1};
  body.translation_mm = {shift, 0, 0};
  body.covariance = 0.01 * registration::RigidCovariance::Identity();
  body.mtpm_mm = std::abs(shift);
  made.migration.bodies.push_back(body);
  return made;
}

TEST(DoubleExaminations, GiveMeanDeviationAndLimit) {
  const auto precision = precision_of({moved_by(0.1), moved_by(-0.1), moved_by(0.3)});
  ASSERT_EQ(precision.size(), 1u);
  EXPECT_EQ(precision[0].body, "tray");
  const ZeroMotion& tx = precision[0].numbers[3];
  EXPECT_NEAR(tx.mean, 0.1, 1e-12);
  EXPECT_NEAR(tx.sd, 0.2, 1e-12);
  EXPECT_NEAR(tx.limit_95, 4.30265 * 0.2, 1e-6);
  EXPECT_NEAR(tx.stated_sigma, 0.1, 1e-12);
  EXPECT_NEAR(precision[0].mtpm_largest_mm, 0.3, 1e-12);
}

TEST(DoubleExaminations, OnePairHasNoDeviation) { EXPECT_TRUE(precision_of({moved_by(0.1)}).empty()); }

TEST(DoubleExaminations, AreRowsOfTheTable) {
  const MigrationAnswer answer{moved_by(1), {moved_by(0.1)}, {}};
  const std::string csv = migration_csv(answer);
  EXPECT_NE(csv.find("\nmigration,a,b,tray,tibia,0,0,0,1,0,0,"), std::string::npos) << csv;
  EXPECT_NE(csv.find("\ndouble,a,b,tray,tibia,0,0,0,0.1,0,0,"), std::string::npos) << csv;
  EXPECT_NE(migration_report(answer).find("tray"), std::string::npos);
}

struct DoubleFiles : testing::Test {
  TemporaryFolder folder;
  const std::vector<std::string> usual{"bone", "stem", "cup"};
  std::pair<std::filesystem::path, std::filesystem::path> first_pair{exam("d1", 11), exam("d2", 12)},
      second_pair{exam("e1", 13), exam("e2", 14)};
  MigrationRequest request{exam("a", 1), exam("b", 2)};

  /// A CSV of five markers of each segment with noise of 0.02 mm; `left_out` markers of the first are
  /// missing.
  std::filesystem::path exam(const std::string& name, unsigned seed, const std::vector<std::string>& order,
                             int left_out = 0) const {
    static constexpr std::array<std::array<double, 3>, 5> places{
        {{-14, 3, -20}, {11, 9, -26}, {2, -13, -12}, {-6, 12, -8}, {13, -5, -15}}};
    std::mt19937 random(seed);
    std::normal_distribution<double> noise(0, 0.02);
    std::string csv = "name,x_mm,y_mm,z_mm,segment\n";
    for (const std::string& segment : order)
      for (std::size_t i = segment == order[0] ? std::size_t(left_out) : 0; i < places.size(); ++i) {
        const double share = 1 + 0.1 * double(segment[0] - 'b');
        csv += fmt::format("{}{}", segment, i);
        for (const double place : places[i])
          csv += fmt::format(",{}", share * place + 40 * (share - 1) + noise(random));
        csv += fmt::format(",{}\n", segment);
      }
    const std::filesystem::path path = folder.path() / (name + ".csv");
    EXPECT_TRUE(write_file(path, csv));
    return path;
  }
  std::filesystem::path exam(const std::string& name, unsigned seed) const { return exam(name, seed, usual); }
};

TEST_F(DoubleFiles, AreAgainstTheMigrationsReferenceWhateverTheirOrder) {
  const std::vector<std::string> other{"cup", "bone", "stem"};
  request.doubles = {first_pair, {exam("f1", 15, other), exam("f2", 16, other)}};
  const auto found = answer(request);
  ASSERT_TRUE(found) << found.error().message;
  for (const NamedMigration& each : found->doubles) EXPECT_EQ(each.migration.segments.front().name, "bone");
  ASSERT_EQ(found->precision.size(), 2u);
  for (const Precision& each : found->precision) {
    EXPECT_NE(each.body, "bone");
    EXPECT_EQ(each.n, 2);
  }
}

TEST_F(DoubleFiles, WithoutTheReferenceAreRefused) {
  const std::vector<std::string> without{"stem", "cup"};
  request.doubles = {first_pair, {exam("f1", 15, without), exam("f2", 16, without)}};
  EXPECT_THAT(answer(request).error().message, HasSubstr("f1.csv and f2.csv: reference: \"bone\""));
}

TEST_F(DoubleFiles, CountOnceInEitherOrder) {
  request.doubles = {first_pair, {first_pair.second, first_pair.first}};
  EXPECT_THAT(answer(request).error().message, HasSubstr("the same pair as d1.csv and d2.csv"));
}

TEST_F(DoubleFiles, HaveExaminationsOfTheirOwn) {
  const auto copy = folder.path() / "copy.csv";
  std::filesystem::copy_file(first_pair.second, copy);
  request.doubles = {first_pair, {copy, second_pair.second}};
  EXPECT_THAT(answer(request).error().message, HasSubstr("has the examination d2.csv of the pair d1.csv"));
  request.doubles = {first_pair, second_pair};
  EXPECT_TRUE(answer(request));
}

TEST_F(DoubleFiles, WarningsNameThePair) {
  request.doubles = {first_pair, {second_pair.first, exam("f", 15, usual, 1)}};
  const auto found = answer(request);
  ASSERT_TRUE(found) << found.error().message;
  const auto says = HasSubstr("double examination e1.csv and f.csv: segment \"bone\"");
  ASSERT_EQ(all_warnings(*found).size(), 1u);
  EXPECT_THAT(to_json(*found)["warnings"][0]["message"].get<std::string>(), says);
  EXPECT_THAT(migration_report(*found), HasSubstr("double examination e1.csv and f.csv"));
}

TEST_F(DoubleFiles, ARefusalReplacesWhatWasWrittenEarlier) {
  const auto out = folder.path() / "out";
  ASSERT_TRUE(answer_into(request, out));
  ASSERT_TRUE(std::filesystem::exists(out / "report.html"));
  request.second = exam("few", 3, usual, 3);
  EXPECT_EQ(answer_into(request, out).error().reason, Reason::too_few_fiducials);
  EXPECT_FALSE(std::filesystem::exists(out / "report.html"));
  EXPECT_THAT(*read_file(out / "migration.json", 1 << 20), HasSubstr("\"refused\""));
  request.second = request.first;
  EXPECT_EQ(answer_into(request, out).error().reason, Reason::bad_value);
  EXPECT_FALSE(std::filesystem::exists(out / "migration.json"));
}

}  // namespace double_examinations_test
}  // namespace helicarm::migration
