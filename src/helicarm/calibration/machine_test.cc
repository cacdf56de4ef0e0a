// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/machine.h"

#include <Eigen/Cholesky>
#include <gtest/gtest.h>

#include "helicarm/calibration/views_test.h"

namespace helicarm {
namespace {

using Eigen::Vector3d;

constexpr double px_per_mm = 1 / 0.15;
const Vector3d nominal(900, 0, 0);
const MachinePrior unknown{Departure{10, 1.4}, Departure{7, 4.2}};

/// A shot of a machine whose focal length and principal point (mm from the middle) are these.
ViewFiducials shot_with(const Vector3d& intrinsics_mm, bool mirrored, RandomStream& random) {
  View view = paper_view(6 * random.uniform());
  const double hand = mirrored ? -1 : 1;
  view.intrinsics = {hand * px_per_mm * intrinsics_mm.x(), px_per_mm * intrinsics_mm.x(),
                     512 + hand * px_per_mm * intrinsics_mm.y(), 512 + px_per_mm * intrinsics_mm.z(), 0};
  ViewFiducials seen = pictured("AP", view, 0.05, random);
  seen.prior = {px_per_mm * nominal.x(), Eigen::Vector2d(512, 512), px_per_mm, Belief{1, 1e-3}};
  return seen;
}

Vector3d wander(const Vector3d& mean, const Vector3d& sigma, RandomStream& random) {
  return mean + sigma.cwiseProduct(Vector3d(random.normal(), random.normal(), random.normal()));
}

TEST(ShotOf, EstimateAndInformationHoldTheTruthWithoutThePrior) {
  const Vector3d truth(912, -9, 8);  // far from nominal: a prior that stayed in would show
  double distance2 = 0;
  const int trials = 200;
  for (int trial = 0; trial < trials; ++trial) {
    RandomStream random(31, 0, std::uint64_t(trial));
    const auto shot = shot_of(shot_with(truth, trial % 2, random), "a", {unknown});
    ASSERT_TRUE(shot.has_value());
    const Vector3d error = shot->estimate_mm - truth;
    distance2 += error.dot(shot->information * error) / trials;
  }
  EXPECT_NEAR(distance2, 3, 0.6);
}

TEST(KnowledgeOf, NoHistoryTellsNothing) {
  const MachineKnowledge known = knowledge_of({}, nominal, unknown);
  EXPECT_EQ(known.mean_mm, nominal);
  EXPECT_EQ(known.prior.focal->common, unknown.focal->common);
}

TEST(KnowledgeOf, PredictsTheNextShotAsWidelyAsItMust) {
  double distance2 = 0, focal_sigma = 0;
  const int trials = 100;
  for (int trial = 0; trial < trials; ++trial) {
    RandomStream random(32, 0, std::uint64_t(trial));
    const Vector3d mean = wander(nominal, {10, 7, 7}, random);
    const Vector3d sag(1.4, 4.2, 4.2);
    std::vector<MachineShot> shots;
    for (int k = 0; k < 12; ++k)
      shots.push_back(*shot_of(shot_with(wander(mean, sag, random), false, random), "a", {unknown}));
    const MachineKnowledge known = knowledge_of(shots, nominal, unknown);
    const Vector3d next = wander(mean, sag, random) - known.mean_mm;
    const double focal = std::hypot(known.prior.focal->common, known.prior.focal->of_view);
    const double principal = std::hypot(known.prior.principal->common, known.prior.principal->of_view);
    distance2 +=
        (next.x() * next.x() / focal / focal + next.tail<2>().squaredNorm() / principal / principal) / trials;
    focal_sigma += focal / trials;
  }
  EXPECT_NEAR(distance2, 3, 0.8);
  EXPECT_LT(focal_sigma, 2.5);  // of 10 mm beforehand
}

TEST(KnownPrior, TakesTheMeanAndTurnsItWithAMirroredPicture) {
  const MachineKnowledge known{{905, 4, -2}, unknown};
  const IntrinsicsPrior prior{900 * px_per_mm, Eigen::Vector2d(512, 512), px_per_mm};
  EXPECT_NEAR(*known_prior(prior, known, false).focal_px, 905 * px_per_mm, 1e-9);
  EXPECT_NEAR(known_prior(prior, known, false).principal_px->x(), 512 + 4 * px_per_mm, 1e-9);
  EXPECT_NEAR(known_prior(prior, known, true).principal_px->x(), 512 - 4 * px_per_mm, 1e-9);
}

TEST(MachineJson, ComesBackAsItWasWritten) {
  RandomStream random(33, 0);
  const Machine machine{{*shot_of(shot_with({905, 1, 2}, false, random), "digest", {unknown})}};
  const auto again = machine_from_json(to_json(machine), "machine.json");
  ASSERT_TRUE(again.has_value()) << again.error().message;
  EXPECT_EQ(again->shots.at(0).picture, "digest");
  EXPECT_EQ(again->shots[0].estimate_mm, machine.shots[0].estimate_mm);
  EXPECT_TRUE(again->shots[0].information.isApprox(machine.shots[0].information));
}

TEST(MachineJson, RefusesInformationThatIsNone) {
  RandomStream random(34, 0);
  Json json = to_json(Machine{{*shot_of(shot_with({905, 1, 2}, false, random), "digest", {unknown})}});
  json["shots"][0]["information_per_mm2"][0][0] = -1;
  EXPECT_EQ(machine_from_json(json, "machine.json").error().reason, Reason::bad_value);
}

}  // namespace
}  // namespace helicarm
