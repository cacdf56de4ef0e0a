// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "helicarm/xray/xray_image.h"

namespace helicarm::xray {

/// An image file of several frames or pages, opened and checked once; its pixels are decoded frame by frame.
class ImageFile {
 public:
  /// Fails as `read_xray_image`; the file may have 4 GiB.
  static Expected<std::shared_ptr<const ImageFile>> open(const std::filesystem::path& path);
  /// Images that are in memory, as the frames of a file. Fails with bad_size for none.
  static Expected<std::shared_ptr<const ImageFile>> of(std::vector<XrayImage> images);
  ~ImageFile();

  int frames() const;
  /// bad_value where a DICOM file gives angle increments for another number of frames than it has.
  Expected<void> check_angles() const;
  /// As `read_xray_image`. Thread-safe.
  Expected<XrayImage> read(const std::string& view_name, std::optional<int> frame) const;

 private:
  struct Content;
  explicit ImageFile(std::unique_ptr<Content> content);
  std::unique_ptr<Content> content_;
};

}  // namespace helicarm::xray
