// SPDX-License-Identifier: Apache-2.0
#include "helicarm/simulation/tracker_model.h"

#include <cmath>

#include "helicarm/core/random.h"
#include "helicarm/geometry/dense_matrix.h"
#include "helicarm/geometry/rotation.h"
#include "helicarm/simulation/random_pose.h"

namespace helicarm::simulation {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Vector6d = Eigen::Matrix<double, 6, 1>;

bool in_volume(const TrackerModel& model, const Vector3d& position) {
  return position.z() >= model.nearest_mm && position.z() <= model.farthest_mm &&
         position.head<2>().norm() <= std::tan(model.half_field_deg * radian) * position.z();
}

bool is_turned_to_the_camera(const TrackerModel& model, const MarkerFacet& facet,
                             const geometry::RigidTransform& tracker_from_body) {
  const Vector3d normal = tracker_from_body.rotation * facet.normal_in_body;
  const double least = std::cos(model.facing_deg * radian);
  for (const Vector3d& marker : facet.markers_in_body) {
    const Vector3d position = tracker_from_body * marker;
    if (!in_volume(model, position) || -position.normalized().dot(normal) < least) return false;
  }
  return true;
}

std::vector<const MarkerFacet*> facets_seen(const TrackerModel& model, const TrackedBody& body,
                                            const geometry::RigidTransform& tracker_from_body) {
  std::vector<const MarkerFacet*> seen;
  for (const MarkerFacet& facet : body.facets)
    if (is_turned_to_the_camera(model, facet, tracker_from_body)) seen.push_back(&facet);
  return seen;
}

/// The pose is fitted to the markers with equal weights; to first order its error is this matrix times
/// theirs: (A'A)^-1 A', where marker i, at r from the body's origin, moves by rotation x r + translation.
Eigen::MatrixXd pose_from_marker_errors(const std::vector<const MarkerFacet*>& facets,
                                        const Matrix3d& rotation) {
  std::vector<Vector3d> arms;
  for (const MarkerFacet* facet : facets)
    for (const Vector3d& marker : facet->markers_in_body) arms.push_back(rotation * marker);
  Eigen::MatrixXd a(3 * arms.size(), 6);
  for (std::size_t i = 0; i < arms.size(); ++i)
    a.middleRows<3>(3 * static_cast<Eigen::Index>(i)) << -geometry::cross_matrix(arms[i]),
        Matrix3d::Identity();
  return geometry::solve_spd(a.transpose() * a, a.transpose()).solution;
}

/// Sum of waves with random frequencies and phases: normal and smooth, and each time can be evaluated alone.
Vector3d drift(const TrackerModel& model, double time_s, std::uint64_t seed, std::uint32_t stream) {
  if (model.drift_sigma_mm.isZero()) return Vector3d::Zero();
  constexpr int waves = 32;
  RandomStream random(seed, stream);
  Vector3d sum = Vector3d::Zero();
  for (int wave = 0; wave < waves; ++wave)
    for (int axis = 0; axis < 3; ++axis) {
      const double frequency = random.normal() / model.drift_time_s;
      sum[axis] += std::cos(frequency * time_s + random.uniform(0, 2 * EIGEN_PI));
    }
  return std::sqrt(2.0 / waves) * sum.cwiseProduct(model.drift_sigma_mm);
}

}  // namespace

TrackerSample track_sample(const TrackerModel& model, const TrackedBody& body, const TrackedPath& path,
                           double time_s, std::uint64_t seed, std::uint32_t stream, std::uint64_t sample) {
  RandomStream random(seed, stream, sample);
  TrackerSample read;
  read.exposed_s = time_s;
  read.stamp_s = time_s + model.stamp_delay_s + model.stamp_jitter_s * random.normal();
  read.truth = path(time_s);
  std::vector<const MarkerFacet*> facets = facets_seen(model, body, read.truth);
  std::erase_if(facets, [&](const MarkerFacet*) { return random.uniform() < model.lost_facet; });
  read.facets = static_cast<int>(facets.size());
  const bool lost = random.uniform() < model.lost_sample;
  read.outlier = random.uniform() < model.outlier;
  if (lost || facets.empty()) {
    read.outlier = false;
    return read;
  }
  const Eigen::MatrixXd from_markers = pose_from_marker_errors(facets, read.truth.rotation);
  Eigen::VectorXd errors(from_markers.cols());
  for (Eigen::Index i = 0; i < errors.size(); ++i) errors[i] = model.marker_sigma_mm[i % 3] * random.normal();
  const Vector6d error = from_markers * errors;
  geometry::RigidTransform pose{
      geometry::rotation_from_vector(error.head<3>()) * read.truth.rotation,
      read.truth.translation + error.tail<3>() + drift(model, time_s, seed, stream + 1)};
  if (read.outlier) pose = pose * random_motion(random, model.outlier_deg, model.outlier_mm);
  read.tracker_from_body = pose;
  return read;
}

std::vector<TrackerSample> track(const TrackerModel& model, const TrackedBody& body, const TrackedPath& path,
                                 std::span<const double> times_s, std::uint64_t seed, std::uint32_t stream) {
  std::vector<TrackerSample> samples;
  for (const double time_s : times_s)
    samples.push_back(track_sample(model, body, path, time_s, seed, stream, samples.size()));
  return samples;
}

std::vector<double> steady_times(double rate_hz, std::size_t count, double start_s) {
  std::vector<double> times(count);
  for (std::size_t i = 0; i < count; ++i) times[i] = start_s + static_cast<double>(i) / rate_hz;
  return times;
}

std::optional<Matrix6d> pose_covariance(const TrackerModel& model, const TrackedBody& body,
                                        const geometry::RigidTransform& tracker_from_body, int samples) {
  const auto facets = facets_seen(model, body, tracker_from_body);
  if (facets.empty()) return {};
  const Eigen::MatrixXd from_markers = pose_from_marker_errors(facets, tracker_from_body.rotation);
  const Eigen::VectorXd variances = model.marker_sigma_mm.cwiseAbs2().replicate(from_markers.cols() / 3, 1);
  Matrix6d covariance = from_markers * variances.asDiagonal() * from_markers.transpose() / samples;
  covariance.diagonal().tail<3>() += model.drift_sigma_mm.cwiseAbs2();
  return covariance;
}

std::optional<geometry::RigidTransform> mean_pose(std::span<const TrackerSample> samples) {
  std::optional<geometry::RigidTransform> first;
  Vector3d turn = Vector3d::Zero();
  Vector3d position = Vector3d::Zero();
  int count = 0;
  for (const TrackerSample& sample : samples) {
    if (!sample.valid()) continue;
    if (!first) first = sample.tracker_from_body;
    turn += geometry::vector_from_rotation(sample.tracker_from_body->rotation * first->rotation.transpose());
    position += sample.tracker_from_body->translation;
    ++count;
  }
  if (!first) return {};
  return geometry::RigidTransform{geometry::rotation_from_vector(turn / count) * first->rotation,
                                  position / count};
}

}  // namespace helicarm::simulation
