// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <vector>

#include "helicarm/track/track_case.h"
#include "helicarm/xray/image_file.h"

namespace helicarm::track {

/// The images of a sequence, checked for existence and size before the first is used.
class SequenceImages {
 public:
  /// Fails with missing_file where images do not exist, bad_value for frames that a file does not have, and
  /// bad_size where sizes differ within a view or from its camera's, as far as the files' headers state them.
  static Expected<SequenceImages> open(const TrackCase& given, const case_registration::FrameRange& frames);

  /// The images of all views, by their own threads. Fails as `read_xray_image`, and with bad_size.
  /// Thread-safe.
  Expected<std::vector<xray::XrayImage>> at(int frame) const;

 private:
  Expected<xray::XrayImage> image(std::size_t view, int frame) const;

  std::vector<TrackView> views_;
  std::vector<std::shared_ptr<const xray::ImageFile>> files_;  ///< of several frames; null: numbered files
  std::vector<std::optional<Eigen::Vector2i>> sizes_;
};

}  // namespace helicarm::track
