// SPDX-License-Identifier: Apache-2.0
#include "helicarm/exchange/run_geometry.h"

#include <bit>
#include <cstring>

#include <fmt/format.h>

#include "helicarm/exchange/rtk_projection.h"

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

}  // namespace

PlacedDetector placed_detector(const geometry::View& view, const Eigen::Vector2i& size, double pixel_mm) {
  const geometry::Intrinsics& k = view.intrinsics;
  const double distance = k.fy * pixel_mm;
  const Eigen::Matrix3d back = distance * view.camera_from_world.rotation.transpose() * k.matrix().inverse();
  const Eigen::Vector2d middle = (size - Eigen::Vector2i::Ones()).cast<double>() / 2;
  const Eigen::Vector3d source = view.source_in_world();
  return {source, source + back * Eigen::Vector3d(middle.x(), middle.y(), 1), back.col(0), back.col(1)};
}

Expected<std::string> rtk_geometry(const RunGeometry& run) {
  return guarded([&] {
    std::string text;
    for (const RunGeometry::Image& image : run.images) {
      const RtkView rtk = value_or_throw(rtk_view(image.view, run.size, run.pixel_mm));
      if (text.empty())
        text = fmt::format(
            "<?xml version=\"1.0\"?>\n<!DOCTYPE RTKGEOMETRY>\n<!-- Projection image: spacing {} {} mm, "
            "origin {} "
            "{} mm; "
            "rows {} -->\n<RTKThreeDCircularGeometry version=\"3\">\n",
            rtk.pixels.spacing_mm.x(), rtk.pixels.spacing_mm.y(), rtk.pixels.origin_mm.x(),
            rtk.pixels.origin_mm.y(),
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
      text += "    <Matrix>\n" + numbers_of(p.matrix(), " ", "\n") + "\n    </Matrix>\n  </Projection>\n";
    }
    return text + "</RTKThreeDCircularGeometry>\n";
  });
}

std::string astra_vectors(const RunGeometry& run) {
  std::string text;
  for (const RunGeometry::Image& image : run.images) {
    const PlacedDetector d = placed_detector(image.view, run.size, run.pixel_mm);
    Eigen::RowVectorXd row(12);
    row << d.source.transpose(), d.centre.transpose(), d.along_u.transpose(), d.along_v.transpose();
    text += numbers_of(row, " ", "") + "\n";
  }
  return text;
}

std::string ompl_matrices(const RunGeometry& run) {
  std::string text;
  for (const RunGeometry::Image& image : run.images)
    text += "[" + numbers_of(image.view.projection(), " ", "; ") + "]\n";
  return text;
}

std::string matrices_csv(const RunGeometry& run) {
  std::string text = "view";
  for (int i = 0; i < 12; ++i) text += fmt::format(",p{}{}", i / 4 + 1, i % 4 + 1);
  text += "\n";
  for (const RunGeometry::Image& image : run.images)
    text += image.name + "," + numbers_of(image.view.projection(), ",", ",") + "\n";
  return text;
}

std::string matrices_npy(const RunGeometry& run) {
  static_assert(std::endian::native == std::endian::little);
  std::string header =
      fmt::format("{{'descr': '<f8', 'fortran_order': False, 'shape': ({}, 3, 4), }}", run.images.size());
  constexpr std::size_t preamble = 10, alignment = 64;
  header += std::string(alignment - (preamble + header.size() + 1) % alignment, ' ') + "\n";
  std::string bytes = std::string("\x93NUMPY\x01\x00", 8);
  bytes += char(header.size() & 0xFF);
  bytes += char(header.size() >> 8);
  bytes += header;
  for (const RunGeometry::Image& image : run.images) {
    const Eigen::Matrix<double, 3, 4, Eigen::RowMajor> rows = image.view.projection();
    bytes.append(reinterpret_cast<const char*>(rows.data()), sizeof(double) * std::size_t(rows.size()));
  }
  return bytes;
}

}  // namespace helicarm::exchange
