// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/repeated_images.h"

#include <algorithm>
#include <functional>
#include <utility>

#include <fmt/format.h>

#include "helicarm/core/number_ranges.h"

namespace helicarm::track {
namespace {

bool is_constant(const image::Image<float>& image) {
  const auto& pixels = image.pixels();
  return std::ranges::adjacent_find(pixels, std::not_equal_to<>()) == pixels.end();
}

}  // namespace

std::vector<RepeatedImage> RepeatedImages::among(int frame, const std::vector<xray::XrayImage>& images) {
  const ImageKeys keys = keys_of(images);
  std::vector<RepeatedImage> repeated;
  for (std::size_t k = 0; k < images.size(); ++k) {
    if (keys[k].empty()) continue;
    const auto [found, is_new] = seen_.try_emplace(keys[k], From{frame, k});
    if (is_new || is_constant(images[k].pixels)) continue;
    const From& from = found->second;
    repeated.push_back({k, from.frame, from.view});
    // Of two views of one frame either may be the wrong one.
    if (from.frame == frame && std::ranges::find(repeated, from.view, &RepeatedImage::view) == repeated.end())
      repeated.push_back({from.view, frame, k});
  }
  return repeated;
}

std::string repeated_text(const std::vector<std::string>& views, int frame, const RepeatedImage& repeated) {
  if (repeated.of_frame == frame)
    return fmt::format("frame {}: {} and {} are the same image", frame, views[repeated.of_view],
                       views[repeated.view]);
  return fmt::format("frame {}: the image of {} is that of {} frame {} again", frame, views[repeated.view],
                     repeated.of_view == repeated.view ? "its" : views[repeated.of_view] + " in",
                     repeated.of_frame);
}

void check_views_differ(const std::vector<std::string>& views, int frame,
                        const std::vector<RepeatedImage>& repeated) {
  if (!repeated.empty())
    throw BadInput({repeated.front().reason(), repeated_text(views, frame, repeated.front()),
                    views[repeated.front().view]});
}

std::optional<RepeatedImage> too_many_repeated(const std::vector<RepeatedImage>& repeated,
                                               std::size_t views) {
  constexpr std::size_t fewest = 2;
  if (repeated.empty() || views >= repeated.size() + fewest) return std::nullopt;
  return repeated.front();
}

std::vector<Warning> warnings_of_repeated(const std::vector<std::string>& views,
                                          const std::vector<int>& frames,
                                          const std::vector<std::vector<RepeatedImage>>& of_frames) {
  struct Found {
    RepeatedImage first;
    std::vector<int> frames;
  };
  std::map<std::pair<std::size_t, std::size_t>, Found> found;
  for (std::size_t f = 0; f < of_frames.size(); ++f)
    for (const RepeatedImage& each : of_frames[f])
      found.try_emplace({each.view, each.of_view}, Found{each, {}}).first->second.frames.push_back(frames[f]);
  std::vector<Warning> warnings;
  for (const auto& [of, each] : found) {
    const bool is_one = each.frames.size() == 1;
    warnings.push_back(
        {each.first.reason(),
         fmt::format("{}{}: {}, and {} not used", repeated_text(views, each.frames.front(), each.first),
                     is_one ? ""
                            : fmt::format("; so are {} images, of the frames {}", each.frames.size(),
                                          number_ranges(each.frames)),
                     is_one ? "it says nothing of its own moment" : "they say nothing of their own moments",
                     is_one ? "is" : "are"),
         views[each.first.view],
         {{"frames", double(each.frames.size())},
          {"first", double(each.frames.front())},
          {"of_frame", double(each.first.of_frame)}}});
  }
  return warnings;
}

}  // namespace helicarm::track
