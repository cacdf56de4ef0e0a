// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/core/json.h"
#include "helicarm/core/random.h"
#include "helicarm/geometry/view.h"
#include "helicarm/image/png.h"

namespace helicarm::sweep {

/// A run of images of steel balls, drawn by their exact chords; written as numbered files with sidecars.
struct DrawnRun {
  int frames = 20, size = 256;
  double pixel_mm = 1.0, step_deg = 5;
  double stated_source_detector_mm = 1000;  ///< in the sidecars
  int moved_from = 1000;                    ///< from this frame on the balls are shifted
  Eigen::Vector3d shift_mm = Eigen::Vector3d(1.5, 0, 0);
  std::vector<int> blank = {};
  double flex_mm = 3;     ///< of the detector to the right, times the sine of the harmonic's angle
  int flex_harmonic = 1;  ///< above 1 no circle about another axis holds it

  static std::vector<Eigen::Vector3d> balls() {
    RandomStream random{21, 0};
    std::vector<Eigen::Vector3d> places;
    for (int k = 0; k < 14; ++k)
      places.emplace_back(random.uniform(-55, 55), random.uniform(-55, 55), random.uniform(-45, 45));
    return places;
  }
  static double diameter_mm(std::size_t ball) { return ball % 3 == 0 ? 7 : 5; }

  /// Turns about z; the detector flexes by millimetres.
  geometry::View view(int frame) const {
    const double angle = frame * step_deg * EIGEN_PI / 180;
    const Eigen::Vector3d u(-std::sin(angle), std::cos(angle), 0), v(0, 0, -1),
        w(-std::cos(angle), -std::sin(angle), 0);
    geometry::View view;
    view.camera_from_world.rotation << u.transpose(), v.transpose(), w.transpose();
    const Eigen::Vector3d source = -620 * w + std::sin(angle) * u;
    view.camera_from_world.translation = -(view.camera_from_world.rotation * source);
    const double middle = (size - 1) / 2.0;
    view.intrinsics = {1000 / pixel_mm, 1000 / pixel_mm,
                       middle + flex_mm / pixel_mm * std::sin(flex_harmonic * angle),
                       middle + 2 * std::cos(angle), 0};
    return view;
  }

  /// A pixel's neighbours share a quarter of its light on either side.
  static void blur(Eigen::MatrixXd& beam) {
    const auto along_columns = [](const Eigen::MatrixXd& of) {
      Eigen::MatrixXd blurred = of;
      const auto n = of.rows() - 2;
      blurred.middleRows(1, n) = of.middleRows(1, n) / 2 + (of.topRows(n) + of.bottomRows(n)) / 4;
      return blurred;
    };
    beam = along_columns(along_columns(beam).transpose().eval()).transpose().eval();
  }

  image::Image<std::uint16_t> image(int frame) const {
    image::Image<std::uint16_t> drawn(size, size);
    Eigen::MatrixXd beam(size, size);  // row, column
    const geometry::View at = view(frame);
    const Eigen::Vector3d source = at.source_in_world();
    const Eigen::Matrix3d back = at.camera_from_world.rotation.transpose() * at.intrinsics.matrix().inverse();
    const bool is_blank = std::ranges::find(blank, frame + 1) != blank.end();
    std::vector<Eigen::Vector3d> places = balls();
    for (Eigen::Vector3d& place : places)
      if (frame + 1 >= moved_from) place += shift_mm;
    RandomStream random{77, std::uint32_t(frame)};
    constexpr int parts = 3;
    const auto is_near_a_ball = [&](double u, double v) {
      for (std::size_t b = 0; b < places.size(); ++b) {
        const double reach = 0.6 * diameter_mm(b) * at.intrinsics.fy / at.depth(places[b]) + 2;
        if ((at.project(places[b]) - Eigen::Vector2d(u, v)).norm() < reach) return true;
      }
      return false;
    };
    for (int row = 0; row < size; ++row)
      for (int column = 0; column < size; ++column) {
        const bool is_drawn = !is_blank && is_near_a_ball(column, row);
        double light = is_drawn ? 0 : 1;
        for (int k = 0; is_drawn && k < parts * parts; ++k) {
          const Eigen::Vector3d pixel(column + (k % parts - 1.0) / parts, row + (k / parts - 1.0) / parts, 1);
          const Eigen::Vector3d ray = (back * pixel).normalized();
          double chord = 0;
          for (std::size_t b = 0; b < places.size(); ++b) {
            const Eigen::Vector3d from = places[b] - source;
            const double across2 = from.squaredNorm() - std::pow(from.dot(ray), 2),
                         radius = diameter_mm(b) / 2;
            chord += 2 * std::sqrt(std::max(0.0, radius * radius - across2));
          }
          light += std::exp(-0.3 * chord) / (parts * parts);
        }
        beam(row, column) = light;
      }
    blur(beam);
    for (int row = 0; row < size; ++row)
      for (int column = 0; column < size; ++column)
        drawn(column, row) = std::uint16_t(
            std::clamp(30000 * beam(row, column) + (is_blank ? 0 : 120 * random.normal()), 0.0, 65535.0));
    return drawn;
  }

  /// case.json, calibrator.json and the images.
  void write(const std::filesystem::path& folder) const {
    Json calibrator = {{"name", "drawn"}, {"balls", Json::array()}};
    const auto places = balls();
    for (std::size_t k = 0; k < places.size(); ++k)
      calibrator["balls"].push_back({{"label", fmt::format("G{}", k + 1)},
                                     {"xyz_mm", {places[k].x(), places[k].y(), places[k].z()}},
                                     {"diameter_mm", diameter_mm(k)}});
    const Json json = {{"format", "helicarm-case/1"},
                       {"calibrator", "calibrator.json"},
                       {"plate", nullptr},
                       {"views", {{{"name", "RUN"}, {"image", "run_{frame:03d}.png"}, {"frames", "all"}}}}};
    value_or_throw(write_file(folder / "calibrator.json", calibrator.dump()));
    value_or_throw(write_file(folder / "case.json", json.dump()));
    for (int i = 0; i < frames; ++i) {
      value_or_throw(write_file(folder / fmt::format("run_{:03d}.png", i + 1), image::encode_png(image(i))));
      value_or_throw(write_file(
          folder / fmt::format("run_{:03d}.json", i + 1),
          Json({{"pixel_mm", pixel_mm}, {"source_detector_mm", stated_source_detector_mm}}).dump()));
    }
  }
};

}  // namespace helicarm::sweep
