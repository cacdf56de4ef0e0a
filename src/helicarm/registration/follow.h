// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/registration/register_model.h"

namespace helicarm::registration {

/// Follows a body through images of views that stay where they are. The first image is registered from the
/// starts; each further one from the pose at constant velocity and from the last pose, or, where these are
/// refused or end differently, by a search about the former. Where that is refused too, in two views or more,
/// every orientation and position is searched: a body that jumps is found again. Of the images in a row that
/// are refused only the first, second, fourth, eighth, ... are searched so, which a body that left costs
/// little.
class Follower {
 public:
  /// `model` must outlive the follower.
  Follower(const Model& model, std::vector<geometry::RigidTransform> starts, RegistrationOptions options);

  /// Registers the next images; `time` (in any unit) increases. A refused result does not change the motion,
  /// and one that was found anywhere begins another.
  Registration next(const std::vector<RegistrationView>& views, double time);

  /// Goes on from an earlier result at its time, as if `next` had given it.
  void take(const Registration& result, double time);

  /// The pose expected at a time: none before the first that was not refused.
  std::optional<geometry::RigidTransform> predicted(double time) const;

 private:
  struct Timed {
    double time;
    geometry::RigidTransform pose;
  };
  const Model* model_;
  std::vector<geometry::RigidTransform> starts_;
  RegistrationOptions options_;
  Registration near(const std::vector<RegistrationView>& views,
                    const geometry::RigidTransform& expected) const;

  std::optional<Timed> last_, before_;  ///< the newest two that were not refused, of one motion
  unsigned refused_ = 0;                ///< in a row
  /// Of the motion: later images tell less of it.
  std::optional<std::pair<Warning, std::optional<NotExplained>>> part_not_explained_;
};

/// A body's pose in the coordinates of another, the reference.
struct RelativePose {
  geometry::RigidTransform reference_from_model;
  RigidCovariance covariance;  ///< as RigidStep about the model's centre, in the reference's axes
};

/// The registrations' errors are taken as independent: an error of the cameras, which moves both bodies
/// alike, is counted twice.
RelativePose relative_pose(const Registration& reference, const Registration& model);

}  // namespace helicarm::registration
