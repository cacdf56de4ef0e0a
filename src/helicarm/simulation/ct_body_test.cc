// SPDX-License-Identifier: Apache-2.0
#include "helicarm/simulation/ct_body.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "helicarm/simulation/simulate_case.h"
#include "helicarm/simulation/truth_json.h"

namespace helicarm::simulation {
namespace {

using Eigen::Vector3d;

/// Block of 40 x 40 x 40 mm of one density; its corner voxel is at -20, -20, -20.
CtOptions block(float hu) {
  CtOptions ct;
  ct.volume.size = {20, 20, 20};
  ct.volume.voxels.assign(8000, hu);
  ct.volume.patient_from_voxel = Eigen::Translation3d(-19, -19, -19) * Eigen::Scaling(2.0);
  ct.name = "block.mha";
  return ct;
}

Attenuation through(float hu) {
  const CtBody body(block(hu), {}, 1);
  const std::array<Vector3d, 1> ray = {Vector3d(0, 0, 1)};
  std::array<Eigen::Array3d, 1> depth = {Eigen::Array3d::Zero()};
  body.add_depths({0, 0, -500}, ray, depth);
  return depth[0] / 40;
}

TEST(CtBody, AirWaterAndBoneAttenuateAsTabulated) {
  EXPECT_TRUE((through(-1000) == 0).all());
  EXPECT_NEAR(through(0)[1], 0.02059, 1e-6);
  EXPECT_NEAR(through(-500)[1], 0.02059 / 2, 1e-6);
  EXPECT_TRUE(through(1600).isApprox(material::cortical_bone, 1e-4));
}

TEST(CtBody, SupineLeftKneeIsOrientedDistalLateralAnterior) {
  CtOptions ct = block(0);
  ct.centre = Vector3d(1, 2, 3);
  const geometry::RigidTransform placed = knee_from_patient(ct);
  EXPECT_TRUE((placed * Vector3d(1, 2, 3)).isZero(1e-12));
  EXPECT_TRUE((placed * Vector3d(1, 2, -7)).isApprox(Vector3d(10, 0, 0)));  // to the feet
  EXPECT_TRUE((placed * Vector3d(11, 2, 3)).isApprox(Vector3d(0, 10, 0)));  // to the left
  EXPECT_TRUE((placed * Vector3d(1, -8, 3)).isApprox(Vector3d(0, 0, 10)));  // to the front
  EXPECT_NEAR(placed.rotation.determinant(), 1, 1e-12);
  ct.turn_deg = Vector3d(0, 0, 90);
  EXPECT_TRUE((knee_from_patient(ct) * Vector3d(1, 2, -7)).isApprox(Vector3d(0, 10, 0)));
}

TEST(CtBody, CaseIsRenderedThroughTheCtAndNamedInTheTruth) {
  SimulationOptions options;
  options.kind = CaseKind::flat;
  options.size = 512;
  options.ct = std::make_shared<CtOptions>(block(700));
  const SimulatedCase with = *simulate_case(options);
  SimulationOptions bare = options;
  bare.ct = std::make_shared<CtOptions>(block(-1000));
  const SimulatedCase without = *simulate_case(bare);
  ASSERT_TRUE(with.calibrator_from_ct.has_value());
  const TrueView& true_view = with.views[0].true_view;
  const Eigen::Vector2d centre = true_view.raw_image(with.calibrator_from_ct->translation);
  const Eigen::Vector2i pixel = centre.array().round().cast<int>();
  EXPECT_LT(with.views[0].pixels(pixel.x(), pixel.y()), 0.9 * without.views[0].pixels(pixel.x(), pixel.y()));
  const Json truth = truth_json(with);
  EXPECT_EQ(truth["ct"]["file"], "block.mha");
  EXPECT_EQ(truth["ct"]["digest"].get<std::string>().size(), 32u);
  options.threads = 3;
  EXPECT_TRUE(
      std::ranges::equal(simulate_case(options)->views[1].pixels.pixels(), with.views[1].pixels.pixels()));
}

TEST(CtBody, InvalidOptionsAreRefused) {
  SimulationOptions options;
  options.ct = std::make_shared<CtOptions>(block(0));
  options.knee = false;
  EXPECT_EQ(simulate_case(options).error().reason, Reason::usage);
  options.knee = true;
  options.kind = CaseKind::grid;
  EXPECT_EQ(simulate_case(options).error().reason, Reason::usage);
  options.kind = CaseKind::flat;
  CtOptions vast = block(0);
  vast.volume.patient_from_voxel = Eigen::Translation3d(-950, -950, -950) * Eigen::Scaling(100.0);
  options.ct = std::make_shared<CtOptions>(vast);
  EXPECT_EQ(simulate_case(options).error().reason, Reason::bad_value);
}

}  // namespace
}  // namespace helicarm::simulation
