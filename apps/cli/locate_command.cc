// SPDX-License-Identifier: Apache-2.0
#include "locate_command.h"

#include <algorithm>
#include <optional>
#include <set>
#include <vector>

#include <fmt/format.h>

#include "command_line.h"
#include "helicarm/calibration/camera_files.h"
#include "helicarm/core/csv.h"
#include "helicarm/fiducials/find_target.h"
#include "helicarm/localization/located_point_json.h"
#include "helicarm/localization/pick_checks.h"
#include "helicarm/pipeline/result.h"
#include "helicarm/pipeline/run_fields.h"
#include "helicarm/rectification/distortion_map.h"

namespace helicarm::cli {
namespace {

/// A point of the picks, in the order of first occurrence.
struct PickedPoint {
  std::string name;
  std::vector<localization::PointObservation> images;
  std::vector<Warning> unseen = {};  ///< picks that were not taken, and why
};

/// Converts picks as `run` does for its case; rectified ones are used unchanged.
Expected<localization::PointObservation> image_from(const CsvTable& table, std::size_t row,
                                                    const calibration::SavedCalibration& calibration,
                                                    bool raw) {
  const std::string where = fmt::format("picks: row {}", row + 1);
  const auto found =
      std::ranges::find(calibration.views, table.text(row, "view"), &calibration::CalibratedView::name);
  if (found == calibration.views.end())
    throw BadInput(Reason::bad_value, fmt::format("{}: view: the calibration has no view \"{}\"", where,
                                                  table.text(row, "view")));
  const auto given_sigma = table.optional_number(row, "sigma_px");
  if (given_sigma && *given_sigma < 0)
    throw BadInput(Reason::bad_value, fmt::format("{}: sigma_px: {} is negative", where, *given_sigma));
  const auto view = static_cast<std::size_t>(found - calibration.views.begin());
  const Eigen::Vector2d uv{table.number(row, "u_px"), table.number(row, "v_px")};
  const auto& map = calibration.maps[view];
  if (raw && map && !map->shows(uv))
    throw BadInput(Reason::bad_value, fmt::format("{}: {:g}, {:g} lies outside the image of {} x {} pixels",
                                                  where, uv.x(), uv.y(), map->width, map->height));
  if (!raw && map && !rectification::raw_in_image(*map, uv))
    return fail(Reason::not_seen,
                fmt::format("{}: {:g}, {:g} lies outside the rectified image: it is not taken", where, uv.x(),
                            uv.y()));
  return (raw && map ? fiducials::point_of_click(*map, uv, given_sigma)
                     : fiducials::ImagePoint{uv, uv, given_sigma.value_or(fiducials::click_sigma_px)})
      .map([&](const fiducials::ImagePoint& seen) {
        return localization::PointObservation{view, seen.uv,
                                              seen.sigma_px * seen.sigma_px * Eigen::Matrix2d::Identity()};
      });
}

std::vector<PickedPoint> picked_points(const CsvTable& table,
                                       const calibration::SavedCalibration& calibration, bool raw) {
  std::vector<PickedPoint> points;
  std::set<std::pair<std::string, std::string>> clicks;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    const auto image = image_from(table, row, calibration, raw);
    const std::string &name = table.text(row, "name"), &view = table.text(row, "view");
    if (!clicks.emplace(name, view).second)
      throw BadInput(Reason::name_clash, fmt::format("picks: row {}: \"{}\" is picked twice in view \"{}\"",
                                                     row + 1, name, view));
    auto point = std::ranges::find(points, name, &PickedPoint::name);
    if (point == points.end()) point = points.insert(points.end(), {name, {}});
    if (image)
      point->images.push_back(*image);
    else
      point->unseen.push_back(image.error());
  }
  return points;
}

struct GivenCalibration {
  calibration::SavedCalibration calibration;
  bool of_cameras = false;  ///< one file for each view
};

GivenCalibration calibration_from(const std::vector<std::string>& words) {
  if (words.size() == 1 && (words[0].find('=') == std::string::npos || std::filesystem::exists(words[0]))) {
    const std::filesystem::path path = words[0];
    return {value_or_throw(
        calibration::saved_calibration_from_json(value_or_throw(read_json(path)), path.filename().string()))};
  }
  std::vector<calibration::CameraFile> files;
  for (const std::string& word : words) files.push_back(value_or_throw(calibration::camera_file_from(word)));
  return {value_or_throw(calibration::calibration_of_cameras(files)), true};
}

using Located = Expected<localization::LocatedPoint>;

std::vector<Located> located_points(const std::vector<PickedPoint>& picked,
                                    const calibration::SavedCalibration& calibration,
                                    double motion_sigma_mm) {
  std::vector<Located> points;
  for (const PickedPoint& point : picked)
    points.push_back(localization::locate(point.name, localization::PointSource::pick, point.images,
                                          calibration, motion_sigma_mm));
  localization::inflate_if_views_contradict(points);
  return points;
}

std::optional<Warning> taken_as_rectified(const std::vector<PickedPoint>& picked,
                                          const calibration::SavedCalibration& calibration) {
  std::vector<localization::PointObservation> picks;
  for (const PickedPoint& point : picked) picks.insert(picks.end(), point.images.begin(), point.images.end());
  return localization::pixels_taken_as_rectified(picks, calibration);
}

/// {"points", "warnings", "notes"}.
Json located(const LocateArguments& arguments, std::ostream& progress) {
  const auto [calibration, of_cameras] = calibration_from(arguments.calibrations);
  const auto table =
      value_or_throw(read_csv(arguments.picks, {"name", "view", "u_px", "v_px"}, {"sigma_px"}));
  const std::vector<PickedPoint> picked = picked_points(table, calibration, arguments.raw);
  const double motion = arguments.motion_sigma_mm;
  const std::vector<Located> all = located_points(picked, calibration, motion);
  Json points = Json::array();
  std::vector<Warning> warnings, notes;
  if (const auto note = arguments.raw ? std::nullopt : taken_as_rectified(picked, calibration)) {
    progress << fmt::format("{}\n", note->message);
    notes.push_back(*note);
  }
  for (std::size_t i = 0; i < all.size(); ++i) {
    const auto& [name, images, unseen] = picked[i];
    const Located& point = all[i];
    const auto unknown = point && of_cameras ? localization::covariance_missing(*point, images, calibration)
                                             : std::optional<Warning>();
    std::vector<Warning> own_warnings, own_notes;
    std::optional<Failure> refusal;
    if (!point) refusal = unseen.empty() ? point.error() : unseen.back();
    if (point) own_warnings = unseen;
    if (point && point->missing_rays) own_warnings.push_back(*point->missing_rays);
    if (unknown) own_warnings.push_back(*unknown);
    if (refusal) progress << fmt::format("{}: {}\n", name, refusal->message);
    for (const Warning& warning : own_warnings) progress << fmt::format("{}: {}\n", name, warning.message);
    const bool rays_miss = point && point->missing_rays;
    if (const auto on_ball =
            point ? localization::pick_on_fiducial(name, images, calibration, calibration.balls, rays_miss)
                  : std::nullopt) {
      progress << fmt::format("{}\n", on_ball->message);
      own_warnings.push_back(*on_ball);
      refusal = on_ball;
    }
    points.push_back(refusal
                         ? localization::point_json(name, localization::PointSource::pick, refusal->reason)
                     : unknown ? localization::point_json_without_covariance(*point)
                               : localization::point_json(*point));
    if (!refusal)
      own_notes.push_back(localization::unobservable_motion(name, point->point_in_anchor,
                                                            calibration.views[images.front().view], motion));
    points.back()["warnings"] = pipeline::json_list_of(own_warnings);
    points.back()["notes"] = pipeline::json_list_of(own_notes);
    warnings.insert(warnings.end(), own_warnings.begin(), own_warnings.end());
    notes.insert(notes.end(), own_notes.begin(), own_notes.end());
  }
  return {{"points", points},
          {"warnings", pipeline::json_list_of(warnings)},
          {"notes", pipeline::json_list_of(notes)}};
}

void print_table(const Json& points, std::ostream& out) {
  out << fmt::format("{:<16} {:>10} {:>10} {:>10} {:>9} {:>9}\n", "point", "x mm", "y mm", "z mm", "95 % mm",
                     "gap mm");
  for (const Json& point : points) {
    const auto name = point["name"].get<std::string>();
    if (point["xyz_mm"].is_null()) {
      out << fmt::format("{:<16} {}\n", name, point["reason"].get<std::string>());
      continue;
    }
    const auto xyz = point["xyz_mm"].get<std::vector<double>>();
    const Json& error = point["error_95_mm"];
    out << fmt::format("{:<16} {:10.3f} {:10.3f} {:10.3f} {:>9} {:9.3f}\n", name, xyz[0], xyz[1], xyz[2],
                       error.is_null() ? "-" : fmt::format("{:.3f}", error.get<double>()),
                       point["ray_gap_mm"].get<double>());
  }
}

}  // namespace

CommandResult locate_command(const LocateArguments& arguments, Console& console) {
  const auto answer = guarded([&] { return located(arguments, console.progress); });
  if (!answer) return tl::unexpected<Failure>(answer.error());
  if (console.json)
    console.out << to_text(*answer) << '\n';
  else
    print_table((*answer)["points"], console.out);
  return {};
}

void add_locate(CLI::App& app, Action& action) {
  auto* command = add_command(
      app, group::images, "locate", "Triangulate picked pixels in calibrated views (Eq. 8)",
      "helicarm locate --calibration my-result/result.json --picks picks.csv --json\n"
      "  helicarm locate --calibration AP=cam1.json --calibration LAT=cam2.json --picks picks.csv");
  auto& a = arguments_of(command, action, locate_command);
  command
      ->add_option("--calibration", a.calibrations,
                   "result.json of a run; or for each view VIEW=FILE: result.json, the output of solve or "
                   "import, or a file that import reads, all in one frame and in mm")
      ->allow_extra_args(false)
      ->required();
  command->add_option("--picks", a.picks, "CSV: name,view,u_px,v_px[,sigma_px], rectified pixels")
      ->required();
  command->add_flag("--raw", a.raw, "The picks are raw pixels");
  add_number(command, field_named<pipeline::RunOptions>(pipeline::run_fields, "motion_sigma_mm"),
             a.motion_sigma_mm);
}

}  // namespace helicarm::cli
