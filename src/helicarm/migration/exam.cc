// SPDX-License-Identifier: Apache-2.0
#include "helicarm/migration/exam.h"

#include <algorithm>
#include <set>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "helicarm/core/csv.h"
#include "helicarm/core/json.h"

namespace helicarm::migration {
namespace {

namespace fs = std::filesystem;
constexpr std::size_t most_markers = 200;

void add(Exam& exam, Marker marker) {
  if (marker.name.empty()) throw BadInput(Reason::bad_value, exam.name + ": a marker has no name");
  if (exam.find(marker.name))
    throw BadInput(Reason::name_clash, fmt::format("{}: \"{}\" is given twice", exam.name, marker.name));
  if (exam.markers.size() == most_markers)
    throw BadInput(Reason::bad_value, fmt::format("{}: more than {} markers", exam.name, most_markers));
  exam.markers.push_back(std::move(marker));
}

void put_into_segment(Exam& exam, const std::string& segment, const std::string& marker) {
  auto found = std::ranges::find(exam.segments, segment, &Segment::name);
  if (found == exam.segments.end()) {
    exam.segments.push_back({segment, {}});
    found = std::prev(exam.segments.end());
  }
  found->markers.push_back(marker);
}

Eigen::Vector3d place_in(const CsvTable& table, std::size_t row) {
  return {table.number(row, "x_mm"), table.number(row, "y_mm"), table.number(row, "z_mm")};
}

/// Of the row's standard deviations, which are all given or none.
std::optional<Eigen::Matrix3d> covariance_in(const CsvTable& table, std::size_t row, const Exam& exam) {
  const std::array<std::optional<double>, 3> sigma{table.optional_number(row, "sx_mm"),
                                                   table.optional_number(row, "sy_mm"),
                                                   table.optional_number(row, "sz_mm")};
  const auto stated = std::ranges::count_if(sigma, [](const auto& each) { return each.has_value(); });
  if (stated == 0) return std::nullopt;
  if (stated < 3)
    throw BadInput(Reason::bad_value, fmt::format("{}: row {}: sx_mm, sy_mm and sz_mm must be given together",
                                                  exam.name, row + 2));
  for (const auto& each : sigma)
    if (!(*each > 0))
      throw BadInput(Reason::bad_value, fmt::format("{}: row {}: a standard deviation of {} mm: it must be "
                                                    "greater than 0, or empty where it is not known",
                                                    exam.name, row + 2, *each));
  return Eigen::Vector3d(*sigma[0], *sigma[1], *sigma[2]).cwiseAbs2().asDiagonal().toDenseMatrix();
}

void read_points(const fs::path& path, Exam& exam) {
  const CsvTable table = value_or_throw(
      read_csv(path, {"name", "x_mm", "y_mm", "z_mm"}, {"sx_mm", "sy_mm", "sz_mm", "ray_gap_mm", "segment"}));
  for (std::size_t row = 0; row < table.rows(); ++row) {
    Marker marker{table.text(row, "name"), place_in(table, row), covariance_in(table, row, exam),
                  table.optional_number(row, "ray_gap_mm")};
    if (table.has("segment") && !table.text(row, "segment").empty())
      put_into_segment(exam, table.text(row, "segment"), marker.name);
    add(exam, std::move(marker));
  }
}

/// Of one frame; a place that no ray shows says nothing new about its marker.
void read_tracked(const fs::path& path, std::optional<int> frame, Exam& exam) {
  const CsvTable table = value_or_throw(
      read_csv(path, {"frame", "name", "x_mm", "y_mm", "z_mm", "sx_mm", "sy_mm", "sz_mm", "status"},
               {"ray_gap_mm", "views"}));
  std::set<int> frames;
  for (std::size_t row = 0; row < table.rows(); ++row) frames.insert(int(table.number(row, "frame")));
  if (!frame && frames.size() > 1)
    throw BadInput(Reason::bad_value, fmt::format("{}: has the frames {} to {}: name one by --frame",
                                                  exam.name, *frames.begin(), *frames.rbegin()));
  if (frame && !frames.contains(*frame))
    throw BadInput(Reason::bad_value, fmt::format("{}: has no frame {}", exam.name, *frame));
  for (std::size_t row = 0; row < table.rows(); ++row)
    if (table.text(row, "status") == "tracked" && (!frame || int(table.number(row, "frame")) == *frame))
      add(exam, {table.text(row, "name"), place_in(table, row), covariance_in(table, row, exam),
                 table.optional_number(row, "ray_gap_mm")});
}

void read_bodies(const fs::path& path, Exam& exam) {
  const Json json = value_or_throw(read_json(path));
  JsonReader reader(json, path.filename().string());
  for (JsonReader& body : reader.objects("bodies", false)) {
    const std::string name = body.text("name");
    for (JsonReader& marker : body.objects("markers", true))
      put_into_segment(exam, name, marker.text("name"));
  }
}

void read_result(const fs::path& path, Exam& exam) {
  constexpr Range numbers{-1e9, 1e9};
  const Json json = value_or_throw(read_json(path));
  JsonReader reader(json, path.filename().string());
  for (JsonReader& point : reader.objects("points", true)) {
    if (!point.has("xyz_mm")) continue;
    Marker marker{point.text("name"), Eigen::Vector3d(point.numbers("xyz_mm", 3, numbers).data()), {}, {}};
    if (point.has("covariance_mm2"))
      marker.covariance = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(
          point.matrix("covariance_mm2", 3, 3, numbers).data());
    marker.ray_gap_mm = point.optional_number("ray_gap_mm", {0, 1e9});
    add(exam, std::move(marker));
  }
}

/// Whether the table has a column `frame`, as markers.csv of `helicarm track`; its other columns are then the
/// unknown ones.
bool has_frames(const fs::path& path) {
  const auto table = read_csv(path, {"frame"}, {});
  return table || table.error().reason == Reason::unknown_key;
}

/// The file of an examination in a folder.
fs::path file_in(const fs::path& folder) {
  for (const char* name : {"markers.csv", "result.json"})
    if (fs::exists(folder / name)) return folder / name;
  throw BadInput(
      Reason::missing_file,
      fmt::format("{}: neither markers.csv of `helicarm track` nor result.json of `helicarm run`{}",
                  folder.filename().string(),
                  fs::exists(folder / "case.json") ? ": measure the case by `helicarm run` first" : ""));
}

}  // namespace

const Marker* Exam::find(const std::string& marker) const {
  const auto found = std::ranges::find(markers, marker, &Marker::name);
  return found == markers.end() ? nullptr : &*found;
}

Expected<Exam> read_exam(const fs::path& path, std::optional<int> frame) {
  return guarded([&] {
    std::error_code ignored;
    if (!fs::exists(path, ignored))
      throw BadInput(Reason::missing_file, path.string() + ": there is no such file or folder");
    const fs::path file = fs::is_directory(path, ignored) ? file_in(path) : path;
    Exam exam;
    exam.name = (path.filename().empty() ? path.parent_path() : path).filename().string();
    const bool is_result = file.extension() == ".json", is_tracked = !is_result && has_frames(file);
    if (frame && !is_tracked)
      throw BadInput(Reason::usage, fmt::format("{}: has no frames: --frame is for markers.csv of `helicarm "
                                                "track`",
                                                exam.name));
    if (is_result) {
      read_result(file, exam);
    } else if (is_tracked) {
      read_tracked(file, frame, exam);
      if (file.filename() == "markers.csv" && fs::exists(file.parent_path() / "track.json", ignored))
        read_bodies(file.parent_path() / "track.json", exam);
    } else {
      read_points(file, exam);
    }
    return exam;
  });
}

std::vector<Marker> markers_of(const Exam& exam, const Segment& segment) {
  std::vector<Marker> markers;
  for (const std::string& name : segment.markers)
    if (const Marker* marker = exam.find(name)) markers.push_back(*marker);
  return markers;
}

std::vector<Marker> candidates_for(const Exam& exam, const std::string& segment) {
  const auto named = std::ranges::find(exam.segments, segment, &Segment::name);
  return named == exam.segments.end() ? exam.markers : markers_of(exam, *named);
}

Expected<Segment> segment_of(std::string name, std::vector<std::string> markers) {
  if (name.empty() || markers.size() < 3 || std::ranges::any_of(markers, &std::string::empty))
    return fail(Reason::bad_value,
                fmt::format("segment: \"{}={}\" is not NAME=M1,M2,M3 with three markers or "
                            "more",
                            name, fmt::join(markers, ",")));
  return Segment{std::move(name), std::move(markers)};
}

Expected<Segment> segment_from(const std::string& text) {
  const std::size_t equals = text.find('=');
  std::vector<std::string> markers;
  if (equals != text.npos)
    for (std::size_t at = equals + 1, end; at <= text.size(); at = end + 1) {
      end = std::min(text.find(',', at), text.size());
      markers.push_back(text.substr(at, end - at));
    }
  return segment_of(text.substr(0, equals), std::move(markers));
}

}  // namespace helicarm::migration
