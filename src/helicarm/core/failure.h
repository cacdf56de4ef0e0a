// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <exception>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

#include <tl/expected.hpp>

namespace helicarm {

/// Why a result is missing or uncertain: the closed list of codes that a caller can receive
/// (docs/reasons.md).
enum class Reason {
  // Unreadable input or wrong usage.
  usage,
  not_an_image,
  truncated,
  bad_size,
  bad_value,
  unsupported,
  missing_file,
  bad_json,
  not_finite,
  unknown_key,
  path_outside,
  name_clash,
  cannot_write,
  port_taken,
  // Refused because the data do not support a reliable result.
  blank_image,
  saturated,
  plate_not_found,
  plate_mismatch,
  too_few_fiducials,
  ambiguous_labels,
  calibrator_mismatch,
  coplanar_fiducials,
  views_too_close,
  residual_too_large,
  uncertain,
  ambiguous_handedness,
  scale_disagrees,
  patient_mismatch,
  parallel_rays,
  point_at_infinity,
  behind_source,
  not_seen,
  target_not_found,
  bad_tunnel,
  no_pose,
  stale_pose,
  pose_spread,
  poses_too_alike,
  out_of_reach,
  singular_pose,
  keep_out,
  robot_moved,
  plan_stale,
  robot_locked,
  robot_stopped,
  order_not_confirmed,
  stale_state,
  off_target,
  not_connected,
  replay_differs,
  interrupted,
  too_few_views,
  distances_disagree,
  phantom_changed,
  c_arm_changed,
  unequal_pixels,
  // Warnings only.
  name_differs,
  bone_taken_as_fixed,
  tag_disagrees,
  spacing_missing,
  lossy_image,
  uid_reused,
  few_fiducials,
  rules_broken,
  unobservable_motion,
  pick_on_fiducial,
  intrinsics_inconsistent,
  intrinsics_weak,
  residual_distortion,
  calibrator_strained,
  calibrator_deviates,
  ball_displaced,
  scale_unverified,
  scale_weak,
  covariance_missing,
  // Refused registrations of a model to the views.
  registration_ambiguous,
  registration_disagrees,
  wrong_model,
  out_of_capture,
  // Files that declare one thing and hold another, or break a rule of their format.
  surplus_data,
  irregular_file,
  outside_model,
  outside_reference,
  depth_from_scale,
  pixels_taken_as_rectified,
  // An operation whose record or images were changed from outside.
  record_lost,
  image_changed,
  // Planned tunnels beside the bone's surface, and registrations that guide a tool.
  tunnel_breach,
  bridge_thin,
  registration_stale,
  registration_not_confirmed,
  // Markers and bodies through a sequence.
  marker_lost,
  marker_loose,
  markers_swapped,
  bodies_exchanged,
  body_ill_conditioned,
  cameras_not_in_step,
  frames_missing,
  // Bones of a CT that are chosen by seeds.
  seed_off_bone,
  seeds_in_one_bone,
  bones_in_contact,
  bone_cut_off,
  // A volume that is taken as a CT.
  not_hounsfield,
};

/// Machine-readable code of a reason, e.g. "too_few_fiducials".
std::string_view code(Reason reason);

/// 2 for unreadable input or wrong usage, 3 for a refusal.
int exit_code(Reason reason);

/// Every reason, once.
std::span<const Reason> all_reasons();

/// A reason, a message for the user, the view concerned (may be empty) and the figures behind the decision.
struct Failure {
  Reason reason;
  std::string message;
  std::string view = {};
  std::map<std::string, double> figures = {};

  bool operator==(const Failure&) const = default;
};

using Warning = Failure;

template <class T>
using Expected = tl::expected<T, Failure>;

inline tl::unexpected<Failure> fail(Reason reason, std::string message,
                                    std::map<std::string, double> figures = {}) {
  return tl::unexpected<Failure>(Failure{reason, std::move(message), {}, std::move(figures)});
}

/// Carries a Failure out of nested parser calls; never leaves a public function (see `guarded`).
class BadInput : public std::exception {
 public:
  explicit BadInput(Failure failure) : failure_(std::move(failure)) {}
  BadInput(Reason reason, std::string message) : failure_{reason, std::move(message), {}, {}} {}
  const char* what() const noexcept override { return failure_.message.c_str(); }
  const Failure& failure() const { return failure_; }

 private:
  Failure failure_;
};

/// Calls a parser that throws BadInput and returns its Failure as a value.
template <class F>
auto guarded(F&& parse) -> Expected<std::invoke_result_t<F>> {
  try {
    if constexpr (std::is_void_v<std::invoke_result_t<F>>) {
      std::forward<F>(parse)();
      return {};
    } else {
      return std::forward<F>(parse)();
    }
  } catch (const BadInput& bad) {
    return tl::unexpected<Failure>(bad.failure());
  }
}

/// The value, or its failure thrown as BadInput; for use inside `guarded`.
template <class T>
T value_or_throw(Expected<T> result) {
  if (!result) throw BadInput(std::move(result).error());
  if constexpr (!std::is_void_v<T>) return *std::move(result);
}

}  // namespace helicarm
