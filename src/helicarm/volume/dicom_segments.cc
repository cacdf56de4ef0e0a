// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <map>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/core/text.h"
#include "helicarm/volume/read_volume.h"
#include "helicarm/volume/voxels.h"
#include "helicarm/xray/compressed_frame.h"
#include "helicarm/xray/dicom_tags.h"
#include "helicarm/xray/frame_fragments.h"
#include "helicarm/xray/transfer_syntax.h"

namespace helicarm::volume {
namespace {

using Eigen::Vector3d;
using xray::DicomElements;
using xray::DicomTag;

constexpr std::string_view segmentation_class = "1.2.840.10008.5.1.4.1.1.66.4";
constexpr std::string_view label_map_class = "1.2.840.10008.5.1.4.1.1.66.7";  // Supplement 243
constexpr DicomTag pixel_padding{0x00280120, "Pixel Padding Value"};
constexpr DicomTag lossy_compression{0x00282110, "Lossy Image Compression"};
constexpr DicomTag segmentation_type{0x00620001, "Segmentation Type"};
constexpr DicomTag fractional_type{0x00620010, "Segmentation Fractional Type"};
constexpr DicomTag fractional_maximum{0x0062000E, "Maximum Fractional Value"};
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

/// A frame shows one segment in one slice, of a LABELMAP (segment 0) all of them. Columns of `axes`: along a
/// row, along a column, mm per pixel.
struct SegmentFrame {
  int segment = 0;
  Vector3d corner;
  Eigen::Matrix<double, 3, 2> axes;
  std::optional<double> spacing, thickness;
  int slice = 0;

  Vector3d normal() const { return axes.col(0).cross(axes.col(1)).normalized(); }
  double along(const Vector3d& direction) const { return direction.dot(corner); }
};

std::vector<double> numbers_in(const DicomElements& elements, DicomTag tag, std::size_t count, double low,
                               double high) {
  const auto numbers = elements.numbers(tag, count, low, high);
  if (!numbers) elements.refuse(Reason::bad_value, tag, "is missing");
  return *numbers;
}

int word_in(const DicomElements& elements, DicomTag tag, int low) {
  const auto word = elements.word(tag, "US");
  if (!word) elements.refuse(Reason::bad_value, tag, "is missing");
  if (*word < low)
    elements.refuse(Reason::bad_value, tag, fmt::format("is {}, must be at least {}", *word, low));
  return *word;
}

/// The functional group of a frame, or else that of all frames.
DicomElements group_of(const DicomElements& frame, const DicomElements& shared, DicomTag tag) {
  for (const DicomElements* of : {&frame, &shared})
    if (auto items = xray::sequence_items(*of, tag); !items.empty()) return items.front();
  frame.refuse(Reason::bad_value, tag, "is missing");
}

enum class Kind { binary, fractional, label_map };

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

/// Refuses what `Frames` does not read.
Kind checked_kind(const DicomElements& elements) {
  const Kind kind = kind_of(elements);
  check_bits(elements, kind);
  check_compression(elements);
  if (!elements.find(xray::tags::pixel_data))
    elements.refuse(Reason::bad_value, xray::tags::pixel_data, "is missing");
  return kind;
}

/// Without number 0, which is a label map's background.
std::map<int, std::string> segments_of(const DicomElements& elements) {
  const int least = kind_of(elements) == Kind::label_map ? 0 : 1;
  std::map<int, std::string> segments;
  for (const DicomElements& item : xray::sequence_items(elements, segment_sequence))
    if (const int number = word_in(item, segment_number, least); number > 0)
      segments[number] = without_control_characters(std::string(item.text(segment_label).substr(0, 64)));
  return segments;
}

std::vector<SegmentFrame> frames_of(const DicomElements& elements, Kind kind) {
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

/// Numbers the slices and returns the step between them. Frames are sorted along the normal.
Vector3d place_frames(std::vector<SegmentFrame>& frames, const std::string& origin) {
  const Vector3d normal = frames[0].normal(), first = frames[0].corner;
  const double step = step_of(frames, origin), allowed = std::max(0.1, 0.02 * step);
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

/// Which voxels of each frame belong to which segment.
class Frames {
 public:
  /// `threshold`: of a FRACTIONAL segmentation.
  Frames(const DicomElements& elements, const Eigen::Vector2i& size, std::size_t count,
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

  /// Calls `take(i, segment)` for each voxel of a frame that belongs to one; `of_frame`: its own.
  template <class Take>
  void for_each_inside(std::size_t frame, int of_frame, const Take& take) const {
    const std::string unpacked = compressed_.empty() ? std::string() : decoded(frame);
    const std::size_t first = compressed_.empty() ? frame * area_ : 0;
    const std::string_view values = compressed_.empty() ? values_ : std::string_view(unpacked);
    const std::size_t bits = compressed_.empty() ? bits_ : std::max<std::size_t>(bits_, 8);
    for (std::size_t i = 0; i < area_; ++i)
      if (const int segment = segment_of(value_at(values, first + i, bits), of_frame, frame))
        take(i, segment);
  }

 private:
  /// Of `bits` each: these are packed from the least significant one on; words are little-endian.
  static int value_at(std::string_view values, std::size_t at, std::size_t bits) {
    const auto byte = [&](std::size_t i) { return int(static_cast<unsigned char>(values[i])); };
    if (bits == 1) return byte(at / 8) >> (at % 8) & 1;
    return bits == 8 ? byte(at) : byte(2 * at) | byte(2 * at + 1) << 8;
  }

  /// 0: of none.
  int segment_of(int value, int of_frame, std::size_t frame) const {
    if (kind_ == Kind::binary) return value != 0 ? of_frame : 0;
    if (kind_ == Kind::fractional) return value >= least_ ? of_frame : 0;
    if (value == 0 || segments_.contains(value)) return value;
    if (value == padding_) return 0;
    throw BadInput(Reason::bad_value,
                   fmt::format("{}: frame {} has a pixel of value {}, which Segment Sequence does not list",
                               elements_.origin, frame + 1, value));
  }

  std::string decoded(std::size_t frame) const {
    std::string bytes;
    for (std::size_t i = compressed_[frame].first; i < compressed_[frame].last; ++i)
      bytes += elements_.fragments[i];
    const xray::Coding coding = xray::transfer_syntax(elements_.transfer_syntax)->coding;
    const std::string origin = fmt::format("{}: frame {}", elements_.origin, frame + 1);
    return value_or_throw(
        bits_ == 1 ? xray::decode_compressed_bits(std::move(bytes), coding, size_, origin)
                   : xray::decode_compressed(std::move(bytes), coding, size_, int(bits_ / 8), origin));
  }

  const DicomElements& elements_;
  Eigen::Vector2i size_;
  std::size_t area_;
  Kind kind_;
  std::size_t bits_;  ///< of a value
  double least_ = 0;
  std::map<int, std::string> segments_;  ///< of a LABELMAP
  std::optional<int> padding_;
  std::string_view values_;
  std::vector<xray::FrameFragments> compressed_;
};

/// Before the file is walked.
bool may_be_segmentation(std::string_view bytes) {
  constexpr std::size_t looked_at = 4000;
  const std::string_view begin = bytes.substr(0, looked_at);
  return xray::looks_like_dicom(bytes) && (begin.find(segmentation_class) != std::string_view::npos ||
                                           begin.find(label_map_class) != std::string_view::npos);
}

bool is_segmentation_class(const DicomElements& elements) {
  const auto sop_class = elements.text(xray::tags::sop_class);
  return sop_class == segmentation_class || sop_class == label_map_class;
}

/// Frames in the order of their slices, and an empty volume of these.
struct Segmentation {
  Volume volume;
  std::vector<SegmentFrame> frames;
  std::vector<std::size_t> stored_at;  ///< of each frame, in the file

  Eigen::Vector2i plane() const { return volume.size.head<2>(); }
  float* voxels_of(std::size_t frame) {
    return volume.voxels.data() + std::ptrdiff_t(plane().prod()) * frames[frame].slice;
  }
};

Segmentation whole_segmentation(const DicomElements& elements) {
  const std::vector<SegmentFrame> frames = frames_of(elements, checked_kind(elements));
  Segmentation made;
  made.stored_at.resize(frames.size());
  for (std::size_t i = 0; i < frames.size(); ++i) made.stored_at[i] = i;
  const Vector3d normal = frames[0].normal();
  std::ranges::stable_sort(made.stored_at, {}, [&](std::size_t i) { return frames[i].along(normal); });
  for (const std::size_t i : made.stored_at) made.frames.push_back(frames[i]);
  const Vector3d step = place_frames(made.frames, elements.origin);
  const Vector3d size(word_in(elements, xray::tags::columns, 1), word_in(elements, xray::tags::rows, 1),
                      made.frames.back().slice + 1);
  made.volume.voxels.resize(value_or_throw(voxel_count(size, elements.origin)));
  made.volume.size = size.cast<int>();
  made.volume.patient_from_voxel.linear() << made.frames[0].axes, step;
  made.volume.patient_from_voxel.translation() = made.frames[0].corner;
  return made;
}

std::string list_of(const std::map<int, std::string>& segments) {
  constexpr std::size_t most_named = 20;
  std::string list;
  std::size_t named = 0;
  for (const auto& [number, label] : segments) {
    if (named++ == most_named) return list + "; ...";
    list += fmt::format("{} {} \"{}\"", list.empty() ? "" : ",", number, label);
  }
  return list;
}

/// The number of the segment that is meant.
int chosen_segment(const std::map<int, std::string>& segments, const SegmentChoice& choice,
                   const std::string& origin) {
  const auto refuse = [&](const std::string& problem) {
    throw BadInput(Reason::bad_value,
                   fmt::format("{}: {}; its segments:{}", origin, problem, list_of(segments)));
  };
  if (choice.number && !segments.contains(*choice.number))
    refuse(fmt::format("has no segment {}", *choice.number));
  if (choice.number) return *choice.number;
  std::vector<int> found;
  for (const auto& [number, label] : segments)
    if (!choice.label || label == *choice.label) found.push_back(number);
  if (found.size() == 1) return found.front();
  if (choice.label)
    refuse(fmt::format("{} labelled \"{}\"", found.empty() ? "has no segment" : "has several segments",
                       *choice.label));
  refuse("has several segments, choose one by \"mask_label\" or \"mask_segment\"");
  return 0;
}

void check_threshold(const DicomElements& elements, const SegmentChoice& choice) {
  if ((kind_of(elements) == Kind::fractional) == choice.threshold.has_value()) return;
  elements.refuse(Reason::bad_value, segmentation_type,
                  choice.threshold
                      ? fmt::format("is {}: it takes no \"mask_threshold\"", elements.text(segmentation_type))
                      : fmt::format("is FRACTIONAL ({}): state by \"mask_threshold\" from which share on a "
                                    "voxel belongs to the body, such as 0.5",
                                    without_control_characters(std::string(elements.text(fractional_type)))));
}

}  // namespace

std::optional<Volume> read_segmentation(const std::filesystem::path& path, std::string_view bytes) {
  if (!may_be_segmentation(bytes)) return std::nullopt;
  const std::string origin = path.string();
  const DicomElements elements = value_or_throw(xray::walk_dicom(bytes, origin));
  if (!is_segmentation_class(elements)) return std::nullopt;
  if (kind_of(elements) == Kind::fractional)
    elements.refuse(Reason::unsupported, segmentation_type,
                    "is FRACTIONAL, which is read as a model's mask, with \"mask_threshold\"");
  Segmentation made = whole_segmentation(elements);
  const Frames values(elements, made.plane(), made.frames.size(), {});
  for (std::size_t f = 0; f < made.frames.size(); ++f) {
    float* voxels = made.voxels_of(f);
    const SegmentFrame& frame = made.frames[f];
    values.for_each_inside(made.stored_at[f], frame.segment, [&](std::size_t i, int segment) {
      if (voxels[i] != 0 && voxels[i] != float(segment))
        throw BadInput(Reason::unsupported,
                       fmt::format("{}: segments {} and {} overlap in slice {}: choose one by "
                                   "\"mask_label\", or export them to one file each",
                                   origin, voxels[i], segment, frame.slice + 1));
      voxels[i] = float(segment);
    });
  }
  return std::move(made.volume);
}

namespace {

/// What `take` makes of the elements of a DICOM segmentation; nothing of another file.
template <class Take>
auto of_segmentation(const std::filesystem::path& path, const Take& take)
    -> Expected<std::optional<std::invoke_result_t<Take, const DicomElements&>>> {
  return guarded([&]() -> std::optional<std::invoke_result_t<Take, const DicomElements&>> {
    std::error_code error;
    if (!std::filesystem::is_regular_file(path, error)) return std::nullopt;
    const std::string bytes = read_volume_file(path);
    if (!may_be_segmentation(bytes)) return std::nullopt;
    const DicomElements elements = value_or_throw(xray::walk_dicom(bytes, path.string()));
    if (!is_segmentation_class(elements)) return std::nullopt;
    return take(elements);
  });
}

}  // namespace

Expected<std::optional<Volume>> read_segment(const std::filesystem::path& path, const SegmentChoice& choice) {
  return of_segmentation(path, [&](const DicomElements& elements) {
    const int segment = chosen_segment(segments_of(elements), choice, elements.origin);
    check_threshold(elements, choice);
    Segmentation made = whole_segmentation(elements);
    const Frames values(elements, made.plane(), made.frames.size(), choice.threshold);
    for (std::size_t f = 0; f < made.frames.size(); ++f)
      if (const int of_frame = made.frames[f].segment; of_frame == segment || of_frame == 0)
        values.for_each_inside(made.stored_at[f], of_frame,
                               [voxels = made.voxels_of(f), segment](std::size_t i, int of_voxel) {
                                 if (of_voxel == segment) voxels[i] = 1;
                               });
    return std::move(made.volume);
  });
}

Expected<std::optional<std::map<int, std::string>>> segments_in(const std::filesystem::path& path) {
  return of_segmentation(path, [](const DicomElements& elements) { return segments_of(elements); });
}

}  // namespace helicarm::volume
