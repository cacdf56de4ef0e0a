// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "helicarm/core/failure.h"

namespace helicarm {

/// One tool at one moment, as recorded: perhaps no pose at all.
struct RecordedPose {
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
  bool visible = true;  ///< its status is OK; a file without status says nothing against it
};

struct SequenceFrame {
  double time_s = 0;
  std::map<std::string, RecordedPose> poses;  ///< by name without "Transform", e.g. ToolToTracker
};

/// Reads the poses of a MetaImage sequence file (.mha, .mhd): Seq_FrameNNNN_NAMETransform, ...Status and
/// Timestamp; images in it are passed over. Fails with `missing_file`, `bad_size` (over 512 MiB),
/// `truncated` (no ElementDataFile), `bad_value`.
Expected<std::vector<SequenceFrame>> read_sequence(const std::filesystem::path& path);

/// Fails with `cannot_write`, `bad_value` for a name that is no word.
Expected<void> write_sequence(const std::filesystem::path& path, const std::vector<SequenceFrame>& frames);

}  // namespace helicarm
