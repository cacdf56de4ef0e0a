// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/saved_calibration.h"

#include <gtest/gtest.h>

#include "helicarm/calibration/views_test.h"

namespace helicarm::calibration {
namespace {

SavedCalibration saved_example() {
  RandomStream random(31, 0);
  const auto result = calibrate({observed_fiducials("AP", paper_view(0), 0.1, random),
                                 observed_fiducials("LAT", paper_view(1.5), 0.1, random)},
                                {});
  SavedCalibration saved;
  static_cast<Calibration&>(saved) = *result;
  saved.maps = {rectification::identity_map(64, 48, 0.3), std::nullopt};
  saved.fiducials = result->fiducials;
  saved.chi2 = result->chi2;
  saved.dof = result->dof;
  saved.variance_scale = result->variance_scale;
  return saved;
}

TEST(SavedCalibration, RoundTripKeepsViewsCovarianceAndFiducials) {
  SavedCalibration given = saved_example();
  given.fiducials[1][2].status = fiducials::FiducialStatus::not_found;
  given.views[1].by_paper = true;
  given.calibrator_from_bone = {{{"L4", {Eigen::Matrix3d::Identity(), {1, 2, 3}}}}, {}};
  const auto read = saved_calibration_from_json(to_json(given), "calibration.json");
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_TRUE(read->joint_covariance.isApprox(given.joint_covariance, 1e-12));
  EXPECT_TRUE(read->views[1].covariance.isApprox(given.views[1].covariance, 1e-12));
  EXPECT_LT((read->views[0].view.projection() - given.views[0].view.projection()).norm(), 1e-6);
  EXPECT_TRUE(read->maps[0].has_value() && !read->maps[1].has_value());
  ASSERT_EQ(read->fiducials[1].size(), 12u);
  EXPECT_EQ(read->fiducials[1][2].status, fiducials::FiducialStatus::not_found);
  EXPECT_EQ(read->fiducials[1][2].centre_in_calibrator, given.fiducials[1][2].centre_in_calibrator);
  EXPECT_EQ(read->fiducials[0][5].uv, given.fiducials[0][5].uv);
  EXPECT_EQ(read->dof, given.dof);
  EXPECT_EQ(read->bones_in(0).at("L4").translation, Eigen::Vector3d(1, 2, 3));
  EXPECT_TRUE(read->bones_in(1).empty());
  EXPECT_TRUE(!read->views[0].by_paper && read->views[1].by_paper);
}

TEST(SavedCalibration, FiducialsOfAResultTakeTheirCoordinatesFromItsBalls) {
  Json json = to_json(saved_example());
  json["format"] = "helicarm-result/1";
  json["status"] = "ok";
  for (Json& view : json["views"])
    for (Json& fiducial : view["fiducials"]) fiducial.erase("xyz_mm");
  EXPECT_TRUE(saved_calibration_from_json(json, "result.json")->fiducials[0].empty());
  const SavedCalibration given = saved_example();
  for (const fiducials::Fiducial& fiducial : given.fiducials[0])
    json["calibrator"]["balls"].push_back(
        {{"label", fiducial.label},
         {"xyz_mm",
          {fiducial.centre_in_calibrator.x(), fiducial.centre_in_calibrator.y(),
           fiducial.centre_in_calibrator.z()}},
         {"diameter_mm", 4}});
  const auto read = saved_calibration_from_json(json, "result.json");
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->fiducials[0][7].centre_in_calibrator, given.fiducials[0][7].centre_in_calibrator);
}

}  // namespace
}  // namespace helicarm::calibration
