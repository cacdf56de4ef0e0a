// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <map>

#include <fmt/format.h>

#include "helicarm/volume/voxels.h"
#include "helicarm/xray/dicom_elements.h"

namespace helicarm::volume {
namespace {

using Eigen::Vector3d;

/// Fields that affect neither geometry nor values.
constexpr std::array<std::string_view, 21> ignored = {
    "content",  "number",       "block size",       "blocksize", "thicknesses", "axis mins",
    "axismins", "axis maxs",    "axismaxs",         "centers",   "centerings",  "labels",
    "units",    "kinds",        "space units",      "min",       "max",         "old min",
    "old max",  "sample units", "measurement frame"};
constexpr std::array<std::string_view, 12> interpreted = {
    "type",      "dimension", "sizes",           "encoding",         "endian",
    "spacings",  "space",     "space dimension", "space directions", "space origin",
    "data file", "byte skip"};

/// Lines `field: value` up to an empty one; removed from `rest`.
class NrrdHeader {
 public:
  NrrdHeader(std::string_view& rest, std::string origin) : origin_(std::move(origin)) {
    take_line(rest);  // the magic
    while (!rest.empty()) {
      const std::string_view line = take_line(rest);
      if (line.empty()) return;
      if (line.starts_with('#') || line.find(":=") != std::string_view::npos) continue;
      const std::size_t colon = line.find(": ");
      if (colon == std::string_view::npos)
        throw BadInput(Reason::bad_value,
                       fmt::format("{}: the line {} is not a field", origin_, xray::quote(line)));
      std::string name(line.substr(0, colon));
      if (name == "datafile") name = "data file";
      if (name == "byteskip") name = "byte skip";
      if (std::ranges::find(ignored, name) != ignored.end()) continue;
      if (std::ranges::find(interpreted, name) == interpreted.end())
        throw BadInput(name == "line skip" ? Reason::unsupported : Reason::unknown_key,
                       fmt::format("{}: the field {} is unknown", origin_, xray::quote(name)));
      if (!values_.emplace(name, trim(line.substr(colon + 2))).second)
        throw BadInput(Reason::bad_value, fmt::format("{}: {} is given twice", origin_, xray::quote(name)));
    }
    detached_end_ = true;
  }

  std::string field(const std::string& name) const { return fmt::format("{}: {}", origin_, name); }
  bool ended_without_blank() const { return detached_end_; }
  std::string text(const std::string& name, const std::string& otherwise = "") const {
    const auto found = values_.find(name);
    return found == values_.end() ? otherwise : found->second;
  }
  /// Empty if the field is absent.
  std::vector<double> numbers(const std::string& name, std::size_t count) const {
    const std::string value = text(name);
    if (value.empty()) return {};
    return read_numbers(value, count, field(name), "(),");
  }

 private:
  std::string origin_;
  std::map<std::string, std::string> values_;
  bool detached_end_ = false;
};

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
                                                    {"uint64", Kind::uint64},
                                                    {"uint64_t", Kind::uint64},
                                                    {"ulonglong", Kind::uint64},
                                                    {"float", Kind::float32},
                                                    {"double", Kind::float64}};
  const auto found = kinds.find(header.text("type"));
  if (found == kinds.end())
    throw BadInput(Reason::unsupported, fmt::format("{} is {}, must be int8 to double", header.field("type"),
                                                    xray::quote(header.text("type"))));
  VoxelFormat format{found->second, false};
  const std::string endian = header.text("endian");
  if (endian != "little" && endian != "big" &&
      (!endian.empty() || (format.bytes() > 1 && header.text("encoding") != "ascii")))
    throw BadInput(Reason::bad_value, fmt::format("{} is {}, must be little or big", header.field("endian"),
                                                  xray::quote(endian)));
  format.big_endian = endian == "big";
  return format;
}

/// From the file's space to L, P, S: signs of the axes.
Vector3d lps_from(const NrrdHeader& header) {
  const std::string space = header.text("space");
  if (space.empty() || space == "left-posterior-superior" || space == "LPS") return {1, 1, 1};
  if (space == "right-anterior-superior" || space == "RAS") return {-1, -1, 1};
  if (space == "left-anterior-superior" || space == "LAS") return {1, -1, 1};
  throw BadInput(Reason::unsupported, fmt::format("{} is {}, must be left-posterior-superior, "
                                                  "right-anterior-superior or left-anterior-superior",
                                                  header.field("space"), xray::quote(space)));
}

Eigen::Affine3d place_of(const NrrdHeader& header) {
  Eigen::Affine3d place = Eigen::Affine3d::Identity();
  const auto directions = header.numbers("space directions", 9);
  const auto spacings = header.numbers("spacings", 3);
  const auto origin = header.numbers("space origin", 3);
  if (!directions.empty())
    place.linear() = Eigen::Map<const Eigen::Matrix3d>(directions.data());
  else if (!spacings.empty())
    place.linear() = Vector3d::Map(spacings.data()).asDiagonal();
  if (!origin.empty()) place.translation() = Vector3d::Map(origin.data());
  return lps_from(header).asDiagonal() * place;
}

std::vector<float> text_voxels(std::string_view bytes, std::size_t count, const std::string& origin) {
  if (bytes.size() / 2 + 1 < count)
    throw BadInput(Reason::truncated,
                   fmt::format("{}: {} bytes cannot hold {} numbers", origin, bytes.size(), count));
  const std::vector<double> numbers = read_numbers(bytes, count, origin);
  return {numbers.begin(), numbers.end()};
}

}  // namespace

Volume read_nrrd(const std::filesystem::path& path, std::string_view bytes) {
  const std::string origin = path.string();
  std::string_view rest = bytes;
  const NrrdHeader header(rest, origin);
  if (header.text("dimension") != "3")
    throw BadInput(Reason::unsupported, fmt::format("{} is {}, must be 3", header.field("dimension"),
                                                    xray::quote(header.text("dimension"))));
  const auto size = header.numbers("sizes", 3);
  if (size.empty()) throw BadInput(Reason::bad_value, header.field("sizes") + " is missing");

  Volume volume;
  const std::size_t count = value_or_throw(voxel_count(Vector3d::Map(size.data()), header.field("sizes")));
  volume.size = Vector3d::Map(size.data()).cast<int>();
  volume.patient_from_voxel = place_of(header);
  if (header.text("space").empty())
    volume.warnings.push_back(
        {Reason::spacing_missing,
         fmt::format("{}: no \"space\" gives the axes' directions; x left, y posterior, z superior "
                     "are assumed",
                     origin)});
  const VoxelFormat format = format_of(header);
  std::string data;
  if (const std::string file = header.text("data file"); !file.empty()) {
    if (file.starts_with("LIST") || file.find('%') != std::string::npos)
      throw BadInput(Reason::unsupported,
                     header.field("data file") + " is a list of files; one file is supported");
    data = read_data_file(path, file);
    rest = data;
  } else if (header.ended_without_blank()) {
    throw BadInput(Reason::truncated, origin + ": the header has no end");
  }
  const std::string encoding = header.text("encoding");
  std::string unpacked;
  if (encoding == "gzip" || encoding == "gz")
    rest = unpacked = inflate(rest, count * format.bytes(), origin);
  else if (encoding == "ascii" || encoding == "text" || encoding == "txt")
    return volume.voxels = text_voxels(rest, count, origin), volume;
  else if (encoding != "raw")
    throw BadInput(Reason::unsupported, fmt::format("{} is {}, must be raw, gzip or ascii",
                                                    header.field("encoding"), xray::quote(encoding)));
  if (const auto skip = header.numbers("byte skip", 1); !skip.empty() && skip[0] != 0) {
    const std::size_t needed = count * format.bytes();
    const double start =
        skip[0] == -1 ? static_cast<double>(rest.size()) - static_cast<double>(needed) : skip[0];
    if (!(start >= 0 && start <= static_cast<double>(rest.size())))
      throw BadInput(Reason::truncated, fmt::format("{} is {}, but the data contain only {} bytes",
                                                    header.field("byte skip"), skip[0], rest.size()));
    rest.remove_prefix(static_cast<std::size_t>(start));
  }
  volume.voxels = decode_voxels(rest, count, format, origin);
  return volume;
}

}  // namespace helicarm::volume
