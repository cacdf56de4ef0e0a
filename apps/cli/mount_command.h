// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "command.h"
#include "helicarm/devices/tracker/mount_calibration.h"
#include "tracker_command.h"

namespace helicarm::cli {

struct MountArguments {
  TrackerLinkArguments link;           ///< its peer is empty if all places come from recordings
  std::string facet;                   ///< name of the calibrator's marker
  std::string pointer = "pointer";     ///< name of the pointer's marker
  std::filesystem::path tip;           ///< as `tracker pivot --json` writes
  std::string calibrator = "udcsc";    ///< a built-in or a file
  std::vector<std::string> divots;     ///< NAME=X,Y,Z in the calibrator's frame, mm
  std::vector<std::string> touch;      ///< places to touch, in order
  std::vector<std::string> recorded;   ///< LABEL=FILE: the pointer at rest on a place
  std::vector<std::string> pivoted;    ///< LABEL=FILE: the calibrator turned about a place
  std::optional<double> tip_sigma_mm;  ///< per axis, of a tip whose file has no covariance
  double tip_radius_mm = 0;            ///< of the pointer, on balls
  std::filesystem::path out = "mount.json";
  std::filesystem::path plan;  ///< its facet of this name is replaced or added
  tracker::MountOptions options;
};

/// Finds `calibrator_from_facet` of the user's own mount and writes it with its covariance.
CommandResult calibrate_mount_command(const MountArguments& arguments, Console& console);

}  // namespace helicarm::cli
