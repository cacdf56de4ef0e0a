// SPDX-License-Identifier: Apache-2.0
#include "helicarm/volume/segment_values.h"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include "helicarm/xray/compressed_frame.h"
#include "helicarm/xray/transfer_syntax.h"

namespace helicarm::volume {
namespace {

using xray::DicomElements;
using xray::DicomTag;
using Kind = SegmentationKind;

constexpr DicomTag pixel_padding{0x00280120, "Pixel Padding Value"};
constexpr DicomTag fractional_maximum{0x0062000E, "Maximum Fractional Value"};

/// Of `bits` each: these are packed from the least significant one on; words are little-endian.
int value_at(std::string_view values, std::size_t at, std::size_t bits) {
  const auto byte = [&](std::size_t i) { return int(static_cast<unsigned char>(values[i])); };
  if (bits == 1) return byte(at / 8) >> (at % 8) & 1;
  return bits == 8 ? byte(at) : byte(2 * at) | byte(2 * at + 1) << 8;
}

}  // namespace

SegmentValues::SegmentValues(const DicomElements& elements, const Eigen::Vector2i& size, std::size_t count,
                             std::optional<double> threshold)
    : elements_(elements),
      size_(size),
      area_(std::size_t(size.x()) * std::size_t(size.y())),
      kind_(kind_of(elements)),
      bits_(std::size_t(word_in(elements, xray::tags::bits_allocated, 1))) {
  if (kind_ == Kind::fractional) least_ = *threshold * word_in(elements, fractional_maximum, 1);
  if (kind_ == Kind::label_map) {
    segments_ = segments_of(elements);
    padding_ = elements.word(pixel_padding, "US");
  }
  if (!elements.fragments.empty()) {
    compressed_ = xray::fragments_of_frames(elements, int(count)).frames;
    return;
  }
  values_ = elements.find(xray::tags::pixel_data)->value;
  const std::size_t needed = (area_ * count * bits_ + 7) / 8;
  if (values_.size() < needed)
    elements.refuse(Reason::truncated, xray::tags::pixel_data,
                    fmt::format("has {} bytes, {} frames of {} x {} {} need {}", values_.size(), count,
                                size.x(), size.y(),
                                bits_ == 1   ? "bits"
                                : bits_ == 8 ? "bytes"
                                             : "words",
                                needed));
}

std::vector<int> SegmentValues::of_frame(std::size_t frame, int of_frame) const {
  const bool is_plain = compressed_.empty();
  const std::string unpacked = is_plain ? std::string() : decoded(frame);
  const std::size_t first = is_plain ? frame * area_ : 0,
                    bits = is_plain ? bits_ : std::max<std::size_t>(bits_, 8);
  const std::string_view values = is_plain ? values_ : std::string_view(unpacked);
  std::vector<int> segments(area_);
  for (std::size_t i = 0; i < area_; ++i)
    segments[i] = segment_of(value_at(values, first + i, bits), of_frame, frame);
  return segments;
}

int SegmentValues::segment_of(int value, int of_frame, std::size_t frame) const {
  if (kind_ == Kind::binary) return value != 0 ? of_frame : 0;
  if (kind_ == Kind::fractional) return value >= least_ ? of_frame : 0;
  if (value == 0 || segments_.contains(value)) return value;
  if (value == padding_) return 0;
  throw BadInput(Reason::bad_value,
                 fmt::format("{}: frame {} has a pixel of value {}, which Segment Sequence does not list",
                             elements_.origin, frame + 1, value));
}

std::string SegmentValues::decoded(std::size_t frame) const {
  std::string bytes;
  for (std::size_t i = compressed_[frame].first; i < compressed_[frame].last; ++i)
    bytes += elements_.fragments[i];
  const xray::Coding coding = xray::transfer_syntax(elements_.transfer_syntax)->coding;
  const std::string origin = fmt::format("{}: frame {}", elements_.origin, frame + 1);
  return value_or_throw(
      bits_ == 1 ? xray::decode_compressed_bits(std::move(bytes), coding, size_, origin)
                 : xray::decode_compressed(std::move(bytes), coding, size_, int(bits_ / 8), origin));
}

}  // namespace helicarm::volume
