// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/follow.h"

#include <algorithm>
#include <bit>
#include <utility>

#include <fmt/format.h>

#include "helicarm/geometry/rotation.h"
#include "helicarm/registration/causes.h"
#include "helicarm/registration/checks.h"

namespace helicarm::registration {

using geometry::RigidTransform;

namespace {

constexpr double longest_extrapolation = 2;  // of the last interval, after refused images

Warning jump(const Registration& result, double distance_mm) {
  return {
      Reason::out_of_capture,
      fmt::format(
          "{}: jumps: the search about the expected pose was refused, and this pose, {:.1f} mm from it, is "
          "that of a search over every orientation and position",
          result.name, distance_mm),
      {},
      {{"distance_mm", distance_mm}}};
}

}  // namespace

Follower::Follower(const Model& model, std::vector<RigidTransform> starts, RegistrationOptions options)
    : model_(&model), starts_(std::move(starts)), options_(std::move(options)) {}

std::optional<RigidTransform> Follower::predicted(double time) const {
  if (!last_) return std::nullopt;
  if (!before_) return last_->pose;
  const double intervals = (time - last_->time) / (last_->time - before_->time);
  const RigidStep step = step_about(before_->pose, last_->pose, before_->pose * model_->centre);
  return moved_about(last_->pose, last_->pose * model_->centre,
                     std::min(intervals, longest_extrapolation) * step);
}

/// About the poses that the motion expects.
Registration Follower::near(const std::vector<RegistrationView>& views,
                            const RigidTransform& expected) const {
  Registration result;
  RegistrationOptions narrow = options_;
  narrow.search.candidates = 0;
  narrow.names_causes = false;
  if (before_) result = register_model(*model_, views, {expected, last_->pose}, narrow);
  if (before_ && !result.failure && result.agree >= 2) return result;
  RegistrationOptions wide = options_;
  wide.search.candidates = SearchOptions{}.candidates;
  wide.search.anywhere_after_refusal = false;
  wide.names_causes = false;
  const double spent_s = result.seconds;
  result = register_model(*model_, views, {expected}, wide);
  result.seconds += spent_s;
  return result;
}

Registration Follower::next(const std::vector<RegistrationView>& views, double time) {
  const auto expected = predicted(time);
  Registration result = expected ? near(views, *expected) : register_model(*model_, views, starts_, options_);
  if (expected && views.size() > 1 && options_.search.anywhere_after_refusal && may_have_missed(result) &&
      std::has_single_bit(refused_ + 1)) {
    RegistrationOptions anywhere = options_;
    anywhere.names_causes = false;  // the refusal is that of the motion
    Registration sought = register_model(*model_, views, {}, anywhere);
    result.seconds += sought.seconds;
    if (!sought.failure) {
      sought.seconds = result.seconds;
      sought.decision = std::max(sought.decision, Decision::warn);
      sought.warnings.push_back(jump(sought, separation(*model_, *expected, sought.world_from_model)));
      result = std::move(sought);
    }
  }
  if (part_not_explained_ && !result.failure && !result.anywhere &&
      std::ranges::none_of(result.warnings, is_of_part_not_explained)) {
    result.warnings.push_back(part_not_explained_->first);
    result.not_explained = part_not_explained_->second;
    result.decision = Decision::warn;
  }
  take(result, time);
  return result;
}

void Follower::take(const Registration& result, double time) {
  if (result.failure) {
    ++refused_;
    return;
  }
  refused_ = 0;
  if (const auto warning = std::ranges::find_if(result.warnings, is_of_part_not_explained);
      warning != result.warnings.end())
    part_not_explained_ = {*warning, result.not_explained};
  else
    part_not_explained_.reset();
  before_ = result.anywhere ? std::nullopt : last_;
  last_ = Timed{time, result.world_from_model};
}

RelativePose relative_pose(const Registration& reference, const Registration& model) {
  Eigen::Matrix<double, 6, 6> at_centre = Eigen::Matrix<double, 6, 6>::Identity();
  at_centre.bottomLeftCorner<3, 3>() = -geometry::cross_matrix(model.centre - reference.centre);
  const Eigen::Matrix3d axes = reference.world_from_model.rotation.transpose();
  Eigen::Matrix<double, 6, 6> turn = Eigen::Matrix<double, 6, 6>::Zero();
  turn.topLeftCorner<3, 3>() = turn.bottomRightCorner<3, 3>() = axes;
  const RigidCovariance sum = model.covariance + at_centre * reference.covariance * at_centre.transpose();
  return {reference.world_from_model.inverse() * model.world_from_model, turn * sum * turn.transpose()};
}

}  // namespace helicarm::registration
