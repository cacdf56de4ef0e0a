// SPDX-License-Identifier: Apache-2.0
#include "studies/simd_geometry.h"

#include <array>
#include <vector>

#include <gtest/gtest.h>

#include "helicarm/geometry/dlt.h"
#include "helicarm/geometry/triangulation.h"
#include "studies/paper_scene.h"

namespace helicarm::study {
namespace {

geometry::Projection projection_of(const SimdProjection& simd_of, int lane) {
  geometry::Projection p;
  for (int i = 0; i < 4; ++i) {
    p(0, i) = simd_of.u[i][lane];
    p(1, i) = simd_of.v[i][lane];
    p(2, i) = i < 3 ? simd_of.w[i][lane] : 1;
  }
  return p;
}

Eigen::Vector2d pixel_of(const geometry::Projection& p, const Eigen::Vector3d& x) {
  return (p * x.homogeneous()).hnormalized();
}

/// Four random groups of balls on the spiral with their noisy pixels in both views.
struct Scene {
  std::vector<SimdPoint> balls;
  std::vector<SimdPixel> pixels[2];

  Scene(std::size_t count, double sigma, std::uint64_t first_trial) {
    const SimdRandom random(5, 1, first_trial);
    const SimdViews views(paper_views(WorldOrigin::base));
    balls = balls_on_spiral(random, count);
    SimdPixels noise;
    draw_noise(random, draw::calibration, count, noise);
    for (std::size_t view = 0; view < 2; ++view)
      for (std::size_t i = 0; i < count; ++i) {
        SimdPixel pixel = views.project(view, balls[i]);
        pixel.u += sigma * noise.of_view[view][i].u;
        pixel.v += sigma * noise.of_view[view][i].v;
        pixels[view].push_back(pixel);
      }
  }
  Eigen::Vector3d ball(std::size_t i, int lane) const {
    return {balls[i].x[lane], balls[i].y[lane], balls[i].z[lane]};
  }
  std::vector<geometry::PointPair> pairs(std::size_t view, int lane) const {
    std::vector<geometry::PointPair> all;
    for (std::size_t i = 0; i < balls.size(); ++i)
      all.push_back({ball(i, lane), {pixels[view][i].u[lane], pixels[view][i].v[lane]}});
    return all;
  }
};

TEST(SimdBalls, AgreeWithTheScalarLeastSquaresSolution) {
  const Eigen::Vector3d far(70, -60, 120);
  for (const std::size_t count : {6u, 7u, 12u, 20u, 64u})
    for (std::uint64_t trial = 0; trial < 200; trial += 4) {
      const Scene scene(count, 2.34, trial);
      const SimdBalls model(scene.balls);
      for (std::size_t view = 0; view < 2; ++view) {
        const SimdProjection four = model.calibrate(scene.pixels[view]);
        for (int lane = 0; lane < simd_width; ++lane) {
          const auto pairs = scene.pairs(view, lane);
          const double condition = geometry::dlt_condition(pairs).value_or(1e9);
          if (condition > 1e4) continue;
          const double tolerance_px = 1e-8 * condition;
          const geometry::Projection one = geometry::projection_from_factors(geometry::solve_dlt(pairs));
          const geometry::Projection fast = projection_of(four, lane);
          EXPECT_LT((pixel_of(one, far) - pixel_of(fast, far)).norm(), tolerance_px) << count << ' ' << trial;
          for (const geometry::PointPair& pair : pairs)
            EXPECT_LT((pixel_of(one, pair.point_in_world) - pixel_of(fast, pair.point_in_world)).norm(),
                      tolerance_px);
        }
      }
    }
}

TEST(SimdBalls, RecoverTheViewFromExactPixels) {
  const Scene scene(8, 0, 0);
  const auto views = paper_views(WorldOrigin::base);
  for (std::size_t view = 0; view < 2; ++view) {
    const SimdProjection four = SimdBalls(scene.balls).calibrate(scene.pixels[view]);
    const geometry::Projection truth = views[view].projection() / views[view].projection()(2, 3);
    for (int lane = 0; lane < simd_width; ++lane)
      EXPECT_LT((projection_of(four, lane) - truth).norm(), 1e-8 * truth.norm());
  }
}

TEST(SimdBalls, LanesAreIndependent) {
  Scene scene(9, 1, 0);
  const SimdProjection before = SimdBalls(scene.balls).calibrate(scene.pixels[0]);
  for (SimdPoint& ball : scene.balls) ball.x[1] = ball.y[1] = ball.z[1] = 0;  // degenerate
  const SimdProjection after = SimdBalls(scene.balls).calibrate(scene.pixels[0]);
  for (const int lane : {0, 2, 3}) EXPECT_EQ(projection_of(before, lane), projection_of(after, lane));
}

TEST(SimdBalls, NoneAndTooManyAreRefused) {
  EXPECT_THROW(SimdBalls({}), std::invalid_argument);
  EXPECT_THROW(SimdBalls(std::vector<SimdPoint>(SimdBalls::most + 1)), std::invalid_argument);
}

TEST(SimdIntersect, AgreesWithTheScalarSolution) {
  const Scene scene(12, 2.34, 8);
  const SimdBalls model(scene.balls);
  const SimdProjection views[2] = {model.calibrate(scene.pixels[0]), model.calibrate(scene.pixels[1])};
  for (std::size_t i = 0; i < scene.balls.size(); ++i) {
    const SimdPoint point = intersect(views[0], scene.pixels[0][i], views[1], scene.pixels[1][i]);
    for (int lane = 0; lane < simd_width; ++lane) {
      const std::array projections{projection_of(views[0], lane), projection_of(views[1], lane)};
      const std::array pixels{scene.pairs(0, lane)[i].pixel, scene.pairs(1, lane)[i].pixel};
      const Eigen::Vector3d one = *geometry::intersect_linear(projections, pixels);
      EXPECT_LT((one - Eigen::Vector3d(point.x[lane], point.y[lane], point.z[lane])).norm(), 1e-9);
    }
  }
}

TEST(SimdRay, DistanceAgreesWithTheScalarRay) {
  const geometry::View view = paper_views(WorldOrigin::base)[1];
  const geometry::Projection p = view.projection() / view.projection()(2, 3);
  SimdProjection four;
  for (int i = 0; i < 4; ++i) {
    four.u[i] = simd(p(0, i));
    four.v[i] = simd(p(1, i));
    if (i < 3) four.w[i] = simd(p(2, i));
  }
  const Eigen::Vector3d on_ray(10, 20, 30), across = (on_ray - view.source_in_world()).unitOrthogonal();
  const Eigen::Vector2d pixel = view.project(on_ray);
  const Eigen::Vector3d point = on_ray + 2.5 * across;
  EXPECT_NEAR(ray_distance(four, {simd(pixel.x()), simd(pixel.y())},
                           {simd(point.x()), simd(point.y()), simd(point.z())})[2],
              2.5, 1e-9);
}

TEST(PaperScene, SimdProjectionAgreesWithTheViews) {
  const auto views = paper_views(WorldOrigin::centre);
  const SimdViews simd_of(views);
  const Eigen::Vector3d point(20, -35, 60);
  for (std::size_t view = 0; view < 2; ++view) {
    const SimdPixel pixel = simd_of.project(view, {simd(20), simd(-35), simd(60)});
    EXPECT_LT((views[view].project(point) - Eigen::Vector2d(pixel.u[3], pixel.v[3])).norm(), 1e-9);
  }
}

TEST(PaperScene, WithTheCentreAsOriginBothImagesContainTheCone) {
  const Eigen::Vector3d top(0, 0, cone_height_mm);
  EXPECT_GT(paper_views(WorldOrigin::base)[1].project(top).y(), 1024);
  for (const geometry::View& view : paper_views(WorldOrigin::centre)) {
    const Eigen::Vector2d pixel = view.project(top);
    EXPECT_LT((pixel - Eigen::Vector2d(512, 512)).lpNorm<Eigen::Infinity>(), 512);
  }
}

TEST(PaperScene, BallsLieOnTheSpiral) {
  for (const SimdPoint& ball : balls_on_spiral(SimdRandom(1, 1, 0), 7))
    for (int lane = 0; lane < simd_width; ++lane) {
      const double t = ball.z[lane] / 3.979;
      EXPECT_GT(t, 0);
      EXPECT_LT(t, 7 * std::numbers::pi);
      EXPECT_NEAR(ball.x[lane], 60 * std::exp(-t / 31.529) * std::cos(t), 1e-9);
      EXPECT_NEAR(ball.y[lane], 60 * std::exp(-t / 31.529) * std::sin(t), 1e-9);
    }
}

TEST(PaperScene, TargetsFillTheirRegions) {
  for (const WorldOrigin origin : {WorldOrigin::base, WorldOrigin::centre}) {
    const auto targets = targets_in_ball(origin);
    EXPECT_EQ(targets.size(), 19u);
    double squares = 0;
    for (const auto& target : targets) squares += (target - origin_in_calibrator(origin)).squaredNorm();
    EXPECT_NEAR(squares / 19, 0.6 * 100 * 100, 1e-6);
  }
  EXPECT_GT(targets_in_cone().size(), 10u);
  for (const auto& target : targets_in_cone()) EXPECT_LT(target.head<2>().norm(), 60);
}

TEST(SigmaReadings, GiveTheStandardDeviationPerAxis) {
  EXPECT_EQ(sigma_px(SigmaReading::std, 2.34), 2.34);
  EXPECT_NEAR(sigma_px(SigmaReading::var, 2.34), 1.5297, 1e-4);
  EXPECT_NEAR(sigma_px(SigmaReading::mean_distance, 2.34), 1.8671, 1e-4);
  EXPECT_NEAR(sigma_px(SigmaReading::rms_distance, 2.34), 1.6546, 1e-4);
}

}  // namespace
}  // namespace helicarm::study
