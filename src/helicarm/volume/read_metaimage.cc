// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <map>

#include <fmt/format.h>

#include "helicarm/volume/voxels.h"
#include "helicarm/xray/dicom_elements.h"

namespace helicarm::volume {
namespace {

using Eigen::Vector3d;

/// Header lines `Key = Value` up to and including ElementDataFile; removed from `rest`.
class MetaHeader {
 public:
  MetaHeader(std::string_view& rest, std::string origin) : origin_(std::move(origin)) {
    while (!has("ElementDataFile")) {
      if (rest.empty()) throw BadInput(Reason::truncated, origin_ + ": the header has no ElementDataFile");
      const std::string_view line = take_line(rest);
      const std::size_t equals = line.find('=');
      if (equals == std::string_view::npos)
        throw BadInput(Reason::bad_value,
                       fmt::format("{}: the line {} has no \"=\"", origin_, xray::quote(line)));
      const std::string key(trim(line.substr(0, equals)));
      if (!values_.emplace(key, trim(line.substr(equals + 1))).second)
        throw BadInput(Reason::bad_value, fmt::format("{}: {} is given twice", origin_, xray::quote(key)));
    }
  }

  bool has(const std::string& key) const { return values_.contains(key); }
  std::string field(const std::string& key) const { return fmt::format("{}: {}", origin_, key); }

  std::string text(const std::string& key, const std::string& otherwise = "") const {
    const auto found = values_.find(key);
    return found == values_.end() ? otherwise : found->second;
  }

  bool flag(const std::string& key, bool otherwise) const {
    const std::string value = text(key, otherwise ? "True" : "False");
    if (value == "True" || value == "true" || value == "1") return true;
    if (value == "False" || value == "false" || value == "0") return false;
    throw BadInput(Reason::bad_value,
                   fmt::format("{} is {}, must be True or False", field(key), xray::quote(value)));
  }

  /// Values of the first key that is present; empty if none is.
  std::vector<double> numbers(std::initializer_list<const char*> keys, std::size_t count) const {
    for (const char* key : keys)
      if (has(key)) return read_numbers(text(key), count, field(key));
    return {};
  }

 private:
  std::string origin_;
  std::map<std::string, std::string> values_;
};

VoxelFormat format_of(const MetaHeader& header) {
  using Kind = VoxelFormat::Kind;
  static const std::map<std::string, Kind> kinds = {
      {"MET_CHAR", Kind::int8},       {"MET_UCHAR", Kind::uint8},       {"MET_SHORT", Kind::int16},
      {"MET_USHORT", Kind::uint16},   {"MET_INT", Kind::int32},         {"MET_UINT", Kind::uint32},
      {"MET_LONG_LONG", Kind::int64}, {"MET_ULONG_LONG", Kind::uint64}, {"MET_FLOAT", Kind::float32},
      {"MET_DOUBLE", Kind::float64}};
  const auto found = kinds.find(header.text("ElementType"));
  if (found == kinds.end())
    throw BadInput(Reason::unsupported,
                   fmt::format("{} is {}, must be MET_CHAR to MET_DOUBLE", header.field("ElementType"),
                               xray::quote(header.text("ElementType"))));
  return {found->second,
          header.flag("BinaryDataByteOrderMSB", false) || header.flag("ElementByteOrderMSB", false)};
}

/// Columns: directions of the axes from their letters, which name the side where each begins ("RAI": L, P,
/// S).
Eigen::Matrix3d directions_from_letters(const std::string& letters, const std::string& field) {
  constexpr std::string_view from = "RAILPS";
  Eigen::Matrix3d directions = Eigen::Matrix3d::Zero();
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::size_t letter = letters.size() == 3 ? from.find(letters[axis]) : std::string_view::npos;
    if (letter == std::string_view::npos)
      throw BadInput(Reason::bad_value,
                     fmt::format("{} is {}, must be three of R L A P I S", field, xray::quote(letters)));
    directions(static_cast<int>(letter % 3), static_cast<int>(axis)) = letter < 3 ? 1 : -1;
  }
  return directions;
}

Eigen::Affine3d place_of(const MetaHeader& header) {
  const auto spacing = header.numbers({"ElementSpacing", "ElementSize"}, 3);
  const auto offset = header.numbers({"Offset", "Position", "Origin"}, 3);
  const auto matrix = header.numbers({"TransformMatrix", "Rotation", "Orientation"}, 9);
  Eigen::Affine3d place = Eigen::Affine3d::Identity();
  const std::string letters = header.text("AnatomicalOrientation", "???");
  if (!matrix.empty())  // fewer numbers describe fewer axes
    place.linear() = Eigen::Map<const Eigen::Matrix3d>(matrix.data());
  else if (letters != "???")
    place.linear() = directions_from_letters(letters, header.field("AnatomicalOrientation"));
  if (!spacing.empty()) place.linear() *= Vector3d::Map(spacing.data()).asDiagonal();
  if (!offset.empty()) place.translation() = Vector3d::Map(offset.data());
  return place;
}

std::string_view skip_header(std::string_view bytes, const MetaHeader& header, std::size_t needed) {
  const auto size = header.numbers({"HeaderSize"}, 1);
  if (size.empty() || size[0] == 0) return bytes;
  if (size[0] == -1 && bytes.size() >= needed) return bytes.substr(bytes.size() - needed);
  if (!(size[0] > 0 && size[0] <= static_cast<double>(bytes.size())))
    throw BadInput(Reason::truncated, fmt::format("{} is {}, but the data contain only {} bytes",
                                                  header.field("HeaderSize"), size[0], bytes.size()));
  return bytes.substr(static_cast<std::size_t>(size[0]));
}

}  // namespace

Volume read_metaimage(const std::filesystem::path& path, std::string_view bytes) {
  const std::string origin = path.string();
  std::string_view rest = bytes;
  const MetaHeader header(rest, origin);
  if (header.text("NDims") != "3")
    throw BadInput(Reason::unsupported, fmt::format("{} is {}, must be 3", header.field("NDims"),
                                                    xray::quote(header.text("NDims"))));
  if (header.text("ElementNumberOfChannels", "1") != "1")
    throw BadInput(Reason::unsupported, header.field("ElementNumberOfChannels") + " must be 1");
  if (!header.flag("BinaryData", true))
    throw BadInput(Reason::unsupported,
                   header.field("BinaryData") + " is False: text voxels are not supported");
  const auto size = header.numbers({"DimSize"}, 3);
  if (size.empty()) throw BadInput(Reason::bad_value, header.field("DimSize") + " is missing");

  Volume volume;
  const std::size_t count = value_or_throw(voxel_count(Vector3d::Map(size.data()), header.field("DimSize")));
  volume.size = Vector3d::Map(size.data()).cast<int>();
  volume.patient_from_voxel = place_of(header);
  const VoxelFormat format = format_of(header);
  const std::string file = header.text("ElementDataFile");
  std::string data;
  if (file == "LIST" || std::ranges::count(file, '%') > 0)
    throw BadInput(Reason::unsupported,
                   header.field("ElementDataFile") + " is a list of files; one file is supported");
  if (file != "LOCAL") {
    data = read_data_file(path, file);
    rest = data;
  }
  const std::size_t needed = count * format.bytes();
  const bool packed = header.flag("CompressedData", false);
  rest = skip_header(rest, header, packed ? rest.size() : needed);
  std::string unpacked;
  if (packed) rest = unpacked = inflate(rest, needed, origin);
  volume.voxels = decode_voxels(rest, count, format, origin);
  return volume;
}

}  // namespace helicarm::volume
