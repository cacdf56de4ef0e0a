// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "helicarm/exchange/import_formats.h"
#include "helicarm/exchange/run_geometry.h"
#include "helicarm/geometry/rotation.h"

namespace helicarm::exchange {
namespace {

constexpr Range any_number{-largest_number, largest_number}, positive{1e-9, largest_number};

std::size_t count_of(JsonReader& reader, const char* key) {
  const Json& list = reader.raw(key);
  if (!list.is_array() || list.empty() || list.size() > most_cameras)
    reader.refuse(Reason::bad_value, key, fmt::format("must be a list of 1 to {}", most_cameras));
  return list.size();
}

ImportedMatrix placed_camera(const PlacedDetector& detector, const Eigen::Vector2i& size,
                             const std::string& where) {
  const auto view = view_of_detector(detector, size);
  if (!view) throw BadInput(view.error().reason, fmt::format("{}: {}", where, view.error().message));
  return {*view, size, {}, true};
}

Eigen::Vector3d row_of(const std::vector<double>& numbers, std::size_t row) {
  return Eigen::Vector3d(numbers.data() + 3 * row);
}

Eigen::Matrix3d turned_about(double angle_rad, const Eigen::Vector3d& axis) {
  return Eigen::AngleAxisd(angle_rad, axis).toRotationMatrix();
}

Cameras from_leap(JsonReader reader) {
  const std::size_t count = count_of(reader, "sourcePositions");
  if (reader.integer("numAngles", 1, int(most_cameras)) != int(count))
    reader.refuse(Reason::bad_size, "numAngles", fmt::format("is not the number of sources, {}", count));
  const Eigen::Vector2i size(reader.integer("numCols", 1, largest_side_px),
                             reader.integer("numRows", 1, largest_side_px));
  const double width = reader.number("pixelWidth", positive), height = reader.number("pixelHeight", positive);
  const auto list = [&](const char* key) { return reader.matrix(key, count, 3, any_number); };
  const auto sources = list("sourcePositions"), centres = list("moduleCenters");
  const auto rows = list("rowVectors"), columns = list("colVectors");
  reader.finish();
  Cameras cameras;
  for (std::size_t i = 0; i < count; ++i) {
    const Eigen::Vector3d u = row_of(columns, i), v = row_of(rows, i);
    constexpr double rounding = 1e-4;
    if (std::abs(u.norm() - 1) > rounding || std::abs(v.norm() - 1) > rounding ||
        std::abs(u.dot(v)) > rounding)
      throw BadInput(
          Reason::bad_value,
          fmt::format("{}: rowVectors and colVectors {} must be unit vectors, perpendicular to each other",
                      reader.where(), i + 1));
    cameras.push_back(placed_camera({row_of(sources, i), row_of(centres, i), width * u, height * v}, size,
                                    fmt::format("{}: image {}", reader.where(), i + 1)));
  }
  return cameras;
}

/// As TIGRE's Siddon projector places source and detector.
Cameras from_tigre(JsonReader reader) {
  const std::size_t count = count_of(reader, "angles");
  reader.choice("mode", {"cone"});
  const auto pixels = reader.numbers("nDetector", 2, {1, largest_side_px});
  const auto pixel_mm = reader.numbers("dDetector", 2, positive);
  if (reader.number("COR", any_number) != 0)
    reader.refuse(Reason::unsupported, "COR", "must be 0: a shift of the centre of rotation is not read");
  const auto distances = [&](const char* key) { return reader.numbers(key, count, positive); };
  const auto source_mm = distances("DSO"), detector_mm = distances("DSD");
  const auto offsets = reader.matrix("offDetector", count, 2, any_number);
  const auto own_turns = reader.matrix("rotDetector", count, 3, any_number);
  const auto angles = reader.matrix("angles", count, 3, any_number);
  reader.finish();
  const Eigen::Vector2i size = image_size_from({pixels[1], pixels[0]}, reader.where() + ": nDetector");
  const Eigen::Vector3d x = Eigen::Vector3d::UnitX(), y = Eigen::Vector3d::UnitY(),
                        z = Eigen::Vector3d::UnitZ();
  Cameras cameras;
  for (std::size_t i = 0; i < count; ++i) {
    const Eigen::Vector3d own = row_of(own_turns, i), angle = row_of(angles, i);
    const Eigen::Matrix3d run =
        turned_about(angle[0], z) * turned_about(angle[1], y) * turned_about(angle[2], z);
    const Eigen::Matrix3d detector =
        run * turned_about(own[0], z) * turned_about(own[1], y) * turned_about(own[2], x);
    const Eigen::Vector3d centre(source_mm[i] - detector_mm[i], offsets[2 * i + 1], offsets[2 * i]);
    cameras.push_back(placed_camera({run * (source_mm[i] * x), run * centre, pixel_mm[1] * detector.col(1),
                                     -pixel_mm[0] * detector.col(2)},
                                    size, fmt::format("{}: image {}", reader.where(), i + 1)));
  }
  return cameras;
}

geometry::RigidTransform rigid_4x4(JsonReader& reader, const char* key) {
  const auto numbers = reader.matrix(key, 4, 4, any_number);
  return value_or_throw(geometry::rigid_transform_from(
      Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(numbers.data()),
      fmt::format("{}: {}", reader.where(), key)));
}

/// The inverse of `diffdrr_cameras`.
ImportedMatrix from_diffdrr(JsonReader& reader) {
  const std::string name = reader.optional_text("name").value_or("");
  const double sdd = reader.number("sdd", positive);
  const Eigen::Vector2i size(reader.integer("width", 1, largest_side_px),
                             reader.integer("height", 1, largest_side_px));
  const double delx = reader.number("delx", positive), dely = reader.number("dely", positive);
  const double column = size.x() / 2.0 - reader.number("x0", any_number) / delx;
  const double row = size.y() / 2.0 - reader.number("y0", any_number) / dely;
  if (!reader.has("reverse_x_axis")) reader.refuse(Reason::truncated, "reverse_x_axis", "is missing");
  const bool against_x = reader.boolean("reverse_x_axis", true);
  geometry::RigidTransform camera_from_world = rigid_4x4(reader, "pose").inverse();
  reader.finish();
  const Eigen::DiagonalMatrix<double, 3> turned(-1, -1, 1);
  camera_from_world.rotation = turned * camera_from_world.rotation;
  camera_from_world.translation = turned * camera_from_world.translation;
  const geometry::Intrinsics k{against_x ? sdd / delx : -sdd / delx, sdd / dely,
                               against_x ? size.x() - column - 0.5 : column - 0.5, size.y() - row - 0.5, 0};
  return {{k, camera_from_world}, size, {}, true, name};
}

ImportedMatrix from_deepdrr(JsonReader& reader) {
  const std::string name = reader.optional_text("name").value_or("");
  const auto k = reader.matrix("intrinsic", 3, 3, any_number);
  const geometry::RigidTransform pose = rigid_4x4(reader, "extrinsic");
  const Eigen::Vector2i size(reader.integer("sensor_width", 1, largest_side_px),
                             reader.integer("sensor_height", 1, largest_side_px));
  reader.finish();
  const Eigen::Matrix<double, 3, 3, Eigen::RowMajor> r = pose.rotation;
  const Eigen::Vector3d& t = pose.translation;
  return {camera_of(k, {r.data(), r.data() + r.size()}, {t.x(), t.y(), t.z()}, reader.where()),
          size,
          {},
          true,
          name};
}

Cameras each_of(JsonReader reader, const char* key, ImportedMatrix (*read)(JsonReader&)) {
  Cameras cameras;
  for (JsonReader& camera : reader.objects(key, true, most_cameras)) cameras.push_back(read(camera));
  reader.finish();
  if (cameras.empty()) reader.refuse(Reason::truncated, key, "holds no camera");
  return cameras;
}

}  // namespace

bool is_run_geometry(const Json& json) {
  if (!json.is_object()) return false;
  for (const char* key : {"diffdrr", "deepdrr", "sourcePositions", "DSD"})
    if (json.contains(key)) return true;
  return false;
}

Cameras cameras_of_run(const Json& json, const std::string& origin) {
  const JsonReader reader(json, origin);
  if (json.contains("diffdrr")) return each_of(reader, "diffdrr", from_diffdrr);
  if (json.contains("deepdrr")) return each_of(reader, "deepdrr", from_deepdrr);
  return json.contains("DSD") ? from_tigre(reader) : from_leap(reader);
}

Cameras cameras_of_astra(const std::vector<std::vector<double>>& rows, const std::string& origin,
                         const ImportOptions& options) {
  if (!options.image_size)
    throw BadInput(Reason::usage, fmt::format("{}: ASTRA's vectors are about the detector's middle: give the "
                                              "image's size (--image-size)",
                                              origin));
  Cameras cameras;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const auto at = [&](std::size_t k) { return row_of(rows[i], k); };
    cameras.push_back(placed_camera({at(0), at(1), at(2), at(3)}, *options.image_size,
                                    fmt::format("{}: row {}", origin, i + 1)));
    cameras.back().in_mm = false;
  }
  return cameras;
}

}  // namespace helicarm::exchange
