// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/c_arm.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <fmt/format.h>

#include "helicarm/calibration/c_arm_history_file.h"
#include "helicarm/core/files.h"
#include "helicarm/core/statistics.h"
#include "helicarm/pipeline/measure.h"
#include "helicarm/pipeline/prior.h"

namespace helicarm::pipeline {

namespace {

Expected<CArmAcquisitions> measured_acquisitions(const Case& the_case, unsigned threads) {
  RunOptions options;
  options.threads = threads;
  return measure(the_case, options).and_then([](const Result& result) -> Expected<CArmAcquisitions> {
    if (result.failure) return tl::unexpected<Failure>(*result.failure);
    if (result.calibration->entries.empty())
      return fail(
          Reason::residual_too_large,
          "the residuals contradict the noise model, the images contradict the calibrator's file, or no view "
          "alone determines its camera: the case "
          "says nothing of the C-arm (exchanged plate images, wrong pixel size or calibrator's file: "
          "`helicarm run` of it names causes)");
    return CArmAcquisitions{result.calibration->entries, result.warnings, {}};
  });
}

bool is_among(const std::vector<calibration::HistoryEntry>& acquired,
              const calibration::HistoryEntry& entry) {
  return std::ranges::find(acquired, entry.image, &calibration::HistoryEntry::image) != acquired.end();
}

bool holds_others(const calibration::CArmHistory& record,
                  const std::vector<calibration::HistoryEntry>& acquired) {
  return !std::ranges::all_of(record.entries, [&](const auto& entry) { return is_among(acquired, entry); });
}

}  // namespace

Expected<CArmAcquisitions> c_arm_acquisitions(const std::filesystem::path& from, unsigned threads) {
  std::filesystem::path result = from;
  if (std::filesystem::is_directory(from)) {
    const auto holds = [&](const char* name) { return std::filesystem::exists(from / name); };
    if (holds("case.json") || (!holds("result.json") && !holds("sweep.json")))
      return read_case(from).and_then(
          [&](const Case& the_case) { return measured_acquisitions(the_case, threads); });
    result /= holds("result.json") ? "result.json" : "sweep.json";
  }
  return read_json(result).and_then([&](const Json& json) {
    return guarded([&] {
      return CArmAcquisitions{value_or_throw(calibration::acquisitions_of_result(json, result.string())),
                              {},
                              value_or_throw(calibration::isocentre_of_result(json, result.string()))};
    });
  });
}

namespace {

/// Source distance from which the entries that do not know what they stated count: the nearest of the others'
/// near their own, else their own.
double nominal_focal_mm(const std::vector<calibration::HistoryEntry>& entries) {
  constexpr double near_mm = 30;  // three standard deviations of an unknown C-arm
  std::vector<double> own, stated;
  for (const calibration::HistoryEntry& entry : entries)
    if (entry.nominal_focal_mm)
      stated.push_back(*entry.nominal_focal_mm);
    else
      own.push_back(entry.estimate_mm.x());
  if (own.empty()) return median(std::move(stated));
  const double at = median(std::move(own));
  const auto nearest =
      std::ranges::min_element(stated, {}, [&](double focal_mm) { return std::abs(focal_mm - at); });
  return nearest != stated.end() && std::abs(*nearest - at) <= near_mm ? *nearest : at;
}

Expected<calibration::CArmModel> model_about(std::optional<double> focal_mm,
                                             const calibration::CArmHistory& record,
                                             const std::string& origin) {
  if (record.entries.empty())
    return fail(
        Reason::too_few_views,
        fmt::format("{}: holds no acquisition beside these; add cases with `helicarm c-arm add`", origin));
  calibration::CArmModel model = calibration::c_arm_model(
      record.entries, {focal_mm ? *focal_mm : nominal_focal_mm(record.entries), 0, 0}, unknown_c_arm());
  model.runs = record.runs;
  return model;
}

}  // namespace

Expected<calibration::CArmModel> model_of_record(const calibration::CArmHistory& record,
                                                 const std::string& origin) {
  return model_about({}, record, origin);
}

Expected<calibration::CArmCheck> check_against_record(std::vector<calibration::HistoryEntry> acquired,
                                                      calibration::CArmHistory record,
                                                      const std::string& origin) {
  std::erase_if(record.entries,
                [&](const calibration::HistoryEntry& entry) { return is_among(acquired, entry); });
  // As the prior of `--machine`, which begins from what the first view states.
  const auto stated = acquired.empty() ? std::nullopt : acquired.front().nominal_focal_mm;
  return model_about(stated, record, origin).map([&](const calibration::CArmModel& model) {
    return calibration::check_c_arm(model, acquired, record.tolerances);
  });
}

namespace {

/// Of maps that are not compared with the record's; nothing where it holds none.
std::optional<Warning> uncompared_maps(const calibration::CArmCheck& check) {
  if (check.uncompared_maps.empty() || check.recorded_maps == 0) return {};
  const bool are_few = check.recorded_maps < calibration::least_compared_maps;
  return Warning{
      Reason::plate_mismatch,
      fmt::format("the distortion of {} is not compared with the record: {}",
                  fmt::join(check.uncompared_maps, ", "),
                  are_few ? fmt::format("it holds {} maps, and {} tell what is usual", check.recorded_maps,
                                        calibration::least_compared_maps)
                          : "its image size or pixel size (another field of the intensifier) is not that of "
                            "the record's latest map"),
      {},
      {{"maps", double(check.recorded_maps)}}};
}

}  // namespace

std::vector<Warning> limits_of(const calibration::CArmCheck& check) {
  std::vector<Warning> limits;
  if (auto maps = uncompared_maps(check)) limits.push_back(*std::move(maps));
  std::vector<double> sigmas_mm;
  for (const calibration::AcquisitionCheck& one : check.acquisitions)
    if (!one.entry.primary_deg) sigmas_mm.push_back(one.sigma_mm.tail<2>().maxCoeff());
  if (sigmas_mm.empty()) return limits;
  const auto count = sigmas_mm.size();
  const double sigma_mm = median(std::move(sigmas_mm));
  limits.push_back(
      {Reason::intrinsics_weak,
       fmt::format(
           "{} of {} acquisitions state no positioner angles: each counts as a position of its own, and "
           "its principal point is predicted with a standard deviation of {:.1f} mm; smaller changes, and "
           "another C-arm that is alike, are not seen",
           count, check.acquisitions.size(), sigma_mm),
       {},
       {{"acquisitions", double(count)}, {"sigma_mm", sigma_mm}}});
  return limits;
}

Expected<calibration::HistoryGrowth> add_to_record(const std::filesystem::path& record,
                                                   const CArmAcquisitions& acquired,
                                                   const std::optional<std::string>& date) {
  return guarded([&] {
    const calibration::CArmHistory earlier = value_or_throw(calibration::history_at(record));
    if (holds_others(earlier, acquired.entries)) {
      const auto check = value_or_throw(check_against_record(acquired.entries, earlier, record.string()));
      if (const auto change = c_arm_change(check)) throw BadInput(*change);
    }
    return value_or_throw(calibration::add_to_history(record, acquired.entries, acquired.run, date));
  });
}

Expected<calibration::HistoryGrowth> add_to_record(const std::filesystem::path& record,
                                                   const Result& measured) {
  const bool is_told = measured.calibration && !measured.calibration->is_record_contradicted;
  return calibration::add_to_history(
      record, is_told ? measured.calibration->entries : std::vector<calibration::HistoryEntry>());
}

std::optional<Failure> c_arm_change(const calibration::CArmCheck& check) {
  if (const auto map = std::ranges::find_if(check.maps, &calibration::MapDifference::is_changed);
      !check.changed && map != check.maps.end())
    return Failure{
        Reason::c_arm_changed,
        fmt::format("the distortion is {:.2f} px rms from what the record predicts (sigma {:.2f}): the "
                    "intensifier or its settings have changed, the record is another C-arm's, or the stated "
                    "angles or "
                    "the plate's file is wrong",
                    map->error_px, map->sigma_px),
        map->view,
        {{"distortion_px", map->error_px}, {"sigma_px", map->sigma_px}}};
  if (!check.changed) return {};
  const auto& worst = *std::ranges::max_element(
      check.acquisitions, {}, [](const auto& one) { return one.is_changed ? one.chi2 : -1; });
  const Eigen::Vector3d off = worst.entry.estimate_mm - worst.predicted_mm;
  return Failure{
      Reason::c_arm_changed,
      fmt::format(
          "the source distance is {:+.2f} mm (sigma {:.2f}) and the principal point {:+.2f}, {:+.2f} mm "
          "(sigma {:.2f}, {:.2f}) from what the record predicts; chi-square of all {:.0f}, limit {:.0f}: "
          "the C-arm has changed, the record is another C-arm's, or the case's pixel size, plate or "
          "calibrator is wrong",
          off.x(), worst.sigma_mm.x(), off.y(), off.z(), worst.sigma_mm.y(), worst.sigma_mm.z(), check.chi2,
          check.limit),
      worst.entry.view,
      {{"focal_mm", off.x()},
       {"u0_mm", off.y()},
       {"v0_mm", off.z()},
       {"chi2", check.chi2},
       {"limit", check.limit}}};
}

}  // namespace helicarm::pipeline
