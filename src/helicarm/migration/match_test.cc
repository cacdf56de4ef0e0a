// SPDX-License-Identifier: Apache-2.0
#include "helicarm/migration/match.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "helicarm/geometry/rotation.h"

namespace helicarm::migration {
namespace {

const geometry::RigidTransform turned{geometry::rotation_from_vector({0.4, -1.2, 2.5}), {40, -3, 7}};

std::vector<Marker> cluster(const std::vector<Eigen::Vector3d>& places,
                            const geometry::RigidTransform& pose) {
  std::vector<Marker> markers;
  for (const Eigen::Vector3d& place : places)
    markers.push_back({"m" + std::to_string(markers.size()), pose * place, {}, {}});
  return markers;
}

const std::vector<Eigen::Vector3d> irregular{{0, 0, 0}, {17, 2, 1}, {4, 21, -3}, {-6, 5, 13}, {9, -8, 20}};

TEST(Match, FindsMarkersInAnyOrderAmongOthers) {
  const auto first = cluster(irregular, {});
  auto second = cluster(irregular, turned);
  std::ranges::reverse(second);
  second.push_back({"other", {60, 1, 2}, {}, {}});
  second.insert(second.begin(), {"another", {33, -20, 12}, {}, {}});
  const auto match = match_by_geometry("bone", first, second, 1);
  ASSERT_TRUE(match) << match.error().message;
  ASSERT_EQ(match->first.size(), 5u);
  for (std::size_t n = 0; n < 5; ++n) EXPECT_EQ(first[match->first[n]].name, second[match->second[n]].name);
}

TEST(Match, AMirroredClusterIsNotTheSame) {
  std::vector<Eigen::Vector3d> mirrored = irregular;
  for (Eigen::Vector3d& place : mirrored) place.x() = -place.x();
  const auto match = match_by_geometry("bone", cluster(irregular, {}), cluster(mirrored, turned), 1);
  EXPECT_TRUE(!match || match->first.size() < 5);
}

TEST(Match, CongruentMarkersAreRefusedAndMatchByName) {
  const std::vector<Eigen::Vector3d> square{{0, 0, 0}, {20, 0, 0}, {20, 20, 0}, {0, 20, 0}};
  const auto first = cluster(square, {}), second = cluster(square, turned);
  EXPECT_EQ(match_by_geometry("bone", first, second, 1).error().reason, Reason::ambiguous_labels);
  EXPECT_EQ(match_by_name("bone", first, second)->second, (std::vector<std::size_t>{0, 1, 2, 3}));
}

TEST(Match, TwoMarkersAreTooFew) {
  const auto first = cluster(irregular, {});
  auto second = cluster(irregular, turned);
  second.resize(2);
  EXPECT_EQ(match_by_geometry("bone", first, second, 1).error().reason, Reason::too_few_fiducials);
  EXPECT_EQ(match_by_name("bone", first, second).error().reason, Reason::too_few_fiducials);
}

}  // namespace
}  // namespace helicarm::migration
