// SPDX-License-Identifier: Apache-2.0
#include <numbers>

#include <fmt/format.h>

#include "helicarm/exchange/import_text_test.h"
#include "helicarm/geometry/rotation.h"

namespace helicarm::exchange {
namespace {

const geometry::View maya_view{{6200, 6200, 840.5, 910.25, 0},
                               {geometry::rotation_from_vector({0.4, -1.1, 2.2}), {12, -30, 905}}};
constexpr int maya_height = 1700;

/// The five lines by the equations of XMALab's export: rows 1 and 3 of R and t negated, v counted upwards
/// from 1, angles about x, y, z.
std::string maya_cam_1(double image_plane_z_factor = 1) {
  Eigen::Matrix3d r = maya_view.camera_from_world.rotation;
  Eigen::Vector3d t = maya_view.camera_from_world.translation;
  for (const int row : {0, 2}) {
    r.row(row) *= -1;
    t[row] *= -1;
  }
  const Eigen::Matrix3d q = r.transpose();
  const Eigen::Vector3d source = -(q * t);
  const double degrees = 180 / std::numbers::pi;
  const double x = degrees * std::atan2(-q(2, 1), q(2, 2)),
               y = degrees * std::atan2(q(2, 0), std::hypot(q(2, 1), q(2, 2))),
               z = degrees * std::atan2(-q(1, 0), -q(0, 0));
  const double u = maya_view.intrinsics.u0 + 1, v = maya_height - 1 - maya_view.intrinsics.v0 + 1, f = -6200;
  return fmt::format("{},{},{}\n{},{},{}\n{},{},{}\n{},{},{}\n0.1,1760,{}\n", source.x(), source.y(),
                     source.z(), x, y, z, 0.1 * (880 - u), 0.1 * (0.5 * maya_height - v),
                     0.1 * f * image_plane_z_factor, u, v, f, maya_height);
}

TEST(ImportMaya, MayaCam1ProjectsAsXmalabsCamera) {
  const auto camera = import_text(maya_cam_1());
  ASSERT_TRUE(camera) << camera.error().message;
  EXPECT_EQ(*camera->image_size, Eigen::Vector2i(1760, maya_height));
  EXPECT_TRUE(camera->warnings.empty());
  for (const Eigen::Vector3d& point : {Eigen::Vector3d(1, 2, 3), {-20, 5, 12}, {7, -30, 4}})
    EXPECT_LT((camera->view.project(point) - maya_view.project(point)).norm(), 1e-8);
}

TEST(ImportMaya, ImagePlaneThatContradictsIsWarnedOf) {
  const auto camera = import_text(maya_cam_1(1.5));
  ASSERT_TRUE(camera) << camera.error().message;
  ASSERT_EQ(camera->warnings.size(), 1u);
  EXPECT_EQ(camera->warnings[0].reason, Reason::tag_disagrees);
}

TEST(ImportMaya, MayaCam1WithoutSizeAsksForIt) {
  const std::string none = replaced(maya_cam_1(), "0.1,1760,1700", "0.1,0,0");
  EXPECT_EQ(import_text(none).error().reason, Reason::usage);
  EXPECT_TRUE(import_text(none, {.image_size = Eigen::Vector2i(1760, maya_height)}));
}

}  // namespace
}  // namespace helicarm::exchange
