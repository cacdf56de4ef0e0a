// SPDX-License-Identifier: Apache-2.0
#include "helicarm/exchange/run_geometry.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <vector>

#include <fmt/format.h>

#include "helicarm/core/csv.h"
#include "helicarm/core/json.h"
#include "helicarm/exchange/rtk_projection.h"
#include "helicarm/geometry/decomposition.h"
#include "helicarm/geometry/view_json.h"

namespace helicarm::exchange {
namespace {

/// A row-major matrix as text.
std::string numbers_of(const Eigen::MatrixXd& matrix, std::string_view between, std::string_view after_row) {
  std::string text;
  for (Eigen::Index i = 0; i < matrix.rows(); ++i)
    for (Eigen::Index j = 0; j < matrix.cols(); ++j)
      text += fmt::format("{}{}", matrix(i, j),
                          j + 1 < matrix.cols()   ? between
                          : i + 1 < matrix.rows() ? after_row
                                                  : "");
  return text;
}

Json list_of(const Eigen::VectorXd& values) { return std::vector<double>(values.begin(), values.end()); }

/// Angles a, b, c of a rotation Rz(a) Ry(b) Rz(c), rad.
Eigen::Vector3d zyz_angles(const Eigen::Matrix3d& r) {
  constexpr double locked_sine = 1e-9;
  const double sine = std::hypot(r(0, 2), r(1, 2));
  if (sine < locked_sine)
    return {std::atan2(r(1, 0), r(0, 0) * (r(2, 2) < 0 ? -1 : 1)), std::atan2(sine, r(2, 2)), 0};
  return {std::atan2(r(1, 2), r(0, 2)), std::atan2(sine, r(2, 2)), std::atan2(r(2, 1), -r(2, 0))};
}

/// Angles a, b, c of a rotation Rz(a) Ry(b) Rx(c), rad.
Eigen::Vector3d zyx_angles(const Eigen::Matrix3d& r) {
  return {std::atan2(r(1, 0), r(0, 0)), std::atan2(-r(2, 0), std::hypot(r(2, 1), r(2, 2))),
          std::atan2(r(2, 1), r(2, 2))};
}

Expected<void> check_not_skewed(const RunGeometry::Image& image, const char* program) {
  constexpr double largest_skew_px = 1e-6;
  if (std::abs(image.view.intrinsics.skew) <= largest_skew_px) return {};
  return fail(Reason::unsupported, fmt::format("{}: {}'s detector has no skew; the camera's is {:g} px",
                                               image.name, program, image.view.intrinsics.skew));
}

double shape_of(const RunGeometry::Image& image) {
  return std::abs(image.view.intrinsics.fx / image.view.intrinsics.fy);
}

/// Of each image: the factor of its columns, whose inverse is that of its rows, that gives the pixels of all
/// images one shape.
std::vector<double> stretches(const RunGeometry& run) {
  std::vector<double> logs;
  double mean = 0;
  for (const RunGeometry::Image& image : run.images) {
    logs.push_back(std::log(shape_of(image) / shape_of(run.images.front())));
    mean += logs.back() / double(run.images.size());
  }
  for (double& each : logs) each = std::exp((mean - each) / 2);
  return logs;
}

/// The cameras with pixels of one shape, each stretched about its image's middle.
Expected<RunGeometry> with_one_shape(RunGeometry run, const char* program) {
  if (const double error = one_shape_error_px(run); error > largest_one_shape_error_px)
    return fail(Reason::unsupported,
                fmt::format("{}'s geometry has one pixel size for all images; theirs differ, which would "
                            "displace pixels by up to {:.2g} px, limit {:g} px: take a format in which each "
                            "image has its own (ASTRA, plastimatch, matrices)",
                            program, error, largest_one_shape_error_px));
  const std::vector<double> factors = stretches(run);
  const Eigen::Vector2d middle = (run.size - Eigen::Vector2i::Ones()).cast<double>() / 2;
  for (std::size_t i = 0; i < factors.size(); ++i) {
    geometry::Intrinsics& k = run.images[i].view.intrinsics;
    k.fx *= factors[i];
    k.skew *= factors[i];
    k.u0 = middle.x() + factors[i] * (k.u0 - middle.x());
    k.fy /= factors[i];
    k.v0 = middle.y() + (k.v0 - middle.y()) / factors[i];
  }
  return run;
}

/// The same for a format without skew.
Expected<RunGeometry> with_one_pixel(const RunGeometry& run, const char* program) {
  for (const RunGeometry::Image& image : run.images)
    if (auto square = check_not_skewed(image, program); !square)
      return tl::unexpected<Failure>(std::move(square).error());
  return with_one_shape(run, program);
}

}  // namespace

double one_shape_error_px(const RunGeometry& run) {
  const Eigen::Vector2d half = (run.size - Eigen::Vector2i::Ones()).cast<double>() / 2;
  double largest = 0;
  for (const double factor : stretches(run))
    largest = std::max(largest, half.cwiseProduct(Eigen::Vector2d(factor - 1, 1 / factor - 1)).norm());
  return largest;
}

PlacedDetector placed_detector(const geometry::View& view, const Eigen::Vector2i& size, double pixel_mm) {
  const geometry::Intrinsics& k = view.intrinsics;
  const double distance = k.fy * pixel_mm;
  const Eigen::Matrix3d back = distance * view.camera_from_world.rotation.transpose() * k.matrix().inverse();
  const Eigen::Vector2d middle = (size - Eigen::Vector2i::Ones()).cast<double>() / 2;
  const Eigen::Vector3d source = view.source_in_world();
  return {source, source + back * Eigen::Vector3d(middle.x(), middle.y(), 1), back.col(0), back.col(1)};
}

Expected<geometry::View> view_of_detector(const PlacedDetector& detector, const Eigen::Vector2i& size) {
  const Eigen::Vector2d middle = (size - Eigen::Vector2i::Ones()).cast<double>() / 2;
  Eigen::Matrix3d ray_of_pixel;
  ray_of_pixel << detector.along_u, detector.along_v,
      detector.centre - detector.source - middle.x() * detector.along_u - middle.y() * detector.along_v;
  constexpr double least_sine = 1e-6;
  const double volume = std::abs(ray_of_pixel.determinant());
  if (volume <= least_sine * detector.along_u.norm() * detector.along_v.norm() *
                    (detector.centre - detector.source).norm())
    return fail(Reason::bad_value, "the source lies in the detector's plane, or its pixels have no area");
  geometry::Projection projection;
  projection.leftCols<3>() = ray_of_pixel.inverse();
  projection.col(3) = -(projection.leftCols<3>() * detector.source);
  return geometry::decompose(projection, detector.centre);
}

geometry::View with_rows_reversed(const geometry::View& view, int height) {
  const Eigen::DiagonalMatrix<double, 3> half_turn(-1, -1, 1);
  const geometry::Intrinsics& k = view.intrinsics;
  return {{-k.fx, k.fy, k.u0, height - 1 - k.v0, -k.skew},
          {half_turn * view.camera_from_world.rotation, half_turn * view.camera_from_world.translation}};
}

Expected<std::string> rtk_geometry(const RunGeometry& given) {
  return guarded([&] {
    const RunGeometry run = value_or_throw(with_one_shape(given, "RTK"));
    for (const RunGeometry::Image& image : run.images)
      if ((image.view.intrinsics.fx < 0) != (run.images.front().view.intrinsics.fx < 0))
        throw BadInput(
            Reason::unsupported,
            fmt::format("{} is mirrored and {} is not, or the reverse: the rows of RTK's images all "
                        "run upwards or none do",
                        run.images.front().name, image.name));
    std::string text;
    for (const RunGeometry::Image& image : run.images) {
      const RtkView rtk = value_or_throw(rtk_view(image.view, run.size, run.pixel_mm));
      if (text.empty())
        text = fmt::format(
            "<?xml version=\"1.0\"?>\n<!DOCTYPE RTKGEOMETRY>\n<!-- Projection image: spacing {} {} mm, "
            "origin {} "
            "{} mm; "
            "image {} x {} px; rows {} -->\n<RTKThreeDCircularGeometry version=\"3\">\n",
            rtk.pixels.spacing_mm.x(), rtk.pixels.spacing_mm.y(), rtk.pixels.origin_mm.x(),
            rtk.pixels.origin_mm.y(), run.size.x(), run.size.y(),
            rtk.rows_upwards ? "run upwards: flip the rectified image upside down"
                             : "as in the rectified image");
      const RtkProjection& p = rtk.projection;
      text += "  <Projection>\n";
      for (const auto& [name, value] : {std::pair{"SourceToIsocenterDistance", p.source_to_isocenter},
                                        {"SourceToDetectorDistance", p.source_to_detector},
                                        {"GantryAngle", p.gantry_angle},
                                        {"OutOfPlaneAngle", p.out_of_plane_angle},
                                        {"InPlaneAngle", p.in_plane_angle},
                                        {"SourceOffsetX", p.source_offset.x()},
                                        {"SourceOffsetY", p.source_offset.y()},
                                        {"ProjectionOffsetX", p.projection_offset.x()},
                                        {"ProjectionOffsetY", p.projection_offset.y()}})
        text += fmt::format("    <{0}>{1}</{0}>\n", name, value);
      text += fmt::format("    <Matrix>\n{}\n    </Matrix>\n  </Projection>\n",
                          numbers_of(p.matrix(), " ", "\n"));
    }
    return fmt::format("{}</RTKThreeDCircularGeometry>\n", text);
  });
}

std::string astra_vectors(const RunGeometry& run) {
  std::string text = "# ASTRA cone_vec: source, middle of the detector, u and v of a pixel, mm\n";
  for (const RunGeometry::Image& image : run.images) {
    const PlacedDetector d = placed_detector(image.view, run.size, run.pixel_mm);
    Eigen::RowVectorXd row(12);
    row << d.source.transpose(), d.centre.transpose(), d.along_u.transpose(), d.along_v.transpose();
    text += fmt::format("{}\n", numbers_of(row, " ", ""));
  }
  return text;
}

Expected<std::string> leap_modular(const RunGeometry& given) {
  const auto one = with_one_pixel(given, "LEAP");
  if (!one) return tl::unexpected<Failure>(one.error());
  const RunGeometry& run = *one;
  Json json = {{"numAngles", run.images.size()}, {"numRows", run.size.y()}, {"numCols", run.size.x()}};
  json["pixelHeight"] = json["pixelWidth"] = nullptr;
  for (const char* key : {"sourcePositions", "moduleCenters", "rowVectors", "colVectors"})
    json[key] = Json::array();
  for (const RunGeometry::Image& image : run.images) {
    const PlacedDetector d = placed_detector(image.view, run.size, run.pixel_mm);
    json["pixelHeight"] = d.along_v.norm();
    json["pixelWidth"] = d.along_u.norm();
    json["sourcePositions"].push_back(list_of(d.source));
    json["moduleCenters"].push_back(list_of(d.centre));
    json["rowVectors"].push_back(list_of(d.along_v.normalized()));
    json["colVectors"].push_back(list_of(d.along_u.normalized()));
  }
  return to_text(json) + "\n";
}

Expected<std::string> tigre_geometry(const RunGeometry& given) {
  const auto one = with_one_pixel(given, "TIGRE");
  if (!one) return tl::unexpected<Failure>(one.error());
  const RunGeometry& run = *one;
  Json json = {
      {"mode", "cone"}, {"nDetector", {run.size.y(), run.size.x()}}, {"dDetector", nullptr}, {"COR", 0}};
  for (const char* key : {"DSD", "DSO", "offDetector", "rotDetector", "angles"}) json[key] = Json::array();
  for (const RunGeometry::Image& image : run.images) {
    const PlacedDetector d = placed_detector(image.view, run.size, run.pixel_mm);
    // Turned so that the source lies on x; the detector's columns run along y, its rows against z.
    Eigen::Matrix3d axes, detector;
    axes.col(0) = d.source.normalized();
    axes.col(1) = (d.along_u - axes.col(0) * axes.col(0).dot(d.along_u)).normalized();
    axes.col(2) = axes.col(0).cross(axes.col(1));
    detector.col(1) = d.along_u.normalized();
    detector.col(2) = -d.along_v.normalized();
    detector.col(0) = detector.col(1).cross(detector.col(2));
    const Eigen::Vector3d centre = axes.transpose() * d.centre;
    const double distance = d.source.norm();
    json["dDetector"] = {d.along_v.norm(), d.along_u.norm()};
    json["DSO"].push_back(distance);
    json["DSD"].push_back(distance - centre.x());
    json["offDetector"].push_back({centre.z(), centre.y()});
    json["rotDetector"].push_back(list_of(zyx_angles(axes.transpose() * detector)));
    json["angles"].push_back(list_of(zyz_angles(axes)));
  }
  return to_text(json) + "\n";
}

Expected<std::string> diffdrr_cameras(const RunGeometry& run) {
  Json images = Json::array();
  for (const RunGeometry::Image& image : run.images) {
    if (auto square = check_not_skewed(image, "DiffDRR"); !square)
      return tl::unexpected<Failure>(std::move(square).error());
    const geometry::Intrinsics& k = image.view.intrinsics;
    // Its camera has x to the left and y upwards; columns run against x unless the image is mirrored. The
    // middle of the first pixel is (0.5, 0.5).
    const Eigen::DiagonalMatrix<double, 3> turned(-1, -1, 1);
    Eigen::Matrix4d camera_from_world = image.view.camera_from_world.matrix();
    camera_from_world.topRows<3>() = turned * camera_from_world.topRows<3>();
    const bool against_x = k.fx > 0;
    const double sdd = k.fy * run.pixel_mm, delx = sdd / std::abs(k.fx);
    const double column = against_x ? run.size.x() - k.u0 - 0.5 : k.u0 + 0.5;
    const double row = run.size.y() - k.v0 - 0.5;
    images.push_back({{"name", image.name},
                      {"sdd", sdd},
                      {"height", run.size.y()},
                      {"width", run.size.x()},
                      {"delx", delx},
                      {"dely", run.pixel_mm},
                      {"x0", delx * (run.size.x() / 2.0 - column)},
                      {"y0", run.pixel_mm * (run.size.y() / 2.0 - row)},
                      {"reverse_x_axis", against_x},
                      {"pose", geometry::json_rows(Eigen::Matrix4d(camera_from_world.inverse()))}});
  }
  return to_text(Json{{"diffdrr", std::move(images)}}) + "\n";
}

std::string deepdrr_cameras(const RunGeometry& run) {
  Json images = Json::array();
  for (const RunGeometry::Image& image : run.images)
    images.push_back({{"name", image.name},
                      {"intrinsic", geometry::json_rows(image.view.intrinsics.matrix())},
                      {"extrinsic", geometry::json_rows(image.view.camera_from_world.matrix())},
                      {"sensor_width", run.size.x()},
                      {"sensor_height", run.size.y()}});
  return to_text(Json{{"deepdrr", std::move(images)}}) + "\n";
}

std::string plastimatch_matrix(const geometry::View& view, double pixel_mm) {
  const geometry::Intrinsics& k = view.intrinsics;
  const double distance = k.fy * pixel_mm;
  const Eigen::Matrix4d extrinsic = view.camera_from_world.matrix();
  Eigen::Matrix<double, 3, 4> intrinsic = Eigen::Matrix<double, 3, 4>::Zero();
  intrinsic(0, 0) = k.fx / distance;
  intrinsic(0, 1) = k.skew / distance;
  intrinsic(1, 1) = k.fy / distance;
  intrinsic(2, 2) = 1 / distance;
  const Eigen::Matrix<double, 3, 4> matrix = intrinsic * extrinsic;
  return fmt::format("{} {}\n{}\n{}\n{}\n{}\nExtrinsic\n{}\nIntrinsic\n{}\n", k.u0, k.v0,
                     numbers_of(matrix, " ", "\n"), extrinsic(2, 3), distance,
                     numbers_of(extrinsic.block<1, 3>(2, 0), " ", "\n"), numbers_of(extrinsic, " ", "\n"),
                     numbers_of(intrinsic, " ", "\n"));
}

std::string ompl_matrices(const RunGeometry& run) {
  std::string text;
  for (const RunGeometry::Image& image : run.images)
    text += fmt::format("[{}]\n", numbers_of(image.view.projection(), " ", "; "));
  return text;
}

std::string matrices_csv(const RunGeometry& run) {
  std::string text = "view";
  for (int i = 0; i < 12; ++i) text += fmt::format(",p{}{}", i / 4 + 1, i % 4 + 1);
  text += "\n";
  for (const RunGeometry::Image& image : run.images)
    text += fmt::format("{},{}\n", csv_field(image.name), numbers_of(image.view.projection(), ",", ","));
  return text;
}

std::string matrices_npy(const RunGeometry& run) {
  static_assert(std::endian::native == std::endian::little);
  std::string header =
      fmt::format("{{'descr': '<f8', 'fortran_order': False, 'shape': ({}, 3, 4), }}", run.images.size());
  constexpr std::size_t preamble = 10, alignment = 64;
  const std::size_t padded = (preamble + header.size() + alignment) / alignment * alignment - preamble;
  header.resize(padded, ' ');
  header.back() = '\n';
  std::string bytes =
      fmt::format("\x93NUMPY{}{}{}{}{}", '\x01', '\0', char(padded & 0xFF), char(padded >> 8), header);
  for (const RunGeometry::Image& image : run.images) {
    const Eigen::Matrix<double, 3, 4, Eigen::RowMajor> rows = image.view.projection();
    bytes.append(reinterpret_cast<const char*>(rows.data()), sizeof(double) * std::size_t(rows.size()));
  }
  return bytes;
}

}  // namespace helicarm::exchange
