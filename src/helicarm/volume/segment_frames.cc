// SPDX-License-Identifier: Apache-2.0
#include "helicarm/volume/segment_frames.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "helicarm/core/text.h"
#include "helicarm/volume/voxels.h"
#include "helicarm/xray/transfer_syntax.h"

namespace helicarm::volume {
namespace {

using Eigen::Vector3d;
using xray::DicomElements;
using xray::DicomTag;
using Kind = SegmentationKind;

constexpr DicomTag lossy_compression{0x00282110, "Lossy Image Compression"};
constexpr DicomTag segment_sequence{0x00620002, "Segment Sequence"};
constexpr DicomTag segment_number{0x00620004, "Segment Number"};
constexpr DicomTag segment_label{0x00620005, "Segment Label"};
constexpr DicomTag segment_identification{0x0062000A, "Segment Identification Sequence"};
constexpr DicomTag referenced_segment{0x0062000B, "Referenced Segment Number"};
constexpr DicomTag plane_position{0x00209113, "Plane Position Sequence"};
constexpr DicomTag plane_orientation{0x00209116, "Plane Orientation Sequence"};
constexpr DicomTag pixel_measures{0x00289110, "Pixel Measures Sequence"};
constexpr DicomTag slice_thickness{0x00180050, "Slice Thickness"};
constexpr DicomTag slice_spacing{0x00180088, "Spacing Between Slices"};

constexpr double farthest_coordinate_mm = 1e5, same_slice_mm = 0.01;
constexpr std::size_t most_group_bytes = std::size_t{64} << 20;

std::vector<double> numbers_in(const DicomElements& elements, DicomTag tag, std::size_t count, double low,
                               double high) {
  const auto numbers = elements.numbers(tag, count, low, high);
  if (!numbers) elements.refuse(Reason::bad_value, tag, "is missing");
  return *numbers;
}

/// The functional group of a frame, or else that of all frames.
DicomElements group_of(const DicomElements& frame, const DicomElements& shared, DicomTag tag) {
  for (const DicomElements* of : {&frame, &shared})
    if (auto items = xray::sequence_items(*of, tag); !items.empty()) return items.front();
  frame.refuse(Reason::bad_value, tag, "is missing");
}

SegmentFrame frame_of(const DicomElements& frame, const DicomElements& shared, Kind kind) {
  SegmentFrame segment_frame;
  if (kind != Kind::label_map)
    segment_frame.segment = word_in(group_of(frame, shared, segment_identification), referenced_segment, 1);
  const auto corner = numbers_in(group_of(frame, shared, plane_position), xray::tags::image_position, 3,
                                 -farthest_coordinate_mm, farthest_coordinate_mm);
  const DicomElements orientation = group_of(frame, shared, plane_orientation);
  const auto turn = numbers_in(orientation, xray::tags::image_orientation, 6, -1.001, 1.001);
  const DicomElements measures = group_of(frame, shared, pixel_measures);
  const auto spacing = numbers_in(measures, xray::tags::pixel_spacing, 2, 1e-3, 100);
  const auto length = [&](DicomTag tag) -> std::optional<double> {
    const auto value = measures.numbers(tag, 1, 1e-3, 100);
    return value ? std::optional((*value)[0]) : std::nullopt;
  };
  segment_frame.spacing = length(slice_spacing);
  segment_frame.thickness = length(slice_thickness);
  const auto directions = Eigen::Map<const Eigen::Matrix<double, 3, 2>>(turn.data());
  if (!(directions.transpose() * directions).isIdentity(1e-3))
    orientation.refuse(Reason::bad_value, xray::tags::image_orientation,
                       "is not a pair of perpendicular unit vectors");
  segment_frame.corner = Vector3d::Map(corner.data());
  segment_frame.axes.col(0) = directions.col(0) * spacing[1];
  segment_frame.axes.col(1) = directions.col(1) * spacing[0];
  return segment_frame;
}

/// Refuses values that are no bits (BINARY), bytes (FRACTIONAL) or words (LABELMAP).
void check_bits(const DicomElements& elements, Kind kind) {
  const int bits = word_in(elements, xray::tags::bits_allocated, 1);
  const auto refuse = [&](const char* needed) {
    elements.refuse(Reason::unsupported, xray::tags::bits_allocated,
                    fmt::format("is {}, must be {}", bits, needed));
  };
  if (kind == Kind::binary && bits != 1) refuse("1");
  if (kind == Kind::fractional && bits != 8) refuse("8");
  if (kind == Kind::label_map && bits != 8 && bits != 16) refuse("8 or 16");
}

/// Values that changed in compression would be other labels, or another outline.
void check_compression(const DicomElements& elements) {
  if (elements.fragments.empty()) return;
  const xray::TransferSyntax* syntax = xray::transfer_syntax(elements.transfer_syntax);
  if (syntax == nullptr)
    elements.refuse(Reason::unsupported, xray::tags::pixel_data,
                    "is compressed: decompress the file, for example with dcmconv or gdcmconv --raw");
  if (syntax->coding == xray::Coding::jpeg ||
      (syntax->may_be_lossy && elements.text(lossy_compression) != "00"))
    elements.refuse(Reason::unsupported, xray::tags::pixel_data,
                    "is compressed with loss, or may be (Lossy Image Compression (0028,2110) is not 00): a "
                    "segmentation must be stored without loss");
}

/// Refuses what `SegmentValues` does not read.
Kind checked_kind(const DicomElements& elements) {
  const Kind kind = kind_of(elements);
  check_bits(elements, kind);
  check_compression(elements);
  if (!elements.find(xray::tags::pixel_data))
    elements.refuse(Reason::bad_value, xray::tags::pixel_data, "is missing");
  return kind;
}

/// Distance of two slices: as stated, or the least between frames; of one slice its thickness. Slices without
/// a segment have no frame.
double step_of(const std::vector<SegmentFrame>& frames, const std::string& origin) {
  if (frames[0].spacing) return *frames[0].spacing;
  const Vector3d normal = frames[0].normal();
  double least = 0;
  for (std::size_t i = 1; i < frames.size(); ++i)
    if (const double gap = frames[i].along(normal) - frames[i - 1].along(normal); gap > same_slice_mm)
      least = least > 0 ? std::min(least, gap) : gap;
  if (least > 0) return least;
  if (frames[0].thickness) return *frames[0].thickness;
  throw BadInput(
      Reason::bad_value,
      origin + ": one slice, without Spacing Between Slices (0018,0088) or Slice Thickness (0018,0050)");
}

}  // namespace

int word_in(const DicomElements& elements, DicomTag tag, int low) {
  const auto word = elements.word(tag, "US");
  if (!word) elements.refuse(Reason::bad_value, tag, "is missing");
  if (*word < low)
    elements.refuse(Reason::bad_value, tag, fmt::format("is {}, must be at least {}", *word, low));
  return *word;
}

Kind kind_of(const DicomElements& elements) {
  const auto type = elements.text(segmentation_type);
  if (type == "BINARY") return Kind::binary;
  if (type == "FRACTIONAL") return Kind::fractional;
  if (type == "LABELMAP") return Kind::label_map;
  elements.refuse(Reason::unsupported, segmentation_type,
                  fmt::format("is {}, must be BINARY, FRACTIONAL or LABELMAP: export the segmentation as "
                              "binary, or as a label map in NRRD or NIfTI",
                              xray::quote(type)));
}

std::map<int, std::string> segments_of(const DicomElements& elements) {
  const int least = kind_of(elements) == Kind::label_map ? 0 : 1;
  std::map<int, std::string> segments;
  for (const DicomElements& item : xray::sequence_items(elements, segment_sequence))
    if (const int number = word_in(item, segment_number, least); number > 0)
      segments[number] = without_control_characters(std::string(item.text(segment_label).substr(0, 64)));
  return segments;
}

std::vector<SegmentFrame> frames_of(const DicomElements& elements) {
  const Kind kind = checked_kind(elements);
  const auto count = std::size_t(numbers_in(elements, xray::tags::frames, 1, 1, 1e6)[0]);
  const auto* groups = elements.find(xray::tags::frame_groups);
  if (!groups) elements.refuse(Reason::bad_value, xray::tags::frame_groups, "is missing");
  if (groups->value.size() > most_group_bytes)
    elements.refuse(Reason::bad_size, xray::tags::frame_groups,
                    fmt::format("has {} bytes, limit {}", groups->value.size(), most_group_bytes));
  auto items = xray::sequence_items(elements, xray::tags::frame_groups);
  if (items.size() != count)
    elements.refuse(Reason::bad_value, xray::tags::frame_groups,
                    fmt::format("has {} items, but there are {} frames", items.size(), count));
  const auto shared = xray::sequence_items(elements, xray::tags::shared_groups);
  const std::map<int, std::string> segments = segments_of(elements);
  std::vector<SegmentFrame> frames;
  for (std::size_t i = 0; i < count; ++i) {
    items[i].origin = fmt::format("{}: frame {}", elements.origin, i + 1);
    frames.push_back(frame_of(items[i], shared.empty() ? DicomElements{} : shared.front(), kind));
    if (kind != Kind::label_map && !segments.contains(frames.back().segment))
      throw BadInput(Reason::bad_value,
                     fmt::format("{}: shows segment {}, which Segment Sequence does not list",
                                 items[i].origin, frames.back().segment));
    if (!frames.back().axes.isApprox(frames[0].axes, 1e-3))
      throw BadInput(Reason::bad_value,
                     fmt::format("{}: its orientation or pixel spacing differs from the first frame's",
                                 items[i].origin));
  }
  return frames;
}

Vector3d place_frames(std::vector<SegmentFrame>& frames, const std::string& origin) {
  const Vector3d normal = frames[0].normal(), first = frames[0].corner;
  const double step = step_of(frames, origin), allowed = uneven_mm(step);
  for (SegmentFrame& frame : frames) {
    const double at = normal.dot(frame.corner - first) / step;
    if (!(at < max_volume_side))
      throw BadInput(Reason::bad_size,
                     fmt::format("{}: slices over {:.4g} mm in steps of {:.4g} mm, limit {} slices", origin,
                                 at * step, step, max_volume_side));
    frame.slice = int(std::lround(at));
    if (std::abs(at - frame.slice) * step > allowed)
      throw BadInput(Reason::bad_value,
                     fmt::format("{}: a slice lies {:.4g} mm from the first, no multiple of {:.4g} mm",
                                 origin, at * step, step));
  }
  const int last = frames.back().slice;
  const Vector3d along = last > 0 ? Vector3d((frames.back().corner - first) / last) : Vector3d(normal * step);
  for (const SegmentFrame& frame : frames)
    if (const double off = (first + frame.slice * along - frame.corner).norm(); off > 2 * allowed)
      throw BadInput(Reason::bad_value,
                     fmt::format("{}: slice {} is misaligned by {:.4g} mm", origin, frame.slice + 1, off));
  return along;
}

}  // namespace helicarm::volume
