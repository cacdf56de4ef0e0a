// SPDX-License-Identifier: Apache-2.0
#include "helicarm/rectification/pixel_map.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "helicarm/core/files.h"
#include "helicarm/core/temporary_folder.h"

namespace helicarm::rectification {
namespace pixel_map_test {

/// Distorted by pincushion and S distortion, in a frame that is shifted, larger and turned.
Eigen::Vector2d raw_of(const Eigen::Vector2d& at) {
  const Eigen::Vector2d p = (Eigen::Rotation2Dd(0.03) * at / 1.02 - Eigen::Vector2d(252, 240)) / 250;
  const double r2 = p.squaredNorm();
  return Eigen::Vector2d(252, 240) + 250 * (p + 0.03 * r2 * p + 0.01 * r2 * Eigen::Vector2d(-p.y(), p.x()));
}

struct GridFiles {
  TemporaryFolder folder;
  std::string raw, straight;
  GridFiles() {
    for (double y = 40; y < 470; y += 18)
      for (double x = 40; x < 470; x += 18) {
        const Eigen::Vector2d uv = raw_of({x, y});
        raw += fmt::format("{:.12g},{:.12g}\n", uv.x(), uv.y());
        straight += fmt::format("{:.12g},{:.12g}\n", x, y);
      }
  }
  Expected<std::vector<Correspondence>> read() {
    EXPECT_TRUE(write_file(folder.path() / "a_INPTS.csv", raw));
    EXPECT_TRUE(write_file(folder.path() / "a_BSPTS.csv", straight));
    return read_xmalab_grid(folder.path() / "a_INPTS.csv", folder.path() / "a_BSPTS.csv");
  }
};

TEST(PixelMap, KeepsTheUndistortedPixelsOfTheGrid) {
  GridFiles files;
  const auto dots = files.read();
  ASSERT_TRUE(dots) << dots.error().message;
  const auto fit = fit_pixel_map(*dots, 512, 512);
  ASSERT_TRUE(fit) << fit.error().message;
  EXPECT_LT(fit->map.residual_rms_px, 0.01);
  for (const Eigen::Vector2d& at : {Eigen::Vector2d(100, 90), {256, 256}, {300, 410}}) {
    EXPECT_LT((fit->map.raw_from_rectified(at) - raw_of(at)).norm(), 0.02);
    EXPECT_LT((*fit->map.rectified_from_raw(raw_of(at)) - at).norm(), 0.02);
  }
}

TEST(PixelMap, BrokenGridsAreNamed) {
  GridFiles shorter;
  shorter.straight.resize(shorter.straight.find_last_of('\n', shorter.straight.size() - 2) + 1);
  EXPECT_EQ(shorter.read().error().reason, Reason::bad_size);
  GridFiles words;
  words.raw += "x,y\n";
  EXPECT_NE(words.read().error().message.find("a_INPTS.csv: line 577"), std::string::npos)
      << words.read().error().message;
  GridFiles three;
  three.raw.insert(0, "1,2,3\n");
  EXPECT_EQ(three.read().error().reason, Reason::bad_value);
  GridFiles infinite;
  infinite.raw.insert(0, "inf,2\n");
  EXPECT_EQ(infinite.read().error().reason, Reason::bad_value);
}

}  // namespace pixel_map_test
}  // namespace helicarm::rectification
