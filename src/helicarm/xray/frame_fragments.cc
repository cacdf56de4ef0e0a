// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/frame_fragments.h"

#include <algorithm>
#include <optional>

#include <fmt/format.h>

#include "helicarm/xray/bytes.h"
#include "helicarm/xray/dicom_tags.h"
#include "helicarm/xray/transfer_syntax.h"

namespace helicarm::xray {
namespace {

using namespace std::literals;

/// PS3.5 G.5: the number of segments and their offsets, of which the first follows the header.
bool begins_rle(std::string_view fragment) {
  constexpr std::size_t header_bytes = 64;
  if (fragment.size() < header_bytes) return false;
  const std::size_t segments = number_at(fragment, 0);
  if (segments < 1 || segments > 2 || number_at(fragment, 4) != header_bytes) return false;
  for (std::size_t at = 8; at < header_bytes; at += 4)
    if ((number_at(fragment, at) == 0) != (at / 4 > segments)) return false;
  return true;
}

bool begins_image(Coding coding, std::string_view fragment) {
  if (coding == Coding::rle) return begins_rle(fragment);
  if (coding == Coding::jpeg_2000)
    return fragment.starts_with("\xFF\x4F\xFF\x51"sv) || fragment.starts_with("\0\0\0\x0CjP  "sv);
  return fragment.starts_with("\xFF\xD8"sv);
}

/// From each beginning to the next; the last ends with the fragments.
std::vector<FrameFragments> between(const std::vector<std::size_t>& begins, std::size_t frames,
                                    std::size_t end) {
  std::vector<FrameFragments> found;
  for (std::size_t i = 0; i < frames; ++i)
    found.push_back({begins[i], i + 1 < begins.size() ? begins[i + 1] : end});
  return found;
}

/// Where the table of offsets lets the frames begin; nothing without a table that fits.
std::optional<std::vector<std::size_t>> begins_by_table(const DicomElements& elements, std::size_t frames) {
  const auto& fragments = elements.fragments;
  const std::string_view table = fragments.front();
  if (table.size() != 4 * frames) return std::nullopt;
  std::vector<std::size_t> begins;
  std::size_t at = 0;
  for (std::size_t i = 1; i < fragments.size() && begins.size() < frames; at += 8 + fragments[i++].size())
    if (at == number_at(table, 4 * begins.size())) begins.push_back(i);
  return begins.size() == frames ? std::optional(begins) : std::nullopt;
}

}  // namespace

EncapsulatedFrames fragments_of_frames(const DicomElements& elements, int frames) {
  const auto& fragments = elements.fragments;
  const auto wanted = static_cast<std::size_t>(frames);
  const Coding coding = transfer_syntax(elements.transfer_syntax)->coding;
  std::vector<std::size_t> filled, begins;
  for (std::size_t i = 1; i < fragments.size(); ++i) {
    if (fragments[i].empty()) continue;
    filled.push_back(i);
    if (begins_image(coding, fragments[i])) begins.push_back(i);
  }
  if (filled.size() < wanted)
    elements.refuse(
        Reason::truncated, tags::pixel_data,
        fmt::format("has {} fragments, Number of Frames (0028,0008) says {}", filled.size(), frames));
  const bool by_images = !begins.empty() && begins.front() == filled.front();
  const std::size_t images = by_images ? begins.size() : 0;
  if (wanted == 1 && images < 2) return {{{filled.front(), fragments.size()}}, images};
  if (filled.size() == wanted) return {between(filled, wanted, fragments.size()), images};
  if (const auto table = begins_by_table(elements, wanted))
    return {between(*table, wanted, fragments.size()), images};
  if (images >= wanted) return {between(begins, wanted, fragments.size()), images};
  if (images > 0)
    elements.refuse(
        Reason::truncated, tags::pixel_data,
        fmt::format("holds {} compressed images, Number of Frames (0028,0008) says {}", images, frames));
  elements.refuse(
      Reason::bad_value, tags::pixel_data,
      fmt::format("has {} fragments for {} frames, no table of their offsets, and no image begins in the "
                  "first",
                  filled.size(), frames));
}

}  // namespace helicarm::xray
