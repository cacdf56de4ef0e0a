// SPDX-License-Identifier: Apache-2.0
#include "helicarm/migration/migration_files.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "helicarm/core/csv.h"
#include "helicarm/core/earlier_files.h"
#include "helicarm/core/files.h"
#include "helicarm/geometry/rotation.h"
#include "helicarm/geometry/view_json.h"
#include "helicarm/pipeline/result.h"
#include "helicarm/report/markup.h"
#include "helicarm/report/table.h"
#include "helicarm/track/motion_charts.h"

namespace helicarm::migration {
namespace {

using geometry::json_list, geometry::json_rows;

constexpr double in_degrees = 180 / EIGEN_PI;
constexpr std::array numbers{"rx_deg", "ry_deg", "rz_deg", "tx_mm", "ty_mm", "tz_mm"};

/// The six numbers: rotations in degrees, then translations in mm.
Eigen::Matrix<double, 6, 1> six_of(const BodyMigration& body) {
  Eigen::Matrix<double, 6, 1> six;
  six << body.rotation_deg, body.translation_mm;
  return six;
}

Eigen::Matrix<double, 6, 1> sigma_of_six(const BodyMigration& body) {
  Eigen::Matrix<double, 6, 1> sigma = body.covariance.diagonal().cwiseSqrt();
  sigma.head<3>() *= in_degrees;
  return sigma;
}

Json json_of(const MatchedSegment& segment) {
  Json json = {{"name", segment.name}, {"markers", Json::array()}};
  for (std::size_t n = 0; n < segment.first.size(); ++n)
    json["markers"].push_back({{"first", segment.first[n]},
                               {"second", segment.second[n]},
                               {"residual_mm", segment.fit.residual_mm[n]}});
  json["missing"] = segment.missing;
  json["loose"] = segment.loose;
  json["condition_per_m"] = segment.condition_per_m;
  json["mean_error_mm"] = segment.fit.mean_error_mm;
  json["ray_gap_mm"] = segment.ray_gap_mm ? Json(*segment.ray_gap_mm) : Json(nullptr);
  json["second_from_first"] = json_rows(segment.fit.second_from_first.matrix());
  return json;
}

Json json_of(const BodyMigration& body, const Migration& migration) {
  const Eigen::Matrix<double, 6, 1> sigma = sigma_of_six(body);
  return {{"name", migration.segments[body.segment].name},
          {"rotation_deg", json_list(body.rotation_deg)},
          {"translation_mm", json_list(body.translation_mm)},
          {"sigma",
           {{"rotation_deg", json_list(sigma.head<3>())}, {"translation_mm", json_list(sigma.tail<3>())}}},
          {"limits_95",
           {{"rotation_deg", json_list(migration.width_of_95 * sigma.head<3>())},
            {"translation_mm", json_list(migration.width_of_95 * sigma.tail<3>())}}},
          {"covariance", json_rows(body.covariance)},
          {"centre_mm", json_list(body.centre)},
          {"turn_deg", body.turn_deg},
          {"motion", json_rows(body.motion.matrix())},
          {"mtpm_mm", body.mtpm_mm},
          {"mtpm_sigma_mm", body.mtpm_sigma_mm},
          {"mtpm_marker", body.mtpm_marker}};
}

Json json_of(const NamedMigration& named) {
  const Migration& migration = named.migration;
  Json json = {{"first", named.first},
               {"second", named.second},
               {"reference", migration.segments.front().name},
               {"errors", migration.is_by_residuals ? "residuals" : "stated"},
               {"bodies", Json::array()},
               {"segments", Json::array()}};
  for (const BodyMigration& body : migration.bodies) json["bodies"].push_back(json_of(body, migration));
  for (const MatchedSegment& segment : migration.segments) json["segments"].push_back(json_of(segment));
  return json;
}

Json json_of(const Precision& precision) {
  Json json = {{"name", precision.body}, {"n", precision.n}};
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const ZeroMotion& number = precision.numbers[i];
    json[numbers[i]] = {{"mean", number.mean},
                        {"sd", number.sd},
                        {"limit_95", number.limit_95},
                        {"stated_sigma", number.stated_sigma}};
  }
  json["mtpm_mm"] = {{"mean", precision.mtpm_mean_mm}, {"largest", precision.mtpm_largest_mm}};
  return json;
}

std::string rows_of(const NamedMigration& named, const char* kind) {
  std::string rows;
  for (const BodyMigration& body : named.migration.bodies) {
    const MatchedSegment &segment = named.migration.segments[body.segment],
                         &reference = named.migration.segments.front();
    rows += fmt::format("{},{},{},{},{}", kind, csv_field(named.first), csv_field(named.second),
                        csv_field(segment.name), csv_field(reference.name));
    for (const double value : six_of(body)) rows += fmt::format(",{:.9g}", value);
    for (const double value : sigma_of_six(body)) rows += fmt::format(",{:.6g}", value);
    rows += fmt::format(",{:.9g},{:.6g},{},{:.6g},{:.6g},{:.6g},{:.6g}\n", body.mtpm_mm, body.mtpm_sigma_mm,
                        segment.first.size(), segment.condition_per_m, reference.condition_per_m,
                        segment.fit.mean_error_mm, reference.fit.mean_error_mm);
  }
  return rows;
}

/// A row of the report's table of migrations.
struct Row {
  std::string name;
  const BodyMigration* body;
  const Migration* migration;
};

std::string migrations_table(const std::string& title, const std::vector<Row>& rows) {
  constexpr std::array titles{"Rx, °", "Ry, °", "Rz, °", "Tx, mm", "Ty, mm", "Tz, mm"};
  std::vector<report::ColumnOf<Row>> columns{
      {{"Body", "Moving segment"}, [](const Row& row) { return report::Cell{row.name}; }}};
  for (std::size_t i = 0; i < titles.size(); ++i)
    columns.push_back({{titles[i], "With half the width of its 95 % interval", true}, [i](const Row& row) {
                         const auto at = Eigen::Index(i);
                         return report::Cell{
                             fmt::format("{:.3f} ± {:.3f}", six_of(*row.body)[at],
                                         row.migration->width_of_95 * sigma_of_six(*row.body)[at])};
                       }});
  columns.push_back(
      {{"MTPM, mm", "Maximum total point motion, with half the width of its 95 % interval", true},
       [](const Row& row) {
         return report::Cell{fmt::format("{:.3f} ± {:.3f}", row.body->mtpm_mm,
                                         row.migration->width_of_95 * row.body->mtpm_sigma_mm)};
       }});
  return html_of(report::table_of<Row>(title, columns, rows));
}

std::string segments_table(const Migration& migration) {
  return html_of(report::table_of<MatchedSegment>(
      "Segments",
      {{{"Segment", "The first is the reference"},
        [](const MatchedSegment& s) { return report::Cell{s.name}; }},
       {{"Markers", "In both examinations", true},
        [](const MatchedSegment& s) { return report::Cell{std::to_string(s.first.size())}; }},
       {{"Condition, 1/m", "Condition number, limit 120", true},
        [](const MatchedSegment& s) {
          return report::Cell{fmt::format("{:.0f}", s.condition_per_m),
                              s.condition_per_m > condition_limit_per_m};
        }},
       {{"Mean error, mm", "Mean error of rigid-body fitting, limit 0.35", true},
        [](const MatchedSegment& s) { return report::Cell{report::fixed(s.fit.mean_error_mm, 3)}; }},
       {{"Crossing-line distance, mm", "Largest of its markers", true},
        [](const MatchedSegment& s) { return report::Cell{report::fixed(s.ray_gap_mm, 3)}; }},
       {{"Missing or loose", "Markers of the first examination that do not count"},
        [](const MatchedSegment& s) {
          std::vector<std::string> out = s.missing;
          out.insert(out.end(), s.loose.begin(), s.loose.end());
          return report::Cell{fmt::format("{}", fmt::join(out, ", "))};
        }}},
      migration.segments));
}

struct PrecisionRow {
  std::string body, number;
  int n;
  ZeroMotion value;
};

std::string precision_table(const std::vector<Precision>& precisions) {
  std::vector<PrecisionRow> rows;
  for (const Precision& precision : precisions)
    for (std::size_t i = 0; i < numbers.size(); ++i)
      rows.push_back({precision.body, numbers[i], precision.n, precision.numbers[i]});
  if (rows.empty()) return "";
  const auto column = [](const char* title, const char* what, double ZeroMotion::*part) {
    return report::ColumnOf<PrecisionRow>{{title, what, true}, [part](const PrecisionRow& row) {
                                            return report::Cell{report::fixed(row.value.*part, 4)};
                                          }};
  };
  return html_of(report::table_of<PrecisionRow>(
      "Precision by double examinations",
      {{{"Body", "Moving segment"}, [](const PrecisionRow& row) { return report::Cell{row.body}; }},
       {{"Number", "With its unit"}, [](const PrecisionRow& row) { return report::Cell{row.number}; }},
       {{"Pairs", "Double examinations", true},
        [](const PrecisionRow& row) { return report::Cell{std::to_string(row.n)}; }},
       column("Mean", "Zero without bias", &ZeroMotion::mean),
       column("SD", "About the mean", &ZeroMotion::sd),
       column("95 % limit", "t(n - 1) standard deviations: a larger migration is significant",
              &ZeroMotion::limit_95),
       column("Stated", "Standard deviation that the migrations state, rms", &ZeroMotion::stated_sigma)},
      rows));
}

}  // namespace

Expected<Eigen::Matrix3d> read_axes(const std::filesystem::path& path) {
  return guarded([&] {
    const CsvTable table = value_or_throw(read_csv(path, {"axis", "x", "y", "z"}, {}));
    Eigen::Matrix3d axes = Eigen::Matrix3d::Zero();
    for (std::size_t row = 0; row < table.rows(); ++row) {
      const std::string& axis = table.text(row, "axis");
      if (axis.size() != 1 || axis[0] < 'x' || axis[0] > 'z' || !axes.col(axis[0] - 'x').isZero(0))
        throw BadInput(Reason::bad_value, fmt::format("{}: row {}: \"{}\" is not x, y or z, each once",
                                                      path.filename().string(), row + 2, axis));
      axes.col(axis[0] - 'x') << table.number(row, "x"), table.number(row, "y"), table.number(row, "z");
    }
    constexpr double rounding = 1e-3;
    if (!(axes.transpose() * axes).isIdentity(rounding) || !(axes.determinant() > 0))
      throw BadInput(
          Reason::bad_value,
          fmt::format("{}: x, y and z are not three perpendicular unit vectors, right-handed, within "
                      "{:g}",
                      path.filename().string(), rounding));
    return geometry::nearest_rotation(axes);
  });
}

Expected<MigrationAnswer> answer(const MigrationRequest& request) {
  return guarded([&] {
    MigrationOptions options = request.options;
    if (request.axes) options.axes = value_or_throw(read_axes(*request.axes));
    const auto exams = [&](const std::filesystem::path& first, const std::filesystem::path& second) {
      return ExamPair{value_or_throw(read_exam(first, request.frame)),
                      value_or_throw(read_exam(second, request.frame))};
    };
    const auto between = [&](const ExamPair& pair) {
      return NamedMigration{pair.first.name, pair.second.name,
                            value_or_throw(migrate(pair.first, pair.second, options))};
    };
    MigrationAnswer migration_answer{between(exams(request.first, request.second)), {}, {}, options.axes};
    // A file may list the segments in another order: all are against the same bone.
    options.reference = migration_answer.migration.migration.segments.front().name;
    std::vector<ExamPair> pairs;
    for (const auto& [first, second] : request.doubles) {
      auto one = guarded([&] {
        ExamPair pair = exams(first, second);
        NamedMigration migration = between(pair);
        require_new_exams(pair, pairs);
        pairs.push_back(std::move(pair));
        return migration;
      });
      if (!one) {
        one.error().message = fmt::format("double examination {} and {}: {}", first.filename().string(),
                                          second.filename().string(), one.error().message);
        throw BadInput(one.error());
      }
      migration_answer.doubles.push_back(*std::move(one));
    }
    migration_answer.precision = precision_of(migration_answer.doubles);
    return migration_answer;
  });
}

std::vector<Warning> all_warnings(const MigrationAnswer& answer) {
  std::vector<Warning> all = answer.migration.migration.warnings;
  for (const NamedMigration& each : answer.doubles)
    for (Warning warning : each.migration.warnings) {
      warning.message =
          fmt::format("double examination {} and {}: {}", each.first, each.second, warning.message);
      all.push_back(std::move(warning));
    }
  return all;
}

Json refused_json(const Failure& refusal) {
  return {{"format", "helicarm-migration/1"},
          {"status", "refused"},
          {"failure", pipeline::to_json(refusal)},
          {"warnings", Json::array()},
          {"version", HELICARM_VERSION}};
}

Json to_json(const MigrationAnswer& answer) {
  Json json = {{"format", "helicarm-migration/1"},
               {"status", "ok"},
               {"failure", nullptr},
               {"warnings", Json::array()},
               {"axes", json_rows(answer.axes)}};
  for (const Warning& warning : all_warnings(answer)) json["warnings"].push_back(pipeline::to_json(warning));
  json.update(json_of(answer.migration));
  json["double"] = Json::array();
  for (const NamedMigration& each : answer.doubles) json["double"].push_back(json_of(each));
  json["precision"] = Json::array();
  for (const Precision& each : answer.precision) json["precision"].push_back(json_of(each));
  json["version"] = HELICARM_VERSION;
  return json;
}

std::string migration_csv(const MigrationAnswer& answer) {
  std::string csv = "kind,first,second,body,reference";
  for (const char* number : numbers) csv += fmt::format(",{}", number);
  for (const char* number : numbers) csv += fmt::format(",s_{}", number);
  csv +=
      ",mtpm_mm,s_mtpm_mm,markers,condition_per_m,reference_condition_per_m,mean_error_mm,"
      "reference_mean_error_mm\n";
  csv += rows_of(answer.migration, "migration");
  for (const NamedMigration& each : answer.doubles) csv += rows_of(each, "double");
  return csv;
}

std::string migration_report(const MigrationAnswer& answer) {
  const Migration& migration = answer.migration.migration;
  std::string cards = "<div class=\"cards\">";
  std::vector<Row> rows, of_doubles;
  for (const BodyMigration& body : migration.bodies) {
    const std::string& name = migration.segments[body.segment].name;
    rows.push_back({name, &body, &migration});
    cards += track::report_card(fmt::format("{:.2f} mm", body.mtpm_mm),
                                "maximum total point motion of " + report::escaped(name));
  }
  for (const NamedMigration& each : answer.doubles)
    for (const BodyMigration& body : each.migration.bodies)
      of_doubles.push_back(
          {fmt::format("{}, {} – {}", each.migration.segments[body.segment].name, each.first, each.second),
           &body, &each.migration});
  std::string body =
      cards + "</div>\n" + track::warnings_list(all_warnings(answer)) +
      migrations_table(fmt::format("Migration against {}, {} – {}", migration.segments.front().name,
                                   answer.migration.first, answer.migration.second),
                       rows) +
      segments_table(migration) + precision_table(answer.precision);
  if (!of_doubles.empty()) body += migrations_table("Double examinations", of_doubles);
  return report::page_html("helicarm migration", "Migration between two examinations", body,
                           ". Millimetres and degrees; rotations about the fixed axes x, then y, then z.");
}

Expected<void> write_migration(const MigrationAnswer& answer, const std::filesystem::path& folder) {
  return write_file(folder / "migration.csv", migration_csv(answer))
      .and_then([&] { return write_file(folder / "report.html", migration_report(answer)); })
      .and_then([&] { return write_file(folder / "migration.json", to_text(to_json(answer)) + "\n"); });
}

Expected<MigrationAnswer> answer_into(const MigrationRequest& request, const std::filesystem::path& folder) {
  return guarded([&] {
    forget_migration(folder);
    const auto found = answer(request);
    if (!found && exit_code(found.error().reason) == 3)
      value_or_throw(write_file(folder / "migration.json", to_text(refused_json(found.error())) + "\n"));
    MigrationAnswer migration_answer = value_or_throw(found);
    value_or_throw(write_migration(migration_answer, folder));
    return migration_answer;
  });
}

void forget_migration(const std::filesystem::path& folder) {
  forget_files(folder, {"migration.csv", "report.html", "migration.json"});
}

}  // namespace helicarm::migration
