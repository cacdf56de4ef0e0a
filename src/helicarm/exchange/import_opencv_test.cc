// SPDX-License-Identifier: Apache-2.0
#include "helicarm/exchange/import_text_test.h"

namespace helicarm::exchange {
namespace {

/// Written by OpenCV 4.6.0's FileStorage.
const std::string opencv_yaml = R"(%YAML:1.0
---
image_width: 1024
image_height: 760
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 4.0125000000000000e+03, 0., 5.1125000000000000e+02, 0.,
       3.9987500000000000e+03, 3.8050000000000000e+02, 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: [ 0., 0., 0., 0., 0. ]
rvec: !!opencv-matrix
   rows: 3
   cols: 1
   dt: d
   data: [ 2.9999999999999999e-01, -1.1000000000000001e+00,
       4.5000000000000001e-01 ]
tvec: !!opencv-matrix
   rows: 3
   cols: 1
   dt: d
   data: [ 1.2500000000000000e+01, -8.2500000000000000e+00, 905. ]
)";
const std::string opencv_xml = R"(<?xml version="1.0"?>
<opencv_storage>
<image_width>1024</image_width>
<image_height>760</image_height>
<camera_matrix type_id="opencv-matrix">
  <rows>3</rows>
  <cols>3</cols>
  <dt>d</dt>
  <data>
    4.0125000000000000e+03 0. 5.1125000000000000e+02 0.
    3.9987500000000000e+03 3.8050000000000000e+02 0. 0. 1.</data></camera_matrix>
<rvec type_id="opencv-matrix">
  <rows>3</rows>
  <cols>1</cols>
  <dt>d</dt>
  <data>
    2.9999999999999999e-01 -1.1000000000000001e+00
    4.5000000000000001e-01</data></rvec>
<tvec type_id="opencv-matrix">
  <rows>3</rows>
  <cols>1</cols>
  <dt>d</dt>
  <data>
    1.2500000000000000e+01 -8.2500000000000000e+00 905.</data></tvec>
</opencv_storage>
)";
const std::string lens = "data: [ 0., 0., 0., 0., 0. ]";

/// Pixels from OpenCV 4.6.0's projectPoints with these files.
void expect_opencv_pixels(const Expected<ImportedMatrix>& camera) {
  ASSERT_TRUE(camera) << camera.error().message;
  EXPECT_EQ(*camera->image_size, Eigen::Vector2i(1024, 760));
  for (const auto& [point, pixel] :
       {std::pair{Eigen::Vector3d(10, 20, 30), Eigen::Vector2d(437.2874277338652, 370.68509910910745)},
        {Eigen::Vector3d(-25, 4, 12), Eigen::Vector2d(473.58974938860206, 312.2512171668905)},
        {Eigen::Vector3d(33, -41, -7), Eigen::Vector2d(729.2040191031577, 233.55213175894963)}})
    EXPECT_LT((camera->view.project(point) - pixel).norm(), 1e-9) << point.transpose();
}

TEST(ImportOpenCv, YamlProjectsAsProjectPoints) { expect_opencv_pixels(import_text(opencv_yaml)); }

TEST(ImportOpenCv, XmlProjectsAsProjectPoints) { expect_opencv_pixels(import_text(opencv_xml)); }

TEST(ImportOpenCv, MatrixAndTAreRead) {
  const auto at = opencv_yaml.find("rvec:");
  const auto camera = import_text(opencv_yaml.substr(0, at) +
                                  "R: [ 0., 0., 1., -0.6, -0.8, 0., 0.8, -0.6, 0. ]\nT: [ 1., 2., 700. ]\n");
  ASSERT_TRUE(camera) << camera.error().message;
  EXPECT_EQ(camera->view.camera_from_world.rotation(1, 0), -0.6);
  EXPECT_EQ(camera->view.camera_from_world.translation, Eigen::Vector3d(1, 2, 700));
}

TEST(ImportOpenCv, PoseIsARowOfTheTableOfCalibrateCamera) {
  const auto at = opencv_yaml.find("rvec:");
  const std::string table =
      opencv_yaml.substr(0, at) +
      "extrinsic_parameters: !!opencv-matrix\n   rows: 2\n   cols: 6\n   dt: d\n   data: [ "
      "0., 0., 0., 1., 2., 600.,\n       0.3, -1.1, 0.45, 12.5, -8.25, 905. ]\n";
  EXPECT_EQ(import_text(table).error().reason, Reason::usage);
  EXPECT_EQ(import_text(table, {.column = 3}).error().reason, Reason::bad_value);
  expect_opencv_pixels(import_text(table, {.column = 2}));
}

TEST(ImportOpenCv, LensDistortionIsRefusedUnlessTheImagesAreUndistorted) {
  const std::string distorted = replaced(opencv_yaml, lens, "data: [ -0.2, 0., 0., 0., 0. ]");
  const auto refused = import_text(distorted);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().reason, Reason::unsupported);
  EXPECT_NE(
      refused.error().message.find("distortion_coefficients: the camera has a lens distortion (k1 -0.2"),
      std::string::npos)
      << refused.error().message;
  expect_opencv_pixels(import_text(distorted, {.undistorted = true}));
}

TEST(ImportOpenCv, BrokenFilesAreNamed) {
  for (const auto& [text, reason] :
       {std::pair{opencv_yaml.substr(0, opencv_yaml.find("rvec:")), Reason::truncated},
        {replaced(opencv_yaml, "camera_matrix", "some_matrix"), Reason::truncated},
        {replaced(opencv_yaml, "905. ]", "905."), Reason::truncated},
        {replaced(opencv_yaml, "0., 0., 1. ]", "0., 1. ]"), Reason::bad_size},
        {replaced(opencv_yaml, "905. ]", "near ]"), Reason::bad_value},
        {replaced(opencv_yaml, "image_width: 1024", "image_width: -3"), Reason::bad_value},
        {replaced(opencv_xml, "</rvec>", "</tvec>"), Reason::bad_value},
        {replaced(opencv_xml, "</opencv_storage>", ""), Reason::truncated}}) {
    const auto refused = import_text(text);
    ASSERT_FALSE(refused) << text;
    EXPECT_EQ(refused.error().reason, reason) << refused.error().message;
  }
}

TEST(ImportOpenCv, RotationVectorInDegreesIsRefused) {
  const auto at = opencv_yaml.find("rvec:"), data = opencv_yaml.find("data: [", at),
             end = opencv_yaml.find(']', data);
  std::string text = opencv_yaml;
  text.replace(data, end - data, "data: [ 10., -20., 30. ");
  const auto refused = import_text(text);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().reason, Reason::bad_value);
  EXPECT_NE(refused.error().message.find("are these degrees?"), std::string::npos) << refused.error().message;
}

/// As PyYAML writes it, with OpenCV's numbers.
const std::string py_yaml = R"(camera_name: left, upper
calibrated: 2026-05-04 10:00:00
image_width: 1024
image_height: 760
camera_matrix:
- - 4012.5
  - 0.0
  - 511.25
- [0.0, 3998.75,
   380.5]
- - 0.0
  - 0.0
  - 1.0
distortion_coefficients:
- 0.0
- 0.0
- -0.0
rvec:
- 0.3
- -1.1
- 0.45
tvec: !!python/tuple
- 12.5
- -8.25
- 905.0
)";

TEST(ImportOpenCv, YamlOfPyYamlIsRead) {
  expect_opencv_pixels(import_text(py_yaml));
  expect_opencv_pixels(import_text("%YAML:1.0\n---\n" + py_yaml));
  const auto refused = import_text(replaced(py_yaml, "- -0.0", "- -0.21"));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().reason, Reason::unsupported);
}

TEST(ImportOpenCv, CameraInfoOfRosWithAPoseIsRead) {
  expect_opencv_pixels(import_text(R"(image_width: 1024
image_height: 760
camera_name: narrow
camera_matrix:
  rows: 3
  cols: 3
  data: [4012.5, 0, 511.25, 0, 3998.75, 380.5, 0, 0, 1]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [0, 0, 0, 0, 0]
projection_matrix:
  rows: 3
  cols: 4
  data: [4012.5, 0, 511.25, 0, 0, 3998.75, 380.5, 0, 0, 0, 1, 0]
rvec: [0.3, -1.1, 0.45]
tvec: [12.5, -8.25, 905]
)"));
}

std::string json_camera(const std::string& more, const std::string& k = "camera_matrix") {
  return "{\"image_width\": 1024, \"image_height\": 760, \"" + k +
         "\": [[4012.5, 0, 511.25], [0, 3998.75, 380.5], [0, 0, 1]], \"rvec\": [[0.3], [-1.1], [0.45]], "
         "\"tvec\": [12.5, -8.25, 905]" +
         (more.empty() ? "" : ", " + more) + "}";
}

TEST(ImportOpenCv, JsonIsReadUnderTheUsualNames) {
  for (const char* k : {"camera_matrix", "cameraMatrix", "K", "intrinsic_matrix", "mtx"})
    expect_opencv_pixels(import_text(json_camera("\"dist\": [0, 0, 0, 0]", k)));
  expect_opencv_pixels(import_text(json_camera(
      R"("D": {"type_id": "opencv-matrix", "rows": 1, "cols": 4, "dt": "d", "data": [0, 0, 0, 0]})")));
}

TEST(ImportOpenCv, LensIsRefusedUnderEveryName) {
  for (const char* key : {"\"dist_coeff\": [-0.2, 0.1]",
                          "\"distortion\": [-0.2]",
                          "\"distCoeffs\": [[-0.2, 0]]",
                          "\"D\": [0, 0.1]",
                          "\"d\": [0.1]",
                          "\"kc\": [0.1]",
                          "\"dist_params\": [0.1]",
                          "\"cam_dist\": [0.1]",
                          "\"kappa\": 0.1",
                          "\"k1\": -0.2",
                          "\"p2\": 1e-4",
                          "\"K1\": 0.1",
                          "\"dist\": [0.1]",
                          "\"distortion\": {\"k1\": 0, \"k2\": 0.1}",
                          "\"RadialDistortion\": [0.1, 0]",
                          "\"lens\": {\"radial\": [0.1]}",
                          "\"intrinsics_extra\": {\"coeffs\": [0.1]}",
                          "\"xi\": 0.8",
                          "\"distortion\": \"see lens.txt\"",
                          "\"distortion_model\": \"equidistant\"",
                          "\"camera_model\": \"fisheye\", \"D\": [0, 0, 0, 0]",
                          "\"fisheye_model\": 1",
                          "\"distortion_coefficients\": {\"rows\": 1, \"cols\": 2, \"data\": [0, 0.1]}"}) {
    const auto refused = import_text(json_camera(key));
    ASSERT_FALSE(refused) << key;
    EXPECT_EQ(refused.error().reason, Reason::unsupported) << refused.error().message;
    expect_opencv_pixels(import_text(json_camera(key), {.undistorted = true}));
  }
}

TEST(ImportOpenCv, NoLensIsAccepted) {
  for (const char* none : {"\"dist_coeff\": [0, 0]", "\"distortion\": null", "\"D\": []", "\"k1\": 0",
                           "\"distortion_model\": \"plumb_bob\"", "\"distance_mm\": 900",
                           "\"undistorted\": true", "\"fisheye_model\": 0", "\"model\": \"Arcadis Orbic\"",
                           "\"P1\": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]]"})
    expect_opencv_pixels(import_text(json_camera(none)));
}

TEST(ImportOpenCv, TwoNumbersForOneThingMustAgree) {
  EXPECT_TRUE(import_text(json_camera("\"skew\": 0")));
  for (const char* more :
       {"\"skew\": 12", "\"image_size\": [760, 1024]", "\"R\": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]",
        "\"K\": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]"}) {
    const auto refused = import_text(json_camera(more));
    ASSERT_FALSE(refused) << more;
    EXPECT_EQ(refused.error().reason, Reason::bad_value) << refused.error().message;
  }
}

TEST(ImportOpenCv, DeepNestingIsRefused) {
  const std::string start = "%YAML:1.0\n---\nK: ";
  std::string items, columns = start + "\n", tags = "<?xml version=\"1.0\"?>\n<opencv_storage>";
  for (int i = 0; i < 2000; ++i) {
    items += "- ";
    columns += std::string(std::size_t(i) + 1, ' ') + "a:\n";
    tags += "<a>";
  }
  for (const std::string& text :
       {start + std::string(100000, '['), start + std::string(100000, '[') + std::string(100000, ']'),
        start + "\n  " + items + "1\n", columns, tags, tags + "</opencv_storage>"})
    EXPECT_FALSE(import_text(text));
}

TEST(ImportOpenCv, StereoPairIsNamedByItsKeys) {
  const auto refused = import_text("%YAML:1.0\n---\nM1: [1, 0, 0]\nD1: [0.1]\nM2: [1]\n");
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().reason, Reason::truncated);
  EXPECT_NE(refused.error().message.find("M1, D1, M2"), std::string::npos) << refused.error().message;
}

}  // namespace
}  // namespace helicarm::exchange
