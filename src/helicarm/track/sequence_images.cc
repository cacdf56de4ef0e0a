// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/sequence_images.h"

#include <algorithm>

#include <fmt/format.h>

#include "helicarm/core/number_ranges.h"
#include "helicarm/core/parallel.h"
#include "helicarm/pipeline/case_frames.h"
#include "helicarm/pipeline/view_image.h"
#include "helicarm/xray/run_polarity.h"
#include "helicarm/xray/stated_size.h"

namespace helicarm::track {
namespace {

namespace fs = std::filesystem;

void check_size(const std::string& view, int number, const Eigen::Vector2i& size,
                const std::optional<Eigen::Vector2i>& expected) {
  if (expected && *expected != size)
    throw BadInput(
        Reason::bad_size,
        fmt::format("{}: image {} has {} x {} pixels, the camera, its map or the first image {} x {}", view,
                    number, size.x(), size.y(), expected->x(), expected->y()));
}

}  // namespace

Expected<SequenceImages> SequenceImages::open(std::span<const SequenceView> views,
                                              const case_registration::FrameRange& frames) {
  return guarded([&] {
    SequenceImages images;
    images.views_.assign(views.begin(), views.end());
    std::string first, missing;
    std::size_t missing_count = 0;
    for (const SequenceView& view : views) {
      if (view.images.frame)
        throw BadInput(Reason::bad_value,
                       fmt::format("{}: \"frame\" names one image: a sequence has --frames and "
                                   "\"frame_offset\"",
                                   view.images.name));
      auto& size = images.sizes_.emplace_back(view.image_size);
      auto& file = images.files_.emplace_back();
      const int lowest = frames.first + view.frame_offset;
      const int highest = lowest + (frames.count() - 1) * frames.step;
      if (lowest < 0)
        throw BadInput(Reason::bad_value,
                       fmt::format("{}: frame {} with \"frame_offset\" {} is image {}", view.images.name,
                                   frames.first, view.frame_offset, lowest));
      if (view.opened || !pipeline::is_numbered(view.images)) {
        file = view.opened ? view.opened : value_or_throw(xray::ImageFile::open(view.images.image));
        if (lowest < 1 || highest > file->frames())
          throw BadInput(
              Reason::bad_value,
              fmt::format("{}: the frames {} to {} are asked for, but {} has the frames 1 to {}",
                          view.images.name, lowest, highest,
                          view.opened ? "it" : view.images.image.filename().string(), file->frames()));
        continue;
      }
      std::vector<int> of_view;
      for (int i = 0; i < frames.count(); ++i) {
        const int frame = frames.first + i * frames.step;
        const fs::path path =
            value_or_throw(pipeline::at_number(view.images, frame + view.frame_offset)).image;
        if (!fs::exists(path)) {
          if (missing_count++ == 0) first = path.filename().string();
          of_view.push_back(frame + view.frame_offset);
          continue;
        }
        if (const auto stated = xray::stated_size(path)) {
          if (!size) size = stated;
          check_size(view.images.name, frame + view.frame_offset, *stated, size);
        }
      }
      if (!of_view.empty())
        missing +=
            fmt::format("{}{}: {}", missing.empty() ? "" : "; ", view.images.name, number_ranges(of_view));
    }
    if (missing_count > 0)
      throw BadInput(Reason::missing_file,
                     fmt::format("{} of {} images do not exist, the first: {}; the numbers {}", missing_count,
                                 frames.count() * int(views.size()), first, missing));
    images.decide_polarity(frames);
    return images;
  });
}

xray::XrayImage SequenceImages::as_read(std::size_t view, int frame) const {
  const SequenceView& source = views_[view];
  return files_[view] ? value_or_throw(files_[view]->read(source.images.name, frame + source.frame_offset))
                      : value_or_throw(pipeline::image_of(
                            value_or_throw(pipeline::at_number(source.images, frame + source.frame_offset))));
}

void SequenceImages::decide_polarity(const case_registration::FrameRange& frames) {
  constexpr int most_looked_at = 15;
  const int looked_at = std::min(most_looked_at, frames.count());
  std::vector<int> bright(views_.size());
  std::vector<std::optional<Warning>> lossy(views_.size());
  // In the order of the frames, in which a film is decoded.
  parallel_for(views_.size(), 0, [&](std::size_t view) {
    for (int i = 0; i < looked_at; ++i) {
      const int at = i * (frames.count() - 1) / std::max(1, looked_at - 1);
      const xray::XrayImage image = as_read(view, frames.first + at * frames.step);
      bright[view] += image.inverted.has_value();
      const auto found = std::ranges::find(image.warnings, Reason::lossy_image, &Warning::reason);
      if (found != image.warnings.end() && !lossy[view]) lossy[view] = *found;
    }
  });
  for (std::size_t view = 0; view < views_.size(); ++view) {
    if (lossy[view]) warnings_.push_back(*std::move(lossy[view]));
    inverted_.emplace_back();
    if (2 * bright[view] <= looked_at) continue;
    const std::string& name = views_[view].images.name;
    inverted_.back() = {Reason::tag_disagrees,
                        fmt::format("{}: in {} of {} frames metal is bright; the grey values were inverted, "
                                    "those of all its frames",
                                    name, bright[view], looked_at),
                        name,
                        {}};
    warnings_.push_back(*inverted_.back());
  }
}

void SequenceImages::undo_inversion(std::size_t view) {
  if (inverted_[view]) std::erase(warnings_, *inverted_[view]);
  inverted_[view].reset();
}

Expected<xray::XrayImage> SequenceImages::image(std::size_t view, int frame) const {
  const SequenceView& source = views_[view];
  return guarded([&] {
    xray::XrayImage read = as_read(view, frame);
    xray::take_polarity(read, is_inverted(view));
    check_size(source.images.name, frame + source.frame_offset, {read.pixels.width(), read.pixels.height()},
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
