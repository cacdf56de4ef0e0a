// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/plan.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "helicarm/case_registration/fcsv.h"
#include "helicarm/core/csv.h"
#include "helicarm/core/files.h"
#include "helicarm/core/json.h"
#include "helicarm/core/text.h"
#include "helicarm/volume/declared.h"

namespace helicarm::case_registration {
namespace {

using Eigen::Vector3d;

constexpr std::size_t most_points = 10000;
constexpr double farthest_mm = 10000;
constexpr std::uintmax_t most_plan_bytes = 64u << 20;

void check_place(const PlanPoint& point, const std::string& where) {
  if (const Vector3d& at = point.in_model; !(at.cwiseAbs().maxCoeff() <= farthest_mm))
    throw BadInput(Reason::bad_value,
                   fmt::format("{}: \"{}\" at ({:g}, {:g}, {:g}) mm, must lie within {:g} mm", where,
                               point.name, at.x(), at.y(), at.z(), farthest_mm));
}

/// Slicer's files hold many display settings: only what is used is read, and other keys are allowed.
class Markup {
 public:
  Markup(const Json& json, std::string where) : json_(json), where_(std::move(where)) {}

  std::string text(const char* key, const std::string& fallback) const {
    if (!json_.is_object() || !json_.contains(key)) return fallback;
    if (!json_[key].is_string()) refuse(fmt::format("\"{}\" is not a text", key));
    return without_control_characters(json_[key].get<std::string>()).substr(0, 100);
  }

  std::vector<PlanPoint> points() const {
    std::vector<PlanPoint> points;
    if (!json_.is_object() || !json_.contains("controlPoints")) return points;
    const Vector3d to_lps =
        lps_from() * volume::declared_unit(text("coordinateUnits", "mm"), where_ + ": coordinateUnits");
    if (!json_["controlPoints"].is_array()) refuse("\"controlPoints\" is not a list");
    for (const Json& entry : json_["controlPoints"]) {
      const Markup point(entry, where_ + ": controlPoints");
      if (point.text("positionStatus", "defined") != "defined") continue;
      points.push_back({point.text("label", ""), point.position().cwiseProduct(to_lps)});
      check_place(points.back(), where_);
    }
    return points;
  }

 private:
  /// Signs of the axes. Slicer writes names, older versions of it numbers.
  Vector3d lps_from() const {
    if (!json_.contains("coordinateSystem")) return {1, 1, 1};
    const Json& value = json_["coordinateSystem"];
    const std::string system =
        value.is_number_integer() ? std::to_string(value.get<int>()) : text("coordinateSystem", "");
    if (system == "0") return {-1, -1, 1};
    return system == "1" ? Vector3d(1, 1, 1) : volume::declared_space(system, where_ + ": coordinateSystem");
  }
  Vector3d position() const {
    if (!json_.is_object() || !json_.contains("position") || !json_["position"].is_array() ||
        json_["position"].size() != 3)
      refuse("\"position\" must be three numbers");
    Vector3d place;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const Json& value = json_["position"][axis];
      if (!value.is_number()) refuse("\"position\" must be three numbers");
      place[Eigen::Index(axis)] = value.get<double>();
    }
    return place;
  }
  [[noreturn]] void refuse(const std::string& problem) const {
    throw BadInput(Reason::bad_value, fmt::format("{}: {}", where_, problem));
  }

  const Json& json_;
  std::string where_;
};

void add_point(MarkupPlan& plan, PlanPoint point, const std::string& where) {
  if (std::ranges::find(plan.points, point.name, &PlanPoint::name) != plan.points.end())
    throw BadInput(Reason::name_clash, fmt::format("{}: \"{}\" is given twice", where, point.name));
  if (plan.points.size() == most_points)
    throw BadInput(Reason::bad_size, fmt::format("{}: over {} points", where, most_points));
  plan.points.push_back(std::move(point));
}

MarkupPlan plan_of_fcsv(std::string_view bytes, const std::string& origin) {
  MarkupPlan plan;
  const std::string stem = origin.substr(0, origin.find('.'));
  for (PlanPoint& point : fcsv_points(bytes, origin)) {
    if (point.name.empty()) point.name = fmt::format("{}-{}", stem, plan.points.size() + 1);
    check_place(point, origin);
    add_point(plan, std::move(point), origin);
  }
  return plan;
}

bool is_json(std::string_view bytes) {
  const std::size_t first = bytes.find_first_not_of("\xEF\xBB\xBF \t\r\n");
  return first != std::string_view::npos && bytes[first] == '{';
}

}  // namespace

Expected<MarkupPlan> read_plan(const std::filesystem::path& path) {
  return guarded([&] {
    const std::string origin = path.filename().string();
    const std::string bytes = value_or_throw(read_file(path, most_plan_bytes));
    if (is_fcsv(path, bytes)) return plan_of_fcsv(bytes, origin);
    const Json json = value_or_throw(parse_json(bytes, origin));
    if (!json.is_object() || !json.contains("markups") || !json["markups"].is_array())
      throw BadInput(Reason::bad_value,
                     fmt::format("{}: no list \"markups\": not a file of Slicer's markups", origin));
    std::string stem = origin.substr(0, origin.find('.'));
    MarkupPlan plan;
    for (std::size_t i = 0; i < json["markups"].size(); ++i) {
      const std::string where = fmt::format("{}: markups[{}]", origin, i);
      const Markup markup(json["markups"][i], where);
      std::vector<PlanPoint> points = markup.points();
      if (markup.text("type", "Fiducial") == "Line") {
        if (points.size() != 2)
          throw BadInput(Reason::bad_value,
                         fmt::format("{}: a line of {} points, must be 2", where, points.size()));
        const std::string name = markup.text("name", i == 0 ? stem : fmt::format("{}_{}", stem, i + 1));
        points[0].name = name + "_start", points[1].name = name + "_end";
        plan.tunnels.push_back({name, plan.points.size(), plan.points.size() + 1});
      }
      for (std::size_t k = 0; k < points.size(); ++k) {
        if (points[k].name.empty()) points[k].name = fmt::format("{}-{}", stem, k + 1);
        add_point(plan, std::move(points[k]), where);
      }
    }
    return plan;
  });
}

std::vector<PlanPoint> read_landmarks(const std::filesystem::path& path) {
  const std::string bytes = value_or_throw(read_file(path, most_plan_bytes));
  if (is_fcsv(path, bytes) || is_json(bytes)) return value_or_throw(read_plan(path)).points;
  const CsvTable table = value_or_throw(read_csv(path, {"name", "x_mm", "y_mm", "z_mm"}, {}));
  std::vector<PlanPoint> landmarks;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    const std::string& name = table.text(row, "name");
    if (std::ranges::find(landmarks, name, &PlanPoint::name) != landmarks.end())
      throw BadInput(Reason::name_clash,
                     fmt::format("{}: landmark \"{}\" is given twice", path.filename().string(), name));
    landmarks.push_back(
        {name, {table.number(row, "x_mm"), table.number(row, "y_mm"), table.number(row, "z_mm")}});
  }
  return landmarks;
}

std::vector<PlanPoint> start_landmarks(const pipeline::CaseModel& model) {
  if (!model.placed_landmarks.empty()) return model.placed_landmarks;
  return model.landmarks ? read_landmarks(*model.landmarks) : std::vector<PlanPoint>{};
}

std::string source_of_landmarks(const pipeline::CaseModel& model) {
  if (!model.placed_landmarks.empty()) return "placed in the model";
  return model.landmarks ? model.landmarks->filename().string() : "";
}

}  // namespace helicarm::case_registration
