// SPDX-License-Identifier: Apache-2.0
#include "solve_command.h"

#include <cmath>
#include <sstream>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "helicarm/core/files.h"
#include "helicarm/core/json.h"
#include "helicarm/geometry/rotation.h"
#include "helicarm/geometry/view.h"

namespace helicarm::cli {
namespace {
namespace fs = std::filesystem;

const geometry::View view{{-6000, 6000, 512, 500, 0},
                          {geometry::rotation_from_euler(0.3, -0.2, 1), {5, -8, 800}}};

std::string table_of(int n, bool flat, const std::string& sigma = "", double unit_mm = 1) {
  std::string text = "label,x_mm,y_mm,z_mm,u_px,v_px" + std::string(sigma.empty() ? "" : ",sigma_px") + "\n";
  for (int k = 0; k < n; ++k) {
    const double t = 0.5 + 1.57 * k;
    const Eigen::Vector3d p(50 * std::cos(t), 50 * std::sin(t), flat ? 0 : 4 * t);
    const Eigen::Vector2d uv = view.project(p);
    text += fmt::format("P{},{},{},{},{},{}{}\n", k, p.x() / unit_mm, p.y() / unit_mm, p.z() / unit_mm,
                        uv.x(), uv.y(), sigma.empty() ? "" : "," + sigma);
  }
  return text;
}

struct Solved {
  CommandResult result;
  std::string text;
};

Solved solve_text(const std::string& table, const std::string& method, bool json = true) {
  const fs::path path = fs::temp_directory_path() / fmt::format("helicarm_solve_{}.csv", ::getpid());
  EXPECT_TRUE(write_file(path, table));
  std::ostringstream out, progress;
  Console console{out, progress};
  console.json = json;
  auto result = solve_command({path, method}, console);
  fs::remove(path);
  return {std::move(result), out.str()};
}

TEST(SolveCommand, EveryMethodRecoversTheMirroredView) {
  for (const char* method : {"dlt", "homogeneous", "ml"}) {
    const Solved answer = solve_text(table_of(12, false), method);
    ASSERT_TRUE(answer.result.has_value()) << answer.result.error().message;
    const Json json = *parse_json(answer.text, "out");
    EXPECT_NEAR(json["intrinsics"]["fx_px"].get<double>(), -6000, 1e-4) << method;
    EXPECT_TRUE(json["intrinsics"]["f_mm"].is_null());
    EXPECT_NEAR(json["camera_from_world"][2][3].get<double>(), 800, 1e-4);
    EXPECT_EQ(json["dlt"].size(), 11u);
    EXPECT_NEAR(json["projection"][2][3].get<double>(), 800, 1e-4);
    EXPECT_EQ(json["covariance"].is_null(), std::string(method) != "ml");
    EXPECT_LT(json["reprojection_rms_px"].get<double>(), 1e-6);
    EXPECT_LT(json["condition"].get<double>(), 100);
  }
}

TEST(SolveCommand, NegativeFxIsWarnedOf) {
  const Json warnings = (*parse_json(solve_text(table_of(12, false), "ml").text, "out"))["warnings"];
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_EQ(warnings[0]["code"], "ambiguous_handedness");
  EXPECT_NE(warnings[0]["message"].get<std::string>().find("upwards"), std::string::npos);
}

TEST(SolveCommand, AResidualOfManyStatedSigmasIsWarnedOf) {
  std::string table = table_of(12, false, "0.02");
  const auto codes = [](const std::string& points) {
    std::vector<std::string> found;
    const Json answer = *parse_json(solve_text(points, "ml").text, "out");
    for (const Json& warning : answer["warnings"]) found.push_back(warning["code"]);
    return found;
  };
  EXPECT_EQ(codes(table), std::vector<std::string>{"ambiguous_handedness"});
  const std::size_t sigma = table.find(",0.02\nP6,");  // of P5: a pixel to the side
  const std::size_t u_px = table.find("\nP5,");
  ASSERT_NE(sigma, std::string::npos);
  const Eigen::Vector3d p(50 * std::cos(0.5 + 1.57 * 5), 50 * std::sin(0.5 + 1.57 * 5), 4 * (0.5 + 1.57 * 5));
  const Eigen::Vector2d uv = view.project(p) + Eigen::Vector2d(1, 0);
  table.replace(u_px, sigma - u_px, fmt::format("\nP5,{},{},{},{},{}", p.x(), p.y(), p.z(), uv.x(), uv.y()));
  EXPECT_EQ(codes(table), (std::vector<std::string>{"residual_too_large", "ambiguous_handedness"}));
}

TEST(SolveCommand, TableContainsEveryPoint) {
  const Solved answer = solve_text(table_of(8, false, "0.2"), "ml", false);
  ASSERT_TRUE(answer.result.has_value());
  EXPECT_NE(answer.text.find("P7"), std::string::npos);
  EXPECT_NE(answer.text.find("+-"), std::string::npos);
}

TEST(SolveCommand, BadInputIsNamedInTheMessage) {
  const auto reason_of = [](const std::string& table, const std::string& method) {
    return solve_text(table, method).result.error().reason;
  };
  EXPECT_EQ(reason_of(table_of(12, true), "dlt"), Reason::coplanar_fiducials);
  EXPECT_EQ(reason_of(table_of(12, true), "ml"), Reason::coplanar_fiducials);
  EXPECT_EQ(reason_of(table_of(5, false), "homogeneous"), Reason::too_few_fiducials);
  EXPECT_EQ(reason_of(table_of(8, false, "-1"), "ml"), Reason::bad_value);
  EXPECT_EQ(reason_of(table_of(8, false, "nan"), "ml"), Reason::not_finite);
  EXPECT_EQ(reason_of(table_of(8, false), "guess"), Reason::usage);
  EXPECT_EQ(reason_of("label,x_mm\n", "ml"), Reason::bad_value);
}

TEST(SolveCommand, ALabelTwiceIsRefused) {
  const std::string twice = table_of(12, false) + "P3,1,2,3,4,5\n";
  const auto refused = solve_text(twice, "ml").result;
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().reason, Reason::name_clash);
  EXPECT_NE(refused.error().message.find("row 13: label: \"P3\""), std::string::npos);
}

TEST(SolveCommand, LengthsThatAreNotInMillimetresAreRefused) {
  for (const char* method : {"dlt", "homogeneous", "ml"})
    for (const double unit_mm : {10.0, 1000.0}) {
      const auto refused = solve_text(table_of(12, false, "", unit_mm), method).result;
      ASSERT_FALSE(refused) << method << unit_mm;
      EXPECT_EQ(refused.error().reason, Reason::usage) << refused.error().message;
      EXPECT_NE(refused.error().message.find("in mm"), std::string::npos);
    }
}

}  // namespace
}  // namespace helicarm::cli
