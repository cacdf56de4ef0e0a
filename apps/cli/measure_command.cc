// SPDX-License-Identifier: Apache-2.0
#include "measure_command.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <span>
#include <vector>

#include <fmt/format.h>

#include "command_line.h"
#include "helicarm/calibration/saved_calibration.h"
#include "helicarm/case_registration/bone_measures.h"
#include "helicarm/core/csv.h"
#include "helicarm/fiducials/find_target.h"
#include "helicarm/localization/pick_checks.h"
#include "helicarm/measures/measure_json.h"
#include "helicarm/measures/zones.h"
#include "helicarm/pipeline/result.h"
#include "helicarm/rectification/distortion_map.h"
#include "measure_landmarks.h"

namespace helicarm::cli {
namespace {

struct Point {
  Eigen::Vector3d xyz_mm;
  Eigen::Matrix3d covariance_mm2;
  std::map<std::string, measures::Click> seen = {};  ///< by view
  Json warnings = Json::array();
  /// Whose plan holds it, where it is at the registration's first acquisition.
  std::optional<case_registration::PosedModel> model = {};
};

/// A calibration and the points located with it.
struct Measured {
  calibration::SavedCalibration calibration;
  std::map<std::string, Point> points = {};

  /// The view in which the point is where the result or the registration has it.
  geometry::View view_of(const Point& point, std::size_t view) const {
    if (!point.model) return calibration.views[view].view;
    return value_or_throw(
        case_registration::view_of_model(*point.model, case_registration::views_of(calibration)[view]));
  }
};

/// The images in which a point was picked or found.
std::map<std::string, measures::Click> seen_in(JsonReader point, const std::string& name,
                                               std::span<const calibration::CalibratedView> views) {
  constexpr Range pixels{-1e6, 1e6};
  std::map<std::string, measures::Click> seen;
  for (const calibration::CalibratedView& view : views) {
    if (!point.has(view.name.c_str())) continue;
    JsonReader one = point.object(view.name.c_str());
    const double sigma = one.number("sigma_px", {0, 1e6});
    seen[view.name] = {name, Eigen::Vector2d(one.numbers("uv", 2, pixels).data()),
                       sigma * sigma * Eigen::Matrix2d::Identity()};
  }
  return seen;
}

/// Whether the point's picks contradict each other: its covariance holds that, its images do not.
bool rays_miss(JsonReader& point) {
  for (JsonReader& warning : point.objects("warnings", false))
    if (warning.text("code") == code(Reason::residual_too_large)) return true;
  return false;
}

/// Adds the points that have a position and a covariance.
void add_points(std::vector<JsonReader> entries, Measured& measured,
                const std::optional<case_registration::PosedModel>& model = {}) {
  constexpr Range numbers{-1e9, 1e9};
  for (JsonReader& entry : entries) {
    if (!entry.has("xyz_mm") || !entry.has("covariance_mm2")) continue;
    const std::string name = entry.text("name");
    Point point{Eigen::Vector3d(entry.numbers("xyz_mm", 3, numbers).data()),
                Eigen::Map<const Eigen::Matrix3d>(entry.matrix("covariance_mm2", 3, 3, numbers).data())};
    point.model = model;
    if (entry.has("seen") && !rays_miss(entry))
      point.seen = seen_in(entry.object("seen"), name, measured.calibration.views);
    for (JsonReader& warning : entry.objects("warnings", false)) {
      warning.text("code");
      warning.optional_text("message", 10'000);
      point.warnings = entry.raw("warnings");
    }
    if (!measured.points.emplace(name, std::move(point)).second)
      entry.refuse(Reason::name_clash, "name", fmt::format("there is another point \"{}\"", name));
  }
}

Measured measured_from(const MeasureArguments& arguments) {
  const std::string origin = arguments.calibration->filename().string();
  const Json json = value_or_throw(read_json(*arguments.calibration));
  Measured measured{value_or_throw(calibration::saved_calibration_from_json(json, origin))};
  add_points(JsonReader(json, origin).objects("points", false), measured);
  if (!arguments.registration) return measured;
  const Json registration = value_or_throw(read_json(*arguments.registration));
  const std::string registered = arguments.registration->filename().string();
  const auto posed = value_or_throw(case_registration::posed_models_from(registration, registered));
  JsonReader models(registration, registered);
  for (JsonReader& model : models.objects("models", true)) {
    const auto found = std::ranges::find(posed, model.text("name"), &case_registration::PosedModel::name);
    if (found != posed.end()) add_points(model.objects("points", false), measured, *found);
  }
  return measured;
}

std::size_t view_named(const Measured& measured, const std::string& name, const std::string& where) {
  const auto& views = measured.calibration.views;
  const auto found = std::ranges::find(views, name, &calibration::CalibratedView::name);
  if (found == views.end())
    throw BadInput(Reason::bad_value,
                   fmt::format("{}: view: the calibration has no view \"{}\"", where, name));
  return static_cast<std::size_t>(found - views.begin());
}

const Point& point_named(const Measured& measured, const std::string& name, const std::string& where) {
  const auto found = measured.points.find(name);
  if (found == measured.points.end())
    throw BadInput(Reason::bad_value, fmt::format("{}: the result has no located point \"{}\"", where, name));
  return found->second;
}

/// Nothing without fiducials, depth or point: lengths are then in pixels.
std::optional<measures::ObjectPlane> plane_of(const MeasureArguments& arguments, const Measured& measured,
                                              const calibration::CalibratedView& view) {
  if (arguments.depth_mm) {
    const auto& map = measured.calibration.maps[view_named(measured, view.name, "--depth")];
    if (map && map->rectified_pixel_mm) {
      const double receiver_mm = std::abs(view.view.intrinsics.fx) * *map->rectified_pixel_mm;
      if (*arguments.depth_mm > receiver_mm)
        throw BadInput(Reason::bad_value,
                       fmt::format("--depth: {:g} mm is behind the receiver of {}, {:.0f} mm "
                                   "from the source",
                                   *arguments.depth_mm, view.name, receiver_mm));
    }
    return measures::plane_at(view, *arguments.depth_mm, arguments.depth_sigma_mm);
  }
  if (arguments.at) {
    const Point& point = point_named(measured, *arguments.at, "--at");
    calibration::CalibratedView then = view;
    then.view = measured.view_of(point, view_named(measured, view.name, "--at"));
    return value_or_throw(measures::plane_through(then, point.xyz_mm, point.covariance_mm2));
  }
  phantom::Calibrator calibrator;
  calibrator.balls = measured.calibration.balls;
  if (calibrator.balls.empty()) return std::nullopt;
  return value_or_throw(measures::plane_through(view, phantom::middle_of(calibrator)));
}

/// The measures of the table, in the order of first occurrence.
struct Wanted {
  std::string name;
  measures::Kind kind;
  std::string view;
  std::vector<measures::Click> clicks = {};
  std::map<std::string, Json> warnings = {};  ///< of its located points
};

measures::Click click_from(const CsvTable& table, std::size_t row, const std::optional<Measured>& measured,
                           bool raw) {
  const std::string where = fmt::format("clicks: row {}", row + 1);
  const std::string &name = table.text(row, "name"), &view_name = table.text(row, "view");
  const auto u = table.optional_number(row, "u_px"), v = table.optional_number(row, "v_px");
  const auto sigma = table.optional_number(row, "sigma_px");
  if (sigma && *sigma < 0)
    throw BadInput(Reason::bad_value, fmt::format("{}: sigma_px: {} is negative", where, *sigma));
  if (u.has_value() != v.has_value())
    throw BadInput(Reason::bad_value, fmt::format("{}: u_px, v_px: both or none", where));
  if (!u) {
    if (!measured)
      throw BadInput(Reason::bad_value,
                     fmt::format("{}: no pixels: a located point needs --calibration", where));
    const Point& point = point_named(*measured, name, where);
    if (const auto seen = point.seen.find(view_name); seen != point.seen.end()) return seen->second;
    return value_or_throw(
        measures::click_of(name, point.xyz_mm, point.covariance_mm2,
                           measured->view_of(point, view_named(*measured, view_name, where))));
  }
  const Eigen::Vector2d uv{*u, *v};
  double sigma_px = sigma.value_or(fiducials::click_sigma_px);
  Eigen::Vector2d rectified = uv;
  if (measured) {
    const auto& map = measured->calibration.maps[view_named(*measured, view_name, where)];
    if (map && raw) {
      const auto seen = value_or_throw(fiducials::point_of_click(*map, uv, sigma));
      rectified = seen.uv;
      sigma_px = seen.sigma_px;
    } else if (map && !rectification::raw_in_image(*map, uv)) {
      throw BadInput(
          Reason::bad_value,
          fmt::format("{}: ({:g}, {:g}) px is not in the rectified image of {}; --raw for raw pixels", where,
                      uv.x(), uv.y(), view_name));
    }
  }
  return {name, rectified, sigma_px * sigma_px * Eigen::Matrix2d::Identity()};
}

std::vector<Wanted> wanted_measures(const CsvTable& table, const std::optional<Measured>& measured,
                                    bool raw) {
  std::vector<Wanted> all;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    const std::string &name = table.text(row, "measure"), &view = table.text(row, "view");
    const auto kind = measures::kind_named(table.text(row, "kind"));
    if (!kind) {
      std::vector<std::string_view> words;
      for (const measures::KindInfo& info : measures::kinds()) words.push_back(info.word);
      throw BadInput(Reason::bad_value, fmt::format("clicks: row {}: kind: \"{}\" is none of: {}", row + 1,
                                                    table.text(row, "kind"), fmt::join(words, ", ")));
    }
    auto wanted = std::ranges::find(all, name, &Wanted::name);
    if (wanted == all.end()) wanted = all.insert(all.end(), {name, *kind, view});
    if (wanted->kind != *kind || wanted->view != view)
      throw BadInput(
          Reason::bad_value,
          fmt::format("clicks: row {}: measure \"{}\" has another kind or view before", row + 1, name));
    wanted->clicks.push_back(click_from(table, row, measured, raw));
    const std::string& point = wanted->clicks.back().name;
    if (table.text(row, "u_px").empty() && !measured->points.at(point).warnings.empty())
      wanted->warnings[point] = measured->points.at(point).warnings;
  }
  return all;
}

struct Answer {
  std::string name, view;
  measures::Measure measure;
  std::map<std::string, Json> warnings;
};

/// Those of the positions to those of the located points.
void add_warnings(Answer& answer) {
  for (const measures::Position& position : answer.measure.positions)
    for (const Warning& warning : position.warnings) {
      Json& list = answer.warnings[position.point];
      if (list.is_null()) list = Json::array();
      list.push_back(pipeline::to_json(warning));
    }
}

/// Nothing with --raw or without a distortion map.
std::optional<Warning> taken_as_rectified(const MeasureArguments& arguments,
                                          const std::optional<Measured>& measured,
                                          std::span<const Wanted> all) {
  if (arguments.raw || !measured) return std::nullopt;
  std::vector<localization::PointObservation> picks;
  for (const Wanted& wanted : all)
    for (const measures::Click& click : wanted.clicks)
      if (!measured->points.contains(click.name))
        picks.push_back({view_named(*measured, wanted.view, wanted.name), click.uv, click.covariance_px2});
  return localization::pixels_taken_as_rectified(picks, measured->calibration);
}

struct Answers {
  std::vector<Answer> measures;
  std::vector<Warning> notes;
};

Answers answers_to(const MeasureArguments& arguments) {
  if (!arguments.calibration &&
      (arguments.raw || arguments.depth_mm || arguments.at || arguments.registration))
    throw BadInput(Reason::usage, "--raw, --depth, --at and --registration need --calibration");
  if (arguments.depth_sigma_mm > 0 && !arguments.depth_mm)
    throw BadInput(Reason::usage, "--depth-sigma needs --depth");
  if (arguments.depth_mm && arguments.at)
    throw BadInput(Reason::usage, "--depth and --at cannot be combined");
  std::optional<Measured> measured;
  if (arguments.calibration) measured = measured_from(arguments);
  const auto table = value_or_throw(
      read_csv(*arguments.clicks, {"measure", "kind", "view", "name", "u_px", "v_px"}, {"sigma_px"}));
  const std::vector<Wanted> all = wanted_measures(table, measured, arguments.raw);
  std::vector<Answer> answers;
  for (const Wanted& wanted : all) {
    std::optional<measures::ObjectPlane> plane;
    if (measured)
      plane = plane_of(arguments, *measured,
                       measured->calibration.views[view_named(*measured, wanted.view, wanted.name)]);
    auto measure = measures::measure(wanted.kind, wanted.clicks, plane);
    if (!measure) {
      Failure failure = std::move(measure).error();
      failure.message = fmt::format("measure \"{}\": {}", wanted.name, failure.message);
      failure.view = wanted.view;
      throw BadInput(std::move(failure));
    }
    answers.push_back({wanted.name, wanted.view, *std::move(measure), wanted.warnings});
    add_warnings(answers.back());
  }
  const auto note = taken_as_rectified(arguments, measured, all);
  return {std::move(answers), note ? std::vector{*note} : std::vector<Warning>()};
}

void print(const Answer& answer, std::ostream& out) {
  const measures::Measure& measure = answer.measure;
  out << fmt::format("{} ({}, {})\n", answer.name, measures::info_of(measure.kind).label, answer.view);
  for (const measures::Quantity& quantity : measure.quantities)
    out << "  " << measures::sentence_of(quantity) << '\n';
  for (const measures::Position& position : measure.positions)
    out << "  " << measures::sentence_of(measure.kind, position) << '\n';
  if (measure.depth_mm)
    out << fmt::format(
        "  lengths in the plane {:.1f} mm from the source; 1 mm nearer to it they are {:.2f} % shorter\n",
        *measure.depth_mm, 100 / *measure.depth_mm);
  for (const auto& [point, warnings] : answer.warnings)
    for (const Json& warning : warnings)
      out << fmt::format("  warning: {}: {}\n", point,
                         warning.value("message", warning.value("code", std::string())));
}

void check_combination(const MeasureArguments& arguments) {
  if (arguments.clicks.has_value() == arguments.landmarks.has_value())
    throw BadInput(Reason::usage, "give --clicks (of an image) or --landmarks (of a CT)");
  if (arguments.zones && !arguments.landmarks) throw BadInput(Reason::usage, "--zones needs --landmarks");
  if (arguments.landmarks && (arguments.raw || arguments.depth_mm || arguments.at))
    throw BadInput(Reason::usage, "--raw, --depth and --at are of --clicks");
}

}  // namespace

CommandResult measure_command(const MeasureArguments& arguments, Console& console) {
  return guarded([&] {
    if (arguments.print_zones) {
      console.out << measures::usual_zones_text();
      return;
    }
    check_combination(arguments);
    if (arguments.landmarks) return measure_landmarks(arguments, console);
    const auto [answers, notes] = answers_to(arguments);
    for (const Warning& note : notes) console.progress << note.message << '\n';
    if (!console.json) {
      for (const Answer& answer : answers) print(answer, console.out);
      return;
    }
    Json all = Json::array();
    for (const Answer& answer : answers) {
      Json one{{"name", answer.name}, {"view", answer.view}, {"warnings", answer.warnings}};
      one.update(measures::to_json(answer.measure));
      all.push_back(std::move(one));
    }
    console.out << to_text({{"measures", std::move(all)}, {"notes", pipeline::json_list_of(notes)}}) << '\n';
  });
}

void add_measure(CLI::App& app, Action& action) {
  auto* command = add_command(
      app, group::measure, "measure",
      "Measure in single images: distance, angle, circle, positions in femur and tibia",
      "helicarm measure --clicks clicks.csv --calibration my-result/result.json\n"
      "  helicarm measure --clicks clicks.csv      without a calibration: lengths in pixels\n"
      "  helicarm measure --landmarks femur.csv --registration my-registration/registration.json\n\n"
      "kind and the names of its clicks:\n"
      "  distance           from, to\n"
      "  angle              first, vertex, second\n"
      "  line_angle         line1_from, line1_to, line2_from, line2_to\n"
      "  circle             rim1, rim2, rim3 and any further ones\n"
      "  femoral_quadrants  blumensaat_posterior, blumensaat_anterior, inferior[, posterior, anterior]\n"
      "  tibia_ap           anterior, posterior[, plateau1, plateau2]\n"
      "  tibia_ml           medial, lateral\n"
      "In the last three, clicks of other names are points whose positions are given in per cent; a point\n"
      "without pixels is the located one of this name in result.json. With --landmarks these three are "
      "measured "
      "in\nthe bone's CT, in three dimensions; femoral_quadrants and tibia_ap also need axis_medial and "
      "axis_lateral, the\nends of the axis of a true lateral image, such as both condyles' posterior "
      "borders.");
  auto& a = arguments_of(command, action, measure_command);
  command->add_option("--clicks", a.clicks,
                      "CSV: measure,kind,view,name,u_px,v_px[,sigma_px], rectified pixels; a row per click");
  command->add_option(
      "--landmarks", a.landmarks,
      "CSV: measure,kind,model,name,x_mm,y_mm,z_mm[,sigma_mm] in the CT; a row without numbers is "
      "a point of the model's plan (--registration) or a located one (--calibration too)");
  command->add_option(
      "--zones", a.zones,
      "zones.json: published positions with their sources, to compare with; default: built in");
  command->add_flag("--print-zones", a.print_zones, "Print the built-in zones.json");
  command->add_option("--calibration", a.calibration, "result.json of a run: gives lengths in mm");
  command->add_option("--registration", a.registration,
                      "registration.json of the same views: its planned points may be named too");
  command->add_flag("--raw", a.raw, "The clicks are raw pixels");
  command
      ->add_option("--depth", a.depth_mm,
                   "Distance of the plane of lengths from the source, mm (default: through the fiducials' "
                   "centre)")
      ->check(within(1, 10000));
  command->add_option("--depth-sigma", a.depth_sigma_mm, "Its standard deviation, mm")
      ->check(within(0, 1000))
      ->capture_default_str();
  command->add_option("--at", a.at, "A located point of result.json in that plane");
}

}  // namespace helicarm::cli
