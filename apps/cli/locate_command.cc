// SPDX-License-Identifier: Apache-2.0
#include "locate_command.h"

#include <algorithm>
#include <utility>
#include <vector>

#include <Eigen/LU>
#include <fmt/format.h>

#include "helicarm/calibration/saved_calibration.h"
#include "helicarm/core/csv.h"
#include "helicarm/localization/located_point_json.h"

namespace helicarm::cli {
namespace {

constexpr double default_sigma_px = 0.5;

/// Name and pictures, in the order of their first pick.
using Picks = std::vector<std::pair<std::string, std::vector<PointPicture>>>;

/// A raw pixel with its noise as a rectified one with the map's noise as well.
PointPicture rectified(PointPicture picture, const DistortionMap& map, const std::string& where) {
  const auto uv = map.rectified_from_raw(picture.uv);
  if (!uv)
    throw BadInput(Reason::bad_value, fmt::format("{}: lies outside what the view's map covers", where));
  const Eigen::Matrix2d rectified_by_raw = map.jacobian(*uv).inverse();
  const double sigma = map.sigma_px(*uv);
  picture.uv = *uv;
  picture.covariance_px2 = rectified_by_raw * picture.covariance_px2 * rectified_by_raw.transpose() +
                           sigma * sigma * Eigen::Matrix2d::Identity();
  return picture;
}

PointPicture picture_from(const CsvTable& table, std::size_t row, const SavedCalibration& calibration,
                          bool raw) {
  const std::string where = fmt::format("picks: row {}", row + 1);
  const std::string& name = table.text(row, "view");
  const auto same = [&](const CalibratedView& view) { return view.name == name; };
  const auto found = std::find_if(calibration.views.begin(), calibration.views.end(), same);
  if (found == calibration.views.end())
    throw BadInput(Reason::bad_value,
                   fmt::format("{}: view: the calibration has no view \"{}\"", where, name));
  const double sigma = table.optional_number(row, "sigma_px").value_or(default_sigma_px);
  if (sigma < 0) throw BadInput(Reason::bad_value, fmt::format("{}: sigma_px: {} is negative", where, sigma));
  const auto view = static_cast<std::size_t>(found - calibration.views.begin());
  const PointPicture picture{view,
                             {table.number(row, "u_px"), table.number(row, "v_px")},
                             sigma * sigma * Eigen::Matrix2d::Identity()};
  const auto& map = calibration.maps[view];
  return raw && map ? rectified(picture, *map, where) : picture;
}

Picks picks_from(const CsvTable& table, const SavedCalibration& calibration, bool raw) {
  Picks picks;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    const PointPicture picture = picture_from(table, row, calibration, raw);
    const std::string& name = table.text(row, "name");
    auto pick = std::find_if(picks.begin(), picks.end(), [&](const auto& p) { return p.first == name; });
    if (pick == picks.end()) pick = picks.insert(picks.end(), {name, {}});
    for (const PointPicture& other : pick->second)
      if (other.view == picture.view)
        throw BadInput(Reason::name_clash, fmt::format("picks: row {}: \"{}\" is picked twice in view \"{}\"",
                                                       row + 1, name, calibration.views[picture.view].name));
    pick->second.push_back(picture);
  }
  return picks;
}

Json located(const LocateArguments& arguments, std::ostream& progress) {
  const Json result = value_or_throw(read_json(arguments.calibration));
  const auto calibration =
      value_or_throw(saved_calibration_from_json(result, arguments.calibration.filename().string()));
  const auto table =
      value_or_throw(read_csv(arguments.picks, {"name", "view", "u_px", "v_px"}, {"sigma_px"}));
  Json points = Json::array();
  for (const auto& [name, pictures] : picks_from(table, calibration, arguments.raw)) {
    const auto point = locate(name, PointSource::pick, pictures, calibration);
    points.push_back(point ? point_json(*point) : point_json(name, PointSource::pick, point.error().reason));
    if (!point) progress << fmt::format("{}: {}\n", name, point.error().message);
  }
  return points;
}

void print_table(const Json& points, std::ostream& out) {
  out << fmt::format("{:<16} {:>10} {:>10} {:>10} {:>9} {:>9}\n", "point", "x mm", "y mm", "z mm", "+- mm",
                     "gap mm");
  for (const Json& point : points) {
    const auto name = point["name"].get<std::string>();
    if (point["xyz_mm"].is_null()) {
      out << fmt::format("{:<16} {}\n", name, point["reason"].get<std::string>());
      continue;
    }
    const auto xyz = point["xyz_mm"].get<std::vector<double>>();
    out << fmt::format("{:<16} {:10.3f} {:10.3f} {:10.3f} {:9.3f} {:9.3f}\n", name, xyz[0], xyz[1], xyz[2],
                       point["predicted_mm"].get<double>(), point["ray_gap_mm"].get<double>());
  }
}

}  // namespace

CommandResult locate_command(const LocateArguments& arguments, Console& console) {
  const auto points = guarded([&] { return located(arguments, console.progress); });
  if (!points) return tl::unexpected<Failure>(points.error());
  if (console.json)
    console.out << Json{{"points", *points}}.dump(2) << '\n';
  else
    print_table(*points, console.out);
  return {};
}

}  // namespace helicarm::cli
