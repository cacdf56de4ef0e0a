// SPDX-License-Identifier: Apache-2.0
#include "drr_command.h"

#include <cstring>
#include <sstream>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "helicarm/core/files.h"
#include "helicarm/core/json.h"
#include "helicarm/image/png.h"

namespace helicarm::cli {
namespace {
namespace fs = std::filesystem;

TEST(DrrCommand, LeftAndHeadAgreeWithTheHelp) {
  const fs::path folder = fs::temp_directory_path() / fmt::format("helicarm_drr_command_{}", ::getpid());
  fs::create_directories(folder);
  std::string voxels(27, '\0');
  voxels[2 + 3 * 1 + 9 * 2] = 100;  // left, centre in depth, at the head
  ASSERT_TRUE(
      write_file(folder / "a.mha",
                 "NDims = 3\nDimSize = 3 3 3\nElementType = MET_UCHAR\nElementDataFile = LOCAL\n" + voxels));
  std::ostringstream out, progress;
  Console console{out, progress};
  console.json = true;
  DrrArguments arguments;
  arguments.volume = folder / "a.mha";
  arguments.out = folder / "a.png";
  arguments.raw = folder / "a.f32";
  arguments.values = "raw";
  arguments.size = 9;
  arguments.pixel_mm = 0.5;
  const auto done = drr_command(arguments, console);
  const std::string raw = *read_file(folder / "a.f32", 9999);
  const auto png = image::decode_png(*read_file(folder / "a.png", 9999), "a.png");
  arguments.values = "hu";
  const auto as_mask = drr_command(arguments, console);
  arguments.values = "hounsfield";
  const auto refused = drr_command(arguments, console);
  arguments.values = "raw";
  arguments.out = folder / "a.jpg";
  const auto no_png = drr_command(arguments, console);
  arguments.out.clear();
  arguments.raw.clear();
  console.json = false;
  const auto no_output = drr_command(arguments, console);
  fs::remove_all(folder);
  ASSERT_TRUE(done.has_value()) << done.error().message;
  EXPECT_NEAR(parse_json(out.str(), "out")->at("maximum").get<double>(), 100, 0.1);
  ASSERT_EQ(raw.size(), 81 * sizeof(float));
  const auto pixel = [&](int u, int v) {
    float value = 0;
    std::memcpy(&value, raw.data() + sizeof value * static_cast<std::size_t>(u + 9 * v), sizeof value);
    return value;
  };
  EXPECT_FALSE(as_mask.has_value());  // 0 and 100 only
  EXPECT_GT(pixel(7, 1), 99);
  EXPECT_EQ(pixel(1, 1), 0);
  EXPECT_EQ(pixel(7, 7), 0);
  EXPECT_GT(png->pixels(7, 1), 60000);
  for (const auto& wrong : {refused, no_png, no_output}) EXPECT_EQ(wrong.error().reason, Reason::usage);
}

}  // namespace
}  // namespace helicarm::cli
