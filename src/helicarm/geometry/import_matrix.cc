// SPDX-License-Identifier: Apache-2.0
#include "helicarm/geometry/import_matrix.h"

#include <algorithm>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/core/json.h"
#include "helicarm/geometry/import_formats.h"
#include "helicarm/geometry/rotation.h"

namespace helicarm::geometry {
namespace {

constexpr std::uintmax_t max_bytes = 256u << 20;  // an NRRD file includes its pixels
constexpr double largest_number = 1e12;

/// Numbers after a section's title, up to the next title.
std::vector<double> section(const std::string& text, const std::string& title, std::size_t count,
                            const std::string& origin) {
  std::istringstream lines(text);
  std::string line;
  while (std::getline(lines, line) && trimmed(line) != title) continue;
  const std::string where = fmt::format("{}: {}", origin, title);
  std::vector<double> numbers;
  while (numbers.size() < count && std::getline(lines, line)) {
    const auto more = numbers_in(line, where);
    numbers.insert(numbers.end(), more.begin(), more.end());
  }
  if (numbers.size() < count)
    throw BadInput(Reason::truncated,
                   fmt::format("{}: {} numbers, must be {}", where, numbers.size(), count));
  if (numbers.size() > count)
    throw BadInput(Reason::bad_value, fmt::format("{}: a line has too many numbers", where));
  return numbers;
}

std::string without_line_ends(std::string text) {
  std::ranges::replace(text, '\n', ' ');
  return text;
}

/// XMALab's lens model is OpenCV's, beside K.
void check_undistorted(const std::string& text, const std::string& origin, const ImportOptions& options) {
  const auto at = text.find("undistortion");
  if (at == std::string::npos) return;
  const std::string where = origin + ": undistortion";
  refuse_lens_distortion(
      numbers_in(without_line_ends(text.substr(at + std::string_view("undistortion").size())), where), where,
      options);
}

ImportedMatrix parse_maya_cam(const std::string& text, const std::string& origin,
                              const ImportOptions& options) {
  check_undistorted(text, origin, options);
  ImportedMatrix result{
      camera_of(section(text, "camera matrix", 9, origin), section(text, "rotation", 9, origin),
                section(text, "translation", 3, origin), origin),
      std::nullopt};
  result.image_size = image_size_from(section(text, "image size", 2, origin), origin);
  return result;
}

ImportedMatrix parse_nrrd(const std::string& text, const std::string& origin) {
  std::istringstream lines(text);
  std::optional<ImportedMatrix> result;
  std::optional<Eigen::Vector2i> size;
  constexpr std::string_view matrix_key = "Projection Matrix:=", size_key = "sizes:";
  for (std::string line; std::getline(lines, line) && !trimmed(line).empty();) {
    const std::string_view view = line;
    if (view.starts_with(matrix_key))
      result = imported(numbers_in(view.substr(matrix_key.size()), origin + ": Projection Matrix"), origin);
    if (view.starts_with(size_key)) {
      auto sizes = numbers_in(view.substr(size_key.size()), origin + ": sizes");
      sizes.resize(std::min<std::size_t>(sizes.size(), 2));
      size = image_size_from(sizes, origin + ": sizes");
    }
  }
  if (!result)
    throw BadInput(Reason::unsupported, fmt::format("{}: the header has no \"Projection Matrix\"", origin));
  result->image_size = size;
  return *result;
}

/// "K", "R", "t" as `helicarm import --json` prints them.
ImportedMatrix camera_from(JsonReader& reader, const std::string& origin) {
  using RowMajor3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
  const auto square = [&](const char* key) -> Eigen::Matrix3d {
    return Eigen::Map<const RowMajor3>(reader.matrix(key, 3, 3, {-largest_number, largest_number}).data());
  };
  const Eigen::Matrix3d k = square("K");
  Eigen::Matrix4d pose = Eigen::Matrix4d::Identity();
  pose.topLeftCorner<3, 3>() = square("R");
  pose.topRightCorner<3, 1>() =
      Eigen::Vector3d(reader.numbers("t", 3, {-largest_number, largest_number}).data());
  if (k.row(2) != Eigen::RowVector3d(0, 0, 1) || k(1, 0) != 0 || k(0, 0) == 0 || k(1, 1) == 0)
    throw BadInput(Reason::bad_value,
                   fmt::format("{}: \"K\" is not an upper triangle that ends in 1", origin));
  reader.raw("projection");
  return {{{k(0, 0), k(1, 1), k(0, 2), k(1, 2), k(0, 1)},
           value_or_throw(rigid_transform_from(pose, origin + ": \"R\""))},
          std::nullopt};
}

ImportedMatrix parse_json_matrix(const std::string& text, const std::string& origin) {
  Json json = value_or_throw(parse_json(text, origin));
  if (json.is_array()) json = Json{{"projection", std::move(json)}};
  JsonReader reader(json, origin);
  ImportedMatrix result =
      reader.has("K")
          ? camera_from(reader, origin)
          : imported(reader.matrix("projection", 3, 4, {-largest_number, largest_number}), origin);
  if (reader.has("image_size"))
    result.image_size = image_size_from(reader.numbers("image_size", 2, {1, largest_side_px}), origin);
  reader.raw("image_size");
  reader.finish();
  return result;
}

/// L1 to L11 of one camera (XMALab's MergedDlts).
ImportedMatrix from_dlt(const std::vector<std::vector<double>>& rows, const std::string& origin,
                        const ImportOptions& options) {
  const std::size_t cameras = rows.front().size();
  for (const auto& row : rows)
    if (row.size() != cameras)
      throw BadInput(Reason::bad_size,
                     fmt::format("{}: the rows of DLT coefficients differ in length", origin));
  if (!options.image_size || (cameras > 1 && !options.column))
    throw BadInput(
        Reason::usage,
        fmt::format("{}: DLT coefficients of {} camera(s): give the image's size, whose rows they count "
                    "upwards from 1{}",
                    origin, cameras, cameras > 1 ? ", and the column" : ""));
  const int column = options.column.value_or(1);
  if (column < 1 || std::size_t(column) > cameras)
    throw BadInput(Reason::bad_value, fmt::format("{}: column {}, must be 1 to {}", origin, column, cameras));
  Eigen::Matrix<double, 12, 1> l;
  for (std::size_t i = 0; i < rows.size(); ++i) l[Eigen::Index(i)] = rows[i][std::size_t(column) - 1];
  l[11] = 1;
  const Eigen::Matrix<double, 3, 4, Eigen::RowMajor> projection =
      xmalab_from_pixels(options.image_size->y()).inverse() *
      Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>>(l.data());
  ImportedMatrix result = imported({projection.data(), projection.data() + projection.size()}, origin);
  result.image_size = options.image_size;
  return result;
}

ImportedMatrix parse_text_matrix(const std::string& text, const std::string& origin,
                                 const ImportOptions& options) {
  constexpr std::size_t dlt_rows = 11, most_rows = 12;
  std::istringstream lines(text);
  std::vector<std::vector<double>> rows;
  for (std::string line; rows.size() <= most_rows && std::getline(lines, line);)
    if (!line.starts_with('#'))
      if (auto row = numbers_in(line, origin); !row.empty()) rows.push_back(std::move(row));
  if (rows.size() == dlt_rows) return from_dlt(rows, origin, options);
  std::vector<double> numbers;
  for (const auto& row : rows) {
    if (row.size() != 4 && row.size() != 12)
      throw BadInput(Reason::bad_size,
                     fmt::format("{}: a row of {} numbers, a 3x4 matrix has rows of 4", origin, row.size()));
    numbers.insert(numbers.end(), row.begin(), row.end());
  }
  return imported(numbers, origin);
}

/// Names what is not read, where the beginning of the text tells.
void refuse_other_formats(const std::string& text, const std::string& origin) {
  constexpr std::pair<std::string_view, std::string_view> formats[] = {
      {"#Insight Transform File", "an ITK transform, which has no projection"},
      {"\x89HDF", "an HDF5 file, which has no projection"},
      {"%YAML", "a YAML file that OpenCV did not write"},
      {"<?xml", "an XML file of neither RTK nor OpenCV"}};
  const std::string_view beginning = std::string_view(text).substr(0, 1000);
  for (const auto& [mark, name] : formats)
    if (beginning.find(mark) != beginning.npos)
      throw BadInput(Reason::unsupported, fmt::format("{}: is {}", origin, name));
}

ImportedMatrix parse(const std::string& text, const std::string& origin, const ImportOptions& options) {
  const auto first = text.find_first_not_of(" \t\r\n");
  if (first == std::string::npos) throw BadInput(Reason::truncated, fmt::format("{}: is empty", origin));
  if (text.starts_with("NRRD")) return parse_nrrd(text, origin);
  if (is_rtk_geometry(text)) return parse_rtk_geometry(text, origin, options);
  if (is_opencv_file(text)) return parse_opencv_camera(text, origin, options);
  refuse_other_formats(text, origin);
  if (text.find('\0') != std::string::npos)
    throw BadInput(Reason::unsupported,
                   fmt::format("{}: neither MayaCam 2, NRRD, RTK, OpenCV, JSON nor a text matrix", origin));
  if (text.find("camera matrix") != std::string::npos) return parse_maya_cam(text, origin, options);
  if (text[first] == '{' || text.substr(first).starts_with("[[")) return parse_json_matrix(text, origin);
  return parse_text_matrix(text, origin, options);
}

}  // namespace

Eigen::Matrix3d xmalab_from_pixels(int image_height) {
  Eigen::Matrix3d pixels;
  pixels << 1, 0, 1, 0, -1, image_height, 0, 0, 1;
  return pixels;
}

Expected<ImportedMatrix> import_matrix(const std::filesystem::path& path, const ImportOptions& options) {
  const auto text = read_file(path, max_bytes);
  if (!text) return tl::unexpected<Failure>(text.error());
  return guarded([&] {
    ImportedMatrix result = parse(*text, path.filename().string(), options);
    result.view.camera_from_world.translation *= options.mm_per_unit;
    if (!result.view.camera_from_world.translation.allFinite())
      throw BadInput(Reason::not_finite,
                     fmt::format("{}: the translation is not finite in mm", path.filename().string()));
    return result;
  });
}

}  // namespace helicarm::geometry
