// SPDX-License-Identifier: Apache-2.0
#include "helicarm/exchange/import_matrix.h"

#include <algorithm>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/core/json.h"
#include "helicarm/core/text.h"
#include "helicarm/exchange/import_formats.h"
#include "helicarm/exchange/run_geometry.h"

namespace helicarm::exchange {
namespace {

constexpr std::uintmax_t max_bytes = 256u << 20;  // an NRRD file includes its pixels

ImportedMatrix parse_nrrd(const std::string& text, const std::string& origin, const ImportOptions& options) {
  std::istringstream lines(text);
  std::optional<ImportedMatrix> result;
  std::optional<Eigen::Vector2i> size;
  constexpr std::string_view matrix_key = "Projection Matrix:=", size_key = "sizes:";
  const auto refuse_second = [&](bool is_there, const char* name) {
    if (is_there) throw BadInput(Reason::bad_value, fmt::format("{}: \"{}\" is given twice", origin, name));
  };
  for (std::string line; std::getline(lines, line) && !trimmed(line).empty();) {
    const std::string_view view = line;
    const std::string name = line.substr(0, line.find(':'));
    if (key_word(name).find("distortion") != std::string::npos &&
        view.substr(name.size()).starts_with(":=")) {
      const std::string where = fmt::format("{}: {}", origin, name);
      refuse_lens_distortion(numbers_in(view.substr(name.size() + 2), where), where, options);
    }
    if (view.starts_with(matrix_key)) {
      refuse_second(result.has_value(), "Projection Matrix");
      result = imported(numbers_in(view.substr(matrix_key.size()), origin + ": Projection Matrix"), origin);
    }
    if (view.starts_with(size_key)) {
      refuse_second(size.has_value(), "sizes");
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

/// What `helicarm import --json` prints.
ImportedMatrix camera_from(JsonReader& reader, const std::string& origin) {
  const auto k = reader.matrix("K", 3, 3, {-largest_number, largest_number});
  const auto r = reader.matrix("R", 3, 3, {-largest_number, largest_number});
  const auto t = reader.numbers("t", 3, {-largest_number, largest_number});
  reader.raw("warnings");
  const ImportedMatrix camera{camera_of(k, r, t, origin), std::nullopt, {}, true};
  const geometry::View stated_view =
      imported(reader.matrix("projection", 3, 4, {-largest_number, largest_number}), origin).view;
  const geometry::Projection own = camera.view.projection(), stated = stated_view.projection();
  constexpr double rounding = 1e-4;
  if (std::min((own - stated).norm(), (own + stated).norm()) > rounding * own.norm())
    throw BadInput(Reason::bad_value,
                   fmt::format("{}: \"projection\" is not that of \"K\", \"R\" and \"t\"", origin));
  return camera;
}

/// The first three rows; a rigid 4x4 matrix is no camera.
ImportedMatrix from_4x4(std::vector<double> numbers, const std::string& origin) {
  if (numbers[12] != 0 || numbers[13] != 0 || numbers[14] != 0 || numbers[15] != 1)
    throw BadInput(Reason::bad_value,
                   fmt::format("{}: the last row of a 4x4 matrix must be 0 0 0 1", origin));
  numbers.resize(12);
  ImportedMatrix camera = imported(numbers, origin);
  constexpr double least_focal_px = 20;
  const double focal = std::min(std::abs(camera.view.intrinsics.fx), std::abs(camera.view.intrinsics.fy));
  if (focal < least_focal_px)
    throw BadInput(
        Reason::unsupported,
        fmt::format("{}: a 4x4 matrix that is no projection (focal length {:.3g} px, at least {:g}): it "
                    "has no camera; of a pose, give K, R and t",
                    origin, focal, least_focal_px));
  return camera;
}

Cameras cameras_of_json(Json json, const std::string& origin, const ImportOptions& options);

/// What `helicarm import --json` prints of several cameras.
Cameras cameras_of_list(const Json& list, const std::string& origin, const ImportOptions& options) {
  if (!list.is_array() || list.empty() || list.size() > most_cameras)
    throw BadInput(Reason::bad_value,
                   fmt::format("{}: cameras: must be a list of 1 to {}", origin, most_cameras));
  Cameras cameras;
  for (std::size_t i = 0; i < list.size(); ++i) {
    const std::string where = fmt::format("{}: cameras[{}]", origin, i);
    Json camera = list[i];
    std::string name;
    if (camera.is_object() && camera.contains("name")) {
      name = JsonReader(camera, where).text("name");
      camera.erase("name");
    }
    if (!camera.is_object() || camera.contains("cameras"))
      throw BadInput(Reason::bad_value, fmt::format("{}: must be an object of one camera", where));
    for (ImportedMatrix& each : cameras_of_json(std::move(camera), where, options)) {
      each.name = name;
      cameras.push_back(std::move(each));
    }
  }
  return cameras;
}

Cameras cameras_of_json(Json json, const std::string& origin, const ImportOptions& options) {
  if (is_run_geometry(json)) return cameras_of_run(json, origin);
  if (json.is_object() && json.size() == 1 && json.contains("cameras"))
    return cameras_of_list(json["cameras"], origin, options);
  if (json.is_array()) json = Json{{"projection", std::move(json)}};
  if (!json.contains("projection") && holds_camera(json)) return camera_of_keys(json, origin, options);
  if (!json.contains("projection") && json.size() == 1 && json.front().is_array() && json.front().size() == 4)
    json = Json{{"projection", Json(json.front())}};
  JsonReader reader(json, origin);
  const bool has_4_rows = json["projection"].is_array() && json["projection"].size() == 4;
  const auto projection = [&] {
    return reader.matrix("projection", has_4_rows ? 4 : 3, 4, {-largest_number, largest_number});
  };
  ImportedMatrix result = reader.has("K") ? camera_from(reader, origin)
                          : has_4_rows    ? from_4x4(projection(), origin)
                                          : imported(projection(), origin);
  if (reader.has("image_size"))
    result.image_size = image_size_from(reader.numbers("image_size", 2, {1, largest_side_px}), origin);
  reader.raw("image_size");
  reader.finish();
  return {result};
}

/// L1 to L11 of one camera (XMALab's MergedDlts).
Cameras from_dlt(const std::vector<std::vector<double>>& rows, const std::string& origin,
                 const ImportOptions& options) {
  const std::size_t count = rows.front().size();
  for (const auto& row : rows)
    if (row.size() != count)
      throw BadInput(Reason::bad_size,
                     fmt::format("{}: the rows of DLT coefficients differ in length", origin));
  if (!options.image_size)
    throw BadInput(Reason::usage,
                   fmt::format("{}: DLT coefficients of {} camera(s): give the image's size, whose rows they "
                               "count upwards from 1 (--image-size)",
                               origin, count));
  Cameras cameras;
  for (std::size_t column = 0; column < count; ++column) {
    if (options.column && std::size_t(*options.column) != column + 1) {
      cameras.emplace_back();  // not chosen: another camera's coefficients may be empty
      continue;
    }
    Eigen::Matrix<double, 12, 1> l;
    for (std::size_t i = 0; i < rows.size(); ++i) l[Eigen::Index(i)] = rows[i][column];
    l[11] = 1;
    const Eigen::Matrix<double, 3, 4, Eigen::RowMajor> projection =
        xmalab_from_pixels(options.image_size->y()).inverse() *
        Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>>(l.data());
    cameras.push_back(imported({projection.data(), projection.data() + projection.size()}, origin));
  }
  return cameras;
}

/// Rows of 12 numbers are flattened matrices (.ompl has them in brackets) or ASTRA's vectors.
Cameras from_rows_of_12(const std::vector<std::vector<double>>& rows, bool in_brackets, bool says_astra,
                        const std::string& origin, const ImportOptions& options) {
  const std::optional<RowKind> stated = says_astra    ? std::optional(RowKind::astra)
                                        : in_brackets ? std::optional(RowKind::matrix)
                                                      : std::nullopt;
  if (stated && options.rows && *stated != *options.rows)
    throw BadInput(Reason::bad_value,
                   fmt::format("{}: its rows are {}, --rows states otherwise", origin,
                               says_astra ? "ASTRA's vectors by its comment" : "matrices by their brackets"));
  const std::optional<RowKind> kind = stated ? stated : options.rows;
  if (!kind && rows.size() > 1)
    throw BadInput(
        Reason::usage,
        fmt::format("{}: {} rows of 12 numbers, which may be matrices or ASTRA's vectors: state it "
                    "(--rows matrix or astra)",
                    origin, rows.size()));
  if (kind == RowKind::astra) return cameras_of_astra(rows, origin, options);
  Cameras cameras;
  for (const auto& row : rows) cameras.push_back(imported(row, origin));
  return cameras;
}

/// "3532,97 0;" separates by blanks or semicolons and writes the decimal point as a comma.
bool has_decimal_commas(std::string_view text) {
  const auto is_digit = [](char c) { return c >= '0' && c <= '9'; };
  const bool other_separators = text.find_first_of("; \t") != text.npos;
  for (std::size_t at = text.find(','); at != text.npos; at = text.find(',', at + 1))
    if (at == 0 || at + 1 == text.size() || !is_digit(text[at - 1]) || !is_digit(text[at + 1])) return false;
  return other_separators && text.find(',') != text.npos;
}

Cameras parse_text_matrix(const std::string& text, const std::string& origin, const ImportOptions& options) {
  constexpr std::size_t dlt_rows = 11;
  std::istringstream lines(text);
  std::vector<std::vector<double>> rows;
  bool says_astra = false;
  for (std::string line; rows.size() <= most_cameras && std::getline(lines, line);) {
    says_astra = says_astra || (line.starts_with('#') && line.find("cone_vec") != line.npos);
    if (line.starts_with('#')) continue;
    if (has_decimal_commas(trimmed(line)))
      throw BadInput(Reason::bad_value,
                     fmt::format("{}: \"{}\": numbers with a decimal comma: write them with a point", origin,
                                 without_control_characters(std::string(trimmed(line).substr(0, 40)))));
    if (auto row = numbers_in(line, origin); !row.empty()) rows.push_back(std::move(row));
  }
  const auto all_have = [&](std::size_t count) {
    return std::ranges::all_of(rows, [&](const auto& row) { return row.size() == count; });
  };
  if (rows.size() > most_cameras)
    throw BadInput(Reason::bad_size, fmt::format("{}: more than {} rows", origin, most_cameras));
  const bool in_brackets = text.find('[') != text.npos;
  const bool may_be_dlt = rows.size() == dlt_rows && !options.rows && !in_brackets && !says_astra;
  if (!rows.empty() && all_have(12) && !may_be_dlt)
    return from_rows_of_12(rows, in_brackets, says_astra, origin, options);
  if (rows.size() == dlt_rows) return from_dlt(rows, origin, options);
  if (rows.size() == 5 && all_have(3)) return {from_maya_cam_1(rows, origin, options)};
  std::vector<double> numbers;
  for (const auto& row : rows) {
    if (row.size() != 4)
      throw BadInput(Reason::bad_size,
                     fmt::format("{}: a row of {} numbers, a 3x4 matrix has rows of 4", origin, row.size()));
    numbers.insert(numbers.end(), row.begin(), row.end());
  }
  return {rows.size() == 4 ? from_4x4(std::move(numbers), origin) : imported(numbers, origin)};
}

Cameras parse(const std::string& text, const std::string& origin, const ImportOptions& options) {
  const auto first = text.find_first_not_of(" \t\r\n");
  if (first == std::string::npos) throw BadInput(Reason::truncated, fmt::format("{}: is empty", origin));
  if (text.starts_with("NRRD")) return {parse_nrrd(text, origin, options)};
  if (is_numpy_array(text)) return parse_numpy_array(text, origin);
  refuse_other_formats(text, origin);
  const std::string_view content = std::string_view(text).substr(first);
  const auto second = content.find_first_not_of(" \t\r\n", 1);
  if (content[0] == '{' || (content[0] == '[' && second != content.npos && content[second] == '['))
    return cameras_of_json(value_or_throw(parse_json(text, origin)), origin, options);
  if (is_rtk_geometry(text)) return parse_rtk_geometry(text, origin, options);
  if (is_opencv_file(text)) return parse_opencv_camera(text, origin, options);
  if (text.find("camera matrix") != std::string::npos) return {parse_maya_cam(text, origin, options)};
  if (is_plastimatch_matrix(text)) return {parse_plastimatch_matrix(text, origin)};
  if (is_matrix_table(text)) return parse_matrix_table(text, origin);
  return parse_text_matrix(text, origin, options);
}

/// The translation in mm. A file without a unit is in mm, unless the source would lie too near.
void to_mm(ImportedMatrix& camera, std::optional<double> mm_per_unit, const std::string& origin) {
  if (camera.in_mm && mm_per_unit.value_or(1) != 1)
    throw BadInput(
        Reason::bad_value,
        fmt::format("{}: its lengths are in mm, --unit states {:g} mm: leave it out", origin, *mm_per_unit));
  camera.view.camera_from_world.translation *= mm_per_unit.value_or(1);
  if (!camera.view.camera_from_world.translation.allFinite())
    throw BadInput(Reason::not_finite, fmt::format("{}: the translation is not finite in mm", origin));
  if (mm_per_unit || camera.in_mm) return;
  const double distance = camera.view.source_in_world().norm();
  value_or_throw(check_source_distance(
      distance, "the world's origin", origin,
      fmt::format("no unit of length is stated: state it, helicarm import --unit cm ({:.4g} mm), m or mm, "
                  "and use its output",
                  10 * distance)));
}

/// What is unusual in a camera that can be right.
void add_warnings(ImportedMatrix& camera, const std::string& origin) {
  const geometry::Intrinsics& k = camera.view.intrinsics;
  if (const auto flipped = mirrored_or_upwards(k)) {
    camera.warnings.push_back(*flipped);
    camera.warnings.back().message.insert(0, origin + ": ");
  }
  const auto& size = camera.image_size;
  if (size && !(k.u0 > 0 && k.v0 > 0 && k.u0 < size->x() && k.v0 < size->y()))
    camera.warnings.push_back(
        {Reason::intrinsics_inconsistent,
         fmt::format(
             "{}: the central ray ({:.0f}, {:.0f}) lies outside the image of {} x {}: check the image size",
             origin, k.u0, k.v0, size->x(), size->y()),
         {},
         {{"u0_px", k.u0}, {"v0_px", k.v0}}});
}

/// The size, the rows' direction, mm and the warnings.
void complete(ImportedMatrix& camera, const ImportOptions& options, const std::string& origin) {
  const auto &option = options.image_size, &stated = camera.image_size;
  if (option && stated && *option != *stated)
    throw BadInput(Reason::bad_size, fmt::format("{}: is for images of {} x {}, --image-size states {} x {}",
                                                 origin, stated->x(), stated->y(), option->x(), option->y()));
  if (option) camera.image_size = option;
  if (options.rows_upwards) {
    if (!camera.image_size)
      throw BadInput(Reason::usage,
                     fmt::format("{}: rows that run upwards need the image's size (--image-size)", origin));
    camera.view = with_rows_reversed(camera.view, camera.image_size->y());
  }
  to_mm(camera, options.mm_per_unit, origin);
  add_warnings(camera, origin);
}

Cameras chosen(Cameras cameras, std::optional<int> column, const std::string& origin) {
  if (!column) return cameras;
  if (*column < 1 || std::size_t(*column) > cameras.size())
    throw BadInput(Reason::bad_value,
                   fmt::format("{}: column {}, must be 1 to {}", origin, *column, cameras.size()));
  return {std::move(cameras[std::size_t(*column) - 1])};
}

Cameras cameras_of_file(const std::filesystem::path& path, const ImportOptions& options) {
  const std::string text = value_or_throw(read_file(path, max_bytes)), origin = path.filename().string();
  Cameras cameras = chosen(parse(without_byte_order_mark(text), origin, options), options.column, origin);
  for (ImportedMatrix& camera : cameras) complete(camera, options, origin);
  return cameras;
}

/// A file for each camera, as plastimatch has them.
Cameras cameras_of_folder(const std::filesystem::path& folder, const ImportOptions& options) {
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    if (entry.is_regular_file() && !entry.path().filename().string().starts_with('.'))
      files.push_back(entry.path());
  std::ranges::sort(files);
  if (files.empty() || files.size() > most_cameras)
    throw BadInput(Reason::bad_size, fmt::format("{}: holds {} files, must be 1 to {}, one for each camera",
                                                 folder.string(), files.size(), most_cameras));
  ImportOptions each = options;
  each.column.reset();
  Cameras cameras;
  for (const auto& file : files) {
    Cameras of_file = cameras_of_file(file, each);
    if (of_file.size() != 1)
      throw BadInput(Reason::unsupported,
                     fmt::format("{}: holds {} cameras; in a folder each file holds one: name this file",
                                 file.string(), of_file.size()));
    of_file.front().name = file.stem().string();
    cameras.push_back(std::move(of_file.front()));
  }
  return chosen(std::move(cameras), options.column, folder.string());
}

}  // namespace

Expected<void> check_source_distance(double distance_mm, const std::string& from, const std::string& origin,
                                     const std::string& advice) {
  constexpr double least_mm = 200;
  if (distance_mm >= least_mm) return {};
  return tl::unexpected<Failure>(
      {Reason::usage,
       fmt::format("{}: in mm the source lies {:.3g} mm from {} (at least {:g} mm are taken for granted): {}",
                   origin, distance_mm, from, least_mm, advice),
       {},
       {{"distance_mm", distance_mm}, {"limit", least_mm}}});
}

Eigen::Matrix3d xmalab_from_pixels(int image_height) {
  Eigen::Matrix3d pixels;
  pixels << 1, 0, 1, 0, -1, image_height, 0, 0, 1;
  return pixels;
}

std::optional<Warning> mirrored_or_upwards(const geometry::Intrinsics& k) {
  if (k.fx * k.fy >= 0) return std::nullopt;
  return Warning{
      Reason::ambiguous_handedness,
      fmt::format("fx {:.4g} and fy {:.4g} px have different signs: the image is mirrored, or its v "
                  "points upwards; v points downwards here (height - 1 - v: import --rows-upwards)",
                  k.fx, k.fy),
      {},
      {{"fx_px", k.fx}, {"fy_px", k.fy}}};
}

Expected<std::vector<ImportedMatrix>> import_cameras(const std::filesystem::path& path,
                                                     const ImportOptions& options) {
  return guarded([&] {
    return std::filesystem::is_directory(path) ? cameras_of_folder(path, options)
                                               : cameras_of_file(path, options);
  });
}

Expected<ImportedMatrix> import_matrix(const std::filesystem::path& path, const ImportOptions& options) {
  return import_cameras(path, options).and_then([&](Cameras cameras) -> Expected<ImportedMatrix> {
    if (cameras.size() == 1) return std::move(cameras.front());
    return fail(Reason::usage, fmt::format("{}: {} cameras: choose one (helicarm import --column)",
                                           path.filename().string(), cameras.size()));
  });
}

}  // namespace helicarm::exchange
