// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <map>
#include <optional>

#include <fmt/format.h>

#include "helicarm/volume/declared.h"
#include "helicarm/volume/nrrd_header.h"
#include "helicarm/volume/voxels.h"
#include "helicarm/xray/dicom_elements.h"

namespace helicarm::volume {
namespace {

using Eigen::Vector3d;

bool is_text(const NrrdHeader& header) {
  const std::string encoding = header.word("encoding");
  return encoding == "ascii" || encoding == "text" || encoding == "txt";
}

VoxelFormat format_of(const NrrdHeader& header) {
  using Kind = VoxelFormat::Kind;
  static const std::map<std::string, Kind> kinds = {{"signed char", Kind::int8},
                                                    {"int8", Kind::int8},
                                                    {"int8_t", Kind::int8},
                                                    {"uchar", Kind::uint8},
                                                    {"unsigned char", Kind::uint8},
                                                    {"uint8", Kind::uint8},
                                                    {"uint8_t", Kind::uint8},
                                                    {"short", Kind::int16},
                                                    {"short int", Kind::int16},
                                                    {"signed short", Kind::int16},
                                                    {"signed short int", Kind::int16},
                                                    {"int16", Kind::int16},
                                                    {"int16_t", Kind::int16},
                                                    {"ushort", Kind::uint16},
                                                    {"unsigned short", Kind::uint16},
                                                    {"unsigned short int", Kind::uint16},
                                                    {"uint16", Kind::uint16},
                                                    {"uint16_t", Kind::uint16},
                                                    {"int", Kind::int32},
                                                    {"signed int", Kind::int32},
                                                    {"int32", Kind::int32},
                                                    {"int32_t", Kind::int32},
                                                    {"uint", Kind::uint32},
                                                    {"unsigned int", Kind::uint32},
                                                    {"uint32", Kind::uint32},
                                                    {"uint32_t", Kind::uint32},
                                                    {"int64", Kind::int64},
                                                    {"int64_t", Kind::int64},
                                                    {"longlong", Kind::int64},
                                                    {"long long", Kind::int64},
                                                    {"long long int", Kind::int64},
                                                    {"signed long long", Kind::int64},
                                                    {"signed long long int", Kind::int64},
                                                    {"uint64", Kind::uint64},
                                                    {"uint64_t", Kind::uint64},
                                                    {"ulonglong", Kind::uint64},
                                                    {"unsigned long long", Kind::uint64},
                                                    {"unsigned long long int", Kind::uint64},
                                                    {"float", Kind::float32},
                                                    {"double", Kind::float64}};
  const auto found = kinds.find(header.word("type"));
  if (found == kinds.end())
    throw BadInput(Reason::unsupported, fmt::format("{} is {}, must be int8 to double", header.field("type"),
                                                    xray::quote(header.text("type"))));
  VoxelFormat format{found->second, false};
  const std::string endian = header.word("endian");
  if (endian != "little" && endian != "big" && (!endian.empty() || (format.bytes() > 1 && !is_text(header))))
    throw BadInput(Reason::bad_value, fmt::format("{} is {}, must be little or big", header.field("endian"),
                                                  xray::quote(endian)));
  format.big_endian = endian == "big";
  return format;
}

/// From the file's space to L, P, S: signs of the axes.
Vector3d lps_from(const NrrdHeader& header) {
  const std::string space = header.word("space");
  return space.empty() ? Vector3d(1, 1, 1) : declared_space(space, header.field("space"));
}

/// Length of the unit of a field with one for each axis; nothing where it states none.
std::optional<double> unit_of(const NrrdHeader& header, const std::string& name) {
  std::optional<double> unit;
  for (const std::string& word : header.words(name)) {
    if (word.empty() || word == "???" || word == "none") continue;
    const double here = declared_unit(word, header.field(name));
    if (unit && *unit != here)
      throw BadInput(Reason::unsupported, fmt::format("{} is {}, must be one unit for all axes; save the "
                                                      "volume in mm",
                                                      header.field(name), xray::quote(header.text(name))));
    unit = here;
  }
  return unit;
}

double millimetres(const NrrdHeader& header) {
  const auto of_space = unit_of(header, "space units"), of_axes = unit_of(header, "units");
  if (of_space && of_axes && *of_space != *of_axes)
    throw BadInput(Reason::bad_value,
                   fmt::format("{} is {}, but units is {}: remove the wrong one", header.field("space units"),
                               xray::quote(header.text("space units")), xray::quote(header.text("units"))));
  return of_space.value_or(of_axes.value_or(1));
}

/// Refuses what states places in a way that is not read.
void check_axes(const NrrdHeader& header) {
  for (const std::string& kind : header.words("kinds"))
    if (kind != "domain" && kind != "space" && kind != "none" && kind != "???")
      throw BadInput(Reason::unsupported,
                     fmt::format("{} is {}, must be domain for each axis: not one volume; export one frame "
                                 "or channel as a volume of its own",
                                 header.field("kinds"), xray::quote(header.text("kinds"))));
  if (!header.text("space directions").empty() || !header.text("space origin").empty()) return;
  for (const char* name : {"axis mins", "axis maxs"})
    for (const std::string& word : header.words(name))
      if (word != "nan")
        throw BadInput(Reason::unsupported, fmt::format("{} is {}, but neither space directions nor space "
                                                        "origin are given; save the volume with both",
                                                        header.field(name), xray::quote(header.text(name))));
}

Eigen::Affine3d place_of(const NrrdHeader& header) {
  Eigen::Affine3d space_from_index = Eigen::Affine3d::Identity();
  const auto directions = header.numbers("space directions", 9);
  const auto spacings = header.numbers("spacings", 3);
  const auto origin = header.numbers("space origin", 3);
  if (!directions.empty())
    space_from_index.linear() = Eigen::Map<const Eigen::Matrix3d>(directions.data());
  else if (!spacings.empty())
    space_from_index.linear() = Vector3d::Map(spacings.data()).asDiagonal();
  if (!spacings.empty()) check_spacings(Vector3d::Map(spacings.data()), header.field("spacings"));
  if (!directions.empty() && !spacings.empty())
    for (Eigen::Index axis = 0; axis < 3; ++axis)
      if (differ(space_from_index.linear().col(axis).norm(), spacings[static_cast<std::size_t>(axis)], 0.01))
        throw BadInput(
            Reason::bad_value,
            fmt::format("{} of axis {} is {:.6g}, but its space direction has length {:.6g}: "
                        "remove the wrong one",
                        header.field("spacings"), axis + 1, spacings[static_cast<std::size_t>(axis)],
                        space_from_index.linear().col(axis).norm()));
  if (!origin.empty()) space_from_index.translation() = Vector3d::Map(origin.data());
  return lps_from(header).asDiagonal() * (Eigen::Scaling(millimetres(header)) * space_from_index);
}

std::vector<float> text_voxels(std::string_view bytes, std::size_t count, const std::string& origin) {
  std::size_t words = 0;
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    const auto blank = [](char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n'; };
    words += !blank(bytes[i]) && (i == 0 || blank(bytes[i - 1]));
  }
  if (words < count)
    throw BadInput(Reason::truncated, fmt::format("{}: {} numbers, {} are needed", origin, words, count));
  const std::vector<double> numbers = read_numbers(bytes, count, origin);
  return {numbers.begin(), numbers.end()};
}

/// The data file beside the header, or what follows the header. `data` holds the former.
std::string_view stored_data(const NrrdHeader& header, const std::filesystem::path& path,
                             std::string_view behind_header, std::string& data) {
  const std::string file = header.text("data file");
  if (file.empty()) {
    if (header.ended_without_blank())
      throw BadInput(Reason::truncated, header.origin() + ": the header has no end");
    return behind_header;
  }
  if (file.starts_with("LIST") || file.find('%') != std::string::npos)
    throw BadInput(Reason::unsupported, header.field("data file") +
                                            " is a list of files; one file is supported: save the volume as "
                                            "one .nrrd");
  return data = read_data_file(path, file);
}

/// "byte skip" of data that are not compressed, or no longer; -1: the voxels are the end of them.
std::string_view skip_bytes(std::string_view bytes, double skip, std::size_t needed,
                            const NrrdHeader& header) {
  const double start = skip == -1 ? static_cast<double>(bytes.size()) - static_cast<double>(needed) : skip;
  if (!(start >= 0 && start <= static_cast<double>(bytes.size())))
    throw BadInput(Reason::truncated, fmt::format("{} is {}, but the data contain only {} bytes",
                                                  header.field("byte skip"), skip, bytes.size()));
  return bytes.substr(static_cast<std::size_t>(start));
}

std::string dimension_problem(const NrrdHeader& header) {
  const std::string dimension = header.text("dimension");
  return dimension == "4" || dimension == "5"
             ? fmt::format(
                   "{} is {}, must be 3: a sequence or an image of several channels (sizes {}); export "
                   "one frame as a volume of its own",
                   header.field("dimension"), dimension, xray::quote(header.text("sizes")))
             : fmt::format("{} is {}, must be 3", header.field("dimension"), xray::quote(dimension));
}

}  // namespace

Volume read_nrrd(const std::filesystem::path& path, std::string_view bytes) {
  const std::string origin = path.string();
  std::string_view rest = bytes;
  const NrrdHeader header(rest, origin);
  if (header.text("dimension") != "3") throw BadInput(Reason::unsupported, dimension_problem(header));
  const auto size = header.numbers("sizes", 3);
  if (size.empty()) throw BadInput(Reason::bad_value, header.field("sizes") + " is missing");

  Volume volume;
  const std::size_t count = value_or_throw(voxel_count(Vector3d::Map(size.data()), header.field("sizes")));
  volume.size = Vector3d::Map(size.data()).cast<int>();
  check_axes(header);
  volume.patient_from_voxel = place_of(header);
  if (header.text("space directions").empty() && header.text("spacings").empty())
    volume.warnings.push_back(size_not_stated(header.field("spacings")));
  if (header.text("space").empty())
    volume.warnings.push_back(
        {Reason::spacing_missing,
         fmt::format("{}: no \"space\" gives the axes' directions; x left, y posterior, z superior "
                     "are assumed",
                     origin)});
  const VoxelFormat format = format_of(header);
  std::string data;
  rest = stored_data(header, path, rest, data);
  for (double lines = header.whole_number("line skip", 0, 1e6); lines > 0; --lines) take_line(rest);
  if (is_text(header)) return volume.voxels = text_voxels(rest, count, origin), volume;
  const std::string encoding = header.word("encoding");
  const double skip = header.whole_number("byte skip", -1, 1e9);
  const std::size_t needed = count * format.bytes();
  if (encoding == "raw") {
    rest = skip_bytes(rest, skip, needed, header);
    volume.voxels = decode_voxels(rest, count, format, origin);
    warn_of_surplus(volume, rest.substr(needed), needed, origin);
  } else if ((encoding == "gzip" || encoding == "gz") && skip == -1) {
    volume.voxels = decode_voxels(inflate_end(rest, needed, origin), count, format, origin);
  } else if (encoding == "gzip" || encoding == "gz") {
    std::size_t surplus = 0;
    const auto skipped = static_cast<std::size_t>(skip);
    const std::string unpacked = inflate(rest, skipped + needed, origin, &surplus);
    volume.voxels = decode_voxels(std::string_view(unpacked).substr(skipped), count, format, origin);
    warn_of_surplus(volume, surplus, needed, origin);
  } else {
    throw BadInput(Reason::unsupported,
                   fmt::format("{} is {}, must be raw, gzip or ascii; save the volume as one of these",
                               header.field("encoding"), xray::quote(encoding)));
  }
  return volume;
}

}  // namespace helicarm::volume
