// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/surface.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <map>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/registration/vtp.h"

namespace helicarm::registration {
namespace {

using Eigen::Vector3d;
using phantom::TriangleMesh;

constexpr std::uintmax_t most_bytes = std::uintmax_t{1} << 30;
constexpr std::size_t stl_header = 84, stl_facet = 50;

/// Joins corners at exactly one place.
class Welder {
 public:
  explicit Welder(TriangleMesh& mesh) : mesh_(mesh) {}
  std::uint32_t operator()(const Vector3d& place) {
    const auto [entry, added] = index_.try_emplace({place.x(), place.y(), place.z()},
                                                   static_cast<std::uint32_t>(mesh_.corners.size()));
    if (added) mesh_.corners.push_back(place);
    return entry->second;
  }

 private:
  TriangleMesh& mesh_;
  std::map<std::array<double, 3>, std::uint32_t> index_;
};

void add_triangle(TriangleMesh& mesh, std::uint32_t a, std::uint32_t b, std::uint32_t c) {
  if (a != b && b != c && c != a) mesh.triangles.push_back({a, b, c});
}

TriangleMesh welded(const TriangleMesh& soup) {
  TriangleMesh mesh;
  Welder weld(mesh);
  for (const auto& [a, b, c] : soup.triangles)
    add_triangle(mesh, weld(soup.corners[a]), weld(soup.corners[b]), weld(soup.corners[c]));
  return mesh;
}

template <class T>
T value_at(std::string_view bytes, std::size_t at) {
  T value;
  std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

void check_count(double triangles, const std::string& origin) {
  if (triangles > double(max_triangles))
    throw BadInput(Reason::bad_size,
                   fmt::format("{}: {:.0f} triangles, limit {}", origin, triangles, max_triangles));
}

TriangleMesh from_binary_stl(std::string_view bytes, const std::string& origin) {
  const auto count = value_at<std::uint32_t>(bytes, 80);
  if (bytes.size() < stl_header + stl_facet * count)
    throw BadInput(
        Reason::truncated,
        fmt::format("{}: is cut off, or no surface (STL, PLY, VTP): {} bytes, {} triangles of an STL "
                    "file need {}",
                    origin, bytes.size(), count, stl_header + stl_facet * count));
  check_count(count, origin);
  TriangleMesh mesh;
  Welder weld(mesh);
  for (std::size_t i = 0; i < count; ++i) {
    std::uint32_t corner[3];
    for (std::size_t k = 0; k < 3; ++k) {
      Vector3d place;
      for (std::size_t axis = 0; axis < 3; ++axis)
        place[Eigen::Index(axis)] =
            double(value_at<float>(bytes, stl_header + stl_facet * i + 12 + 12 * k + 4 * axis));
      corner[k] = weld(place);
    }
    add_triangle(mesh, corner[0], corner[1], corner[2]);
  }
  return mesh;
}

/// Words of a text, one after the other.
class Words {
 public:
  Words(std::string_view text, const std::string& origin) : rest_(text), origin_(origin) {}
  std::string_view next() {
    const auto blank = [](char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n'; };
    std::size_t first = 0;
    while (first < rest_.size() && blank(rest_[first])) ++first;
    std::size_t end = first;
    while (end < rest_.size() && !blank(rest_[end])) ++end;
    const std::string_view word = rest_.substr(first, end - first);
    rest_.remove_prefix(end);
    return word;
  }
  double number() {
    std::string_view word = next();
    if (word.empty())
      throw BadInput(Reason::truncated, fmt::format("{}: ends within a number list", origin_));
    if (word.starts_with('+')) word.remove_prefix(1);
    double value = 0;
    const auto [stop, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (error != std::errc{} || stop != word.data() + word.size())
      throw BadInput(Reason::bad_value,
                     fmt::format("{}: \"{}\" is not a number", origin_, word.substr(0, 40)));
    return value;
  }

 private:
  std::string_view rest_;
  const std::string& origin_;
};

TriangleMesh from_text_stl(std::string_view bytes, const std::string& origin) {
  TriangleMesh mesh;
  Welder weld(mesh);
  Words words(bytes, origin);
  std::vector<std::uint32_t> facet;
  for (std::string_view word = words.next(); !word.empty(); word = words.next()) {
    if (word == "outer") facet.clear();
    if (word == "vertex") {
      const double x = words.number(), y = words.number(), z = words.number();
      facet.push_back(weld(Vector3d(x, y, z)));
      if (facet.size() == 3) add_triangle(mesh, facet[0], facet[1], facet[2]);
      check_count(double(mesh.triangles.size()), origin);
    }
  }
  return mesh;
}

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
  Words words_;
  bool text_, big_;
  std::size_t at_ = 0;
  const std::string& origin_;
};

struct PlyHeader {
  std::string format;
  std::vector<PlyElement> elements;
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
    Words words(line, origin);
    const std::string_view key = words.next();
    if (key == "end_header") return header;
    if (key == "format") header.format = words.next();
    if (key == "element") {
      PlyElement element{std::string(words.next()), 0, {}};
      const double count = words.number();
      check_count(count, origin);
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

TriangleMesh from_ply(std::string_view bytes, const std::string& origin) {
  const PlyHeader header = ply_header(bytes, origin);
  if (header.format != "ascii" && !header.format.starts_with("binary_"))
    throw BadInput(Reason::unsupported, fmt::format("{}: format \"{}\"", origin, header.format));
  PlyBody body(bytes.substr(header.size), header.format, origin);
  TriangleMesh mesh;
  Welder weld(mesh);
  std::vector<std::uint32_t> joined;
  for (const PlyElement& element : header.elements)
    for (std::size_t i = 0; i < element.count; ++i) {
      Vector3d place = Vector3d::Zero();
      for (const PlyProperty& property : element.properties) {
        if (property.count_type.empty()) {
          const double value = body.number(property.type);
          for (int axis = 0; axis < 3; ++axis)
            if (property.name == std::string(1, "xyz"[axis])) place[axis] = value;
          continue;
        }
        const auto count = static_cast<std::size_t>(std::clamp(body.number(property.count_type), 0.0, 1e6));
        std::vector<std::uint32_t> polygon;
        for (std::size_t k = 0; k < count; ++k) {
          const double index = body.number(property.type);
          if (element.name != "face" || !property.name.starts_with("vertex_ind")) continue;
          if (!(index >= 0 && index < double(joined.size())))
            throw BadInput(Reason::bad_value, fmt::format("{}: face {} names vertex {}", origin, i, index));
          polygon.push_back(joined[static_cast<std::size_t>(index)]);
        }
        for (std::size_t k = 2; k < polygon.size(); ++k)
          add_triangle(mesh, polygon[0], polygon[k - 1], polygon[k]);
        check_count(double(mesh.triangles.size()), origin);
      }
      if (element.name == "vertex") joined.push_back(weld(place));
    }
  return mesh;
}

TriangleMesh mesh_from(std::string_view bytes, const std::string& origin) {
  if (bytes.starts_with("ply\n") || bytes.starts_with("ply\r\n")) return from_ply(bytes, origin);
  const bool sized = bytes.size() >= stl_header &&
                     bytes.size() == stl_header + stl_facet * std::size_t{value_at<std::uint32_t>(bytes, 80)};
  if (!sized && bytes.starts_with("solid")) return from_text_stl(bytes, origin);
  if (is_vtk_xml(bytes)) return welded(mesh_from_vtp(bytes, origin));
  if (bytes.starts_with("<?xml") || bytes.starts_with("# vtk"))
    throw BadInput(Reason::unsupported,
                   fmt::format("{}: neither STL, PLY nor VTK's XML; save the model as one of these", origin));
  if (bytes.size() < stl_header)
    throw BadInput(Reason::truncated,
                   fmt::format("{}: {} bytes, neither STL, PLY nor VTP", origin, bytes.size()));
  return from_binary_stl(bytes, origin);
}

}  // namespace

Expected<TriangleMesh> surface_from(std::string_view bytes, const std::string& origin) {
  return guarded([&] {
    TriangleMesh mesh = mesh_from(bytes, origin);
    if (mesh.triangles.size() < 4)
      throw BadInput(Reason::bad_value, fmt::format("{}: {} triangles, a closed surface has at least 4",
                                                    origin, mesh.triangles.size()));
    for (const Vector3d& corner : mesh.corners)
      if (!corner.allFinite())
        throw BadInput(Reason::not_finite, fmt::format("{}: a corner is not finite", origin));
    return mesh;
  });
}

Expected<TriangleMesh> read_surface(const std::filesystem::path& path) {
  return read_file(path, most_bytes).and_then([&](const std::string& bytes) {
    return surface_from(bytes, path.filename().string());
  });
}

Expected<Surface> prepare_surface(TriangleMesh mesh, const std::string& origin) {
  if (phantom::volume(mesh) < 0)
    for (auto& triangle : mesh.triangles) std::swap(triangle[1], triangle[2]);
  Surface surface{std::move(mesh), {}, {}};
  std::vector<std::array<std::uint32_t, 3>> sides;  // lower corner, upper corner, face
  for (std::uint32_t face = 0; face < surface.mesh.triangles.size(); ++face) {
    const auto& t = surface.mesh.triangles[face];
    const auto& c = surface.mesh.corners;
    surface.normals.push_back((c[t[1]] - c[t[0]]).cross(c[t[2]] - c[t[0]]).normalized());
    for (std::size_t k = 0; k < 3; ++k)
      sides.push_back({std::min(t[k], t[(k + 1) % 3]), std::max(t[k], t[(k + 1) % 3]), face});
  }
  std::ranges::sort(sides);
  std::size_t open = 0;
  for (std::size_t i = 0; i < sides.size();) {
    std::size_t end = i + 1;
    while (end < sides.size() && sides[end][0] == sides[i][0] && sides[end][1] == sides[i][1]) ++end;
    if (end - i == 2)
      surface.edges.push_back({{sides[i][0], sides[i][1]}, {sides[i][2], sides[i + 1][2]}});
    else if (end - i == 1)
      ++open;
    i = end;
  }
  const double share = double(open) / double(sides.size());
  if (share > 0.01)
    return fail(Reason::bad_value,
                fmt::format("{}: the surface is not closed: {:.1f} % of its edges bound one triangle only, "
                            "limit 1 %; close its holes",
                            origin, 100 * share),
                {{"open_edges", double(open)}});
  return surface;
}

}  // namespace helicarm::registration
