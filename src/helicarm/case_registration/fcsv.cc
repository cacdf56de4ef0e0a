// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/fcsv.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include <fmt/format.h>

#include "helicarm/core/json.h"
#include "helicarm/core/text.h"
#include "helicarm/volume/declared.h"

namespace helicarm::case_registration {
namespace {

using Eigen::Vector3d;

using FcsvFields = std::vector<std::string>;

/// Slicer 5 writes two values behind the named columns: the status of the position, and whether a program
/// placed the point.
constexpr std::size_t unnamed_columns = 2;
constexpr std::string_view status_defined = "2";

std::string_view without_blanks(std::string_view text) {
  const std::size_t first = std::min(text.find_first_not_of(" \t\r"), text.size());
  return text.substr(first, text.find_last_not_of(" \t\r") + 1 - first);
}

/// A field that begins with a quote ends with the next single one; doubled quotes stand for one.
FcsvFields fields_of(std::string_view line, const std::string& where) {
  FcsvFields fields(1);
  bool quoted = false;
  for (std::size_t i = 0; i < line.size(); ++i) {
    std::string& field = fields.back();
    if (quoted && line[i] == '"' && line.substr(i + 1).starts_with('"')) {
      field += line[i++];
    } else if (line[i] == '"' && (quoted || without_blanks(field).empty())) {
      quoted = !quoted;
    } else if (line[i] == ',' && !quoted) {
      fields.emplace_back();
    } else {
      field += line[i];
    }
  }
  if (quoted) throw BadInput(Reason::truncated, fmt::format("{}: a quoted field does not end", where));
  for (std::string& field : fields) field = without_control_characters(std::string(without_blanks(field)));
  return fields;
}

bool is_utf_8(std::string_view text) {
  try {
    return !Json(text).dump().empty();
  } catch (const Json::type_error&) {
    return false;
  }
}

class FcsvReader {
 public:
  explicit FcsvReader(const std::string& origin) : origin_(origin) {}

  std::vector<PlanPoint> points(std::string_view bytes) {
    if (bytes.starts_with("\xEF\xBB\xBF")) bytes.remove_prefix(3);
    while (!bytes.empty()) {
      const std::size_t end = std::min(bytes.find_first_of("\r\n"), bytes.size());
      const std::string_view line = bytes.substr(0, end);
      bytes.remove_prefix(std::min(end + 1, bytes.size()));
      if (without_blanks(line).empty()) continue;
      line.starts_with('#') ? comment(line.substr(1)) : point(line);
    }
    const Vector3d to_lps = factors();
    for (PlanPoint& point : points_) point.in_model = point.in_model.cwiseProduct(to_lps);
    return std::move(points_);
  }

 private:
  [[noreturn]] void refuse(Reason reason, const std::string& problem) const {
    throw BadInput(reason, fmt::format("{}: {}", origin_, problem));
  }

  void comment(std::string_view text) {
    constexpr std::size_t most_comments = 10000;
    const std::size_t equals = text.find('=');
    if (equals != std::string_view::npos && without_blanks(text.substr(0, equals)) == "columns") {
      if (!columns_.empty()) refuse(Reason::bad_value, "two lines \"# columns = \": remove the wrong one");
      columns_ = fields_of(text.substr(equals + 1), origin_ + ": columns");
      for (const char* name : {"x", "y", "z", "label"})
        if (const auto count = std::ranges::count(columns_, name); count > 1 || (count == 0 && *name != 'l'))
          refuse(Reason::bad_value,
                 fmt::format("columns: \"{}\" occurs {} times, must occur once", name, count));
    } else if (declares_.size() + text.size() < most_comments) {
      declares_ += std::string(text) + ";";
    }
  }

  void point(std::string_view line) {
    const std::string where = fmt::format("{}: row {}", origin_, ++row_);
    if (columns_.empty())
      refuse(Reason::bad_value,
             "no line \"# columns = \" names the columns before the first point: add \"# columns = "
             "id,x,y,z,ow,ox,oy,oz,vis,sel,lock,label,desc,associatedNodeID\" or what they are");
    if (!is_utf_8(line))
      refuse(Reason::bad_value, fmt::format("row {}: is not UTF-8 (Latin-1?): save the file as UTF-8", row_));
    const FcsvFields fields = fields_of(line, where);
    if (fields.size() != columns_.size() && fields.size() != columns_.size() + unnamed_columns)
      throw BadInput(Reason::bad_value, fmt::format("{}: {} fields, \"# columns = \" names {}", where,
                                                    fields.size(), columns_.size()));
    if (fields.size() > columns_.size() && fields[columns_.size()] != status_defined) return;
    const std::size_t label = column("label");
    points_.push_back({label < fields.size() ? fields[label].substr(0, 100) : "",
                       {number(fields, "x", where), number(fields, "y", where), number(fields, "z", where)}});
  }

  std::size_t column(const char* name) const {
    const auto found = std::ranges::find(columns_, name);
    return found == columns_.end() ? ~std::size_t{0} : std::size_t(found - columns_.begin());
  }

  double number(const FcsvFields& fields, const char* name, const std::string& where) const {
    std::string_view field = fields[column(name)];
    if (field.starts_with('+')) field.remove_prefix(1);
    double value = 0;
    const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), value);
    const auto shown = fmt::format("{}: {} is \"{}\"", where, name, field.substr(0, 40));
    if (error == std::errc::result_out_of_range || (error == std::errc() && !std::isfinite(value)))
      throw BadInput(Reason::not_finite, shown + ", must be finite");
    if (error != std::errc() || end != field.data() + field.size())
      throw BadInput(Reason::bad_value, shown + ", must be a number");
    return value;
  }

  /// Slicer up to 4.10 writes the system's number, RAS by default; later versions write its name.
  Vector3d factors() const {
    const volume::Declared declared = volume::declared_in(declares_, origin_);
    const std::string system = declared.space == "0" ? "RAS" : declared.space == "1" ? "LPS" : declared.space;
    if (system.empty())
      refuse(Reason::bad_value,
             "no line \"# CoordinateSystem = \" states whether the points are in LPS or RAS: the files of "
             "Slicer 3 lack "
             "it; save them as markups (.mrk.json), or add \"# CoordinateSystem = RAS\" or LPS");
    const Vector3d signs = volume::declared_space(system, origin_ + ": CoordinateSystem");
    return declared.unit.empty() ? signs
                                 : Vector3d(signs * volume::declared_unit(declared.unit, origin_ + ": unit"));
  }

  const std::string& origin_;
  std::string declares_;
  FcsvFields columns_;
  std::size_t row_ = 0;
  std::vector<PlanPoint> points_;
};

}  // namespace

bool is_fcsv(const std::filesystem::path& path, std::string_view bytes) {
  if (bytes.starts_with("\xEF\xBB\xBF")) bytes.remove_prefix(3);
  return volume::small_letters(path.extension().string()) == ".fcsv" ||
         bytes.starts_with("# Markups fiducial file") || bytes.starts_with("# Fiducial List file");
}

std::vector<PlanPoint> fcsv_points(std::string_view bytes, const std::string& origin) {
  if (is_utf_16(bytes)) throw BadInput(Reason::bad_value, origin + ": is UTF-16: save it as UTF-8");
  return FcsvReader(origin).points(bytes);
}

}  // namespace helicarm::case_registration
