// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <charconv>

#include <fmt/format.h>

#include "helicarm/registration/surface_file.h"

namespace helicarm::registration {
namespace {

constexpr std::size_t most_obj_corners = 3 * max_triangles, most_obj_comments = 10000;

/// Statements that neither place nor bound a surface.
constexpr std::string_view passed_over[] = {"vt",       "vn",         "vp",       "g",   "o",     "s",
                                            "mg",       "mtllib",     "usemtl",   "p",   "l",     "maplib",
                                            "usemap",   "bevel",      "c_interp", "lod", "ctech", "stech",
                                            "d_interp", "shadow_obj", "trace_obj"};

/// Surfaces that are no polygons, and statements that fetch other files.
constexpr std::string_view not_polygons[] = {"cstype", "curv", "curv2", "surf", "con",
                                             "call",   "csh",  "bzp",   "bsp"};

bool is_listed(std::string_view word, const auto& list) {
  return std::ranges::find(list, word) != std::end(list);
}

/// Removes the first line, whose end may be LF, CR LF or CR.
std::string_view take_obj_line(std::string_view& rest) {
  const std::size_t end = std::min(rest.find_first_of("\r\n"), rest.size());
  const std::string_view line = rest.substr(0, end);
  rest.remove_prefix(std::min(end + (rest.substr(end).starts_with("\r\n") ? 2 : 1), rest.size()));
  return line;
}

class ObjReader {
 public:
  ObjReader(std::string_view bytes, const std::string& origin) : rest_(bytes), origin_(origin) {}

  SurfaceFile read() {
    const bool ended = rest_.ends_with('\n') || rest_.ends_with('\r');
    ends_within_line_ = !ended;
    std::string joined;
    while (!rest_.empty()) {
      std::string_view line = take_obj_line(rest_);
      ++line_;
      if (line.ends_with('\\')) {  // goes on in the next line
        joined.assign(line.substr(0, line.size() - 1));
        do {
          line = take_obj_line(rest_);
          ++line_;
          joined += ' ';
          joined += line.ends_with('\\') ? line.substr(0, line.size() - 1) : line;
        } while (line.ends_with('\\') && !rest_.empty());
        line = joined;
      }
      statement(line);
    }
    if (highest_ > file_.mesh.corners.size())
      refuse(Reason::bad_value,
             fmt::format("a face names vertex {} of {}", highest_, file_.mesh.corners.size()), highest_line_);
    if (!ended)
      file_.warnings.push_back({Reason::irregular_file,
                                fmt::format("{}: the last line has no end: faces may be missing", origin_)});
    return std::move(file_);
  }

 private:
  [[noreturn]] void refuse(Reason reason, const std::string& what, std::size_t line) const {
    throw BadInput(reason, fmt::format("{}: line {}: {}", origin_, line, what));
  }

  void statement(std::string_view line) {
    const std::string where = origin_ + ": line " + std::to_string(line_);
    SurfaceWords words(line, where);
    const std::string_view key = words.next();
    if (key.starts_with('#')) return comment(line);
    if (key.empty() || is_listed(key, passed_over)) return;
    if (key == "v") return vertex(words);
    if (key == "f" || key == "fo") return face(words);
    if (is_listed(key, not_polygons))
      refuse(Reason::unsupported,
             fmt::format(
                 "\"{}\": curved surfaces and other files are not read; save the surface as triangles", key),
             line_);
    refuse(Reason::bad_value, fmt::format("\"{}\" is no statement of OBJ", key.substr(0, 40)), line_);
  }

  void comment(std::string_view line) {
    if (line.size() <= longest_declaration && file_.declares.size() < most_obj_comments)
      file_.declares += std::string(line) + ";";
  }

  /// x y z, then a weight, or a colour of three numbers.
  void vertex(SurfaceWords& words) {
    const double x = words.number(), y = words.number(), z = words.number();
    if (file_.mesh.corners.size() == most_obj_corners)
      refuse(Reason::bad_size, fmt::format("more than {} vertices", most_obj_corners), line_);
    file_.mesh.corners.emplace_back(x, y, z);
    SurfaceWords weight = words;
    if (const std::string_view one = words.next();
        one.empty() || one.starts_with('#') || !words.next().empty())
      return;
    if (const double w = weight.number(); w != 1)
      refuse(Reason::unsupported, fmt::format("the vertex has the weight {}, must be 1 or absent", w), line_);
  }

  void face(SurfaceWords& words) {
    polygon_.clear();
    for (std::string_view word = words.next(); !word.empty() && !word.starts_with('#'); word = words.next())
      polygon_.push_back(corner(word));
    if (polygon_.size() < 3 && ends_within_line_ && rest_.empty())
      refuse(Reason::truncated, "the file ends within a face", line_);
    if (polygon_.size() < 3)
      refuse(Reason::bad_value, fmt::format("the face has {} corners, must be at least 3", polygon_.size()),
             line_);
    check_triangles(double(file_.mesh.triangles.size()) + double(polygon_.size()) - 2, origin_);
    add_polygon(file_.mesh, polygon_);
  }

  /// Of v, v/vt, v/vt/vn or v//vn, counted from 1, or backwards from the last vertex so far.
  std::uint32_t corner(std::string_view word) {
    const std::string_view digits = word.substr(0, word.find('/'));
    std::int64_t index = 0;
    const auto [stop, error] = std::from_chars(digits.data(), digits.data() + digits.size(), index);
    if (error == std::errc::invalid_argument || stop != digits.data() + digits.size())
      refuse(Reason::bad_value, fmt::format("\"{}\" is not a vertex number", word.substr(0, 40)), line_);
    const auto so_far = std::int64_t(file_.mesh.corners.size());
    const std::int64_t from_one = index < 0 ? so_far + 1 + index : index;
    if (error != std::errc() || from_one < 1 || from_one > std::int64_t(most_obj_corners))
      refuse(Reason::bad_value,
             fmt::format("a face names vertex {}, must be 1 to {} or -1 to -{}", digits.substr(0, 40), so_far,
                         so_far),
             line_);
    // A vertex may follow its face.
    if (std::size_t(from_one) > highest_) highest_ = std::size_t(from_one), highest_line_ = line_;
    return static_cast<std::uint32_t>(from_one - 1);
  }

  std::string_view rest_;
  const std::string& origin_;
  bool ends_within_line_ = false;
  std::size_t line_ = 0, highest_ = 0, highest_line_ = 0;
  std::vector<std::uint32_t> polygon_;
  SurfaceFile file_;
};

}  // namespace

bool is_obj(std::string_view bytes) {
  constexpr std::size_t looked_at = 4000, most_lines = 10000;
  if (bytes.substr(0, looked_at).find('\0') != std::string_view::npos) return false;
  const std::string none;
  for (std::size_t lines = 0; !bytes.empty() && lines < most_lines; ++lines) {
    const std::string_view key = SurfaceWords(take_obj_line(bytes), none).next();
    if (key.empty() || key.starts_with('#')) continue;
    return key == "v" || key == "f" || is_listed(key, passed_over);
  }
  return false;
}

SurfaceFile obj_surface(std::string_view bytes, const std::string& origin) {
  return ObjReader(bytes, origin).read();
}

}  // namespace helicarm::registration
