// SPDX-License-Identifier: Apache-2.0
#include "helicarm/exchange/import_matrix.h"

#include <fmt/format.h>

#include "helicarm/exchange/import_text_test.h"
#include "helicarm/geometry/decomposition.h"

namespace helicarm::exchange {
namespace {

Reason reason_of(const std::string& text) {
  const auto result = import_text(text, {.mm_per_unit = 10});
  EXPECT_FALSE(result.has_value()) << text;
  return result ? Reason::usage : result.error().reason;
}

const std::string maya_cam =
    "image size\n1760,1700\n\ncamera matrix\n8000.5,0,794.25\n0,8100.25,866.5\n0,0,1\n\n"
    "rotation\n0,0,1\n-0.6,-0.8,0\n0.8,-0.6,0\n\ntranslation\n-68.5\n125.25\n136.75\n";

TEST(ImportMatrix, MayaCamValuesAreKept) {
  const auto result = import_text(maya_cam, {.mm_per_unit = 10});
  ASSERT_TRUE(result.has_value()) << result.error().message;
  EXPECT_EQ(result->view.intrinsics.fx, 8000.5);
  EXPECT_EQ(result->view.intrinsics.v0, 866.5);
  EXPECT_EQ(result->view.camera_from_world.rotation(1, 0), -0.6);
  EXPECT_EQ(result->view.camera_from_world.translation, Eigen::Vector3d(-685, 1252.5, 1367.5));
  EXPECT_EQ(*result->image_size, Eigen::Vector2i(1760, 1700));
}

TEST(ImportMatrix, LensDistortionIsRefusedUnlessTheImagesAreUndistorted) {
  const std::string none = "\nundistortion\n0\n0\n0\n0\n0\n0\n0\n0\n";
  EXPECT_TRUE(import_text(maya_cam + none, {.mm_per_unit = 10}));
  const std::string lens = maya_cam + "\nundistortion\n-0.12\n0.03\n0\n0\n0\n0\n0\n0\n";
  const auto refused = import_text(lens);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().reason, Reason::unsupported);
  EXPECT_NE(refused.error().message.find("k1 -0.12"), std::string::npos) << refused.error().message;
  EXPECT_TRUE(import_text(lens, {.mm_per_unit = 10, .undistorted = true}));
  const auto other_title = import_text(replaced(lens, "undistortion", "Distortion"));
  ASSERT_FALSE(other_title);
  EXPECT_EQ(other_title.error().reason, Reason::unsupported);
}

/// 198 units: of a file in cm, 2 m.
TEST(ImportMatrix, UnitIsAskedForWhereMillimetresAreImplausible) {
  const auto asked = import_text(maya_cam);
  ASSERT_FALSE(asked);
  EXPECT_EQ(asked.error().reason, Reason::usage);
  EXPECT_NE(asked.error().message.find("--unit"), std::string::npos) << asked.error().message;
  EXPECT_TRUE(import_text(maya_cam, {.mm_per_unit = 1}));
  EXPECT_TRUE(import_text(replaced(maya_cam, "-68.5", "-685")));
}

TEST(ImportMatrix, OtherProgramsFormatsAreNamed) {
  for (const auto& [text, name] :
       {std::pair{std::string("<?xml version=\"1.0\"?>\n<html></html>"), "XML"},
        {std::string("\x89HDF\r\n\x1a\n"), "HDF5"},
        {"(Transform \"EulerTransform\")\n(NumberOfParameters 6)\n", "elastix"},
        {"// elastix\n(Transform \"EulerTransform\")\n", "elastix"},
        {"[cam_0]\nname = \"A\"\nmatrix = [ [ 3100.0, 0.0, 498.25,], ]\n", "anipose"},
        {std::string("\0\0\0\0AffineTransform_double_3_3\0", 32), "ANTs"},
        {"PK\x03\x04", "ZIP"},
        {"\xFF\xFE[\0[\0", "UTF-16"},
        {std::string("#Insight Transform File V1.0\n#Transform 0\n"), "ITK"}}) {
    const auto refused = import_text(text);
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().reason, Reason::unsupported);
    EXPECT_NE(refused.error().message.find(name), std::string::npos) << refused.error().message;
  }
}

/// The steps of XMALab's export by hand: pixels (u + 1, height - v), divided by the last coefficient.
TEST(ImportMatrix, DltCoefficientsOfXmalabAreTurnedIntoPixels) {
  const auto camera = import_text(maya_cam, {.mm_per_unit = 1});
  ASSERT_TRUE(camera);
  constexpr int height = 1700;
  const Eigen::Vector3d points[] = {{1, 2, 3},    {-20, 5, 12}, {7, -30, 4},
                                    {15, 11, -9}, {0, 25, 6},   {-4, -8, 21}};
  const auto column = [&](const geometry::View& view) {
    const geometry::Projection p = view.projection();
    geometry::Projection flipped = p;
    flipped.row(0) = p.row(0) + p.row(2);
    flipped.row(1) = height * p.row(2) - p.row(1);
    return geometry::Projection(flipped / flipped(2, 3));
  };
  const geometry::Projection l = column(camera->view);
  std::string table;
  for (int i = 0; i < 11; ++i) table += fmt::format("0.5,{}\n", l(i / 4, i % 4));
  EXPECT_EQ(reason_of(table), Reason::usage);
  EXPECT_EQ(import_text(table, {.mm_per_unit = 1, .column = 3, .image_size = Eigen::Vector2i(1760, height)})
                .error()
                .reason,
            Reason::bad_value);
  const auto read =
      import_text(table, {.mm_per_unit = 1, .column = 2, .image_size = Eigen::Vector2i(1760, height)});
  ASSERT_TRUE(read) << read.error().message;
  for (const Eigen::Vector3d& point : points)
    EXPECT_LT((read->view.project(point) - camera->view.project(point)).norm(), 1e-6);
}

TEST(ImportMatrix, BrokenMayaCamIsNamed) {
  EXPECT_EQ(reason_of(maya_cam.substr(0, maya_cam.size() - 8)), Reason::truncated);
  EXPECT_EQ(reason_of(maya_cam.substr(0, maya_cam.find("rotation"))), Reason::truncated);
  EXPECT_EQ(reason_of(replaced(maya_cam, "-0.6,-0.8,0", "0.6,0.8,0")), Reason::bad_value);  // a reflection
  EXPECT_EQ(reason_of(replaced(maya_cam, "-0.6,-0.8", "-0.6,-0.7")), Reason::bad_value);
  EXPECT_EQ(reason_of(replaced(maya_cam, "0,0,1\n\n", "0,1,1\n\n")), Reason::bad_value);
  EXPECT_EQ(reason_of(replaced(maya_cam, "125.25", "nan")), Reason::not_finite);
  EXPECT_EQ(reason_of(replaced(maya_cam, "125.25", "12x")), Reason::bad_value);
  EXPECT_EQ(reason_of(replaced(maya_cam, "1760,1700", "1760,-1")), Reason::bad_value);
}

const std::string rows = "-506.148 -0 -3532.97 376726\n-384 -3532.97 -0 285811\n-1 -0 -0 744.3\n";

void expect_matrix(const Expected<ImportedMatrix>& result) {
  ASSERT_TRUE(result.has_value()) << result.error().message;
  geometry::Projection given;
  given << -506.148, 0, -3532.97, 376726, -384, -3532.97, 0, 285811, -1, 0, 0, 744.3;
  EXPECT_LT((result->view.projection() - given).norm(), 1e-9 * given.norm());
  EXPECT_NEAR(result->view.intrinsics.fx, 3532.97, 1e-9);
}

TEST(ImportMatrix, SameMatrixAsTextJsonAndNrrd) {
  expect_matrix(import_text(rows));
  expect_matrix(import_text("# camera\n" + rows));
  expect_matrix(import_text("[[-506.148,0,-3532.97,376726],[-384,-3532.97,0,285811],[-1,0,0,744.3]]"));
  const auto json = import_text(R"({"projection": [[-506.148,0,-3532.97,376726],[-384,-3532.97,0,285811],
                                    [-1,0,0,744.3]], "image_size": [1024, 760]})");
  expect_matrix(json);
  EXPECT_EQ(*json->image_size, Eigen::Vector2i(1024, 760));
  const auto nrrd = import_text(
      "NRRD0004\ndimension: 2\nsizes: 1024 760\nOriginal Image/Projection Matrix:=[1 2 3 4; 5 6 7 8; 9 8 7 "
      "6] \n"
      "Projection Matrix:=[-506.148 -0 -3532.97 376726; -384 -3532.97 -0 285811; -1 -0 -0 744.3] "
      "\n\n\x01\x02");
  expect_matrix(nrrd);
  EXPECT_EQ(*nrrd->image_size, Eigen::Vector2i(1024, 760));
}

TEST(ImportMatrix, AFieldThatIsGivenTwiceIsRefused) {
  const std::string matrix =
      "Projection Matrix:=[-506.148 -0 -3532.97 376726; -384 -3532.97 -0 285811; -1 -0 -0 744.3]\n";
  expect_matrix(import_text("NRRD0004\n" + matrix + "\n"));
  EXPECT_EQ(reason_of("NRRD0004\n" + matrix + matrix + "\n"), Reason::bad_value);
  EXPECT_EQ(reason_of("NRRD0004\nsizes: 4 4\nsizes: 8 8\n" + matrix + "\n"), Reason::bad_value);
  EXPECT_EQ(import_text(maya_cam + "\ntranslation\n1\n2\n3\n", {.mm_per_unit = 10}).error().reason,
            Reason::bad_value);
}

TEST(ImportMatrix, ByteOrderMarkPlusSignsAndAFourthRowAreRead) {
  expect_matrix(import_text("\xEF\xBB\xBF" + rows));
  expect_matrix(import_text(replaced(rows, "744.3", "+744.3")));
  expect_matrix(import_text(rows + "0 0 0 1\n"));
  expect_matrix(
      import_text("[\n [-506.148,0,-3532.97,376726],[-384,-3532.97,0,285811],[-1,0,0,744.3],[0,0,0,1]\n]"));
  EXPECT_EQ(import_text(rows + "0 0 1 0\n").error().reason, Reason::bad_value);
  EXPECT_EQ(import_text("1 0 0 5\n0 1 0 6\n0 0 1 700\n0 0 0 1\n").error().reason, Reason::unsupported);
}

TEST(ImportMatrix, DecimalCommasAreNamed) {
  const auto refused = import_text("-506,148 0 -3532,97 376726\n-384 -3532,97 0 285811\n-1 0 0 744,3\n");
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().reason, Reason::bad_value);
  EXPECT_NE(refused.error().message.find("decimal comma"), std::string::npos) << refused.error().message;
}

TEST(ImportMatrix, ProjectionThatIsNotOfItsKRAndTIsRefused) {
  const std::string json = R"({"K": [[4000,0,512],[0,4000,500],[0,0,1]], "R": [[1,0,0],[0,1,0],[0,0,1]],
      "t": [0,0,700], "projection": [[4000,0,512,358400],[0,4000,500,350000],[0,0,1,700]], "image_size": null,
      "warnings": []})";
  EXPECT_TRUE(import_text(json)) << import_text(json).error().message;
  EXPECT_EQ(import_text(replaced(json, "358400", "368400")).error().reason, Reason::bad_value);
  EXPECT_EQ(import_text(json, {.mm_per_unit = 10}).error().reason, Reason::bad_value);  // import's own output
}

TEST(ImportMatrix, MirroredCameraIsWarnedOf) {
  const auto upwards = import_text("600 0 512 409600\n0 -600 512 409600\n0 0 1 800\n");
  ASSERT_TRUE(upwards);
  ASSERT_EQ(upwards->warnings.size(), 1u);
  EXPECT_EQ(upwards->warnings[0].reason, Reason::ambiguous_handedness);
  EXPECT_TRUE(import_text(rows)->warnings.empty());
}

TEST(ImportMatrix, TwoImageSizesThatDifferAreRefused) {
  EXPECT_EQ(
      import_text(maya_cam, {.mm_per_unit = 10, .image_size = Eigen::Vector2i(1024, 1024)}).error().reason,
      Reason::bad_size);
}

TEST(ImportMatrix, NegativeScaleIsRemovedAndAMirroredImageKept) {
  const auto result = import_text("600 0 512 409600\n0 -600 512 409600\n0 0 1 800\n");
  ASSERT_TRUE(result.has_value());
  EXPECT_LT(result->view.intrinsics.fx, 0);
  const auto negated = import_text("-600 0 -512 -409600\n0 600 -512 -409600\n0 0 -1 -800\n");
  ASSERT_TRUE(negated.has_value());
  EXPECT_LT((negated->view.projection() - result->view.projection()).norm(), 1e-9);
}

TEST(ImportMatrix, TranslationThatOverflowsInMillimetresIsNotFinite) {
  std::string far = maya_cam;
  far.replace(far.find("125.25"), 6, "1e308");
  EXPECT_TRUE(import_text(far, {.mm_per_unit = 1}).has_value());
  EXPECT_EQ(import_text(far, {.mm_per_unit = 10}).error().reason, Reason::not_finite);
}

TEST(ImportMatrix, BadFilesAreNamed) {
  EXPECT_EQ(reason_of(""), Reason::truncated);
  EXPECT_EQ(reason_of("1 2 3\n4 5 6\n7 8 9\n"), Reason::bad_size);
  EXPECT_EQ(reason_of("1 2 3 4\n5 6 7 8\n"), Reason::bad_size);
  EXPECT_EQ(reason_of("hello\n"), Reason::bad_value);
  EXPECT_EQ(reason_of(std::string("\x89PNG\0\0", 6)), Reason::unsupported);
  EXPECT_EQ(reason_of("1 2 3 4\n2 4 6 8\n0 0 1 800\n"), Reason::bad_value);
  EXPECT_EQ(reason_of("1 2 3 inf\n2 4 6 8\n0 0 1 800\n"), Reason::not_finite);
  EXPECT_EQ(reason_of("NRRD0004\nsizes: 4 4\n\n"), Reason::unsupported);
  EXPECT_EQ(reason_of("{\"projection\": 3}"), Reason::bad_value);
  EXPECT_EQ(reason_of("{\"matrix\": []}"), Reason::bad_value);
  EXPECT_EQ(import_matrix("/nonexistent/file").error().reason, Reason::missing_file);
}

}  // namespace
}  // namespace helicarm::exchange
