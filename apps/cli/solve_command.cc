// SPDX-License-Identifier: Apache-2.0
#include "solve_command.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <span>
#include <vector>

#include <fmt/format.h>

#include "command_line.h"
#include "findings.h"
#include "helicarm/calibration/calibrate.h"
#include "helicarm/core/csv.h"
#include "helicarm/core/json.h"
#include "helicarm/exchange/import_matrix.h"
#include "helicarm/geometry/rotation.h"
#include "helicarm/geometry/view_json.h"
#include "helicarm/pipeline/result.h"

namespace helicarm::cli {
namespace {

struct Solution {
  geometry::View view;
  std::optional<geometry::DltFactors> dlt;
  std::optional<Eigen::MatrixXd> covariance;
  double condition = 0;
  double sigmas_exceeded = 1;  ///< residuals over the stated sigmas, where inconsistent
};

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

Expected<Solution> most_likely(const std::vector<fiducials::Fiducial>& points, bool sigmas_given) {
  calibration::CalibrationOptions options;
  options.rejection_probability = 0;
  options.largest_rms_px = std::numeric_limits<double>::infinity();
  const auto result = calibration::calibrate({{"", points}}, options);
  if (!result) return tl::unexpected<Failure>(result.error());
  const calibration::CalibratedView& view = result->views.front();
  const double scale = sigmas_given ? 1 : result->chi2 / result->dof / result->variance_scale;
  return Solution{view.view, view.dlt, result->joint_covariance * scale, view.condition,
                  sigmas_given ? std::sqrt(result->variance_scale) : 1};
}

Expected<Solution> solve(const std::string& method, const std::vector<fiducials::Fiducial>& points,
                         const std::vector<geometry::PointPair>& pairs, bool sigmas_given) {
  if (method == "ml") return most_likely(points, sigmas_given);
  if (method != "dlt" && method != "homogeneous")
    return fail(Reason::usage, fmt::format("--method: \"{}\" is none of: dlt, homogeneous, ml", method));
  const auto result = method == "dlt" ? geometry::dlt_least_squares(pairs) : geometry::dlt_homogeneous(pairs);
  return result.map([](const geometry::DltResult& dlt) {
    return Solution{dlt.view, dlt.factors, std::nullopt, dlt.condition, 1};
  });
}

Json json_of(const Solution& solution, double rms_px, std::span<const Warning> warnings) {
  Json json;
  json["dlt"] = solution.dlt ? geometry::json_list(*solution.dlt) : Json();
  json["projection"] = geometry::json_rows(solution.view.projection());
  json["intrinsics"] = geometry::intrinsics_json(solution.view.intrinsics, std::nullopt);
  json["camera_from_world"] = geometry::json_rows(solution.view.camera_from_world.matrix());
  json["covariance"] = solution.covariance ? geometry::json_rows(*solution.covariance) : Json();
  json["reprojection_rms_px"] = rms_px;
  json["condition"] = solution.condition;
  json["warnings"] = pipeline::json_list_of(warnings);
  return json;
}

void print_table(const Solution& solution, double rms_px, const std::vector<fiducials::Fiducial>& points,
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
                     solution.condition, rms_px, points.size());
  for (const fiducials::Fiducial& point : points)
    out << fmt::format("  {:<12} {:.4g} px\n", point.label,
                       (solution.view.project(point.centre_in_calibrator) - point.uv).norm());
}

/// Label of the point with the largest residual.
std::string farthest(const Solution& solution, const std::vector<fiducials::Fiducial>& points) {
  const auto residual = [&](const fiducials::Fiducial& point) {
    return (solution.view.project(point.centre_in_calibrator) - point.uv).norm();
  };
  return std::ranges::max_element(points, {}, residual)->label;
}

std::vector<Warning> warnings_of(const Solution& solution, double rms_px,
                                 const std::vector<fiducials::Fiducial>& points) {
  std::vector<Warning> warnings;
  const double limit = calibration::CalibrationOptions{}.largest_rms_px;
  if (rms_px > limit)
    warnings.push_back(
        {Reason::residual_too_large,
         fmt::format("{:.3g} px rms, over {:g} px: check the point with the largest residual ({}); "
                     "solve rejects no outlier",
                     rms_px, limit, farthest(solution, points)),
         {},
         {{"rms_px", rms_px}, {"limit", limit}}});
  else if (solution.sigmas_exceeded > 1)
    warnings.push_back(
        {Reason::residual_too_large,
         fmt::format(
             "residuals are {:.3g} times the stated sigma_px, and the covariance is inflated: check the "
             "point with the largest residual ({}); solve rejects no outlier",
             solution.sigmas_exceeded, farthest(solution, points)),
         {},
         {{"sigmas_exceeded", solution.sigmas_exceeded}}});
  if (const auto flipped = exchange::mirrored_or_upwards(solution.view.intrinsics))
    warnings.push_back(*flipped);
  return warnings;
}

double distance_to_source(const Solution& solution, const std::vector<geometry::PointPair>& pairs) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const geometry::PointPair& pair : pairs) sum += pair.point_in_world;
  return (solution.view.source_in_world() - sum / double(pairs.size())).norm();
}

}  // namespace

CommandResult solve_command(const SolveArguments& arguments, Console& console) {
  const auto table =
      read_csv(arguments.points, {"label", "x_mm", "y_mm", "z_mm", "u_px", "v_px"}, {"sigma_px"});
  if (!table) return tl::unexpected<Failure>(table.error());
  const std::string origin = arguments.points.filename().string();
  const auto points = guarded([&] { return points_from(*table, origin); });
  if (!points) return tl::unexpected<Failure>(points.error());
  std::vector<geometry::PointPair> pairs;
  for (const fiducials::Fiducial& point : *points) pairs.push_back({point.centre_in_calibrator, point.uv});
  const auto solution = solve(arguments.method, *points, pairs, table->has("sigma_px"));
  if (!solution) return tl::unexpected<Failure>(solution.error());
  const auto in_mm =
      exchange::check_source_distance(distance_to_source(*solution, pairs), "the points' middle", origin,
                                      "give x_mm, y_mm and z_mm in mm; they look like cm or m");
  if (!in_mm) return in_mm;
  const double rms_px = geometry::reprojection_rms(solution->view, pairs);
  const auto warnings = warnings_of(*solution, rms_px, *points);
  print_warnings(warnings, console);
  if (console.json)
    console.out << to_text(json_of(*solution, rms_px, warnings)) << '\n';
  else
    print_table(*solution, rms_px, *points, console.out);
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
