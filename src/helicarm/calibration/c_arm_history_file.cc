// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/c_arm_history_file.h"

#include <algorithm>
#include <cstdio>
#include <ctime>

#include <fmt/chrono.h>
#include <fmt/format.h>

#include "helicarm/core/codec.h"
#include "helicarm/core/file_lock.h"
#include "helicarm/core/files.h"
#include "helicarm/geometry/dense_matrix.h"

namespace helicarm::calibration {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr std::size_t most_entries = 10000;
constexpr Range tolerance_range_mm{0, 100};

std::string today_utc() { return fmt::format("{:%Y-%m-%d}", fmt::gmtime(std::time(nullptr))); }

void check_information(const Matrix3d& information, const JsonReader& reader) {
  if (!(geometry::symmetric_eigen(information).values[0] > 0) ||
      !information.isApprox(information.transpose(), 1e-9))
    reader.refuse(Reason::bad_value, "information_per_mm2", "is not symmetric and positive");
}

Eigen::Matrix3Xd by_calibrator_from(JsonReader& reader) {
  const Json& rows = reader.raw("by_calibrator");
  if (rows.is_null()) return {};
  const std::size_t columns = rows.is_array() && !rows.empty() ? rows[0].size() : 0;
  if (columns == 0 || columns > most_ball_errors)
    reader.refuse(Reason::bad_value, "by_calibrator",
                  fmt::format("is not 3 rows of 1 to {} numbers", most_ball_errors));
  const std::vector<double> values = reader.matrix("by_calibrator", 3, columns, {-1e6, 1e6});
  using Rows = Eigen::Matrix<double, 3, Eigen::Dynamic, Eigen::RowMajor>;
  return Eigen::Map<const Rows>(values.data(), 3, Eigen::Index(columns));
}

Json by_calibrator_json(const Eigen::Matrix3Xd& values) {
  Json rows = Json::array();
  for (const auto& row : values.rowwise()) rows.push_back(std::vector<double>(row.begin(), row.end()));
  return rows;
}

template <class Codec, class Entry>
void describe_ball_errors(Codec& codec, Entry& entry) {
  codec.custom(
      "calibrator", false, {{"type", "string"}, {"maxLength", 200}},
      "digest of the balls' positions and covariances, where the calibrator's file states errors of them",
      [&](JsonReader& reader) {
        if constexpr (!std::is_const_v<Entry>)
          entry.calibrator = reader.optional_text("calibrator").value_or("");
      },
      [&] { return entry.calibrator.empty() ? std::nullopt : std::optional<Json>(entry.calibrator); });
  codec.custom(
      "by_calibrator", false, {{"type", "array"}, {"minItems", 3}, {"maxItems", 3}},
      "3 rows: how the error of the estimate follows from unit errors of the balls' coordinates (by the "
      "symmetric root "
      "of their covariance), mm. These errors are the same in all images of one calibrator",
      [&](JsonReader& reader) {
        if constexpr (!std::is_const_v<Entry>) entry.by_calibrator = by_calibrator_from(reader);
      },
      [&] {
        return entry.by_calibrator.cols() > 0 ? std::optional(by_calibrator_json(entry.by_calibrator))
                                              : std::nullopt;
      });
  codec.check([&](JsonReader& reader) {
    if (entry.calibrator.empty() != (entry.by_calibrator.cols() == 0))
      reader.refuse(Reason::bad_value, "by_calibrator", "is given with \"calibrator\", and only then");
    if (entry.calibrator.empty()) return;
    const Matrix3d root =
        geometry::symmetric_eigen(entry.information).vectors *
        geometry::symmetric_eigen(entry.information).values.cwiseMax(0).cwiseSqrt().asDiagonal();
    const Eigen::Matrix3Xd whitened = root.transpose() * entry.by_calibrator;
    if (!(geometry::symmetric_eigen(Matrix3d(whitened * whitened.transpose())).values[2] < 1))
      reader.refuse(Reason::bad_value, "by_calibrator",
                    "states larger errors than the covariance that they are a part of");
  });
}

template <class Codec, class Entry>
void describe_acquisition(Codec& codec, Entry& entry) {
  codec.text("picture", entry.image, "digest of the image's pixels, so that each image is added only once",
             {0, 200});
  codec.text("view", entry.view, "its name", {0, 200});
  codec.vector(
      "estimate_mm", entry.estimate_mm, {-1e4, 1e4},
      "focal length, and principal point relative to the image centre (u, v; as if the image were not "
      "mirrored), in the receiver's plane");
  codec.matrix("information_per_mm2", entry.information, {-1e12, 1e12},
               "inverse covariance of these three, without any prior");
  codec.check([&](JsonReader& reader) { check_information(entry.information, reader); });
  codec.number("nominal_focal_mm", entry.nominal_focal_mm, {1, 1e4},
               "source distance that the image or its case stated; `null` in files of earlier versions");
  describe_ball_errors(codec, entry);
  codec.number("primary_deg", entry.primary_deg, {-360, 360},
               "positioner angle; `null` where the image does not state it");
  codec.number("secondary_deg", entry.secondary_deg, {-360, 360}, "likewise");
  codec.custom(
      "date", false, {{"type", "string"}},
      "day of the acquisition as it was told, else on which it was added, UTC (`2026-11-26`); `null` in "
      "files of "
      "earlier versions",
      [&](JsonReader& reader) {
        if constexpr (!std::is_const_v<Entry>) entry.date = reader.optional_text("date").value_or("");
      },
      [&] { return std::optional(entry.date.empty() ? Json() : Json(entry.date)); });
  codec.custom(
      "map", false, {{"type", {"object", "null"}}},
      "distortion [map](#mapjson) by the image's own plate, without covariance; absent without a plate",
      [&](JsonReader& reader) {
        const Json& map = reader.raw("map");
        if constexpr (!std::is_const_v<Entry>)
          if (!map.is_null())
            entry.plate = PlateMap{value_or_throw(rectification::distortion_map_from_json(map, "map"))};
      },
      [&] { return entry.plate ? std::optional(to_json(entry.plate->map)) : std::nullopt; });
  codec.custom(
      "field_radius_px", false, {{"type", "number"}, {"minimum", 0}, {"maximum", 1e5}},
      "of a map: farthest distance of its dots from their middle",
      [&](JsonReader& reader) {
        const double radius_px = reader.optional_number("field_radius_px", {0, 1e5}).value_or(0);
        if constexpr (!std::is_const_v<Entry>)
          if (entry.plate) entry.plate->field_radius_px = radius_px;
      },
      [&] { return entry.plate ? std::optional<Json>(entry.plate->field_radius_px) : std::nullopt; });
  codec.check([&](JsonReader& reader) {
    if (entry.plate && !(entry.plate->field_radius_px > 0))
      reader.refuse(Reason::bad_value, "field_radius_px", "must be positive where there is a map");
  });
}

template <class Codec, class Entries>
void describe_acquisitions(Codec& codec, const char* key, bool required, Entries& entries) {
  codec.list(key, entries, required, most_entries, "one entry per image, see below",
             [](auto& inner, auto& entry) { describe_acquisition(inner, entry); });
}

template <class Codec, class Run>
void describe_run(Codec& codec, Run& run) {
  codec.text("run", run.run, "digest of its first image, so that each run is added only once", {0, 200});
  codec.text("date", run.date, "its day, likewise", {0, 20});
  codec.integer("images", run.images, 1, 1000, "accepted");
  codec.number("arc_deg", run.arc_deg, {0, 3600}, "between the first and the last image");
  codec.number("radius_mm", run.radius_mm, {0, 1e4}, "from the isocentre to the farthest central ray");
  codec.vector("sigma_mm", run.sigma_mm, {0, 1e4},
               "standard deviation of the isocentre, in the calibrator's frame");
  codec.number("source_to_axis_mm", run.source_to_axis_mm, {0, 1e4}, "mean of the images");
}

/// machine.json (docs/formats.md).
template <class Codec, class History>
void describe_history(Codec& codec, History& history) {
  codec.custom(
      "format", true, {{"enum", {"helicarm-machine/1"}}}, "`\"helicarm-machine/1\"`",
      [](JsonReader& reader) { reader.choice("format", {"helicarm-machine/1"}); },
      [] { return std::optional<Json>("helicarm-machine/1"); });
  codec.object("tolerances", history.tolerances,
               "smaller differences from what the record predicts are no `c_arm_changed`",
               [](auto& inner, auto& tolerances) {
                 inner.number_or_default("focal_mm", tolerances.focal_mm, tolerance_range_mm,
                                         "of the source distance");
                 inner.number_or_default("principal_mm", tolerances.principal_mm, tolerance_range_mm,
                                         "of the principal point, per axis");
               });
  describe_acquisitions(codec, "shots", true, history.entries);
  codec.list("runs", history.runs, false, most_entries, "one entry per run of images, see below",
             [](auto& inner, auto& run) { describe_run(inner, run); });
}

}  // namespace

std::optional<std::chrono::sys_days> day_of(const std::string& date) {
  using namespace std::chrono;
  int year_number = 0, read = 0;
  unsigned month_number = 0, day_number = 0;
  if (std::sscanf(date.c_str(), "%4d-%2u-%2u%n", &year_number, &month_number, &day_number, &read) != 3 ||
      read != 10 || date.size() != 10)
    return {};
  const year_month_day of{year(year_number), month(month_number), day(day_number)};
  return of.ok() ? std::optional(sys_days(of)) : std::nullopt;
}

Expected<CArmHistory> read_history(const std::filesystem::path& path) {
  return read_json(path).and_then(
      [&](const Json& json) { return history_from_json(json, path.filename().string()); });
}

Expected<CArmHistory> history_at(const std::filesystem::path& path) {
  if (!std::filesystem::exists(path)) return CArmHistory();
  return read_history(path);
}

Expected<HistoryGrowth> add_to_history(const std::filesystem::path& path,
                                       std::span<const HistoryEntry> entries,
                                       const std::optional<RunIsocentre>& run,
                                       const std::optional<std::string>& date) {
  return guarded([&] {
    const std::string day = date.value_or(today_utc());
    value_or_throw(check_acquisition_day(day));
    value_or_throw(check_history_file(path));
    const FileLock lock = value_or_throw(FileLock::of(path));
    CArmHistory history = value_or_throw(history_at(lock.file()));
    const bool is_new = !std::filesystem::exists(lock.file());
    const Json before = to_json(history);
    std::vector<HistoryEntry> dated(entries.begin(), entries.end());
    for (HistoryEntry& entry : dated) entry.date = day;
    HistoryGrowth growth{history.entries.size(), add_entries(history, dated), is_new};
    forget_old_maps(history);
    if (run && std::ranges::find(history.runs, run->run, &RunIsocentre::run) == history.runs.end()) {
      history.runs.push_back(*run);
      history.runs.back().date = day;
    }
    if (history.entries.size() > most_entries)
      throw BadInput(Reason::cannot_write,
                     fmt::format("{}: holds {} acquisitions, limit {}: begin a new file", path.string(),
                                 growth.earlier, most_entries));
    const Json after = to_json(history);
    if (is_new || after != before) value_or_throw(write_file(lock.file(), to_text(after) + "\n"));
    return growth;
  });
}

Expected<void> check_acquisition_day(const std::string& date) {
  const std::string today = today_utc();
  if (day_of(date) && date <= today) return {};
  return fail(Reason::bad_value, fmt::format("date: \"{}\" is no day up to today, like {}", date, today));
}

Expected<void> check_history_file(const std::filesystem::path& path) {
  std::error_code ec;
  if (path.has_parent_path()) std::filesystem::create_directories(path.parent_path(), ec);
  return FileLock::of(path).map([](const FileLock&) {});
}

Expected<CArmHistory> history_from_json(const Json& json, const std::string& origin) {
  return guarded([&] {
    JsonReader reader(json, origin);
    CArmHistory history;
    FromJson codec(reader);
    describe_history(codec, history);
    reader.finish();
    return history;
  });
}

Json acquisitions_json(const std::vector<HistoryEntry>& entries) {
  ToJson codec(ToJson::Unset::null);
  describe_acquisitions(codec, "acquisitions", false, entries);
  return std::move(codec.json["acquisitions"]);
}

Json to_json(const CArmHistory& history) {
  ToJson codec(ToJson::Unset::null);
  describe_history(codec, history);
  if (history.runs.empty()) codec.json.erase("runs");  // which earlier versions do not know
  return std::move(codec.json);
}

Json history_schema() {
  const CArmHistory shape;
  return schema_of("machine.json", [&](ToSchema& codec) { describe_history(codec, shape); });
}

Expected<std::optional<RunIsocentre>> isocentre_of_result(const Json& json, const std::string& origin) {
  return guarded([&]() -> std::optional<RunIsocentre> {
    if (!json.is_object() || json.value("format", "") != "helicarm-sweep/1") return {};
    JsonReader reader(json, origin);
    std::vector<HistoryEntry> entries;
    FromJson codec(reader);
    describe_acquisitions(codec, "acquisitions", false, entries);
    const Json& path = reader.raw("path");
    if (!path.is_object() || entries.empty()) return {};
    JsonReader of_path(path, origin + ": path");
    RunIsocentre run{entries.front().image};
    const Json& frames = reader.raw("frames");
    run.images = int(std::ranges::count_if(frames, [](const Json& frame) {
      return frame.is_object() && frame.value("decision", "refuse") != "refuse";
    }));
    run.arc_deg = of_path.number("arc_deg", {0, 3600});
    run.radius_mm = of_path.number("isocentre_radius_mm", {0, 1e4});
    run.sigma_mm = Vector3d(of_path.numbers("isocentre_sigma_mm", 3, {0, 1e4}).data());
    run.source_to_axis_mm = of_path.number("source_to_axis_mm", {0, 1e4});
    return run;
  });
}

Expected<std::vector<HistoryEntry>> acquisitions_of_result(const Json& json, const std::string& origin) {
  return guarded([&] {
    JsonReader reader(json, origin);
    reader.choice("format", {"helicarm-result/1", "helicarm-sweep/1"});
    if (reader.choice("status", {"ok", "refused"}) == 1)
      throw BadInput(Reason::too_few_views, origin + ": is of a refused measurement");
    std::vector<HistoryEntry> entries;
    FromJson codec(reader);
    describe_acquisitions(codec, "acquisitions", false, entries);
    if (entries.empty())
      throw BadInput(Reason::too_few_views,
                     origin +
                         ": holds no acquisitions: its residuals contradict the noise model, or the images "
                         "the calibrator's file, they have no pixel "
                         "size or source distance, or an earlier version wrote it (measure again)");
    return entries;
  });
}

}  // namespace helicarm::calibration
