// SPDX-License-Identifier: Apache-2.0
#include "solve_command.h"

#include <cmath>
#include <set>
#include <vector>

#include <fmt/format.h>

#include "command_line.h"
#include "findings.h"
#include "helicarm/calibration/solve_view.h"
#include "helicarm/core/csv.h"
#include "helicarm/core/json.h"
#include "helicarm/geometry/rotation.h"
#include "helicarm/geometry/view_json.h"
#include "helicarm/pipeline/result.h"

namespace helicarm::cli {
namespace {

using calibration::SolvedView;

std::vector<fiducials::Fiducial> points_from(const CsvTable& table, const std::string& origin) {
  std::vector<fiducials::Fiducial> points;
  std::set<std::string> labels;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    const auto number = [&](const char* column) { return table.number(row, column); };
    fiducials::Fiducial point{table.text(row, "label"), {number("x_mm"), number("y_mm"), number("z_mm")}};
    point.status = fiducials::FiducialStatus::used;
    point.uv = {number("u_px"), number("v_px")};
    point.sigma_px = table.has("sigma_px") ? number("sigma_px") : 1;
    if (!(point.sigma_px > 0))
      throw BadInput(Reason::bad_value, fmt::format("{}: row {}: sigma_px: {} must be positive", origin,
                                                    row + 1, point.sigma_px));
    if (!labels.insert(point.label).second)
      throw BadInput(Reason::name_clash,
                     fmt::format("{}: row {}: label: \"{}\" is given twice", origin, row + 1, point.label));
    points.push_back(point);
  }
  return points;
}

Json json_of(const SolvedView& solution) {
  Json json;
  json["dlt"] = solution.dlt ? geometry::json_list(*solution.dlt) : Json();
  json["projection"] = geometry::json_rows(solution.view.projection());
  json["intrinsics"] = geometry::intrinsics_json(solution.view.intrinsics, std::nullopt);
  json["camera_from_world"] = geometry::json_rows(solution.view.camera_from_world.matrix());
  json["covariance"] = solution.covariance ? geometry::json_rows(*solution.covariance) : Json();
  json["reprojection_rms_px"] = solution.reprojection_rms_px;
  json["condition"] = solution.condition;
  json["warnings"] = pipeline::json_list_of(solution.warnings);
  return json;
}

void print_table(const SolvedView& solution, const std::vector<fiducials::Fiducial>& points,
                 std::ostream& out) {
  const geometry::Intrinsics& k = solution.view.intrinsics;
  const geometry::RigidTransform& pose = solution.view.camera_from_world;
  const geometry::EulerAngles angles = geometry::euler_from_rotation(pose.rotation);
  const Eigen::Vector3d source = solution.view.source_in_world();
  const double degrees = 180 / std::acos(-1.0);
  const auto sigma = [&](Eigen::Index i) {
    return solution.covariance ? fmt::format(" +- {:.3g}", std::sqrt((*solution.covariance)(i, i))) : "";
  };
  out << fmt::format("focal length   fx {:.3f}{} px, fy {:.3f}{} px, skew {:.3f} px\n", k.fx, sigma(0), k.fy,
                     sigma(1), k.skew)
      << fmt::format("central ray    u0 {:.3f}{} px, v0 {:.3f}{} px\n", k.u0, sigma(2), k.v0, sigma(3))
      << fmt::format("angles (Eq. 5) alpha {:.4f}, beta {:.4f}, gamma {:.4f} deg{}\n", angles.alpha * degrees,
                     angles.beta * degrees, angles.gamma * degrees, angles.gimbal_locked ? " (locked)" : "")
      << fmt::format("translation    {:.4f} {:.4f} {:.4f} mm\n", pose.translation.x(), pose.translation.y(),
                     pose.translation.z())
      << fmt::format("source         {:.4f} {:.4f} {:.4f} mm\n", source.x(), source.y(), source.z())
      << fmt::format("condition      {:.3g}\nreprojection   {:.4g} px rms over {} points\n",
                     solution.condition, solution.reprojection_rms_px, points.size());
  for (const fiducials::Fiducial& point : points)
    out << fmt::format("  {:<12} {:.4g} px\n", point.label,
                       (solution.view.project(point.centre_in_calibrator) - point.uv).norm());
}

}  // namespace

CommandResult solve_command(const SolveArguments& arguments, Console& console) {
  const auto table =
      read_csv(arguments.points, {"label", "x_mm", "y_mm", "z_mm", "u_px", "v_px"}, {"sigma_px"});
  if (!table) return tl::unexpected<Failure>(table.error());
  const std::string origin = arguments.points.filename().string();
  const auto points = guarded([&] { return points_from(*table, origin); });
  if (!points) return tl::unexpected<Failure>(points.error());
  const auto solved = calibration::solve_method(arguments.method, "--method").and_then([&](auto method) {
    return calibration::solve_view(*points, method, table->has("sigma_px"), {origin, "x_mm, y_mm and z_mm"});
  });
  if (!solved) return tl::unexpected<Failure>(solved.error());
  print_warnings(solved->warnings, console);
  if (console.json)
    console.out << to_text(json_of(*solved)) << '\n';
  else
    print_table(*solved, *points, console.out);
  return {};
}

void add_solve(CLI::App& app, Action& action) {
  auto* command = add_command(app, group::images, "solve",
                              "Calibrate one view from known 3-D points and their pixels (Eq. 4-7)",
                              "helicarm solve --points points.csv --method ml --json");
  auto& a = arguments_of(command, action, solve_command);
  command->add_option("--points", a.points, "CSV: label,x_mm,y_mm,z_mm,u_px,v_px[,sigma_px]")->required();
  command->add_option("--method", a.method, "dlt, homogeneous or ml")
      ->type_name("WORD")
      ->capture_default_str();
}

}  // namespace helicarm::cli
