// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom_calibration/from_scratch.h"

#include <gtest/gtest.h>

#include "helicarm/phantom_calibration/gauge.h"
#include "helicarm/phantom_calibration/synthetic_phantom_test.h"

namespace helicarm::phantom_calibration {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double diameter_mm = 4;

/// What the detector gives of `centres`: candidates in another order in each view, with noise, and false
/// ones.
std::vector<PhantomView> detections(const std::vector<Vector3d>& centres,
                                    const std::vector<geometry::View>& poses, int false_ones) {
  RandomStream random(2, 1, 0);
  std::vector<PhantomView> views;
  for (const geometry::View& pose : poses) {
    PhantomView view;
    view.name = std::string(1, char('A' + views.size()));
    view.labelling.mirrored = pose.intrinsics.fx < 0;
    view.labelling.focal_px = 1000 / 0.23;
    view.labelling.principal_px = {511.5, 511.5};
    view.labelling.field_radius_px = 724;
    view.prior.unit_px = 1 / 0.23;
    view.prior.focal_px = 1000 / 0.23;
    view.prior.principal_px = Vector2d(511.5, 511.5);
    view.prior.aspect = geometry::NormalPrior{1, 0.001};
    for (std::size_t i = 0; i < centres.size(); ++i) {
      const Vector3d& centre = centres[(i * 5 + views.size()) % centres.size()];
      const Vector2d noise(0.05 * random.normal(), 0.05 * random.normal());
      view.candidates.push_back({pose.project(centre) + noise, 0.05,
                                 diameter_mm / 2 * pose.intrinsics.fy / pose.depth(centre), 0.2});
    }
    const double radius = view.candidates.empty() ? 11.6 : view.candidates.front().radius_px;
    for (int i = 0; i < false_ones; ++i)
      view.candidates.push_back({{random.uniform(100, 900), random.uniform(100, 900)}, 0.05, radius, 0.2});
    views.push_back(std::move(view));
  }
  return views;
}

std::vector<geometry::View> poses(int count) {
  RandomStream random(3, 1, 0);
  std::vector<geometry::View> views;
  for (int v = 0; v < count; ++v) views.push_back(synthetic_view(v, random));
  return views;
}

/// Of each found centre from the nearest true one, in the similarity frame that fits them best.
double largest_error(const Reconstruction& found, const std::vector<Vector3d>& truth,
                     const std::vector<geometry::View>& true_poses) {
  // The first view's frame, brought to the mean distance, gives the correspondence.
  std::vector<Vector3d> places;
  for (const Vector3d& centre : found.centres) {
    const Vector2d uv = found.views[0]->project(centre);
    places.push_back(*std::ranges::min_element(
        truth, {}, [&](const Vector3d& p) { return (true_poses[0].project(p) - uv).norm(); }));
  }
  const auto fit =
      similarity_between(found.centres, places, Eigen::VectorXd::Ones(Eigen::Index(places.size())), true);
  double largest = 0;
  for (std::size_t i = 0; i < places.size(); ++i)
    largest = std::max(largest, (fit * found.centres[i] - places[i]).norm());
  return largest;
}

TEST(FromScratch, FourViewsGiveAllFiducialsAndTheShape) {
  const auto truth = helix_centres();
  const auto true_poses = poses(4);
  const auto found = reconstruct_from_scratch(detections(truth, true_poses, 0), {diameter_mm});
  ASSERT_TRUE(found) << found.error().message;
  EXPECT_EQ(found->centres.size(), truth.size());
  EXPECT_LT(found->rms_px, 0.1);
  EXPECT_LT(largest_error(*found, truth, true_poses), 0.1);
}

TEST(FromScratch, FalseCandidatesAreNotFiducials) {
  const auto truth = helix_centres();
  const auto true_poses = poses(4);
  const auto found = reconstruct_from_scratch(detections(truth, true_poses, 3), {diameter_mm});
  ASSERT_TRUE(found) << found.error().message;
  EXPECT_EQ(found->centres.size(), truth.size());
  EXPECT_LT(largest_error(*found, truth, true_poses), 0.1);
}

TEST(FromScratch, MirroredImagesGiveTheSameShape) {
  const auto truth = helix_centres();
  auto true_poses = poses(4);
  for (geometry::View& pose : true_poses) pose.intrinsics.fx = -pose.intrinsics.fx;
  const auto found = reconstruct_from_scratch(detections(truth, true_poses, 0), {diameter_mm});
  ASSERT_TRUE(found) << found.error().message;
  EXPECT_LT(largest_error(*found, truth, true_poses), 0.1);
}

TEST(FromScratch, UnstatedMirroringIsAmbiguousHandedness) {
  auto views = detections(helix_centres(), poses(4), 0);
  views[2].labelling.mirrored.reset();
  const auto found = reconstruct_from_scratch(views, {diameter_mm});
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().reason, Reason::ambiguous_handedness);
  EXPECT_EQ(found.error().view, "C");
}

TEST(FromScratch, NearlyFlatPhantomWhoseReversedDepthFitsAlikeIsAmbiguousHandedness) {
  auto flat = helix_centres();
  for (Vector3d& centre : flat) centre.z() *= 0.01;
  std::vector<geometry::View> near;
  for (int v = 0; v < 3; ++v) {
    geometry::View view = poses(1).front();
    view.camera_from_world.rotation =
        geometry::rotation_from_vector({0, 0.09 * v, 0}) * geometry::rotation_from_vector({3.1, 0, 0.1});
    view.camera_from_world.translation = {0, 0, 4000};
    view.intrinsics.fx = view.intrinsics.fy = 4 * view.intrinsics.fy;
    near.push_back(view);
  }
  const auto found = reconstruct_from_scratch(detections(flat, near, 0), {diameter_mm});
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().reason, Reason::ambiguous_handedness) << found.error().message;
}

TEST(FromScratch, TwoViewsAreTooFew) {
  const auto found = reconstruct_from_scratch(detections(helix_centres(), poses(2), 0), {diameter_mm});
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().reason, Reason::too_few_views);
}

TEST(FromScratch, ViewsOfDifferentThingsAreAmbiguousLabels) {
  const auto found = reconstruct_from_scratch(detections({}, poses(3), 10), {diameter_mm});
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().reason, Reason::ambiguous_labels);
}

}  // namespace
}  // namespace helicarm::phantom_calibration
