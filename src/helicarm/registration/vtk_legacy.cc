// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include <fmt/format.h>

#include "helicarm/registration/vtk_cursor.h"
#include "helicarm/volume/declared.h"

namespace helicarm::registration {
namespace {

constexpr std::size_t most_vtk_values = 3 * max_triangles, most_vtk_fields = 1000;
constexpr std::string_view vtk_magic = "# vtk DataFile Version ";

/// VTK's legacy PolyData: text, or numbers in big-endian order.
class LegacyVtkReader {
 public:
  LegacyVtkReader(std::string_view bytes, const std::string& origin)
      : origin_(origin), cursor_(bytes, origin) {}

  SurfaceFile read() {
    begin();
    for (std::string section = cursor_.next_small(); !section.empty(); section = cursor_.next_small()) {
      if (section == "field") {
        fields();
      } else if (section == "metadata") {
        cursor_.skip_metadata();
      } else if (section == "points") {
        points();
      } else if (section == "polygons" || section == "triangle_strips") {
        cells(section, true);
      } else if (section == "vertices" || section == "lines") {
        cells(section, false);
      } else if (section == "cell_data" || section == "point_data") {
        break;  // attributes of what has been read
      } else {
        cursor_.refuse(Reason::bad_value,
                       fmt::format("\"{}\" is no section of PolyData", section.substr(0, 40)));
      }
    }
    return std::move(file_);
  }

 private:
  using Values = VtkCursor::Values;

  /// Magic, title, coding, and what may precede the kind of the data.
  void begin() {
    const std::string_view version = cursor_.take_line().substr(vtk_magic.size());
    SurfaceWords numbers(version, origin_);
    const double number = numbers.number();
    if (!(number >= 1 && number < 6))
      cursor_.refuse(Reason::unsupported, fmt::format("version {} of VTK's files, must be 1 to 5", number));
    has_offsets_ = number >= 5;
    file_.declares = std::string(cursor_.take_line().substr(0, longest_declaration)) + ";";
    const std::string coding = cursor_.next_small();
    if (coding.empty()) cursor_.refuse(Reason::truncated, "ends within its header");
    if (coding != "ascii" && coding != "binary")
      cursor_.refuse(Reason::bad_value,
                     fmt::format("the third line is \"{}\", must be ASCII or BINARY", coding));
    cursor_.set_text(coding == "ascii");
    std::string section = cursor_.next_small();
    for (; section == "field"; section = cursor_.next_small()) fields();
    if (section.empty()) cursor_.refuse(Reason::truncated, "ends before DATASET");
    const std::string kind(section == "dataset" ? cursor_.words().next() : std::string_view());
    if (volume::small_letters(kind) != "polydata")
      cursor_.refuse(Reason::unsupported, fmt::format("VTK data of type \"{}\"; save the surface as PolyData",
                                                      (kind.empty() ? section : kind).substr(0, 40)));
    cursor_.take_line();
  }

  void points() {
    const std::size_t number = cursor_.count("POINTS", most_vtk_values);
    if (!file_.mesh.corners.empty()) cursor_.refuse(Reason::bad_value, "POINTS are given twice");
    const Values places = cursor_.values(cursor_.type_of("POINTS"), 3 * number, "POINTS");
    file_.mesh.corners.reserve(number);
    for (std::size_t i = 0; i < number; ++i)
      file_.mesh.corners.emplace_back(places[3 * i], places[3 * i + 1], places[3 * i + 2]);
  }

  void cells(const std::string& section, bool is_surface) {
    const std::size_t number = cursor_.count(section, most_vtk_values),
                      size = cursor_.count(section, 4 * most_vtk_values);
    if (!has_offsets_) {
      const Values all = cursor_.values({"int", 4, 'i'}, size, section);
      if (is_surface) counted_cells(section, number, all);
    } else if (number > 0) {
      const Values offsets = array("offsets", number), corners = array("connectivity", size);
      if (is_surface) cells_between(section, offsets, corners);
    }
  }

  /// Each cell begins with its number of corners.
  void counted_cells(const std::string& section, std::size_t number, const Values& all) {
    std::size_t at = 0;
    for (std::size_t cell = 0; cell < number; ++cell) {
      if (at == all.size())
        cursor_.refuse(Reason::bad_value,
                       fmt::format("{}: {} numbers hold {} cells, {} are stated", section, at, cell, number));
      const double corners = all[at], left = double(all.size() - at - 1);
      if (!(corners >= 0 && corners <= left && corners == std::floor(corners)))
        cursor_.refuse(Reason::bad_value,
                       fmt::format("{} {} has {} corners, must be 0 to {}", section, cell, corners, left));
      const std::size_t end = at + 1 + static_cast<std::size_t>(corners);
      add(section, cell, all, at + 1, end);
      at = end;
    }
    if (at != all.size())
      cursor_.refuse(Reason::bad_value, fmt::format("{}: {} cells have {} numbers, {} are stated", section,
                                                    number, at, all.size()));
  }

  /// From version 5: the corners of a cell lie between its offset and the next.
  void cells_between(const std::string& section, const Values& offsets, const Values& corners) {
    const auto is_place = [&](double offset) {
      return offset >= 0 && offset <= double(corners.size()) && offset == std::floor(offset);
    };
    for (std::size_t cell = 0; cell + 1 < offsets.size(); ++cell) {
      const double begin = offsets[cell], end = offsets[cell + 1];
      if (!is_place(begin) || !is_place(end) || begin > end)
        cursor_.refuse(Reason::bad_value,
                       fmt::format("{} {} has the offsets {} and {}, must not decrease and be 0 to {}",
                                   section, cell, begin, end, corners.size()));
      add(section, cell, corners, static_cast<std::size_t>(begin), static_cast<std::size_t>(end));
    }
  }

  Values array(const std::string& name, std::size_t number) {
    if (const std::string found = cursor_.next_small(); found != name)
      cursor_.refuse(found.empty() ? Reason::truncated : Reason::bad_value,
                     fmt::format("\"{}\" where {} must follow", found.substr(0, 40), name));
    const VtkType& type = cursor_.type_of(name);
    const Values all = cursor_.values(type, number, name);
    if (volume::small_letters(SurfaceWords(cursor_.words()).next().substr(0, 20)) == "metadata") {
      cursor_.words().next();
      cursor_.skip_metadata();
    }
    return all;
  }

  /// Of the numbers from `begin` to `end`: a polygon, or a strip whose triangles turn alternately.
  void add(const std::string& section, std::size_t cell, const Values& numbers, std::size_t begin,
           std::size_t end) {
    polygon_.clear();
    const std::size_t corners = file_.mesh.corners.size();
    for (std::size_t k = begin; k < end; ++k) {
      if (!(numbers[k] >= 0 && numbers[k] < double(corners) && numbers[k] == std::floor(numbers[k])))
        cursor_.refuse(Reason::bad_value, fmt::format("{} {} names point {}, must be 0 to {}", section, cell,
                                                      numbers[k], double(corners) - 1));
      polygon_.push_back(static_cast<std::uint32_t>(numbers[k]));
    }
    if (section == "polygons") {
      add_polygon(file_.mesh, polygon_);
    } else {
      for (std::size_t k = 2; k < polygon_.size(); ++k) {
        const std::size_t odd = k % 2;
        file_.mesh.triangles.push_back({polygon_[k - 2 + odd], polygon_[k - 1 - odd], polygon_[k]});
      }
    }
    check_triangles(double(file_.mesh.triangles.size()), origin_);
  }

  /// Arrays of field data: those of texts whose name may be that of a space or unit declare it.
  void fields() {
    cursor_.words().next();  // a name
    const std::size_t number = cursor_.count("FIELD", most_vtk_fields);
    for (std::size_t i = 0; i < number; ++i) {
      std::string name(cursor_.words().next().substr(0, 200));
      if (volume::small_letters(name) == "metadata") {
        cursor_.skip_metadata();
        name = cursor_.words().next().substr(0, 200);
      }
      if (name.empty()) cursor_.refuse(Reason::truncated, "ends within FIELD");
      if (name == "NULL_ARRAY") continue;
      const std::size_t components = cursor_.count(name, most_vtk_values),
                        tuples = cursor_.count(name, most_vtk_values);
      if (tuples > 0 && components > most_vtk_values / tuples)
        cursor_.refuse(Reason::bad_size, fmt::format("{} has {} x {} values, limit {}", name, tuples,
                                                     components, most_vtk_values));
      SurfaceWords ahead = cursor_.words();
      if (volume::small_letters(ahead.next()) == "string") {
        cursor_.words() = ahead;
        cursor_.take_line();
        texts(name, components * tuples);
      } else {
        cursor_.values(cursor_.type_of(name), components * tuples, name);
      }
    }
  }

  void texts(const std::string& name, std::size_t number) {
    const std::string small = volume::small_letters(name);
    const bool declares = small.find("space") != std::string::npos ||
                          small.find("coord") != std::string::npos || small.find("unit") != std::string::npos;
    for (std::size_t i = 0; i < number; ++i) {
      if (cursor_.words().rest().empty())
        cursor_.refuse(Reason::truncated, fmt::format("ends within FIELD {}", name));
      const std::string_view text =
          cursor_.is_text() ? cursor_.take_line() : cursor_.take(text_length(), name);
      if (declares) file_.declares += name + "=" + std::string(text.substr(0, longest_declaration)) + ";";
    }
  }

  /// Two bits of the first byte state how many bytes the length has.
  std::size_t text_length() {
    const auto first = static_cast<unsigned char>(cursor_.words().rest().front());
    const std::size_t bytes = std::size_t{8} >> (first >> 6);
    std::uint64_t length = 0;
    for (const char byte : cursor_.take(bytes, "a text's length"))
      length = length << 8 | static_cast<unsigned char>(byte);
    return static_cast<std::size_t>(length & ((std::uint64_t{1} << (8 * bytes - 2)) - 1));
  }

  const std::string& origin_;
  VtkCursor cursor_;
  bool has_offsets_ = false;
  std::vector<std::uint32_t> polygon_;
  SurfaceFile file_;
};

}  // namespace

bool is_legacy_vtk(std::string_view bytes) { return bytes.starts_with(vtk_magic); }

SurfaceFile legacy_vtk_surface(std::string_view bytes, const std::string& origin) {
  return LegacyVtkReader(bytes, origin).read();
}

}  // namespace helicarm::registration
