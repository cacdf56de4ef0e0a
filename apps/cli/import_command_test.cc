// SPDX-License-Identifier: Apache-2.0
#include "import_command.h"

#include <sstream>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "helicarm/core/files.h"
#include "helicarm/core/json.h"

namespace helicarm::cli {
namespace {
namespace fs = std::filesystem;

TEST(ImportCommand, CentimetresBecomeMillimetres) {
  const fs::path path = fs::temp_directory_path() / fmt::format("helicarm_import_command_{}.txt", ::getpid());
  ASSERT_TRUE(write_file(path, "6000 0 512 40960\n0 6000 500 40000\n0 0 1 80\n"));
  std::ostringstream out, progress;
  Console console{out, progress};
  console.json = true;
  const auto imported = import_command({path, "cm"}, console);
  const auto refused = import_command({path, "inch"}, console);
  fs::remove(path);
  ASSERT_TRUE(imported.has_value());
  const Json json = *parse_json(out.str(), "out");
  EXPECT_NEAR(json["t"][2].get<double>(), 800, 1e-9);
  EXPECT_NEAR(json["K"][0][0].get<double>(), 6000, 1e-9);
  EXPECT_NEAR(json["projection"][2][3].get<double>(), 800, 1e-9);
  EXPECT_TRUE(json["image_size"].is_null());
  EXPECT_EQ(refused.error().reason, Reason::usage);
}

/// 3D Slicer's parent transform of a model that moves by (10, 0, 0) L: the file holds the inverse.
TEST(ImportCommand, ItkTransformIsPrintedInBothDirections) {
  const fs::path path = fs::temp_directory_path() / fmt::format("helicarm_import_command_{}.tfm", ::getpid());
  ASSERT_TRUE(write_file(path,
                         "#Insight Transform File V1.0\n#Transform 0\nTransform: AffineTransform_double_3_3\n"
                         "Parameters: 1 0 0 0 1 0 0 0 1 -10 0 0\nFixedParameters: 0 0 0\n"));
  std::ostringstream out, progress;
  Console console{out, progress};
  console.json = true;
  const auto imported = import_command({path}, console);
  fs::remove(path);
  ASSERT_TRUE(imported) << imported.error().message;
  const Json json = *parse_json(out.str(), "out");
  EXPECT_EQ(json["fixed_from_moving"][0], Json({1.0, 0.0, 0.0, 10.0}));
  EXPECT_EQ(json["moving_from_fixed"][0], Json({1.0, 0.0, 0.0, -10.0}));
}

TEST(ImportCommand, RigidMatrixIsPrintedWithItsInverse) {
  const fs::path path = fs::temp_directory_path() / fmt::format("helicarm_import_command_{}.txt", ::getpid());
  ASSERT_TRUE(write_file(path, "0 -1 0 1\n1 0 0 2\n0 0 1 3\n0 0 0 1\n"));
  std::ostringstream out, progress;
  Console console{out, progress};
  console.json = true;
  const auto imported = import_command({path, "m"}, console);
  fs::remove(path);
  ASSERT_TRUE(imported) << imported.error().message;
  const Json json = *parse_json(out.str(), "out");
  EXPECT_EQ(json["matrix"][0], Json({0.0, -1.0, 0.0, 1000.0}));
  EXPECT_EQ(json["inverse"][0][3], -2000.0);
}

/// The list is read again.
TEST(ImportCommand, RunIsPrintedAsAListOfCameras) {
  const fs::path path = fs::temp_directory_path() / fmt::format("helicarm_import_command_{}.csv", ::getpid());
  ASSERT_TRUE(write_file(path,
                         "view,p11,p12,p13,p14,p21,p22,p23,p24,p31,p32,p33,p34\n"
                         "RUN/1,6000,0,512,409600,0,6000,500,400000,0,0,1,800\n"
                         "RUN/2,6000,0,512,409600,0,6000,500,400000,0,0,1,810\n"));
  std::ostringstream out, again, progress;
  Console console{out, progress}, second{again, progress};
  console.json = second.json = true;
  const auto imported = import_command({path}, console);
  ASSERT_TRUE(write_file(path, out.str()));
  const auto list = import_command({path}, second);
  fs::remove(path);
  ASSERT_TRUE(imported) << imported.error().message;
  ASSERT_TRUE(list) << list.error().message;
  const Json json = *parse_json(out.str(), "out");
  EXPECT_EQ(json["cameras"][1]["name"], "RUN/2");
  EXPECT_NEAR(json["cameras"][1]["t"][2].get<double>(), 810, 1e-9);
  EXPECT_EQ(parse_json(again.str(), "again")->at("cameras").size(), 2u);
}

}  // namespace
}  // namespace helicarm::cli
