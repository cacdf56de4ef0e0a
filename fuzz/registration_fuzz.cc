// SPDX-License-Identifier: Apache-2.0
// registration.json as `measure --registration` reads it beside a calibration.
#include <sstream>

#include "helicarm/geometry/view_json.h"
#include "json_target.h"
#include "measure_command.h"

namespace helicarm::fuzz {
namespace {

std::string calibration_of_two_views() {
  Json views = Json::array();
  for (const double x_mm : {0.0, 40.0}) {
    geometry::View view{{4000, 4000, 512, 384}, {}};
    view.camera_from_world.translation = {x_mm, -5, 700};
    views.push_back({{"name", x_mm > 0 ? "LAT" : "AP"},
                     {"projection", geometry::json_rows(view.projection())},
                     {"camera_from_calibrator", geometry::json_rows(view.camera_from_world.matrix())}});
  }
  const Eigen::MatrixXd covariance = Eigen::MatrixXd::Identity(22, 22);
  return Json{{"format", "helicarm-result/1"},
              {"status", "ok"},
              {"views", views},
              {"calibration", {{"joint_covariance", geometry::json_rows(covariance)}}}}
      .dump();
}

}  // namespace

void run(std::string_view bytes) {
  static const auto calibration = put_file("result.json", calibration_of_two_views());
  static const auto clicks = put_file("clicks.csv",
                                      "measure,kind,view,name,u_px,v_px\nlength,distance,AP,tunnel_start,,"
                                      "\nlength,distance,AP,tunnel_end,,\n");
  std::ostringstream out, progress;
  cli::Console console{out, progress};
  console.json = true;
  cli::MeasureArguments arguments{clicks, calibration, put_file("registration.json", bytes)};
  if (!cli::measure_command(arguments, console)) return;
  const auto answer = parse_json(out.str(), "answer");
  check(answer.has_value() && all_finite(*answer), "measures are finite");
}

std::vector<std::string> seeds() {
  const auto point = [](const char* name, double x) {
    return Json{{"name", name},
                {"xyz_mm", {x, 1, 2}},
                {"covariance_mm2", {{0.1, 0, 0}, {0, 0.1, 0}, {0, 0, 0.2}}},
                {"in_femur", nullptr},
                {"warnings", {{{"code", "uncertain"}, {"message", "may be off"}}}}};
  };
  const Json model{{"name", "femur"},
                   {"status", "ok"},
                   {"failure", nullptr},
                   {"points", {point("tunnel_start", 0), point("tunnel_end", 20)}},
                   {"tunnels", Json::array()}};
  return {Json{{"format", "helicarm-registration/1"}, {"status", "ok"}, {"models", {model}}}.dump()};
}

}  // namespace helicarm::fuzz
