// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/c_arm_history.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>

#include <Eigen/LU>
#include <fmt/chrono.h>
#include <fmt/format.h>

#include "helicarm/calibration/c_arm_history_file.h"
#include "helicarm/calibration/c_arm_position.h"
#include "helicarm/core/codec.h"
#include "helicarm/core/file_lock.h"
#include "helicarm/core/files.h"
#include "helicarm/geometry/dense_matrix.h"

namespace helicarm::calibration {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double prior_weight = 4;
constexpr int rounds = 50;
constexpr double least_information = 1e-9;  // 1 / mm^2
constexpr std::size_t most_entries = 10000;
constexpr std::size_t most_maps = 60;  // of one field
constexpr Range tolerance_range_mm{0, 100};

Vector3d squares(double focal, double principal) {
  return {focal * focal, principal * principal, principal * principal};
}

double variance(double first, double observed, double n) {
  return (prior_weight * first * first + observed) / (prior_weight + n);
}

std::string today_utc() { return fmt::format("{:%Y-%m-%d}", fmt::gmtime(std::time(nullptr))); }

void check_information(const Matrix3d& information, const JsonReader& reader) {
  if (!(geometry::symmetric_eigen(information).values[0] > 0) ||
      !information.isApprox(information.transpose(), 1e-9))
    reader.refuse(Reason::bad_value, "information_per_mm2", "is not symmetric and positive");
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

LearnedIntrinsics learn_intrinsics(std::span<const HistoryEntry> entries, const Vector3d& nominal_mm,
                                   const CArmPrior& unknown) {
  LearnedIntrinsics known{nominal_mm, unknown};
  if (entries.empty()) return known;
  const double n = double(entries.size());
  const Matrix3d assumed =
      squares(unknown.focal->common, unknown.principal->common).cwiseInverse().asDiagonal();
  for (int round = 0; round < rounds; ++round) {
    const Vector3d sag = squares(known.prior.focal->of_view, known.prior.principal->of_view);
    Matrix3d information = assumed;
    Vector3d pull = assumed * nominal_mm;
    const Matrix3d of_sag = sag.cwiseInverse().asDiagonal();
    const auto posterior_of = [&](const HistoryEntry& entry) -> Matrix3d {
      return (entry.information + of_sag).inverse();
    };
    for (const HistoryEntry& entry : entries) {
      // The inverse of information^-1 + sag; the information itself may be too small to be inverted.
      const Matrix3d of_mean = entry.information * posterior_of(entry) * of_sag;
      information += of_mean;
      pull += of_mean * entry.estimate_mm;
    }
    const Matrix3d covariance = information.inverse();
    known.mean_mm = covariance * pull;
    Vector3d observed = Vector3d::Zero();
    for (const HistoryEntry& entry : entries) {
      const Matrix3d posterior = posterior_of(entry);
      const Matrix3d gain = posterior * entry.information;
      const Vector3d variation = gain * (entry.estimate_mm - known.mean_mm);
      observed += (posterior + gain * covariance * gain.transpose()).diagonal() + variation.cwiseAbs2();
    }
    known.prior.focal = {std::sqrt(covariance(0, 0)),
                         std::sqrt(variance(unknown.focal->of_view, observed(0), n))};
    known.prior.principal = {
        std::sqrt((covariance(1, 1) + covariance(2, 2)) / 2),
        std::sqrt(variance(unknown.principal->of_view, (observed(1) + observed(2)) / 2, n))};
  }
  return known;
}

std::optional<HistoryEntry> history_entry_of(const ViewFiducials& view, const std::string& image,
                                             const CommonPrior& unknown) {
  if (!view.prior.focal_px || !view.prior.principal_px) return std::nullopt;
  CalibrationOptions options;
  options.common = unknown;
  options.rejection_probability = 0;  // outliers have been removed already
  const auto alone = calibrate({view}, options);
  if (!alone) return std::nullopt;
  const CalibratedView& calibrated = alone->views[0];
  const geometry::Intrinsics& k = calibrated.view.intrinsics;
  const double hand = k.fx < 0 ? -1 : 1;
  Eigen::Matrix<double, 3, 4> in_mm;
  in_mm << 0.5 * hand, 0.5, 0, 0, 0, 0, hand, 0, 0, 0, 0, 1;
  in_mm /= view.prior.unit_px;
  const Vector3d nominal(*view.prior.focal_px / view.prior.unit_px, 0, 0);
  const Vector3d posterior = in_mm * Eigen::Vector4d(k.fx, k.fy, k.u0 - view.prior.principal_px->x(),
                                                     k.v0 - view.prior.principal_px->y());
  const Matrix3d information =
      (in_mm * calibrated.covariance.topLeftCorner<4, 4>() * in_mm.transpose()).inverse();
  const auto variance_of = [](const IntrinsicsVariation& d) { return std::hypot(d.common, d.of_view); };
  const Matrix3d assumed = squares(variance_of(*unknown.c_arm.focal), variance_of(*unknown.c_arm.principal))
                               .cwiseInverse()
                               .asDiagonal();
  const auto [values, vectors] = geometry::symmetric_eigen(information - assumed);
  const Matrix3d own = vectors * values.cwiseMax(least_information).asDiagonal() * vectors.transpose();
  // Along a direction that the image does not determine, the posterior is as good as any estimate.
  constexpr double least_determined = 1e-4;  // of 100 mm
  const Vector3d variances = (values.array() < least_determined).select(0, values.array().inverse());
  // The posterior is the mean of estimate and nominal values, weighted by `own` and `assumed`.
  const Vector3d estimate = posterior + vectors * (variances.asDiagonal() *
                                                   (vectors.transpose() * (assumed * (posterior - nominal))));
  return HistoryEntry{image, view.name, estimate, own};
}

geometry::IntrinsicsPrior learned_prior(geometry::IntrinsicsPrior prior, const LearnedIntrinsics& knowledge,
                                        bool mirrored) {
  prior.focal_px = knowledge.mean_mm.x() * prior.unit_px;
  *prior.principal_px +=
      prior.unit_px * Eigen::Vector2d((mirrored ? -1 : 1) * knowledge.mean_mm.y(), knowledge.mean_mm.z());
  return prior;
}

Expected<CArmHistory> read_history(const std::filesystem::path& path) {
  return read_json(path).and_then(
      [&](const Json& json) { return history_from_json(json, path.filename().string()); });
}

Expected<CArmHistory> history_at(const std::filesystem::path& path) {
  if (!std::filesystem::exists(path)) return CArmHistory();
  return read_history(path);
}

bool are_of_one_field(const rectification::DistortionMap& a, const rectification::DistortionMap& b) {
  constexpr double tolerance = 0.02;
  const double pixel_a = a.rectified_pixel_mm.value_or(0), pixel_b = b.rectified_pixel_mm.value_or(0);
  return a.width == b.width && a.height == b.height && std::abs(pixel_a - pixel_b) <= tolerance * pixel_b;
}

std::vector<std::size_t> entries_with_latest_maps(std::span<const HistoryEntry> entries) {
  constexpr double alike = 0.99;  // correlation: within 6 degrees
  constexpr int most_alike = 4;
  std::vector<std::size_t> chosen;
  const auto direction_of = [&](std::size_t i) {
    return c_arm_direction(entries[i].primary_deg, entries[i].secondary_deg);
  };
  for (std::size_t i = entries.size(); i-- > 0 && chosen.size() < most_maps;) {
    if (!entries[i].plate) continue;
    if (!chosen.empty() && !are_of_one_field(entries[i].plate->map, entries[chosen.front()].plate->map))
      continue;
    const auto near_it = [&](std::size_t k) {
      return position_correlation(direction_of(i), direction_of(k)) > alike;
    };
    if (std::ranges::count_if(chosen, near_it) < most_alike) chosen.push_back(i);
  }
  std::ranges::reverse(chosen);
  return chosen;
}

void forget_old_maps(CArmHistory& history) {
  std::vector<HistoryEntry> unseen = history.entries;  // of the fields that were not looked at yet
  for (auto kept = entries_with_latest_maps(unseen); !kept.empty(); kept = entries_with_latest_maps(unseen)) {
    const rectification::DistortionMap latest = unseen[kept.back()].plate->map;
    for (std::size_t i = 0; i < unseen.size(); ++i)
      if (unseen[i].plate && are_of_one_field(unseen[i].plate->map, latest)) {
        unseen[i].plate.reset();
        if (!std::ranges::binary_search(kept, i)) history.entries[i].plate.reset();
      }
  }
}

std::size_t add_entries(CArmHistory& history, std::span<const HistoryEntry> entries) {
  const std::size_t earlier = history.entries.size();
  for (const HistoryEntry& entry : entries) {
    const auto held = std::ranges::find(history.entries, entry.image, &HistoryEntry::image);
    if (held == history.entries.end())
      history.entries.push_back(entry);
    else if (!held->plate)
      held->plate = entry.plate;
  }
  return history.entries.size() - earlier;
}

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
      throw BadInput(
          Reason::too_few_views,
          origin +
              ": holds no acquisitions: its residuals contradict the noise model, its images have no pixel "
              "size or source distance, or an earlier version wrote it (measure again)");
    return entries;
  });
}

}  // namespace helicarm::calibration
