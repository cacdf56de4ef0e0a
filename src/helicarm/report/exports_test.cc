// SPDX-License-Identifier: Apache-2.0
#include "helicarm/report/exports.h"

#include <cmath>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "helicarm/core/csv.h"
#include "helicarm/core/files.h"
#include "helicarm/core/json.h"
#include "helicarm/exchange/import_matrix.h"
#include "helicarm/geometry/rotation.h"
#include "helicarm/xray/dicom_elements.h"
#include "helicarm/xray/dicom_tags.h"
#include "helicarm/xray/read_xray_image.h"

namespace helicarm::report {
namespace {
namespace fs = std::filesystem;

geometry::View view_at(double turn, double fx) {
  const Eigen::Matrix3d rotation =
      Eigen::AngleAxisd(turn, Eigen::Vector3d(1, 0.2, 0.1).normalized()).matrix();
  return {{fx, 4000.25, 511.1, 490.7, 0.3}, {rotation, {3, -5, 801.0 / 3}}};
}

class Exports : public testing::Test {
 protected:
  void SetUp() override {
    std::string name = (fs::temp_directory_path() / "helicarm_exports_XXXXXX").string();
    ASSERT_TRUE(mkdtemp(name.data()));
    folder_ = name;
    for (const auto& [view, turn, fx] : {std::tuple{"AP", 0.1, 4000.5}, std::tuple{"LAT", 1.7, -4100.75}}) {
      pipeline::ViewResult& of = result_.views.emplace_back();
      of.name = view;
      of.xray_image = std::make_shared<const xray::XrayImage>(
          xray::XrayImage{view, image::Image<float>(64, 48), 0, 4095, {}, {}});
      of.calibrated = calibration::CalibratedView{};
      of.calibrated->view = view_at(turn, fx);
    }
    for (const char* name_of_point : {"a, \"b\"", "end"}) {
      pipeline::PointResult& point = result_.points.emplace_back();
      point.name = name_of_point;
      point.source = localization::PointSource::pick;
      point.place = guidance::PointInFrames{};
      point.place->in_calibrator = {1.0 / 3, 2, -3};
      point.place->covariance_in_calibrator = Eigen::Vector3d(0.01, 0.04, 0.09).asDiagonal();
    }
    result_.points[1].place->in_bones["femur"] = {{{7, 8, 9}, Eigen::Matrix3d::Zero(), {}, {}},
                                                  Eigen::Matrix3d::Identity()};
    pipeline::PointResult& lost = result_.points.emplace_back();
    lost.name = "lost";
    result_.tunnel_ends = {{0, 1}};
    result_.tunnels.push_back({"femur", {}, {}, {}, 30});
  }
  void TearDown() override { fs::remove_all(folder_); }
  std::string text(const char* name) const { return read_file(folder_ / name, 1 << 20).value(); }

  fs::path folder_;
  pipeline::Result result_;
};

TEST_F(Exports, AllAreWritten) {
  const auto written = write_exports(result_, folder_);
  ASSERT_TRUE(written) << written.error().message;
  std::vector<std::string> names;
  for (const fs::path& path : *written) names.push_back(path.filename().string());
  EXPECT_THAT(names, testing::ElementsAre("AP_matrix.txt", "AP_mayacam.txt", "AP_opencv.yml", "AP_pose.tfm",
                                          "LAT_matrix.txt", "LAT_mayacam.txt", "LAT_opencv.yml",
                                          "LAT_pose.tfm", "dlt.csv", "points.csv", "points.mrk.json"));
}

TEST_F(Exports, RtkRefusesASkewOnlyWhereItIsChosen) {
  const std::array only{Export::rtk};
  const auto refused = write_exports(result_, folder_, only);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().reason, Reason::unsupported);
  EXPECT_EQ(refused.error().view, "AP");
  for (pipeline::ViewResult& view : result_.views) view.calibrated->view.intrinsics.skew = 0;
  EXPECT_EQ(write_exports(result_, folder_, only).value().size(), 2u);
}

TEST_F(Exports, RectifiedImagesAreOfTheViews) {
  for (pipeline::ViewResult& view : result_.views) {
    view.rectification.emplace();
    view.rectification->map = rectification::identity_map(64, 48, 0.25);
  }
  const std::array only{Export::images};
  ASSERT_TRUE(write_exports(result_, folder_, only));
  const auto image = xray::read_xray_image(folder_ / "LAT_rectified.dcm", "LAT", {});
  ASSERT_TRUE(image) << image.error().message;
  EXPECT_EQ(image->pixels.width(), 64);
  EXPECT_EQ(image->acquisition.pixel_mm, std::optional(Eigen::Vector2d(0.25, 0.25)));
}

TEST_F(Exports, PixelSpacingMeasuresLengthsAtTheObjectsDepth) {
  const SpacingObject object{"FS", {20, -10, 30}};
  const auto spacings = spacings_at(result_, object);
  ASSERT_TRUE(spacings) << spacings.error().message;
  for (std::size_t i = 0; i < 2; ++i) {
    const geometry::View& view = result_.views[i].calibrated->view;
    const Eigen::Matrix3d to_world = view.camera_from_world.rotation.transpose();
    const Eigen::Vector2d at = view.project(object.at);
    // Along the image's rows a skew would turn the direction, not the length along u.
    const Eigen::Vector2d right = view.project(object.at + to_world * Eigen::Vector3d(10, 0, 0));
    const Eigen::Vector2d down = view.project(object.at + to_world * Eigen::Vector3d(0, 10, 0));
    EXPECT_NEAR(std::abs(right.x() - at.x()) * spacings->at(i).pixel_mm.x(), 10, 1e-9);
    EXPECT_NEAR(std::abs(down.y() - at.y()) * spacings->at(i).pixel_mm.y(), 10, 1e-9);
  }
}

TEST_F(Exports, AMovedObjectHasTheSpacingOfItsDepthInEachView) {
  const SpacingObject at_rest{"FS", {20, -10, 30}};
  const geometry::View& second = result_.views[1].calibrated->view;
  SpacingObject moved = at_rest;
  moved.motions.resize(2);
  moved.motions[1].translation = second.camera_from_world.rotation.transpose() * Eigen::Vector3d(0, 0, 40);
  const auto before = *spacings_at(result_, at_rest), after = *spacings_at(result_, moved);
  EXPECT_EQ(after.at(0).source_object_mm, before.at(0).source_object_mm);
  EXPECT_NEAR(after.at(1).source_object_mm, before.at(1).source_object_mm + 40, 1e-9);
}

TEST_F(Exports, RectifiedImagesStateTheSpacingOfAnObject) {
  for (pipeline::ViewResult& view : result_.views) {
    view.rectification.emplace();
    view.rectification->map = rectification::identity_map(64, 48, 0.25);
  }
  const std::array only{Export::images};
  const SpacingObject object{"Knie, \xC3\xBC\\" + std::string(80, 'x'), {20, -10, 30}};
  ASSERT_TRUE(write_exports(result_, folder_, only, object));
  const std::string bytes = text("AP_rectified.dcm");
  const auto elements = xray::walk_dicom(bytes, "AP").value();
  const auto at = spacings_at(result_, object)->at(0);
  const auto spacing = elements.numbers(xray::tags::pixel_spacing, 2, 0, 10);
  ASSERT_TRUE(spacing);
  EXPECT_NEAR((*spacing)[1], at.pixel_mm.x(), 1e-9);
  EXPECT_NEAR((*spacing)[0], at.pixel_mm.y(), 1e-9);
  EXPECT_EQ(elements.text({0x00280A02, ""}), "GEOMETRY");
  EXPECT_LE(elements.text({0x00280A04, ""}).size(), 64U);
  const auto magnification = elements.numbers({0x00181114, ""}, 1, 0, 10);
  ASSERT_TRUE(magnification);
  EXPECT_NEAR((*magnification)[0] * (*spacing)[0], 0.25, 1e-8);  // of the detector
  EXPECT_NEAR((*elements.numbers(xray::tags::source_patient, 1, 0, 1e4))[0], at.source_object_mm, 1e-6);
}

TEST_F(Exports, AnObjectBehindTheSourceIsRefused) {
  const auto spacings = spacings_at(result_, {"behind", {0, 0, -5000}});
  EXPECT_EQ(spacings.error().reason, Reason::behind_source);
  EXPECT_EQ(spacings.error().view, "AP");
}

TEST_F(Exports, MayaCamReadsBackToTheLastBit) {
  ASSERT_TRUE(write_exports(result_, folder_));
  for (const pipeline::ViewResult& view : result_.views) {
    const auto back = exchange::import_matrix(folder_ / (view.name + "_mayacam.txt"));
    ASSERT_TRUE(back) << back.error().message;
    EXPECT_EQ(back->view.projection(), view.calibrated->view.projection());
    EXPECT_EQ(back->image_size, Eigen::Vector2i(64, 48));
  }
}

TEST_F(Exports, MatrixReadsBack) {
  ASSERT_TRUE(write_exports(result_, folder_));
  for (const pipeline::ViewResult& view : result_.views) {
    const auto back = exchange::import_matrix(folder_ / (view.name + "_matrix.txt"));
    ASSERT_TRUE(back) << back.error().message;
    const geometry::Projection expected = view.calibrated->view.projection();
    EXPECT_LT((back->view.projection() - expected).norm(), 1e-9 * expected.norm()) << view.name;
    EXPECT_EQ(std::signbit(back->view.intrinsics.fx), view.name == "LAT");
  }
}

TEST_F(Exports, DltCoefficientsProjectIntoXmalabsPixels) {
  ASSERT_TRUE(write_exports(result_, folder_));
  std::istringstream lines(text("dlt.csv"));
  Eigen::Matrix<double, 11, 2> l;
  char comma = 0;
  for (int i = 0; i < 11; ++i) ASSERT_TRUE(lines >> l(i, 0) >> comma >> l(i, 1));
  EXPECT_FALSE(lines >> comma);
  const Eigen::Vector3d p(10, 20, 30);
  for (int i = 0; i < 2; ++i) {
    const double w = l.col(i).segment<3>(8).dot(p) + 1;
    const Eigen::Vector2d uv((l.col(i).head<3>().dot(p) + l(3, i)) / w,
                             (l.col(i).segment<3>(4).dot(p) + l(7, i)) / w);
    const pipeline::ViewResult& view = result_.views[std::size_t(i)];
    const Eigen::Vector2d pixel = view.calibrated->view.project(p);
    const double height = view.xray_image->pixels.height();
    EXPECT_LT((uv - Eigen::Vector2d(pixel.x() + 1, height - pixel.y())).norm(), 1e-9);
  }
}

TEST_F(Exports, OnlyLocatedPointsAreWrittenAndQuoted) {
  ASSERT_TRUE(write_exports(result_, folder_));
  const std::string csv = text("points.csv");
  EXPECT_EQ(std::ranges::count(csv, '\n'), 4);
  EXPECT_THAT(csv,
              testing::HasSubstr("\"a, \"\"b\"\"\",pick,calibrator,0.3333333333333333,2,-3,0.1,0.2,0.3,"));
  EXPECT_THAT(csv, testing::HasSubstr("end,pick,femur,7,8,9,1,1,1,"));
  EXPECT_THAT(csv, testing::Not(testing::HasSubstr("lost")));
}

TEST_F(Exports, MarkupsStateThatTheirFrameIsNotThePatients) {
  ASSERT_TRUE(write_exports(result_, folder_));
  const Json json = parse_json(text("points.mrk.json"), "markups").value();
  ASSERT_EQ(json.at("markups").size(), 2u);
  const Json& points = json["markups"][0];
  EXPECT_EQ(points.at("type"), "Fiducial");
  EXPECT_EQ(points.at("coordinateSystem"), "LPS");
  EXPECT_THAT(points.at("description").get<std::string>(), testing::HasSubstr("not in a patient frame"));
  EXPECT_EQ(points.at("controlPoints").size(), 2u);
  EXPECT_EQ(points.at("controlPoints")[0].at("position"), Json({1.0 / 3, 2.0, -3.0}));
  EXPECT_EQ(json["markups"][1].at("type"), "Line");
  EXPECT_EQ(json["markups"][1].at("name"), "tunnel femur");
}

TEST_F(Exports, OnlyRequestedAndAvailablePartsAreWritten) {
  result_.points.clear();
  result_.tunnel_ends.clear();
  result_.views[1].calibrated.reset();
  EXPECT_EQ(write_exports(result_, folder_).value().size(), 5u);
  const std::array kinds{Export::csv, Export::matrix};
  EXPECT_EQ(write_exports(result_, folder_, kinds).value().size(), 1u);
}

TEST_F(Exports, RefusedResultIsRefusedWithItsReason) {
  result_.failure = Failure{Reason::uncertain, "too far off", "", {}};
  EXPECT_EQ(write_exports(result_, folder_).error().reason, Reason::uncertain);
  EXPECT_TRUE(fs::is_empty(folder_));
}

TEST_F(Exports, FailedWriteLeavesNoFiles) {
  fs::create_directories(folder_ / "points.csv");
  EXPECT_EQ(write_exports(result_, folder_).error().reason, Reason::cannot_write);
  EXPECT_FALSE(fs::exists(folder_ / "AP_matrix.txt"));
  result_.views[1].name = "AP";
  EXPECT_EQ(write_exports(result_, folder_).error().reason, Reason::name_clash);
}

TEST_F(Exports, ViewWithoutDltCoefficientsIsNamedInTheMessage) {
  result_.views[1].calibrated->view.camera_from_world.translation.z() = 0;
  const auto written = write_exports(result_, folder_);
  ASSERT_FALSE(written);
  EXPECT_EQ(written.error().reason, Reason::point_at_infinity);
  EXPECT_EQ(written.error().view, "LAT");
}

TEST_F(Exports, GeometryForReconstructionIsOfAllViewsOnRequest) {
  for (pipeline::ViewResult& view : result_.views) view.calibrated->view.intrinsics.skew = 0;
  const auto written = write_exports(result_, folder_, requested_export);
  ASSERT_TRUE(written) << written.error().message;
  std::vector<std::string> names;
  for (const auto& path : *written) names.push_back(path.filename().string());
  EXPECT_THAT(names, testing::ElementsAre("AP_plastimatch.txt", "LAT_plastimatch.txt", "views_astra.txt",
                                          "views_deepdrr.json", "views_diffdrr.json", "views_leap.json",
                                          "views_matrices.npy", "views_matrices.ompl", "views_tigre.json"));
  EXPECT_EQ(parse_json(text("views_tigre.json"), "tigre")->at("DSO").size(), 2u);
  EXPECT_THAT(one_pixel_size_note(result_, requested_export), testing::HasSubstr("up to 0.24 px off"));
  EXPECT_EQ(one_pixel_size_note(result_, every_export), "");
  for (pipeline::ViewResult& view : result_.views) view.calibrated->view.intrinsics.fx = 4000;
  EXPECT_EQ(one_pixel_size_note(result_, requested_export), "");
  forget_exports(folder_);
  EXPECT_TRUE(fs::is_empty(folder_));
}

TEST_F(Exports, GeometryForReconstructionIsOfOneDetector) {
  result_.views[1].xray_image = std::make_shared<const xray::XrayImage>(
      xray::XrayImage{"LAT", image::Image<float>(48, 48), 0, 4095, {}, {}});
  const std::array only{Export::astra};
  const auto refused = write_exports(result_, folder_, only);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().reason, Reason::unsupported);
}

}  // namespace
}  // namespace helicarm::report
