// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <cstring>

#include <fmt/format.h>

#include "helicarm/registration/surface_file.h"

namespace helicarm::registration {
namespace {

constexpr std::size_t most_comments = 10000;

struct PlyProperty {
  std::string type, count_type, name;  ///< count_type: of a list
};
struct PlyElement {
  std::string name;
  std::size_t count = 0;
  std::vector<PlyProperty> properties;
};

/// Numbers of a PLY body, text or binary.
class PlyBody {
 public:
  PlyBody(std::string_view bytes, std::string_view format, const std::string& origin)
      : bytes_(bytes),
        words_(bytes, origin),
        text_(format == "ascii"),
        big_(format == "binary_big_endian"),
        origin_(origin) {}
  double number(const std::string& type) {
    if (text_) return words_.number();
    if (type == "char" || type == "int8") return read<std::int8_t>();
    if (type == "uchar" || type == "uint8") return read<std::uint8_t>();
    if (type == "short" || type == "int16") return read<std::int16_t>();
    if (type == "ushort" || type == "uint16") return read<std::uint16_t>();
    if (type == "int" || type == "int32") return read<std::int32_t>();
    if (type == "uint" || type == "uint32") return read<std::uint32_t>();
    if (type == "float" || type == "float32") return double(read<float>());
    if (type == "double" || type == "float64") return read<double>();
    throw BadInput(Reason::unsupported, fmt::format("{}: property of type \"{}\"", origin_, type));
  }
  /// What has not been read, without blanks at its beginning.
  std::size_t left() const {
    const std::string_view rest = text_ ? words_.rest() : bytes_.substr(at_);
    return rest.size() - std::min(rest.find_first_not_of(" \t\r\n"), rest.size());
  }

 private:
  template <class T>
  T read() {
    if (bytes_.size() - at_ < sizeof(T))
      throw BadInput(Reason::truncated, fmt::format("{}: ends within its elements", origin_));
    char raw[sizeof(T)];
    std::memcpy(raw, bytes_.data() + at_, sizeof(T));
    if (big_) std::reverse(raw, raw + sizeof(T));
    at_ += sizeof(T);
    T value;
    std::memcpy(&value, raw, sizeof(T));
    return value;
  }
  std::string_view bytes_;
  SurfaceWords words_;
  bool text_, big_;
  std::size_t at_ = 0;
  const std::string& origin_;
};

struct PlyHeader {
  std::string format;
  std::vector<PlyElement> elements;
  std::string comments;
  std::size_t size = 0;
};

PlyHeader ply_header(std::string_view bytes, const std::string& origin) {
  PlyHeader header;
  const auto bad = [&](std::string_view line) {
    return BadInput(Reason::bad_value, fmt::format("{}: header line \"{}\"", origin, line.substr(0, 60)));
  };
  while (true) {
    const std::size_t end = bytes.find('\n', header.size);
    if (end == std::string_view::npos)
      throw BadInput(Reason::truncated, fmt::format("{}: the header has no end", origin));
    const std::string_view line = bytes.substr(header.size, end - header.size);
    header.size = end + 1;
    SurfaceWords words(line, origin);
    const std::string_view key = words.next();
    if (key == "end_header") return header;
    if ((key == "comment" || key == "obj_info") && line.size() <= longest_declaration &&
        header.comments.size() < most_comments)
      header.comments += std::string(words.rest()) + ";";
    if (key == "format") header.format = words.next();
    if (key == "element") {
      PlyElement element{std::string(words.next()), 0, {}};
      const double count = words.number();
      check_triangles(count, origin);
      if (!(count >= 0 && count == std::floor(count))) throw bad(line);
      element.count = static_cast<std::size_t>(count);
      header.elements.push_back(element);
    }
    if (key == "property") {
      if (header.elements.empty()) throw bad(line);
      PlyProperty property{std::string(words.next()), "", ""};
      if (property.type == "list") {
        property.count_type = words.next();
        property.type = words.next();
      }
      property.name = words.next();
      header.elements.back().properties.push_back(property);
    }
  }
}

/// The corners of a face, or of another list, which is passed over.
std::vector<std::uint32_t> ply_list(PlyBody& body, const PlyProperty& property, bool is_face,
                                    std::size_t corners, std::size_t face, const std::string& origin) {
  const auto count = static_cast<std::size_t>(std::clamp(body.number(property.count_type), 0.0, 1e6));
  std::vector<std::uint32_t> polygon;
  for (std::size_t k = 0; k < count; ++k) {
    const double index = body.number(property.type);
    if (!is_face || !property.name.starts_with("vertex_ind")) continue;
    if (!(index >= 0 && index < double(corners)))
      throw BadInput(Reason::bad_value, fmt::format("{}: face {} names vertex {}", origin, face, index));
    polygon.push_back(static_cast<std::uint32_t>(index));
  }
  return polygon;
}

}  // namespace

bool is_ply(std::string_view bytes) { return bytes.starts_with("ply\n") || bytes.starts_with("ply\r\n"); }

SurfaceFile ply_surface(std::string_view bytes, const std::string& origin) {
  const PlyHeader header = ply_header(bytes, origin);
  if (header.format != "ascii" && !header.format.starts_with("binary_"))
    throw BadInput(Reason::unsupported, fmt::format("{}: format \"{}\"", origin, header.format));
  PlyBody body(bytes.substr(header.size), header.format, origin);
  SurfaceFile file;
  file.declares = header.comments;
  for (const PlyElement& element : header.elements) {
    if (element.properties.empty() && element.count > 0)
      throw BadInput(Reason::bad_value, fmt::format("{}: {} elements \"{}\" without a property", origin,
                                                    element.count, element.name));
    if (element.name == "vertex")
      check_triangles(double(file.mesh.corners.size() + element.count) / 3, origin);
    if (element.name == "tristrips" && element.count > 0)
      throw BadInput(Reason::unsupported,
                     fmt::format("{}: triangle strips; save the surface as triangles", origin));
    for (std::size_t i = 0; i < element.count; ++i) {
      Eigen::Vector3d place = Eigen::Vector3d::Zero();
      for (const PlyProperty& property : element.properties) {
        if (!property.count_type.empty()) {
          add_polygon(file.mesh,
                      ply_list(body, property, element.name == "face", file.mesh.corners.size(), i, origin));
          check_triangles(double(file.mesh.triangles.size()), origin);
          continue;
        }
        const double value = body.number(property.type);
        for (int axis = 0; axis < 3; ++axis)
          if (property.name == std::string(1, "xyz"[axis])) place[axis] = value;
      }
      if (element.name == "vertex") file.mesh.corners.push_back(place);
    }
  }
  if (const std::size_t left = body.left(); left > 0)
    file.warnings.push_back(
        {Reason::surplus_data,
         fmt::format("{}: {} bytes follow the elements that the header states: check their "
                     "numbers, or save the surface again",
                     origin, left),
         {},
         {{"surplus_bytes", double(left)}}});
  return file;
}

}  // namespace helicarm::registration
