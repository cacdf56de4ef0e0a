// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/measure_case.h"

#include <gtest/gtest.h>

#include "helicarm/core/files.h"
#include "helicarm/core/temporary_folder.h"
#include "helicarm/localization/error_bound.h"
#include "helicarm/pipeline/measure.h"
#include "helicarm/simulation/write_case.h"

namespace helicarm::case_registration {
namespace {

namespace fs = std::filesystem;

/// A simulated case on a flat panel whose check targets are also the landmarks of a model, 100 mm along x
/// from its place in the calibrator, with a planned tunnel.
class MeasureCase : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TemporaryFolder>();
    simulation::SimulationOptions options;
    options.kind = simulation::CaseKind::flat;
    options.size = 512;
    options.seed = 7;
    const auto simulated = simulation::simulate_case(options).value();
    ASSERT_TRUE(simulation::write_case(folder_->path(), simulated));
    Json json = read_json(folder_->path() / "case.json").value();
    std::string landmarks = "name,x_mm,y_mm,z_mm\n";
    json["picks"] = Json::array();
    for (std::size_t v = 0; v < simulated.views.size(); ++v)
      for (const simulation::TruePoint& target : simulated.views[v].targets) {
        json["picks"].push_back({{"name", "p" + target.name},
                                 {"view", json["views"][v]["name"]},
                                 {"uv", {target.raw.x(), target.raw.y()}},
                                 {"sigma_px", 0.2}});
        const Eigen::Vector3d& at = target.in_calibrator;
        if (v == 0) landmarks += fmt::format("p{},{},{},{}\n", target.name, at.x() - 100, at.y(), at.z());
      }
    ASSERT_TRUE(write_file(folder_->path() / "points.csv", landmarks));
    const Json ends = {{{"label", "in"}, {"position", {-100, 0, 40}}},
                       {{"label", "out"}, {"position", {-100, 20, 60}}}};
    const Json line = {
        {"type", "Line"}, {"name", "planned"}, {"coordinateSystem", "LPS"}, {"controlPoints", ends}};
    ASSERT_TRUE(write_file(folder_->path() / "plan.mrk.json", to_text({{"markups", Json::array({line})}})));
    json["models"] = Json::array(
        {{{"name", "body"}, {"start", {{"landmarks", "points.csv"}}}, {"plan", "plan.mrk.json"}}});
    ASSERT_TRUE(write_file(folder_->path() / "case.json", to_text(json)));
    given_ = pipeline::read_case(folder_->path()).value();
  }
  static void TearDownTestSuite() { folder_.reset(); }

  static Measurement measured(const RegisterOptions& options) {
    return measure_case(given_, options).value();
  }
  static const registration::Registration& body(const Measurement& measured) {
    return measured.registration->models.at(0).registration;
  }
  static double worst_error_mm(const Measurement& measured) {
    double worst = 0;
    for (const pipeline::ModelPoint& point : measured.result.model_points)
      worst = std::max(worst, localization::length_at_95(point.place.covariance_in_calibrator));
    return worst;
  }

  static inline std::unique_ptr<TemporaryFolder> folder_;
  static inline pipeline::Case given_;
};

TEST_F(MeasureCase, RegistersTheModelsAndTakesTheirTunnels) {
  const Measurement whole = measured({});
  ASSERT_FALSE(whole.result.failure) << whole.result.failure->message;
  EXPECT_NEAR(body(whole).world_from_model.translation.x(), 100, 1);
  ASSERT_EQ(whole.result.model_tunnels.size(), 1u);
  EXPECT_EQ(whole.result.model_tunnels[0].tunnel.name, "planned");
  EXPECT_EQ(whole.result.model_points[whole.result.model_tunnels[0].ends.end].name, "planned_end");
  EXPECT_EQ(pipeline::to_json(whole.result)["tunnels"][0]["model"], "body");
}

TEST_F(MeasureCase, TheLimitHoldsForModels) {
  RegisterOptions options;
  const Measurement usual = measured({});
  double of_picks = 0;
  for (const pipeline::PointResult& point : usual.result.points)
    of_picks = std::max(of_picks, localization::length_at_95(point.place.value().covariance_in_calibrator));
  ASSERT_LT(of_picks, worst_error_mm(usual));
  options.run.max_error_mm = 0.5 * (of_picks + worst_error_mm(usual));
  const Measurement refused = measured(options);
  ASSERT_TRUE(refused.registration) << refused.result.failure->message;
  ASSERT_TRUE(refused.result.failure);
  EXPECT_EQ(refused.result.failure->reason, Reason::uncertain);
  EXPECT_TRUE(refused.result.model_tunnels.empty());
}

/// Each option reaches models as it does by `register_case`, and changes their poses or errors.
TEST_F(MeasureCase, EveryOptionReachesTheModels) {
  RegisterOptions paper, motion, history;
  paper.run.method = rectification::Method::paper;
  motion.run.motion_sigma_mm = 1;
  pipeline::RunOptions fresh;
  fresh.history.emplace();
  calibration::CArmHistory learned;
  const pipeline::Result acquired = pipeline::measure(given_, fresh).value();
  for (int i = 0; i < 3; ++i)
    for (calibration::HistoryEntry entry : acquired.calibration->entries) {
      entry.image += std::to_string(i);
      learned.entries.push_back(entry);
    }
  history.run.history = learned;
  const Measurement usual = measured({});
  for (const RegisterOptions& options : {paper, motion, history}) {
    const Measurement whole = measured(options);
    const CaseRegistration alone = register_case(given_, options).value();
    const registration::Registration& same = alone.models.at(0).registration;
    EXPECT_EQ(body(whole).world_from_model.matrix(), same.world_from_model.matrix());
    EXPECT_EQ(body(whole).covariance, same.covariance);
    EXPECT_NE(body(whole).covariance, body(usual).covariance);
  }
}

TEST_F(MeasureCase, MotionBetweenTheAcquisitionsIsInTheCovariance) {
  RegisterOptions moving;
  moving.run.motion_sigma_mm = 1;
  const auto variance = [](const Measurement& measured) {
    return body(measured).covariance.bottomRightCorner<3, 3>().trace();
  };
  const double more = variance(measured(moving)) - variance(measured({}));
  // Across one ray the second view's motion counts fully, along the other partly: between 1/4 and 3 mm^2.
  EXPECT_GT(more, 0.25);
  EXPECT_LT(more, 3);
}

TEST_F(MeasureCase, ModelsOfAnEarlierMeasurementAreRemoved) {
  const TemporaryFolder out;
  ASSERT_TRUE(write_models(measured({}).registration, out.path()));
  EXPECT_TRUE(fs::exists(out.path() / "registration.json"));
  EXPECT_TRUE(fs::exists(out.path() / "registration/report.html"));
  ASSERT_TRUE(write_models({}, out.path()));
  EXPECT_FALSE(fs::exists(out.path() / "registration.json"));
  EXPECT_TRUE(fs::is_empty(out.path() / "registration"));
}

TEST(MeasuredCase, CamerasOfOtherProgramsAreNamed) {
  const TemporaryFolder folder;
  ASSERT_TRUE(write_file(folder.path() / "case.json",
                         R"({"format": "helicarm-case/1", "views": [{"name": "A", "image": "a.png",
                             "camera": "a.json"}], "models": [{"name": "x", "surface": "x.stl"}]})"));
  const auto the_case = pipeline::read_case(folder.path());
  ASSERT_FALSE(the_case);
  EXPECT_EQ(the_case.error().reason, Reason::bad_value);
  EXPECT_NE(the_case.error().message.find("helicarm register"), std::string::npos)
      << the_case.error().message;
}

}  // namespace
}  // namespace helicarm::case_registration
