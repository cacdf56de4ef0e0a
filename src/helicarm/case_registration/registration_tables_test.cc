// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/registration_tables.h"

#include <gtest/gtest.h>

namespace helicarm::case_registration {
namespace {

std::string cell(const report::Table& table, std::size_t row, const std::string& title) {
  for (std::size_t i = 0; i < table.columns.size(); ++i)
    if (table.columns[i].title == title) return table.rows.at(row).at(i).text;
  return "no column " + title;
}

RegisteredModel femur() {
  RegisteredModel model;
  model.registration.name = "femur";
  model.registration.centre = {1, 2, 3};
  model.registration.covariance.setZero();
  model.registration.covariance.diagonal() << 1e-6, 1e-6, 1e-6, 0.01, 0.04, 0.09;
  model.registration.views = {{"AP", 0.9, 1, {}, 100}, {"LAT", 0.8, 1, {}, 100}};
  model.registration.starts = 16;
  model.registration.agree = 12;
  return model;
}

TEST(ModelsTable, PoseHasItsStandardDeviations) {
  const report::Table table = models_table({femur()});
  EXPECT_EQ(cell(table, 0, "Agreement"), "0.900, 0.800");
  EXPECT_EQ(cell(table, 0, "Centre x, y, z, mm"), "1.00, 2.00, 3.00");
  EXPECT_EQ(cell(table, 0, "Centre σ, mm"), "0.100, 0.200, 0.300");
  EXPECT_EQ(cell(table, 0, "Rotation σ, °"), "0.057, 0.057, 0.057");
  EXPECT_EQ(cell(table, 0, "Starts"), "12 of 16");
}

TEST(ModelsTable, ModelRefusedBeforeItsPoseHasNone) {
  RegisteredModel model = femur();
  model.registration.centre.setZero();
  model.registration.covariance = registration::Registration{}.covariance;
  model.registration.failure = Failure{Reason::out_of_capture, "no start is near", "", {}};
  const report::Table table = models_table({model});
  for (const char* title : {"Centre x, y, z, mm", "Centre σ, mm", "Rotation σ, °"})
    EXPECT_EQ(cell(table, 0, title), "–") << title;
  EXPECT_TRUE(table.rows[0][1].is_bad);
}

TEST(ModelsTable, LandmarksHaveNoStarts) {
  RegisteredModel model = femur();
  model.by_landmarks_only = true;
  EXPECT_EQ(cell(models_table({model}), 0, "Starts"), "–");
}

TEST(ModelPointsTable, PointsOfAllModelsAreNamed) {
  std::vector<RegisteredModel> models = {femur(), femur()};
  models[1].registration.name = "tibia";
  RegisteredPoint point{};
  point.name = "TS";
  point.place.in_calibrator = {4, 5, 6};
  models[1].points = {point};
  const report::Table table = points_table(models);
  ASSERT_EQ(table.rows.size(), 1u);
  EXPECT_EQ(cell(table, 0, "Model"), "tibia");
  EXPECT_EQ(cell(table, 0, "y, mm"), "5.00");
}

}  // namespace
}  // namespace helicarm::case_registration
