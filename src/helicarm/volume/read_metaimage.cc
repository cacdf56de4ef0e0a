// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <map>
#include <optional>

#include <fmt/format.h>

#include "helicarm/volume/declared.h"
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
      const std::string key(trimmed(line.substr(0, equals)));
      if (!values_.emplace(key, trimmed(line.substr(equals + 1))).second)
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
    const std::string value = small_letters(text(key, otherwise ? "true" : "false"));
    if (value == "true" || value == "t" || value == "1") return true;
    if (value == "false" || value == "f" || value == "0") return false;
    throw BadInput(Reason::bad_value,
                   fmt::format("{} is {}, must be True or False", field(key), xray::quote(value)));
  }

  /// Values under the key, or under one of its other names; empty if none is present. Two that differ are
  /// refused.
  std::vector<double> numbers(std::initializer_list<const char*> keys, std::size_t count) const {
    std::vector<double> found;
    const char* from = nullptr;
    for (const char* key : keys) {
      if (!has(key)) continue;
      auto values = read_numbers(text(key), count, field(key));
      if (!from) {
        from = key;
        found = std::move(values);
      } else if (found != values) {
        throw BadInput(Reason::bad_value, fmt::format("{} is {}, but {} is {}: remove the wrong one",
                                                      field(key), text(key), from, text(from)));
      }
    }
    return found;
  }
  std::string_view sequence_key() const {
    for (const auto& [key, value] : values_)
      if (key.starts_with("Seq_Frame")) return key;
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
      {"MET_DOUBLE", Kind::float64},  {"MET_LONG", Kind::int32},        {"MET_ULONG", Kind::uint32}};
  const auto found = kinds.find(header.text("ElementType"));
  if (found == kinds.end())
    throw BadInput(Reason::unsupported,
                   fmt::format("{} is {}, must be MET_CHAR to MET_DOUBLE", header.field("ElementType"),
                               xray::quote(header.text("ElementType"))));
  const bool big = header.flag("BinaryDataByteOrderMSB", header.flag("ElementByteOrderMSB", false));
  if (header.flag("ElementByteOrderMSB", big) != big)
    throw BadInput(Reason::bad_value, header.field("ElementByteOrderMSB") +
                                          " differs from BinaryDataByteOrderMSB: remove the wrong one");
  return {found->second, big};
}

/// Columns: directions of the axes from their letters, which name the side where each begins ("RAI": L, P,
/// S). Nothing for other letters.
std::optional<Eigen::Matrix3d> directions_from_letters(const std::string& letters) {
  constexpr std::string_view from = "RAILPS";
  Eigen::Matrix3d directions = Eigen::Matrix3d::Zero();
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::size_t letter = letters.size() == 3 ? from.find(letters[axis]) : std::string_view::npos;
    if (letter == std::string_view::npos) return std::nullopt;
    directions(static_cast<int>(letter % 3), static_cast<int>(axis)) = letter < 3 ? 1 : -1;
  }
  return directions;
}

/// Letters of the axes that are nearest to the directions.
std::string letters_of(const Eigen::Matrix3d& directions) {
  std::string letters;
  for (int axis = 0; axis < 3; ++axis) {
    Eigen::Index along = 0;
    directions.col(axis).cwiseAbs().maxCoeff(&along);
    letters += directions(along, axis) > 0 ? "RAI"[along] : "LPS"[along];
  }
  return letters;
}

double millimetres(const MetaHeader& header) {
  const std::string unit = header.text("DistanceUnits", "?");
  return unit.empty() || unit.starts_with('?') ? 1 : declared_unit(unit, header.field("DistanceUnits"));
}

Eigen::Affine3d place_of(const MetaHeader& header, std::vector<Warning>& warnings) {
  const char* spacing_key = header.has("ElementSpacing") ? "ElementSpacing" : "ElementSize";
  const auto spacing = header.numbers({spacing_key}, 3);
  if (!spacing.empty()) check_spacings(Vector3d::Map(spacing.data()), header.field(spacing_key));
  const auto offset = header.numbers({"Offset", "Position", "Origin"}, 3);
  const auto matrix = header.numbers({"TransformMatrix", "Rotation", "Orientation"}, 9);
  Eigen::Affine3d patient_from_index = Eigen::Affine3d::Identity();
  const std::string letters = header.text("AnatomicalOrientation", "???");
  const bool lettered = !letters.starts_with('?');
  const auto directions = directions_from_letters(letters);
  if (!matrix.empty())  // fewer numbers describe fewer axes
    patient_from_index.linear() = Eigen::Map<const Eigen::Matrix3d>(matrix.data());
  else if (directions)
    patient_from_index.linear() = *directions;
  else if (lettered)
    throw BadInput(Reason::bad_value,
                   fmt::format("{} is {}, must be three of R L A P I S",
                               header.field("AnatomicalOrientation"), xray::quote(letters)));
  // An oblique axis is at most 55 degrees from its letter.
  constexpr double least_cosine = 0.5;
  if (!matrix.empty() && lettered &&
      (!directions ||
       (directions->transpose() * patient_from_index.linear().colwise().normalized()).diagonal().minCoeff() <
           least_cosine))
    warnings.push_back({Reason::irregular_file,
                        fmt::format("{} is {}, but the matrix of the axes is that of {}: the matrix is used",
                                    header.field("AnatomicalOrientation"), xray::quote(letters),
                                    letters_of(patient_from_index.linear()))});
  if (spacing.empty())
    warnings.push_back(size_not_stated(header.field("ElementSpacing")));
  else
    patient_from_index.linear() *= Vector3d::Map(spacing.data()).asDiagonal();
  if (!offset.empty()) patient_from_index.translation() = Vector3d::Map(offset.data());
  return Eigen::Scaling(millimetres(header)) * patient_from_index;
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

/// Refuses what is not one volume.
void check_kind(const MetaHeader& header) {
  constexpr const char* way_out = "export one frame as a volume of its own";
  if (header.text("ObjectType", "Image") != "Image")
    throw BadInput(Reason::unsupported, fmt::format("{} is {}, must be Image", header.field("ObjectType"),
                                                    xray::quote(header.text("ObjectType"))));
  if (const std::string_view key = header.sequence_key(); !key.empty())
    throw BadInput(Reason::unsupported, fmt::format("{}: a sequence of images, not a volume; {}",
                                                    header.field(std::string(key)), way_out));
  if (header.text("NDims") != "3")
    throw BadInput(
        Reason::unsupported,
        fmt::format("{} is {}, must be 3{}", header.field("NDims"), xray::quote(header.text("NDims")),
                    header.text("NDims") == "4" ? fmt::format(": a sequence; {}", way_out) : ""));
  if (header.text("ElementNumberOfChannels", "1") != "1")
    throw BadInput(Reason::unsupported, header.field("ElementNumberOfChannels") + " must be 1");
  if (small_letters(header.text("Kinds")).find("list") != std::string::npos)
    throw BadInput(Reason::unsupported, fmt::format("{} is {}: a sequence; {}", header.field("Kinds"),
                                                    xray::quote(header.text("Kinds")), way_out));
  if (!header.flag("BinaryData", true))
    throw BadInput(Reason::unsupported,
                   header.field("BinaryData") + " is False: text voxels are not supported");
}

/// Some programs, such as ITK, do not apply this scale, so that it is said.
void apply_intensity(Volume& volume, const MetaHeader& header) {
  const auto slope = header.numbers({"ElementToIntensityFunctionSlope"}, 1);
  const auto offset = header.numbers({"ElementToIntensityFunctionOffset"}, 1);
  const double factor = slope.empty() ? 1 : slope[0], shift = offset.empty() ? 0 : offset[0];
  if (factor == 1 && shift == 0) return;
  if (factor == 0)
    throw BadInput(Reason::bad_value, header.field("ElementToIntensityFunctionSlope") + " is 0");
  for (float& voxel : volume.voxels) voxel = static_cast<float>(factor * static_cast<double>(voxel) + shift);
  volume.warnings.push_back(
      {Reason::irregular_file,
       fmt::format("{} {:g} and Offset {:g} are applied to the voxels; some programs ignore them",
                   header.field("ElementToIntensityFunctionSlope"), factor, shift)});
}

}  // namespace

Volume read_metaimage(const std::filesystem::path& path, std::string_view bytes) {
  const std::string origin = path.string();
  std::string_view rest = bytes;
  const MetaHeader header(rest, origin);
  check_kind(header);
  const auto size = header.numbers({"DimSize"}, 3);
  if (size.empty()) throw BadInput(Reason::bad_value, header.field("DimSize") + " is missing");

  Volume volume;
  const std::size_t count = value_or_throw(voxel_count(Vector3d::Map(size.data()), header.field("DimSize")));
  volume.size = Vector3d::Map(size.data()).cast<int>();
  volume.patient_from_voxel = place_of(header, volume.warnings);
  const VoxelFormat format = format_of(header);
  const std::string file = header.text("ElementDataFile");
  std::string data;
  if (file == "LIST" || std::ranges::count(file, '%') > 0)
    throw BadInput(Reason::unsupported,
                   header.field("ElementDataFile") +
                       " is a list of files; one file is supported: save the volume as one .mha");
  if (file != "LOCAL") {
    data = read_data_file(path, file);
    rest = data;
  }
  const std::size_t needed = count * format.bytes();
  const bool packed = header.flag("CompressedData", false);
  rest = skip_header(rest, header, packed ? rest.size() : needed);
  std::size_t surplus = 0;
  std::string unpacked;
  if (packed) rest = unpacked = inflate(rest, needed, origin, &surplus);
  volume.voxels = decode_voxels(rest, count, format, origin);
  if (packed)
    warn_of_surplus(volume, surplus, needed, origin);
  else
    warn_of_surplus(volume, rest.substr(needed), needed, origin);
  apply_intensity(volume, header);
  return volume;
}

}  // namespace helicarm::volume
