// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <map>
#include <string>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "helicarm/core/files.h"
#include "helicarm/volume/in_memory.h"
#include "helicarm/volume/read_volume.h"
#include "helicarm/volume/voxels.h"
#include "helicarm/xray/dicom_check.h"
#include "helicarm/xray/dicom_frame.h"
#include "helicarm/xray/dicom_tags.h"

namespace helicarm::volume {
namespace {

using Eigen::Vector3d;

constexpr std::uintmax_t most_slice_bytes = std::uintmax_t{64} << 20;
constexpr xray::DicomTag rescale_type{0x00281054, "Rescale Type"};
constexpr std::string_view enhanced_ct = "1.2.840.10008.5.1.4.1.1.2.1";
constexpr std::string_view segmentation_of = "1.2.840.10008.5.1.4.1.1.66.4";
constexpr std::string_view label_map_of = "1.2.840.10008.5.1.4.1.1.66.7";

bool is_segmentation(std::string_view kind) { return kind == segmentation_of || kind == label_map_of; }
constexpr double most_coordinate_mm = 1e5;

/// Geometry of one slice; columns of `axes`: along a row, along a column, mm per pixel.
struct Slice {
  std::filesystem::path path;         ///< or its name, if `held`
  const std::string* held = nullptr;  ///< its bytes, if they are in memory
  Eigen::Matrix<double, 3, 2> axes;
  Vector3d corner;
  int columns = 0;
  int rows = 0;
  std::string frame_of_reference;        ///< its UID; may be empty
  std::string patient_id, patient_name;  ///< compare, do not print; may be empty

  Vector3d normal() const { return axes.col(0).cross(axes.col(1)).normalized(); }
};

std::vector<double> needed(const xray::DicomElements& elements, xray::DicomTag tag, std::size_t count,
                           double low, double high) {
  const auto numbers = elements.numbers(tag, count, low, high);
  if (!numbers) elements.refuse(Reason::bad_value, tag, "is missing");
  return *numbers;
}

Slice slice_of(const xray::DicomOutline& outline) {
  const xray::DicomElements& elements = outline.elements;
  Slice slice;
  slice.columns = outline.columns;
  slice.rows = outline.rows;
  slice.frame_of_reference = elements.text(xray::tags::frame_of_reference);
  slice.patient_id = elements.text(xray::tags::patient_id);
  slice.patient_name = elements.text(xray::tags::patient_name);
  const auto corner =
      needed(elements, xray::tags::image_position, 3, -most_coordinate_mm, most_coordinate_mm);
  const auto turn = needed(elements, xray::tags::image_orientation, 6, -1.001, 1.001);
  const auto spacing = needed(elements, xray::tags::pixel_spacing, 2, 1e-3, 100);
  slice.corner = Vector3d::Map(corner.data());
  slice.axes.col(0) = Vector3d::Map(turn.data()) * spacing[1];
  slice.axes.col(1) = Vector3d::Map(turn.data() + 3) * spacing[0];
  const auto directions = Eigen::Map<const Eigen::Matrix<double, 3, 2>>(turn.data());
  if (!(directions.transpose() * directions).isIdentity(1e-3))
    elements.refuse(Reason::bad_value, xray::tags::image_orientation,
                    "is not a pair of perpendicular unit vectors");
  return slice;
}

/// By its preamble, or without one by its first group, 0002 or 0008.
bool may_be_dicom(std::string_view bytes) {
  using namespace std::literals;
  return (bytes.size() >= 132 && bytes.substr(128, 4) == "DICM") || bytes.starts_with("\2\0\0\0UL"sv) ||
         bytes.starts_with("\x8\0\5\0CS"sv) || bytes.starts_with("\x8\0\x8\0CS"sv) ||
         bytes.starts_with("\x8\0\x16\0UI"sv);
}

/// The slices of a folder by series UID, and what else lies there.
struct FolderOfSlices {
  std::map<std::string, std::vector<Slice>> series;
  std::vector<Failure> unreadable;  ///< of DICOM files
  std::map<std::string, int> other_classes;
};

/// Adds a file's slice to its series. Localizer images and files that are not DICOM are skipped.
void add_slice(FolderOfSlices& found, const std::filesystem::path& path, const std::string& bytes,
               const std::string* held) {
  if (!may_be_dicom(bytes)) return;
  const auto read = guarded([&] {
    const xray::DicomElements elements = value_or_throw(xray::walk_dicom(bytes, path.string()));
    if (const auto kind = elements.text(xray::tags::sop_class); kind != xray::ct_class) {
      ++found.other_classes[std::string(kind)];
      return;
    }
    if (elements.text(xray::tags::image_type).find("LOCALIZER") != std::string_view::npos) return;
    Slice slice = slice_of(value_or_throw(xray::check_dicom(bytes, path.string(), xray::DicomKind::ct)));
    slice.path = path;
    slice.held = held;
    found.series[std::string(elements.text(xray::tags::series))].push_back(std::move(slice));
  });
  if (!read) found.unreadable.push_back(read.error());
}

FolderOfSlices find_series(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> paths;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    if (entry.is_regular_file()) paths.push_back(entry.path());
  std::ranges::sort(paths);
  FolderOfSlices found;
  for (const auto& path : paths) {
    const auto bytes = read_file(path, most_slice_bytes);
    if (bytes)
      add_slice(found, path, *bytes, nullptr);
    else
      found.unreadable.push_back(bytes.error());
  }
  return found;
}

std::string no_slice(const FolderOfSlices& found, const std::string& origin) {
  std::string message = origin + ": the folder contains no DICOM CT slice";
  for (const auto& [kind, count] : found.other_classes)
    message +=
        fmt::format("; {} of SOP class {}", count,
                    kind == enhanced_ct     ? "Enhanced CT: convert the file to one file for each slice"
                    : is_segmentation(kind) ? "Segmentation: as a mask give the file itself, not its folder"
                                            : xray::quote(kind));
  return message;
}

Warning skipped(const std::vector<Failure>& unreadable) {
  std::string message =
      fmt::format("{} file(s) beside the slices cannot be read and are left out: ", unreadable.size());
  constexpr std::size_t most_named = 3;
  for (std::size_t i = 0; i < std::min(unreadable.size(), most_named); ++i)
    message += (i > 0 ? "; " : "") + unreadable[i].message;
  if (unreadable.size() > most_named) message += "; ...";
  return {unreadable.front().reason, message, {}, {{"files", double(unreadable.size())}}};
}

/// A series is of one patient in one frame of reference; what a slice does not state is not compared.
void check_origin(const std::vector<Slice>& slices) {
  const auto other = [&](std::string Slice::*what) -> const Slice* {
    const auto stated =
        std::ranges::find_if(slices, [&](const Slice& slice) { return !(slice.*what).empty(); });
    for (const Slice& slice : slices)
      if (!(slice.*what).empty() && slice.*what != *stated.*what) return &slice;
    return nullptr;
  };
  for (std::string Slice::*what : {&Slice::patient_id, &Slice::patient_name})
    if (const Slice* slice = other(what))
      throw BadInput(
          Reason::patient_mismatch,
          fmt::format("{}: names another patient than other slices of its series", slice->path.string()));
  if (const Slice* slice = other(&Slice::frame_of_reference))
    throw BadInput(
        Reason::bad_value,
        fmt::format("{}: Frame of Reference UID (0020,0052) is {}, other slices of its series have "
                    "another: their positions are of different frames",
                    slice->path.string(), slice->frame_of_reference));
}

void check_alike(const std::vector<Slice>& slices) {
  check_origin(slices);
  for (const Slice& slice : slices) {
    if (slice.columns != slices[0].columns || slice.rows != slices[0].rows)
      throw BadInput(Reason::bad_size,
                     fmt::format("{}: {} x {} pixels, the first slice has {} x {}", slice.path.string(),
                                 slice.columns, slice.rows, slices[0].columns, slices[0].rows));
    if (!slice.axes.isApprox(slices[0].axes, 1e-3))
      throw BadInput(Reason::bad_value,
                     fmt::format("{}: its orientation differs from the first slice's", slice.path.string()));
  }
}

/// Step between slices; refuses missing, duplicate and misaligned slices.
Vector3d even_step(const std::vector<Slice>& slices, const std::string& origin) {
  const Vector3d normal = slices[0].normal();
  std::vector<double> gaps;
  for (std::size_t i = 1; i < slices.size(); ++i)
    gaps.push_back(normal.dot(slices[i].corner - slices[i - 1].corner));
  std::vector<double> sorted = gaps;
  std::ranges::sort(sorted);
  const double usual = sorted[sorted.size() / 2];
  const double allowed = uneven_mm(usual);
  if (usual < 1e-3)
    throw BadInput(
        Reason::bad_value,
        fmt::format("{}: most of the {} slices lie where another one does: copies of files, or several "
                    "series or phases under one Series Instance UID; keep one of them in the folder",
                    origin, slices.size()));
  for (std::size_t i = 0; i < gaps.size(); ++i)
    if (std::abs(gaps[i] - usual) > allowed || gaps[i] < 1e-3)
      throw BadInput(
          Failure{Reason::bad_value,
                  fmt::format("{}: slices {} and {} of {} are {:.4g} mm apart, the others {:.4g} mm: a slice "
                              "is missing, duplicate or from another series",
                              origin, i + 1, i + 2, slices.size(), gaps[i], usual),
                  {},
                  {{"gap_mm", gaps[i]}, {"usual_mm", usual}}});
  const Vector3d step = (slices.back().corner - slices[0].corner) / static_cast<double>(slices.size() - 1);
  const double most_aside = 2 * allowed;
  for (std::size_t i = 0; i < slices.size(); ++i) {
    const Vector3d apart = slices[i].corner - slices[0].corner - static_cast<double>(i) * step;
    // Uneven gaps add up along the step; aside from it, where a gantry's tilt is part of it, nothing does.
    const double along = normal.dot(apart) / normal.dot(step);
    const double off = (apart - along * step).norm();
    if (off > most_aside || std::abs(along) * usual > std::max(2 * allowed, 0.5 * usual))
      throw BadInput(Reason::bad_value,
                     fmt::format("{}: slice {} of {} is misaligned by {:.4g} mm", origin, i + 1,
                                 slices.size(), std::max(off, std::abs(along) * usual)));
  }
  return step;
}

/// Values that are stated to be something else than Hounsfield units.
void check_rescale_type(const Slice& slice, const xray::DicomElements& elements,
                        std::vector<Warning>& warnings) {
  const std::string_view type = elements.text(rescale_type);
  if (type.empty() || type == "HU" || type == "US" || !warnings.empty()) return;
  warnings.push_back({Reason::irregular_file,
                      fmt::format("{}: Rescale Type (0028,1054) is {}, not HU: the values are taken as "
                                  "Hounsfield units",
                                  slice.path.string(), xray::quote(type))});
}

/// Whether the slice states how its values become Hounsfield units.
bool decode_slice(const Slice& slice, float* voxels, std::vector<Warning>& warnings) {
  const std::string origin = slice.path.string();
  const std::string read = slice.held ? "" : value_or_throw(read_file(slice.path, most_slice_bytes));
  const std::string_view bytes = slice.held ? *slice.held : read;
  const xray::DicomOutline outline = value_or_throw(xray::check_dicom(bytes, origin, xray::DicomKind::ct));
  if (outline.columns != slice.columns || outline.rows != slice.rows)
    throw BadInput(Reason::bad_size, origin + ": changed while it was read");
  check_rescale_type(slice, outline.elements, warnings);
  const auto stated_slope = outline.elements.numbers(xray::tags::rescale_slope, 1, -1e6, 1e6);
  const auto stated_shift = outline.elements.numbers(xray::tags::rescale_intercept, 1, -1e6, 1e6);
  if (stated_slope.has_value() != stated_shift.has_value())
    outline.elements.refuse(Reason::bad_value,
                            stated_slope ? xray::tags::rescale_intercept : xray::tags::rescale_slope,
                            "is missing beside the other of the two");
  const double slope = stated_slope ? stated_slope->front() : 1,
               shift = stated_shift ? stated_shift->front() : 0;
  if (!(slope > 0))
    outline.elements.refuse(
        Reason::bad_value, xray::tags::rescale_slope,
        fmt::format("is {:g}, must be over 0: a CT's values rise with the density", slope));
  const image::Image<float> pixels = value_or_throw(xray::decode_frame(outline, 0));
  for (const float pixel : pixels.pixels())
    *voxels++ = static_cast<float>(slope * static_cast<double>(pixel) + shift);
  return stated_slope.has_value();
}

std::vector<Slice>& largest_of(FolderOfSlices& found, const std::string& origin,
                               std::vector<Warning>& warnings) {
  auto& series = found.series;
  const auto largest =
      std::ranges::max_element(series, {}, [](const auto& entry) { return entry.second.size(); });
  if (series.size() > 1) {
    std::vector<std::size_t> counts;
    for (const auto& entry : series) counts.push_back(entry.second.size());
    if (std::ranges::count(counts, largest->second.size()) > 1)
      throw BadInput(Reason::name_clash,
                     fmt::format("{}: {} CT series of {} slices: keep one series in the folder", origin,
                                 series.size(), fmt::join(counts, ", ")));
    warnings.push_back({Reason::name_clash, fmt::format("{}: {} CT series of {} slices: the largest is used",
                                                        origin, series.size(), fmt::join(counts, ", "))});
  }
  return largest->second;
}

Volume volume_of(std::vector<Slice>& slices, const std::string& origin) {
  if (slices.size() < 2)
    throw BadInput(Reason::bad_size, origin + ": only one slice, at least 2 are required");
  check_alike(slices);
  const Vector3d normal = slices[0].normal();
  std::ranges::stable_sort(slices, {}, [&](const Slice& slice) { return normal.dot(slice.corner); });
  const Vector3d step = even_step(slices, origin);
  Volume volume;
  volume.size = {slices[0].columns, slices[0].rows, static_cast<int>(slices.size())};
  const std::size_t count = value_or_throw(voxel_count(volume.size.cast<double>(), origin));
  volume.patient_from_voxel.linear() << slices[0].axes, step;
  volume.patient_from_voxel.translation() = slices[0].corner;
  volume.voxels.resize(count);
  const std::size_t area = count / slices.size();
  std::size_t without = 0;
  for (std::size_t i = 0; i < slices.size(); ++i)
    if (!decode_slice(slices[i], volume.voxels.data() + i * area, volume.warnings)) ++without;
  if (without > 0 && without < slices.size())
    throw BadInput(Reason::bad_value,
                   fmt::format("{}: {} of {} slices state no Rescale Slope and Intercept (0028,1053 and "
                               "0028,1052): their values are not known in Hounsfield units",
                               origin, without, slices.size()));
  if (without > 0)
    volume.warnings.push_back(
        {Reason::irregular_file,
         fmt::format("{}: no slice states Rescale Slope and Intercept (0028,1053 and 0028,1052): the stored "
                     "values are taken as Hounsfield units",
                     origin)});
  return volume;
}

Volume volume_of(FolderOfSlices found, const std::string& origin) {
  // What makes the series incomplete may be the file that cannot be read.
  if (found.series.empty() && !found.unreadable.empty()) throw BadInput(found.unreadable.front());
  if (found.series.empty()) throw BadInput(Reason::not_an_image, no_slice(found, origin));
  std::vector<Warning> warnings;
  std::vector<Slice>& slices = largest_of(found, origin, warnings);
  auto volume = guarded([&] { return volume_of(slices, origin); });
  if (!volume && !found.unreadable.empty()) {
    Failure failure = found.unreadable.front();
    failure.message += fmt::format("; without it: {}", volume.error().message);
    throw BadInput(std::move(failure));
  }
  Volume read = value_or_throw(std::move(volume));
  if (!found.unreadable.empty()) warnings.push_back(skipped(found.unreadable));
  read.warnings.insert(read.warnings.begin(), warnings.begin(), warnings.end());
  return read;
}

}  // namespace

Expected<std::optional<std::filesystem::path>> slice_of_series(const std::filesystem::path& folder) {
  return guarded([&]() -> std::optional<std::filesystem::path> {
    std::error_code error;
    if (!std::filesystem::is_directory(folder, error)) return std::nullopt;
    FolderOfSlices found = find_series(folder);
    if (found.series.empty()) return std::nullopt;
    std::vector<Warning> warnings;
    const std::vector<Slice>& slices = largest_of(found, folder.string(), warnings);
    check_origin(slices);
    const auto stated = std::ranges::find_if_not(slices, &std::string::empty, &Slice::frame_of_reference);
    return (stated == slices.end() ? slices.front() : *stated).path;
  });
}

Volume read_ct_series(const std::filesystem::path& folder) {
  return volume_of(find_series(folder), folder.string());
}

Expected<Volume> volume_of_slices(const std::vector<std::string>& files, const std::string& origin) {
  return guarded([&] {
    FolderOfSlices found;
    for (std::size_t i = 0; i < files.size(); ++i)
      add_slice(found, fmt::format("{}[{}]", origin, i), files[i], &files[i]);
    Volume volume = volume_of(std::move(found), origin);
    value_or_throw(check_read(volume, origin));
    return volume;
  });
}

}  // namespace helicarm::volume
