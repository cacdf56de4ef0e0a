// SPDX-License-Identifier: Apache-2.0
#include "helicarm/simulation/simulate_case.h"

#include <algorithm>
#include <cmath>
#include <map>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "helicarm/simulation/knee.h"

namespace helicarm::simulation {
namespace {

using Eigen::Vector2d;

SimulationOptions small(CaseKind kind) {
  SimulationOptions options;
  options.seed = 11;
  options.kind = kind;
  options.size = 512;
  options.knee = false;
  return options;
}

bool same(const image::Image<std::uint16_t>& a, const image::Image<std::uint16_t>& b) {
  return std::equal(a.pixels().begin(), a.pixels().end(), b.pixels().begin(), b.pixels().end());
}

/// Centroid of the pixels darker than half-way between the centre and the rim of a round window.
Vector2d dark_centroid(const image::Image<std::uint16_t>& image, const Vector2d& near, int half) {
  const int u0 = static_cast<int>(std::lround(near.x()));
  const int v0 = static_cast<int>(std::lround(near.y()));
  const double threshold = 0.5 * (image(u0, v0) + image(u0 + half, v0 + half));
  Vector2d sum(0, 0);
  double weight = 0;
  for (int v = v0 - half; v <= v0 + half; ++v)
    for (int u = u0 - half; u <= u0 + half; ++u) {
      if (std::hypot(u - near.x(), v - near.y()) > half) continue;
      const double dark = std::max(0.0, threshold - image(u, v));
      sum += dark * Vector2d(u, v);
      weight += dark;
    }
  return sum / weight;
}

TEST(SimulateCase, ReproducibleFromTheSeedForAnyNumberOfThreads) {
  SimulationOptions options = small(CaseKind::accuracy);
  options.knee = true;
  options.threads = 1;
  const SimulatedCase one = *simulate_case(options);
  options.threads = 2;
  const SimulatedCase two = *simulate_case(options);
  options.seed = 12;
  const SimulatedCase other = *simulate_case(options);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_TRUE(same(one.views[i].pixels, two.views[i].pixels));
    EXPECT_FALSE(same(one.views[i].pixels, other.views[i].pixels));
  }
}

TEST(SimulateCase, ClearBallsAreDarkAtTheirTruePositions) {
  for (CaseKind kind : {CaseKind::accuracy, CaseKind::flat}) {
    const SimulatedCase simulated = *simulate_case(small(kind));
    for (const SimulatedView& view : simulated.views) {
      int clear = 0;
      for (const TruePoint& ball : view.balls) {
        if (ball.visibility != Visibility::clear) continue;
        ++clear;
        EXPECT_LT((dark_centroid(view.pixels, ball.raw, 8) - ball.raw).norm(), 0.3)
            << view.true_view.name << ball.name;
      }
      EXPECT_GE(clear, 8);
    }
  }
}

/// Seven balls of two sizes far from the origin, on no cone.
phantom::Calibrator own_phantom() {
  phantom::Calibrator calibrator{"own", {}, {}};
  for (const Eigen::Vector3d& p : {Eigen::Vector3d(230, 20, 100),
                                   {170, 55, 112},
                                   {160, -10, 125},
                                   {195, -45, 133},
                                   {185, 15, 151},
                                   {215, 40, 160},
                                   {160, 30, 175}})
    calibrator.balls.push_back(
        {fmt::format("B{}", calibrator.balls.size()), p, calibrator.balls.size() % 2 ? 5.0 : 4.0});
  return calibrator;
}

TEST(SimulateCase, OwnPhantomIsInTheMiddleOfEveryImage) {
  SimulationOptions options;
  options.size = 512;
  options.knee = false;
  options.calibrator = own_phantom();
  const auto simulated = simulate_case(options);
  ASSERT_TRUE(simulated) << simulated.error().message;
  EXPECT_TRUE(simulated->calibrator.targets.empty());
  for (const SimulatedView& view : simulated->views)
    for (const TruePoint& ball : view.balls)
      EXPECT_NE(ball.visibility, Visibility::outside) << view.true_view.name << " " << ball.name;
}

TEST(SimulateCase, OwnPlateOfHolesHasBrightDots) {
  SimulationOptions options;
  options.size = 512;
  options.knee = false;
  options.response = Response::linear;
  options.plate = phantom::Plate{"own", phantom::DotKind::holes, phantom::Lattice::hexagonal, 20, 5, {}, {}};
  const auto simulated = simulate_case(options);
  ASSERT_TRUE(simulated) << simulated.error().message;
  const SimulatedView& view = simulated->views[0];
  EXPECT_GT(view.plate_dots.size(), 100u);
  int brighter = 0, clear = 0;
  for (const TruePoint& dot : view.plate_dots) {
    if (dot.visibility != Visibility::clear) continue;
    ++clear;
    const auto grey = [&](double du) {
      return view.pixels(int(std::lround(dot.raw.x() + du)), int(std::lround(dot.raw.y())));
    };
    brighter += grey(0) > grey(9);
  }
  EXPECT_GT(clear, 50);
  EXPECT_GT(brighter, 0.9 * clear);
}

TEST(SimulateCase, PlateWithoutDotsAndPitchIsRefused) {
  SimulationOptions options;
  options.plate = phantom::Plate{};
  options.plate->name = "own";
  EXPECT_EQ(simulate_case(options).error().reason, Reason::bad_value);
}

TEST(SimulateCase, FlatPanelHasNoPlate) {
  SimulationOptions options;
  options.kind = CaseKind::flat;
  options.plate = phantom::plate48();
  EXPECT_EQ(simulate_case(options).error().reason, Reason::bad_value);
}

TEST(SimulateCase, PaperSimHasThePosesAndPixelsOfThePaper) {
  SimulationOptions options = small(CaseKind::accuracy);
  options.preset = Preset::paper_sim;
  const SimulatedCase simulated = *simulate_case(options);
  EXPECT_FALSE(simulated.plate);
  const geometry::View& ap = simulated.views[0].true_view.view;
  const geometry::View& lateral = simulated.views[1].true_view.view;
  for (const geometry::View& view : {ap, lateral}) {
    EXPECT_NEAR(view.intrinsics.fx, 3000, 1e-9);  // 900 mm over 0.3 mm
    EXPECT_EQ(view.intrinsics.u0, 256);
  }
  const Eigen::Vector3d middle(0, 0, 0.5 * 3.979 * 7 * EIGEN_PI);
  EXPECT_NEAR((ap.source_in_world() - middle - Eigen::Vector3d(0, 0, -800)).norm(), 0, 1e-9);
  EXPECT_NEAR((lateral.source_in_world() - middle - Eigen::Vector3d(0, 800, 0)).norm(), 0, 1e-9);
  for (const SimulatedView& view : simulated.views)
    for (const TruePoint& ball : view.balls) {
      EXPECT_LT((ball.raw - ball.ideal).norm(), 1e-9);
      EXPECT_NE(ball.visibility, Visibility::outside) << view.true_view.name << ball.name;
    }
}

TEST(SimulateCase, PresetOverridesTheDefaultOfTheKind) {
  SimulationOptions options = small(CaseKind::flat);
  EXPECT_EQ(options.c_arm_preset(), Preset::flat_panel);
  const SimulatedCase flat = *simulate_case(options);
  options.kind = CaseKind::accuracy;
  EXPECT_EQ(options.c_arm_preset(), Preset::ii_9in);
  options.preset = Preset::flat_panel;
  EXPECT_TRUE(same(flat.views[0].pixels, simulate_case(options)->views[0].pixels));
  options = small(CaseKind::flat);
  options.preset = Preset::ii_9in;
  EXPECT_EQ(simulate_case(options).error().reason, Reason::bad_value);
  EXPECT_EQ(preset("ii_9in").error().reason, Reason::usage);
}

TEST(SimulateCase, PlateDotsLieInTheirPlaneAndAreVisible) {
  const SimulatedCase simulated = *simulate_case(small(CaseKind::accuracy));
  for (const SimulatedView& view : simulated.views) {
    ASSERT_EQ(view.plate_dots.size(), 48u);
    for (const TruePoint& dot : view.plate_dots) {
      EXPECT_NEAR(view.true_view.view.depth(dot.in_calibrator), view.true_view.f_mm - 15, 1e-9);
      if (dot.visibility != Visibility::clear) continue;
      EXPECT_LT((dark_centroid(view.pixels, dot.raw, 4) - dot.raw).norm(), 0.5);
    }
  }
}

TEST(SimulateCase, StandMeetsItsLimitsForManySeeds) {
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    SimulationOptions options;
    options.seed = seed;
    const std::vector<TrueView> true_views = take_stand(options, 15, {});
    const Eigen::Vector3d ap = true_views[0].view.camera_from_world.rotation.row(2);
    const Eigen::Vector3d lateral = true_views[1].view.camera_from_world.rotation.row(2);
    EXPECT_NEAR(std::acos(ap.dot(lateral)) * 180 / EIGEN_PI, 90, 5.2);
    const auto principal = [](const TrueView& true_view) {
      return Vector2d(true_view.view.intrinsics.u0, true_view.view.intrinsics.v0);
    };
    EXPECT_LE((principal(true_views[0]) - principal(true_views[1])).norm(), 25);
    EXPECT_LE(std::abs(true_views[0].f_mm - true_views[1].f_mm), 2);
    for (const TrueView& true_view : true_views) {
      EXPECT_NEAR(true_view.view.camera_from_world.rotation.determinant(), 1, 1e-12);
      EXPECT_LE((principal(true_view) - Vector2d(511.5, 511.5)).norm() * true_view.detector.pixel_mm, 12);
      EXPECT_LE(std::abs(true_view.f_mm - true_view.nominal_f_mm), 5);
    }
  }
}

TEST(SimulateCase, MirroredViewFlipsImageAndTruth) {
  SimulationOptions options = small(CaseKind::accuracy);
  const SimulatedCase plain = *simulate_case(options);
  options.faults = {Fault::mirrored};
  const SimulatedCase flipped = *simulate_case(options);
  EXPECT_TRUE(same(plain.views[0].pixels, flipped.views[0].pixels));
  EXPECT_TRUE(same(mirrored(plain.views[1].pixels), flipped.views[1].pixels));
  EXPECT_LT(flipped.views[1].true_view.stored_view().intrinsics.fx, 0);
  for (std::size_t i = 0; i < 12; ++i) {
    const TruePoint& before = plain.views[1].balls[i];
    const TruePoint& after = flipped.views[1].balls[i];
    EXPECT_NEAR(before.raw.x() + after.raw.x(), 511, 1e-9);
    EXPECT_NEAR(before.ideal.x() + after.ideal.x(), 511, 1e-9);
    EXPECT_NEAR(before.ideal.y(), after.ideal.y(), 1e-9);
  }
}

TEST(SimulateCase, FaultsAppearInTheTruth) {
  SimulationOptions options = small(CaseKind::accuracy);
  options.lost_balls = {"P3"};
  options.faults = {Fault::wires, Fault::shutters, Fault::saturated};
  const SimulatedCase simulated = *simulate_case(options);
  std::map<Visibility, int> seen;
  for (const SimulatedView& view : simulated.views) {
    EXPECT_EQ(view.balls[2].visibility, Visibility::absent);
    for (const TruePoint& ball : view.balls) ++seen[ball.visibility];
    for (const TruePoint& dot : view.plate_dots) ++seen[dot.visibility];
    EXPECT_GT(std::count(view.pixels.pixels().begin(), view.pixels.pixels().end(), 4095), 10000);
  }
  EXPECT_EQ(seen[Visibility::absent], 2);
  EXPECT_GE(seen[Visibility::hidden], 2);
  EXPECT_GE(seen[Visibility::outside], 6);
}

TEST(SimulateCase, TunnelPointsAgreeInEveryFrame) {
  const SimulatedCase simulated = *simulate_case(small(CaseKind::tunnels));
  const NavigationTruth& truth = *simulated.navigation;
  for (const TunnelPoint& point : truth.points) {
    const Eigen::Vector3d in_tracker = truth.tracker_from.at("calibrator") * point.in_calibrator;
    EXPECT_LT((truth.tracker_from.at(point.bone) * point.in_bone - in_tracker).norm(), 1e-9);
    EXPECT_LT((truth.tracker_from.at("tool") * point.in_tool - in_tracker).norm(), 1e-9);
  }
  for (const auto& [frame, pose] : truth.tracker_from) {
    const geometry::RigidTransform error = pose.inverse() * truth.read.at(frame);
    EXPECT_GT(error.translation.norm(), 0);
    EXPECT_LT(error.translation.norm(), 0.12 * 5);
  }
  for (const TrueToolLine& line : truth.lines) EXPECT_LT(line.start_error_mm, 3);
  for (const SimulatedView& view : simulated.views)
    for (std::size_t i = 0; i < view.clicks.size(); ++i)
      EXPECT_LT((view.clicks[i].raw - view.tunnel_points[i].raw).norm(), 3.1);
}

TEST(SimulateCase, ReadingsScatterByTheStatedSigmaOverManySeeds) {
  double shift2 = 0;
  double turn2 = 0;
  constexpr int seeds = 500;
  for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
    const NavigationTruth truth = set_up_navigation(seed, {});
    for (const auto& [frame, pose] : truth.tracker_from) {
      const geometry::RigidTransform& read = truth.read.at(frame);
      const double shift = (read.translation - pose.translation).norm() / truth.sigma_mm;
      const double turn =
          Eigen::AngleAxisd(read.rotation * pose.rotation.transpose()).angle() * 180 / EIGEN_PI;
      shift2 += shift * shift / (3 * 4 * seeds);
      turn2 += turn * turn / (truth.sigma_deg * truth.sigma_deg) / (3 * 4 * seeds);
    }
  }
  EXPECT_NEAR(shift2, 1, 0.1);
  EXPECT_NEAR(turn2, 1, 0.1);
}

TEST(SimulateCase, TunnelsRunInsideTheirBones) {
  const Scene knee = knee_body();
  const auto inside = [&](const char* bone, const Eigen::Vector3d& point) {
    return std::any_of(knee.begin(), knee.end(), [&](const Body& body) {
      return body.name == bone &&
             std::any_of(body.solids.begin(), body.solids.end(), [&](const Solid& solid) {
               const Interval part = solid.intersect(point, {0, 0, 1});
               return part.enter < 0 && part.leave > 0;
             });
    });
  };
  for (double t : {0.05, 0.5, 0.95}) {
    EXPECT_TRUE(inside("femur", femoral_tunnel().start * (1 - t) + femoral_tunnel().end * t)) << t;
    EXPECT_TRUE(inside("tibia", tibial_tunnel().start * (1 - t) + tibial_tunnel().end * t)) << t;
  }
}

TEST(SimulateCase, EveryDepthAndResponseUsesItsGreyRange) {
  for (const int bits : {8, 10, 12, 14, 16})
    for (const Response response : {Response::linear, Response::logarithmic}) {
      SimulationOptions options = small(CaseKind::flat);
      options.knee = true;
      options.bits = bits;
      options.response = response;
      const SimulatedCase simulated = *simulate_case(options);
      const auto pixels = simulated.views[0].pixels.pixels();
      const double highest = (1 << bits) - 1;
      EXPECT_NEAR(*std::ranges::max_element(pixels) / highest, 0.9, 0.06);
      EXPECT_EQ(*exposure_of(simulated.views[0]).acquisition.logarithmic, response == Response::logarithmic);
    }
}

TEST(SimulateCase, ViewsAreTakenAtTheRequestedAngles) {
  SimulationOptions options = small(CaseKind::accuracy);
  options.views = {{"AP", {0, 0}}, {"OBL", {45, 10}}, {"LAT", {90, 0}}};
  const SimulatedCase simulated = *simulate_case(options);
  ASSERT_EQ(simulated.views.size(), 3u);
  for (std::size_t i = 0; i < 3; ++i) {
    const SimulatedView& view = simulated.views[i];
    EXPECT_EQ(view.true_view.name, options.views[i].name);
    EXPECT_EQ(view.true_view.primary_angle_deg, options.views[i].angles.primary_deg);
    EXPECT_GE(std::ranges::count(view.balls, Visibility::clear, &TruePoint::visibility), 8);
  }
  options.kind = CaseKind::grid;
  EXPECT_EQ(simulate_case(options).error().reason, Reason::bad_value);
  options.kind = CaseKind::accuracy;
  for (const std::vector<ViewAngles>& wrong : {std::vector<ViewAngles>{{"AP", {}}},
                                               {{"AP", {}}, {"AP", {90, 0}}},
                                               {{"AP", {}}, {"../LAT", {90, 0}}},
                                               {{"AP", {}}, {"LAT", {190, 0}}},
                                               {{"AP", {}}, {"LAT", {90, 61}}}}) {
    options.views = wrong;
    EXPECT_EQ(simulate_case(options).error().reason, Reason::bad_value);
  }
}

TEST(SimulateCase, UnknownSizeDepthAndBallAreRefusedByName) {
  SimulationOptions options = small(CaseKind::accuracy);
  options.size = 640;
  EXPECT_EQ(simulate_case(options).error().reason, Reason::bad_value);
  options = small(CaseKind::accuracy);
  options.bits = 11;
  EXPECT_EQ(simulate_case(options).error().reason, Reason::bad_value);
  options = small(CaseKind::accuracy);
  options.lost_balls = {"P99"};
  EXPECT_THAT(simulate_case(options).error().message, testing::HasSubstr("P99"));
}

TEST(SimulateCase, KneeMatchesTheTunnels) {
  SimulationOptions options = small(CaseKind::tunnels);
  EXPECT_FALSE(simulate_case(options)->calibrator_from_knee);
  options.knee = true;
  const SimulatedCase simulated = *simulate_case(options);
  ASSERT_TRUE(simulated.calibrator_from_knee);
  const Eigen::Vector3d start = *simulated.calibrator_from_knee * femoral_tunnel().start;
  EXPECT_LT((start - simulated.navigation->points[0].in_calibrator).norm(), 1e-9);
}

}  // namespace
}  // namespace helicarm::simulation
