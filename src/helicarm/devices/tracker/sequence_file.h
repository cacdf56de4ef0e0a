// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "helicarm/core/failure.h"
#include "helicarm/geometry/rigid_transform.h"

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

/// Transforms through the items of a sequence, parent_from_name, LPS, mm.
struct TransformSequence {
  std::vector<double> index;  ///< of each item: s, or the frame's number
  std::map<std::string, std::vector<std::optional<geometry::RigidTransform>>> transforms;
};

/// Sequences of transforms of 3D Slicer (RAS, to parent), by name without "Transform", as `track` writes
/// them; items without a valid transform are empty. Fails as `read_sequence`; no_pose for a file without
/// transforms, bad_value for a valid one that is no rigid motion.
Expected<TransformSequence> read_slicer_sequence(const std::filesystem::path& path);

/// Fails with `cannot_write`, `bad_value` for an invalid name.
Expected<void> write_sequence(const std::filesystem::path& path, const std::vector<SequenceFrame>& frames);

}  // namespace helicarm::tracker
