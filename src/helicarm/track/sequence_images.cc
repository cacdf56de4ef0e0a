// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/sequence_images.h"

#include <array>
#include <cstdint>
#include <fstream>

#include <fmt/format.h>

#include "helicarm/core/parallel.h"
#include "helicarm/pipeline/registration_case.h"
#include "helicarm/pipeline/view_image.h"
#include "helicarm/xray/read_dicom.h"

namespace helicarm::track {
namespace {

namespace fs = std::filesystem;

bool is_numbered(const fs::path& image) {
  return image.filename().string().find("{frame") != std::string::npos;
}

pipeline::CaseView at_number(const TrackView& view, int frame) {
  pipeline::RegistrationCase one;
  one.base.views = {view.images};
  return value_or_throw(pipeline::at_frame(std::move(one), frame + view.frame_offset)).base.views.front();
}

/// Width and height in a PNG file's header.
std::optional<Eigen::Vector2i> png_size(const fs::path& path) {
  std::array<unsigned char, 24> head{};
  std::ifstream file(path, std::ios::binary);
  if (!file.read(reinterpret_cast<char*>(head.data()), head.size()) || head[1] != 'P' || head[2] != 'N')
    return std::nullopt;
  const auto number = [&](std::size_t at) {
    return int(std::uint32_t(head[at]) << 24 | std::uint32_t(head[at + 1]) << 16 |
               std::uint32_t(head[at + 2]) << 8 | head[at + 3]);
  };
  return Eigen::Vector2i(number(16), number(20));
}

/// A reader that finds more bright discs than dark ones inverts the image. A sequence keeps its polarity,
/// which the picks show.
void keep_polarity(xray::XrayImage& image) {
  if (std::erase_if(image.warnings, [](const Warning& warning) {
        return warning.reason == Reason::tag_disagrees && warning.message.ends_with("values were inverted");
      }) > 0)
    xray::invert(image);
}

void check_size(const std::string& view, int number, const Eigen::Vector2i& size,
                const std::optional<Eigen::Vector2i>& expected) {
  if (expected && *expected != size)
    throw BadInput(Reason::bad_size,
                   fmt::format("{}: image {} has {} x {} pixels, the camera or the first image {} x {}", view,
                               number, size.x(), size.y(), expected->x(), expected->y()));
}

}  // namespace

Expected<SequenceImages> SequenceImages::open(const TrackCase& given,
                                              const case_registration::FrameRange& frames) {
  return guarded([&] {
    SequenceImages images;
    images.views_ = given.views;
    std::string first;
    int missing = 0;
    for (const TrackView& view : given.views) {
      auto& size = images.sizes_.emplace_back(view.image_size);
      auto& file = images.files_.emplace_back();
      const int lowest = frames.first + view.frame_offset;
      const int highest = lowest + (frames.count() - 1) * frames.step;
      if (lowest < 0)
        throw BadInput(Reason::bad_value,
                       fmt::format("{}: frame {} with \"frame_offset\" {} is image {}", view.images.name,
                                   frames.first, view.frame_offset, lowest));
      if (!is_numbered(view.images.image)) {
        file = value_or_throw(xray::ImageFile::open(view.images.image));
        if (lowest < 1 || highest > file->frames())
          throw BadInput(Reason::bad_value,
                         fmt::format("{}: the frames {} to {} are asked for, but {} has the frames 1 to {}",
                                     view.images.name, lowest, highest, view.images.image.filename().string(),
                                     file->frames()));
        continue;
      }
      for (int i = 0; i < frames.count(); ++i) {
        const int frame = frames.first + i * frames.step;
        const fs::path path = at_number(view, frame).image;
        if (!fs::exists(path)) {
          if (missing++ == 0) first = path.filename().string();
          continue;
        }
        if (const auto stated = png_size(path)) {
          if (!size) size = stated;
          check_size(view.images.name, frame + view.frame_offset, *stated, size);
        }
      }
    }
    if (missing > 0)
      throw BadInput(Reason::missing_file, fmt::format("{} of {} images do not exist, the first: {}", missing,
                                                       frames.count() * int(given.views.size()), first));
    return images;
  });
}

Expected<xray::XrayImage> SequenceImages::image(std::size_t view, int frame) const {
  const TrackView& asked = views_[view];
  return guarded([&] {
    xray::XrayImage read =
        files_[view] ? value_or_throw(files_[view]->read(asked.images.name, frame + asked.frame_offset))
                     : value_or_throw(pipeline::image_of(at_number(asked, frame)));
    keep_polarity(read);
    check_size(asked.images.name, frame + asked.frame_offset, {read.pixels.width(), read.pixels.height()},
               sizes_[view]);
    return read;
  });
}

Expected<std::vector<xray::XrayImage>> SequenceImages::at(int frame) const {
  return guarded([&] {
    std::vector<Expected<xray::XrayImage>> read(views_.size(), xray::XrayImage{});
    parallel_for(views_.size(), 0, [&](std::size_t i) { read[i] = image(i, frame); });
    std::vector<xray::XrayImage> images;
    for (auto& each : read) images.push_back(value_or_throw(std::move(each)));
    return images;
  });
}

}  // namespace helicarm::track
