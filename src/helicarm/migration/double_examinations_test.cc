// SPDX-License-Identifier: Apache-2.0
#include "helicarm/migration/double_examinations.h"

#include <gtest/gtest.h>

#include "helicarm/migration/migration_files.h"

namespace helicarm::migration {
namespace {

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

}  // namespace
}  // namespace helicarm::migration
