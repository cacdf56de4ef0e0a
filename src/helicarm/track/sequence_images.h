// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "helicarm/case_registration/follow_case.h"
#include "helicarm/pipeline/case.h"
#include "helicarm/xray/image_file.h"

namespace helicarm::track {

/// The images of one view through a sequence.
struct SequenceView {
  pipeline::CaseView images;                  ///< "image" with {frame}, or a file with several frames
  int frame_offset = 0;                       ///< the image's number is the sequence's frame plus this
  std::optional<Eigen::Vector2i> image_size;  ///< as the camera's file or the map states it
  std::shared_ptr<const xray::ImageFile> opened = {};  ///< instead of a file of `images`
};

/// The images of a sequence, checked for existence and size before the first is used. The polarity of a view
/// is one for all its frames: where it is not declared and more than half of up to 15 frames, evenly spaced,
/// look as if metal were bright, the view's grey values are inverted, else none is.
class SequenceImages {
 public:
  /// Fails with missing_file where images do not exist, bad_value for frames that a file does not have and
  /// for a view that names one frame, and bad_size where sizes differ within a view or from its camera's or
  /// map's, as far as the files' headers state them.
  static Expected<SequenceImages> open(std::span<const SequenceView> views,
                                       const case_registration::FrameRange& frames);

  /// The images of all views, by their own threads. Fails as `read_xray_image`, and with bad_size.
  /// Thread-safe.
  Expected<std::vector<xray::XrayImage>> at(int frame) const;

  /// Whether the view's grey values are inverted because metal looks bright.
  bool is_inverted(std::size_t view) const { return inverted_[view].has_value(); }
  /// The grey values as stored, without a warning: the view's markers show that its metal is dark.
  void undo_inversion(std::size_t view);

  /// tag_disagrees for each view that is inverted, lossy_image for one whose images were compressed with
  /// loss.
  const std::vector<Warning>& warnings() const { return warnings_; }

 private:
  xray::XrayImage as_read(std::size_t view, int frame) const;
  Expected<xray::XrayImage> image(std::size_t view, int frame) const;
  void decide_polarity(const case_registration::FrameRange& frames);

  std::vector<SequenceView> views_;
  std::vector<std::shared_ptr<const xray::ImageFile>> files_;  ///< of several frames; null: numbered files
  std::vector<std::optional<Eigen::Vector2i>> sizes_;
  std::vector<std::optional<Warning>> inverted_;  ///< of each view that is, the warning among `warnings_`
  std::vector<Warning> warnings_;
};

}  // namespace helicarm::track
