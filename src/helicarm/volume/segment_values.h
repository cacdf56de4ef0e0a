// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "helicarm/volume/segment_frames.h"
#include "helicarm/xray/frame_fragments.h"

namespace helicarm::volume {

/// Which voxels of each frame of a DICOM segmentation belong to which segment.
class SegmentValues {
 public:
  /// `threshold`: of a FRACTIONAL segmentation, the share from which on a voxel belongs to its segment.
  /// Throws BadInput where there are fewer values than `count` frames of `size` have. The elements must
  /// outlive it.
  SegmentValues(const xray::DicomElements& elements, const Eigen::Vector2i& size, std::size_t count,
                std::optional<double> threshold);

  /// Of each pixel of a frame the segment, 0 of none; `of_frame`: the frame's own.
  std::vector<int> of_frame(std::size_t frame, int of_frame) const;

 private:
  int segment_of(int value, int of_frame, std::size_t frame) const;
  std::string decoded(std::size_t frame) const;

  const xray::DicomElements& elements_;
  Eigen::Vector2i size_;
  std::size_t area_;
  SegmentationKind kind_;
  std::size_t bits_;  ///< of a value
  double least_ = 0;
  std::map<int, std::string> segments_;  ///< of a LABELMAP
  std::optional<int> padding_;
  std::string_view values_;
  std::vector<xray::FrameFragments> compressed_;
};

}  // namespace helicarm::volume
