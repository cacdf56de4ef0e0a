// SPDX-License-Identifier: Apache-2.0
#include "gui/scene/model_surface.h"

#include <QCoreApplication>
#include <QElapsedTimer>
#include <QThread>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

namespace helicarm::gui {
namespace {

using Eigen::Vector3d;

/// A ball of `radius` voxels with a cavity, of density 1.2 in voxels of `voxel_mm`.
registration::Model hollow_ball(int radius, double voxel_mm) {
  registration::Model model;
  const int side = 2 * radius + 5;
  model.density.size.setConstant(side);
  model.density.model_from_voxel =
      Eigen::Translation3d(10, -20, 30) * Eigen::Scaling(voxel_mm * Vector3d(1, -1, 1));  // mirrored
  const Vector3d middle = Vector3d::Constant(side / 2);
  for (int z = 0; z < side; ++z)
    for (int y = 0; y < side; ++y)
      for (int x = 0; x < side; ++x) {
        const double at = (Vector3d(x, y, z) - middle).norm();
        model.density.values.push_back(at <= radius && at > 0.7 * radius ? 1.2F : 0);
      }
  model.centre = model.density.model_from_voxel * middle;
  return model;
}

void expect_ball(const phantom::TriangleMesh& mesh, const Vector3d& centre, double radius_mm, double off_mm) {
  for (const Vector3d& corner : mesh.corners) EXPECT_NEAR((corner - centre).norm(), radius_mm, off_mm);
  const double volume = 4 * std::numbers::pi / 3 * std::pow(radius_mm, 3);
  EXPECT_NEAR(phantom::volume(mesh), volume, 3 * off_mm / radius_mm * volume);  // positive: outside out
}

TEST(ModelSurface, OfAVolumeIsItsOuterIsosurface) {
  const registration::Model model = hollow_ball(20, 1.5);
  const phantom::TriangleMesh mesh = surface_of(model);
  EXPECT_GT(mesh.triangles.size(), 1000u);
  expect_ball(mesh, model.centre, 30.3, 1.2);
}

TEST(ModelSurface, OfALargeVolumeIsCoarser) {
  const registration::Model model = hollow_ball(80, 0.5);
  const phantom::TriangleMesh mesh = surface_of(model);
  EXPECT_LE(mesh.triangles.size(), most_model_triangles);
  expect_ball(mesh, model.centre, 40.2, 1);
}

registration::Model ball_surface(double step_mm) {
  registration::Model model;
  model.surface.emplace();
  model.surface->mesh = phantom::surface_of([](const Vector3d& at) { return at.norm() - 50; },
                                            {Vector3d::Constant(-55), Vector3d::Constant(55)}, step_mm);
  return model;
}

TEST(ModelSurface, OfASurfaceIsItsMesh) {
  const registration::Model model = ball_surface(5);
  const phantom::TriangleMesh mesh = surface_of(model);
  EXPECT_EQ(mesh.corners, model.surface->mesh.corners);
  EXPECT_EQ(mesh.triangles, model.surface->mesh.triangles);
}

TEST(ModelSurface, OfAFineSurfaceHasFewerTriangles) {
  const registration::Model model = ball_surface(0.8);
  ASSERT_GT(model.surface->mesh.triangles.size(), most_model_triangles);
  const phantom::TriangleMesh mesh = surface_of(model);
  EXPECT_LE(mesh.triangles.size(), most_model_triangles);
  EXPECT_GT(mesh.triangles.size(), most_model_triangles / 4);
  expect_ball(mesh, Vector3d::Zero(), 50, 0.5);
}

TEST(ModelSurfaces, EachIsComputedOnceInAnotherThread) {
  int argc = 1;
  char name[] = "scene";
  char* argv[] = {name, nullptr};
  const QCoreApplication app(argc, argv);
  ModelSurfaces surfaces;
  int news = 0;
  QObject::connect(&surfaces, &ModelSurfaces::computed, [&] { ++news; });
  const auto wait = [&](int until) {
    QElapsedTimer since;
    since.start();
    while (news < until && since.elapsed() < 60000) {
      QCoreApplication::processEvents();
      QThread::msleep(2);
    }
    ASSERT_EQ(news, until);
  };
  const auto first = std::make_shared<const registration::Model>(ball_surface(5));
  const auto second = std::make_shared<const registration::Model>(hollow_ball(12, 1));
  surfaces.keep({first, nullptr});
  EXPECT_EQ(surfaces.of(first), nullptr);
  EXPECT_EQ(surfaces.of(nullptr), nullptr);
  wait(1);
  const auto surface = surfaces.of(first);
  ASSERT_NE(surface, nullptr);
  surfaces.keep({second, first});
  EXPECT_EQ(surfaces.of(first), surface);
  wait(2);
  EXPECT_NE(surfaces.of(second), nullptr);
  surfaces.keep({second});
  EXPECT_EQ(surfaces.of(first), nullptr);
}

}  // namespace
}  // namespace helicarm::gui
