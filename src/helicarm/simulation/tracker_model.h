// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "helicarm/geometry/rigid_transform.h"
#include "helicarm/simulation/tracked_body.h"

namespace helicarm::simulation {

using Matrix6d = Eigen::Matrix<double, 6, 6>;

/// A stereo optical tracker. Its frame has its origin between the lenses and z into the measured volume.
/// Defaults assume 0.25 mm rms per marker, with depth 2.5 times worse than across.
struct TrackerModel {
  Eigen::Vector3d marker_sigma_mm{0.08, 0.08, 0.20};  ///< of one marker in one sample, along the frame's axes
  Eigen::Vector3d drift_sigma_mm = Eigen::Vector3d::Zero();  ///< of the whole body, slow
  double drift_time_s = 60;                                  ///< correlation time T: exp(-(t / T)^2 / 2)
  double stamp_delay_s = 0;
  double stamp_jitter_s = 0;  ///< standard deviation; above a third of the period stamps can change order
  double lost_sample = 0;     ///< probability that a sample is missing
  double lost_facet = 0;      ///< probability that a facet is covered in a sample, independently
  double outlier = 0;         ///< probability that a sample's pose is an outlier
  double outlier_mm = 10;     ///< standard deviation of an outlier per axis; and rotated by
  double outlier_deg = 5;
  double facing_deg = 70;  ///< a facet is visible while the angle between its normal and the direction to the
                           ///< camera is below this
  double nearest_mm = 500;
  double farthest_mm = 2500;
  double half_field_deg = 35;  ///< about z
};

/// One sample. Without a pose the body was not visible; the identity is never used for that.
struct TrackerSample {
  double stamp_s;    ///< time stamp by the tracker
  double exposed_s;  ///< true time of measurement
  std::optional<geometry::RigidTransform> tracker_from_body;
  geometry::RigidTransform truth;  ///< tracker_from_body at `exposed_s`
  int facets = 0;                  ///< visible facets
  bool outlier = false;

  bool valid() const { return tracker_from_body.has_value(); }
};

/// tracker_from_body at a time (s).
using TrackedPath = std::function<geometry::RigidTransform(double)>;

/// Sample number `sample` of a stream at `time_s`. Keyed by (seed, stream, sample), so each can be generated
/// alone. Uses `stream` and the next.
TrackerSample track_sample(const TrackerModel& model, const TrackedBody& body, const TrackedPath& path,
                           double time_s, std::uint64_t seed, std::uint32_t stream, std::uint64_t sample);

/// One sample per time, numbered from 0.
std::vector<TrackerSample> track(const TrackerModel& model, const TrackedBody& body, const TrackedPath& path,
                                 std::span<const double> times_s, std::uint64_t seed, std::uint32_t stream);

/// `count` times at a constant rate from `start_s`.
std::vector<double> steady_times(double rate_hz, std::size_t count, double start_s = 0);

/// Covariance of the mean pose of `samples` samples (no outliers) with all facets that face the camera
/// visible: rotation (rad), then translation (mm) about the body's origin, along the tracker's axes. Nothing
/// if no facet is visible.
std::optional<Matrix6d> pose_covariance(const TrackerModel& model, const TrackedBody& body,
                                        const geometry::RigidTransform& tracker_from_body, int samples = 1);

/// Mean pose of the valid samples of a body at rest; nothing if there is none.
std::optional<geometry::RigidTransform> mean_pose(std::span<const TrackerSample> samples);

}  // namespace helicarm::simulation
