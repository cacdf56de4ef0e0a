// SPDX-License-Identifier: Apache-2.0
#include <charconv>
#include <cmath>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "command_line.h"
#include "findings.h"
#include "helicarm/core/earlier_files.h"
#include "helicarm/core/files.h"
#include "helicarm/geometry/view_json.h"
#include "helicarm/localization/error_bound.h"
#include "helicarm/localization/locate.h"
#include "helicarm/localization/tre_volume.h"
#include "helicarm/pipeline/calibrate_case.h"
#include "helicarm/pipeline/case.h"
#include "helicarm/pipeline/run_fields.h"
#include "helicarm/report/tre_figure.h"
#include "measuring.h"

namespace helicarm::cli {

struct PredictArguments {
  std::vector<std::string> at;  ///< "x,y,z" each, mm in the calibrator's frame
  double sigma_px = 0.5;        ///< of a pick, per axis
  RunArguments run = {.folder = {}, .options = {.run = {.max_error_mm = 2}}};
  std::optional<std::filesystem::path> map = {};  ///< folder for tre.csv, tre.vtk, tre.svg
  double half_mm = 150;                           ///< of the map's edge
  double step_mm = 10;
};

namespace {

constexpr double most_points_per_edge = 201;

Eigen::Vector3d place_from(const std::string& word) {
  Eigen::Vector3d position;
  const char* at = word.data();
  const char* const end = at + word.size();
  for (int k = 0; k < 3; ++k) {
    const auto [next, error] = std::from_chars(at, end, position(k));
    const bool separated = k == 2 ? next == end : next != end && *next == ',';
    if (error != std::errc() || !separated || !(std::abs(position(k)) <= 1e4))
      throw BadInput(Reason::usage, fmt::format("--at: \"{}\" is not x,y,z in mm within 10000", word));
    at = next + 1;
  }
  return position;
}

Json prediction(const Eigen::Vector3d& position, const calibration::Calibration& calibration,
                const PredictArguments& arguments) {
  Json json{{"xyz_mm", {position.x(), position.y(), position.z()}}};
  const auto covariance = localization::predict_covariance(position, arguments.sigma_px, calibration,
                                                           arguments.run.options.run.motion_sigma_mm);
  if (!covariance) {
    json["decision"] = "refuse";
    json["reason"] = code(covariance.error().reason);
    return json;
  }
  const double within = localization::length_at_95(*covariance);
  json["tre_mm"] = std::sqrt(covariance->trace());
  json["error_95_mm"] = within;
  json["covariance_mm2"] = geometry::json_rows(*covariance);
  json["decision"] = within <= *arguments.run.options.run.max_error_mm ? "accept" : "refuse";
  json["reason"] =
      within <= *arguments.run.options.run.max_error_mm ? Json(nullptr) : Json(code(Reason::uncertain));
  return json;
}

void write_map(const localization::TreVolume& volume, const std::filesystem::path& folder) {
  value_or_throw(write_file(folder / "tre.csv", localization::to_csv(volume)));
  value_or_throw(write_file(folder / "tre.vtk", localization::to_vtk(volume)));
  value_or_throw(write_file(folder / "tre.svg", report::tre_figure(volume)));
}

}  // namespace

/// Predicted error of a point picked in all views of a case, without picks.
CommandResult predict_command(const PredictArguments& arguments, Console& console) {
  return guarded([&] {
    if (arguments.map) forget_files(*arguments.map, {"tre.csv", "tre.vtk", "tre.svg"});
    if (2 * arguments.half_mm / arguments.step_mm + 1 > most_points_per_edge)
      throw BadInput(Reason::usage,
                     fmt::format("--step: {:g} mm over +-{:g} mm gives more than {:g} points per edge",
                                 arguments.step_mm, arguments.half_mm, most_points_per_edge));
    std::vector<Eigen::Vector3d> places;
    for (const std::string& word : arguments.at) places.push_back(place_from(word));
    const pipeline::Case the_case = value_or_throw(pipeline::read_case(arguments.run.folder));
    if (the_case.views.size() < 2)
      throw BadInput(Reason::too_few_views,
                     "one view locates no point: the case needs a second view, of another direction");
    const Eigen::Vector3d middle = phantom::middle_of(the_case.calibrator);
    if (places.empty()) places.push_back(middle);
    const pipeline::RunOptions options = value_or_throw(options_of(arguments.run, console)).run;
    const auto calibrated = pipeline::calibrate_case(the_case, options);
    if (!calibrated) throw BadInput(calibrated.error().failure);
    const calibration::Calibration& calibration = *calibrated;

    Json points = Json::array();
    std::vector<Warning> notes;
    for (const Eigen::Vector3d& position : places) {
      points.push_back(prediction(position, calibration, arguments));
      notes.push_back(localization::unobservable_motion(
          fmt::format("{:g},{:g},{:g}", position.x(), position.y(), position.z()), position,
          calibration.views.front(), arguments.run.options.run.motion_sigma_mm));
    }
    print_warnings(calibrated->warnings, console);
    if (arguments.map)
      write_map(localization::predict_tre(calibration, middle, arguments.half_mm, arguments.step_mm,
                                          arguments.sigma_px, console.threads,
                                          arguments.run.options.run.motion_sigma_mm),
                *arguments.map);
    if (console.json) {
      console.out << to_text(Json{{"sigma_px", arguments.sigma_px},
                                  {"motion_sigma_mm", arguments.run.options.run.motion_sigma_mm},
                                  {"max_error_mm", *arguments.run.options.run.max_error_mm},
                                  {"warnings", pipeline::json_list_of(calibrated->warnings)},
                                  {"notes", pipeline::json_list_of(notes)},
                                  {"points", points}})
                  << '\n';
      return;
    }
    console.out << fmt::format("{:>10} {:>10} {:>10} {:>10} {:>14}  decision\n", "x mm", "y mm", "z mm",
                               "TRE mm rms", "95 % within mm");
    for (std::size_t i = 0; i < places.size(); ++i) {
      const Json& point = points[i];
      const auto number = [&](const char* key) {
        return point.contains(key) ? fmt::format("{:.3f}", point[key].get<double>()) : std::string("-");
      };
      console.out << fmt::format("{:10.2f} {:10.2f} {:10.2f} {:>10} {:>14}  {}\n", places[i].x(),
                                 places[i].y(), places[i].z(), number("tre_mm"), number("error_95_mm"),
                                 point["decision"].get<std::string>());
    }
    if (arguments.map && !console.quiet)
      console.out << fmt::format("\n  map written to {}\n", arguments.map->string());
  });
}

void add_predict(CLI::App& app, Action& action) {
  auto* command =
      add_command(app, group::measure, "predict", "Predict the error of a point before it is picked",
                  "helicarm predict my-case --at 0,0,40 --at 60,0,40 --map tre");
  auto& a = arguments_of(command, action, predict_command);
  command->add_option("CASE", a.run.folder, "Folder that holds case.json")->required();
  command->add_option("--at", a.at,
                      "x,y,z in the calibrator's frame, mm; repeatable (default: the calibrator's centre)");
  command->add_option("--sigma-px", a.sigma_px, "Standard deviation of a picked point, per axis, px")
      ->check(within(0, 100))
      ->capture_default_str();
  add_run_options(command, a.run, "The C-arm's history (JSON), read only");
  command->add_option("--map", a.map, "Folder for a map about the calibrator: tre.csv, tre.vtk, tre.svg");
  command->add_option("--half", a.half_mm, "Half the side of the map, mm")
      ->check(within(1, 1000))
      ->capture_default_str();
  command->add_option("--step", a.step_mm, "Spacing of the map's points, mm")
      ->check(within(0.5, 100))
      ->capture_default_str();
}

}  // namespace helicarm::cli
