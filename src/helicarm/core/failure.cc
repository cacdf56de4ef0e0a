// SPDX-License-Identifier: Apache-2.0
#include "helicarm/core/failure.h"

namespace helicarm {

std::string_view code(Reason reason) {
  switch (reason) {
    case Reason::usage:
      return "usage";
    case Reason::not_an_image:
      return "not_an_image";
    case Reason::truncated:
      return "truncated";
    case Reason::bad_size:
      return "bad_size";
    case Reason::bad_value:
      return "bad_value";
    case Reason::unsupported:
      return "unsupported";
    case Reason::missing_file:
      return "missing_file";
    case Reason::bad_json:
      return "bad_json";
    case Reason::not_finite:
      return "not_finite";
    case Reason::unknown_key:
      return "unknown_key";
    case Reason::path_outside:
      return "path_outside";
    case Reason::name_clash:
      return "name_clash";
    case Reason::cannot_write:
      return "cannot_write";
    case Reason::port_taken:
      return "port_taken";
    case Reason::blank_image:
      return "blank_image";
    case Reason::saturated:
      return "saturated";
    case Reason::plate_not_found:
      return "plate_not_found";
    case Reason::plate_mismatch:
      return "plate_mismatch";
    case Reason::too_few_fiducials:
      return "too_few_fiducials";
    case Reason::ambiguous_labels:
      return "ambiguous_labels";
    case Reason::calibrator_mismatch:
      return "calibrator_mismatch";
    case Reason::coplanar_fiducials:
      return "coplanar_fiducials";
    case Reason::views_too_close:
      return "views_too_close";
    case Reason::residual_too_large:
      return "residual_too_large";
    case Reason::uncertain:
      return "uncertain";
    case Reason::patient_mismatch:
      return "patient_mismatch";
    case Reason::parallel_rays:
      return "parallel_rays";
    case Reason::point_at_infinity:
      return "point_at_infinity";
    case Reason::behind_source:
      return "behind_source";
    case Reason::not_seen:
      return "not_seen";
    case Reason::target_not_found:
      return "target_not_found";
    case Reason::bad_tunnel:
      return "bad_tunnel";
    case Reason::no_pose:
      return "no_pose";
    case Reason::stale_pose:
      return "stale_pose";
    case Reason::pose_spread:
      return "pose_spread";
    case Reason::poses_too_alike:
      return "poses_too_alike";
    case Reason::out_of_reach:
      return "out_of_reach";
    case Reason::singular_pose:
      return "singular_pose";
    case Reason::keep_out:
      return "keep_out";
    case Reason::robot_moved:
      return "robot_moved";
    case Reason::plan_stale:
      return "plan_stale";
    case Reason::robot_locked:
      return "robot_locked";
    case Reason::robot_stopped:
      return "robot_stopped";
    case Reason::order_not_confirmed:
      return "order_not_confirmed";
    case Reason::stale_state:
      return "stale_state";
    case Reason::off_target:
      return "off_target";
    case Reason::not_connected:
      return "not_connected";
    case Reason::replay_differs:
      return "replay_differs";
    case Reason::interrupted:
      return "interrupted";
    case Reason::name_differs:
      return "name_differs";
    case Reason::bone_taken_as_fixed:
      return "bone_taken_as_fixed";
    case Reason::tag_disagrees:
      return "tag_disagrees";
    case Reason::spacing_missing:
      return "spacing_missing";
    case Reason::lossy_image:
      return "lossy_picture";
    case Reason::uid_reused:
      return "uid_reused";
    case Reason::few_fiducials:
      return "few_fiducials";
    case Reason::rules_broken:
      return "rules_broken";
  }
  return "internal";
}

int exit_code(Reason reason) { return reason <= Reason::port_taken ? 2 : 3; }

}  // namespace helicarm
