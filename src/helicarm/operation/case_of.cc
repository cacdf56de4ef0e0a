// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/case_of.h"

#include <algorithm>

#include "helicarm/core/files.h"
#include "helicarm/geometry/view_json.h"
#include "helicarm/operation/records.h"
#include "helicarm/report/report.h"
#include "helicarm/xray/digest.h"

namespace helicarm::operation {
namespace fs = std::filesystem;

namespace {

constexpr std::uintmax_t most_file_bytes = std::uintmax_t{256} << 20;

Json without(Json json, const char* key) {
  json.erase(key);
  return json;
}

Json image_json(const CaseImage& image) {
  return {{"name", image.name},
          {"image", image.name + ".dcm"},
          {"poses", without(to_json(image.poses), "tracker_from_tool")}};
}

Json tool_line_json(const verification::ToolLine& line) {
  return {{"name", line.name},
          {"tunnel", line.tunnel},
          {"p1_in_calibrator", geometry::json_list(line.p1_in_calibrator)},
          {"p2_in_calibrator", geometry::json_list(line.p2_in_calibrator)}};
}

bool is_picked(const Json& picks, const std::string& name) {
  return std::ranges::any_of(
      picks, [&](const Json& pick) { return pick.is_object() && pick.value("name", Json()) == Json(name); });
}

/// The name of a built-in is kept; a file is copied into the case.
std::string brought_along(const std::string& name_or_file, const fs::path& folder) {
  const fs::path file(name_or_file);
  if (!fs::exists(file)) return name_or_file;
  value_or_throw(write_file(folder / file.filename(), value_or_throw(read_file(file, most_file_bytes))));
  return file.filename().string();
}

}  // namespace

Expected<void> write_operation_case(const fs::path& folder, const OperationPlan& plan,
                                    const std::vector<CaseImage>& images, const guidance::Poses& now,
                                    const std::vector<verification::ToolLine>& tool_lines) {
  return guarded([&] {
    const guidance::TrackerNoise noise = plan.tracker.noise();
    Json json = {{"format", "helicarm-case/1"},
                 {"calibrator", brought_along(plan.calibrator, folder)},
                 {"plate", plan.plate ? Json(brought_along(*plan.plate, folder)) : Json()},
                 {"views", Json::array()},
                 {"poses_now", without(to_json(now), "tracker_from_calibrator")},
                 {"tracker",
                  {{"sigma_mm", noise.sigma_mm}, {"sigma_deg", noise.sigma_deg}, {"samples", "independent"}}},
                 {"picks", plan.picks},
                 {"tunnels", Json::array()},
                 {"tool_lines", Json::array()}};
    for (const CaseImage& image : images) {
      value_or_throw(write_file(folder / (image.name + ".dcm"),
                                value_or_throw(read_file(image.image, most_file_bytes))));
      json["views"].push_back(image_json(image));
    }
    for (const PlannedTunnel& tunnel : plan.tunnels)
      if (is_picked(plan.picks, tunnel.start) && is_picked(plan.picks, tunnel.end))
        json["tunnels"].push_back({{"name", tunnel.name}, {"start", tunnel.start}, {"end", tunnel.end}});
    for (const verification::ToolLine& line : tool_lines) json["tool_lines"].push_back(tool_line_json(line));
    value_or_throw(write_file(folder / "case.json", to_text(json)));
  });
}

Expected<CaseRun> recompute_case(const fs::path& folder, const OperationPlan& plan,
                                 pipeline::CalibrationCache& cache) {
  return guarded([&] {
    const pipeline::Case given = value_or_throw(pipeline::read_case(folder));
    pipeline::RunOptions options;
    options.max_error_mm = plan.max_error_mm;
    CaseRun run{value_or_throw(cache.run(given, options)), {}};
    run.digest = xray::digest(to_text(without(pipeline::to_json(run.result), "timing_ms")));
    return run;
  });
}

Expected<CaseRun> run_operation_case(const fs::path& folder, const OperationPlan& plan,
                                     pipeline::CalibrationCache& cache) {
  return guarded([&] {
    CaseRun run = value_or_throw(recompute_case(folder, plan, cache));
    value_or_throw(write_file(folder / "result.json", to_text(pipeline::to_json(run.result))));
    value_or_throw(report::write_report(run.result, folder));
    return run;
  });
}

}  // namespace helicarm::operation
