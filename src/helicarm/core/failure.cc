// SPDX-License-Identifier: Apache-2.0
#include "helicarm/core/failure.h"

#include <algorithm>
#include <array>

namespace helicarm {
namespace {

constexpr int unusable = 2;
constexpr int refused = 3;

struct ReasonEntry {
  Reason reason;
  std::string_view code;
  int exit_code;
};

constexpr ReasonEntry entries[] = {
    {Reason::usage, "usage", unusable},
    {Reason::not_an_image, "not_an_image", unusable},
    {Reason::truncated, "truncated", unusable},
    {Reason::bad_size, "bad_size", unusable},
    {Reason::bad_value, "bad_value", unusable},
    {Reason::unsupported, "unsupported", unusable},
    {Reason::missing_file, "missing_file", unusable},
    {Reason::bad_json, "bad_json", unusable},
    {Reason::not_finite, "not_finite", unusable},
    {Reason::unknown_key, "unknown_key", unusable},
    {Reason::path_outside, "path_outside", unusable},
    {Reason::name_clash, "name_clash", unusable},
    {Reason::cannot_write, "cannot_write", unusable},
    {Reason::port_taken, "port_taken", unusable},
    {Reason::blank_image, "blank_image", refused},
    {Reason::saturated, "saturated", refused},
    {Reason::plate_not_found, "plate_not_found", refused},
    {Reason::plate_mismatch, "plate_mismatch", refused},
    {Reason::too_few_fiducials, "too_few_fiducials", refused},
    {Reason::ambiguous_labels, "ambiguous_labels", refused},
    {Reason::calibrator_mismatch, "calibrator_mismatch", refused},
    {Reason::coplanar_fiducials, "coplanar_fiducials", refused},
    {Reason::views_too_close, "views_too_close", refused},
    {Reason::residual_too_large, "residual_too_large", refused},
    {Reason::uncertain, "uncertain", refused},
    {Reason::ambiguous_handedness, "ambiguous_handedness", refused},
    {Reason::scale_disagrees, "scale_disagrees", refused},
    {Reason::patient_mismatch, "patient_mismatch", refused},
    {Reason::parallel_rays, "parallel_rays", refused},
    {Reason::point_at_infinity, "point_at_infinity", refused},
    {Reason::behind_source, "behind_source", refused},
    {Reason::not_seen, "not_seen", refused},
    {Reason::target_not_found, "target_not_found", refused},
    {Reason::bad_tunnel, "bad_tunnel", refused},
    {Reason::no_pose, "no_pose", refused},
    {Reason::stale_pose, "stale_pose", refused},
    {Reason::pose_spread, "pose_spread", refused},
    {Reason::poses_too_alike, "poses_too_alike", refused},
    {Reason::out_of_reach, "out_of_reach", refused},
    {Reason::singular_pose, "singular_pose", refused},
    {Reason::keep_out, "keep_out", refused},
    {Reason::robot_moved, "robot_moved", refused},
    {Reason::plan_stale, "plan_stale", refused},
    {Reason::robot_locked, "robot_locked", refused},
    {Reason::robot_stopped, "robot_stopped", refused},
    {Reason::order_not_confirmed, "order_not_confirmed", refused},
    {Reason::stale_state, "stale_state", refused},
    {Reason::off_target, "off_target", refused},
    {Reason::not_connected, "not_connected", refused},
    {Reason::replay_differs, "replay_differs", refused},
    {Reason::interrupted, "interrupted", refused},
    {Reason::too_few_views, "too_few_views", refused},
    {Reason::distances_disagree, "distances_disagree", refused},
    {Reason::phantom_changed, "phantom_changed", refused},
    {Reason::c_arm_changed, "c_arm_changed", refused},
    {Reason::unequal_pixels, "unequal_pixels", refused},
    {Reason::name_differs, "name_differs", refused},
    {Reason::bone_taken_as_fixed, "bone_taken_as_fixed", refused},
    {Reason::tag_disagrees, "tag_disagrees", refused},
    {Reason::spacing_missing, "spacing_missing", refused},
    {Reason::lossy_image, "lossy_image", refused},
    {Reason::uid_reused, "uid_reused", refused},
    {Reason::few_fiducials, "few_fiducials", refused},
    {Reason::rules_broken, "rules_broken", refused},
    {Reason::unobservable_motion, "unobservable_motion", refused},
    {Reason::pick_on_fiducial, "pick_on_fiducial", refused},
    {Reason::intrinsics_inconsistent, "intrinsics_inconsistent", refused},
    {Reason::intrinsics_weak, "intrinsics_weak", refused},
    {Reason::residual_distortion, "residual_distortion", refused},
    {Reason::calibrator_strained, "calibrator_strained", refused},
    {Reason::calibrator_deviates, "calibrator_deviates", refused},
    {Reason::ball_displaced, "ball_displaced", refused},
    {Reason::scale_unverified, "scale_unverified", refused},
    {Reason::scale_weak, "scale_weak", refused},
    {Reason::covariance_missing, "covariance_missing", refused},
    {Reason::registration_ambiguous, "registration_ambiguous", refused},
    {Reason::registration_disagrees, "registration_disagrees", refused},
    {Reason::wrong_model, "wrong_model", refused},
    {Reason::out_of_capture, "out_of_capture", refused},
    {Reason::surplus_data, "surplus_data", refused},
    {Reason::irregular_file, "irregular_file", refused},
    {Reason::outside_model, "outside_model", refused},
    {Reason::outside_reference, "outside_reference", refused},
    {Reason::depth_from_scale, "depth_from_scale", refused},
    {Reason::pixels_taken_as_rectified, "pixels_taken_as_rectified", refused},
    {Reason::record_lost, "record_lost", refused},
    {Reason::image_changed, "image_changed", refused},
    {Reason::tunnel_breach, "tunnel_breach", refused},
    {Reason::bridge_thin, "bridge_thin", refused},
    {Reason::registration_stale, "registration_stale", refused},
    {Reason::registration_not_confirmed, "registration_not_confirmed", refused},
    {Reason::marker_lost, "marker_lost", refused},
    {Reason::marker_loose, "marker_loose", refused},
    {Reason::markers_swapped, "markers_swapped", refused},
    {Reason::bodies_exchanged, "bodies_exchanged", refused},
    {Reason::body_ill_conditioned, "body_ill_conditioned", refused},
    {Reason::cameras_not_in_step, "cameras_not_in_step", refused},
    {Reason::frames_missing, "frames_missing", refused},
    {Reason::seed_off_bone, "seed_off_bone", refused},
    {Reason::seeds_in_one_bone, "seeds_in_one_bone", refused},
    {Reason::bones_in_contact, "bones_in_contact", refused},
    {Reason::bone_cut_off, "bone_cut_off", refused},
    {Reason::not_hounsfield, "not_hounsfield", refused},
};

constexpr auto reasons = [] {
  std::array<Reason, std::size(entries)> all{};
  std::ranges::transform(entries, all.begin(), &ReasonEntry::reason);
  return all;
}();

/// Every enumerator up to the last has an entry, in the enumeration's order.
static_assert([] {
  for (std::size_t i = 0; i < reasons.size(); ++i)
    if (reasons[i] != Reason(i)) return false;
  return reasons.back() == Reason::not_hounsfield;
}());

const ReasonEntry& entry(Reason reason) { return entries[std::size_t(reason)]; }

}  // namespace

std::string_view code(Reason reason) { return entry(reason).code; }

int exit_code(Reason reason) { return entry(reason).exit_code; }

std::span<const Reason> all_reasons() { return reasons; }

}  // namespace helicarm
