// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <map>

#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/core/text.h"
#include "helicarm/volume/read_volume.h"
#include "helicarm/volume/segment_frames.h"
#include "helicarm/volume/segment_values.h"
#include "helicarm/volume/voxels.h"

namespace helicarm::volume {
namespace {

using Eigen::Vector3d;
using xray::DicomElements;
using xray::DicomTag;
using Kind = SegmentationKind;

constexpr std::string_view segmentation_class = "1.2.840.10008.5.1.4.1.1.66.4";
constexpr std::string_view label_map_class = "1.2.840.10008.5.1.4.1.1.66.7";  // Supplement 243
constexpr DicomTag fractional_type{0x00620010, "Segmentation Fractional Type"};

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
  const std::vector<SegmentFrame> frames = frames_of(elements);
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
  refuse(fmt::format("has several segments, choose one by \"{0}_label\" or \"{0}_segment\"", choice.key));
  return 0;
}

void check_threshold(const DicomElements& elements, const SegmentChoice& choice) {
  if ((kind_of(elements) == Kind::fractional) == choice.threshold.has_value()) return;
  elements.refuse(
      Reason::bad_value, segmentation_type,
      choice.threshold
          ? fmt::format("is {}: it takes no \"{}_threshold\"", elements.text(segmentation_type), choice.key)
          : fmt::format("is FRACTIONAL ({}): state by \"{}_threshold\" from which share on a "
                        "voxel belongs to the body, such as 0.5",
                        without_control_characters(std::string(elements.text(fractional_type))), choice.key));
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
  const SegmentValues values(elements, made.plane(), made.frames.size(), {});
  for (std::size_t f = 0; f < made.frames.size(); ++f) {
    float* voxels = made.voxels_of(f);
    const SegmentFrame& frame = made.frames[f];
    const std::vector<int> segments = values.of_frame(made.stored_at[f], frame.segment);
    for (std::size_t i = 0; i < segments.size(); ++i) {
      if (segments[i] == 0) continue;
      if (voxels[i] != 0 && voxels[i] != float(segments[i]))
        throw BadInput(Reason::unsupported,
                       fmt::format("{}: segments {} and {} overlap in slice {}: choose one by "
                                   "\"mask_label\", or export them to one file each",
                                   origin, voxels[i], segments[i], frame.slice + 1));
      voxels[i] = float(segments[i]);
    }
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
    const SegmentValues values(elements, made.plane(), made.frames.size(), choice.threshold);
    for (std::size_t f = 0; f < made.frames.size(); ++f)
      if (const int of_frame = made.frames[f].segment; of_frame == segment || of_frame == 0) {
        const std::vector<int> segments = values.of_frame(made.stored_at[f], of_frame);
        for (std::size_t i = 0; i < segments.size(); ++i)
          if (segments[i] == segment) made.voxels_of(f)[i] = 1;
      }
    return std::move(made.volume);
  });
}

Expected<std::optional<std::map<int, std::string>>> segments_in(const std::filesystem::path& path) {
  return of_segmentation(path, [](const DicomElements& elements) { return segments_of(elements); });
}

}  // namespace helicarm::volume
