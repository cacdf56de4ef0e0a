// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "helicarm/core/failure.h"

namespace helicarm::tracker {

/// One tool at one moment, as recorded: possibly not a pose.
struct RecordedPose {
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
  bool visible = true;  ///< its status is OK, or the file has no status
};

struct SequenceFrame {
  double time_s = 0;
  std::map<std::string, RecordedPose> poses;  ///< by name without "Transform", e.g. ToolToTracker
};

/// Reads the poses of a MetaImage sequence file (.mha, .mhd): Seq_FrameNNNN_NAMETransform, ...Status and
/// Timestamp; images in it are skipped. Fails with `missing_file`, `bad_size` (over 512 MiB), `truncated` (no
/// ElementDataFile), `bad_value`.
Expected<std::vector<SequenceFrame>> read_sequence(const std::filesystem::path& path);

/// Fails with `cannot_write`, `bad_value` for an invalid name.
Expected<void> write_sequence(const std::filesystem::path& path, const std::vector<SequenceFrame>& frames);

}  // namespace helicarm::tracker
