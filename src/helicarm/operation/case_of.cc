// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/case_of.h"

#include <algorithm>

#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/core/private_files.h"
#include "helicarm/geometry/view_json.h"
#include "helicarm/pipeline/poses_json.h"
#include "helicarm/report/overlay.h"
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
          {"poses", pipeline::to_json(image.poses, pipeline::OtherMarker::calibrator)}};
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

/// Writes the files of a case and keeps their digests.
class CaseFolder {
 public:
  explicit CaseFolder(fs::path folder) : folder_(std::move(folder)) {
    std::error_code ec;
    if (fs::exists(folder_, ec))
      throw BadInput(Reason::cannot_write,
                     fmt::format("{}: exists already, not made by this operation", folder_.string()));
    value_or_throw(make_private_folder(folder_));
  }

  void add(const std::string& name, const std::string& bytes) {
    value_or_throw(write_private_file(folder_ / name, bytes));
    files[name] = xray::digest(bytes);
  }
  /// The name of a built-in is kept; a file is copied into the case.
  std::string bring(const std::string& name_or_file) {
    const fs::path file(name_or_file);
    if (!fs::exists(file)) return name_or_file;
    add(file.filename().string(), value_or_throw(read_file(file, most_file_bytes)));
    return file.filename().string();
  }

  Digests files;

 private:
  fs::path folder_;
};

}  // namespace

Json operation_case_json(const OperationPlan& plan, const std::vector<CaseImage>& images,
                         const guidance::Poses& now, const std::vector<verification::ToolLine>& tool_lines) {
  const guidance::TrackerNoise noise = plan.tracker.noise();
  Json json = {
      {"format", "helicarm-case/2"},
      {"calibrator", plan.calibrator},
      {"plate", plan.plate ? Json(*plan.plate) : Json()},
      {"bones", plan.bones},
      {"views", Json::array()},
      {"poses_now", pipeline::to_json(now, pipeline::OtherMarker::tool)},
      {"tracker", {{"sigma_mm", noise.sigma_mm}, {"sigma_deg", noise.sigma_deg}, {"samples", "independent"}}},
      {"picks", plan.picks},
      {"tunnels", Json::array()},
      {"tool_lines", Json::array()}};
  for (const CaseImage& image : images) json["views"].push_back(image_json(image));
  for (const PlannedTunnel& tunnel : plan.tunnels)
    if (is_picked(plan.picks, tunnel.start) && is_picked(plan.picks, tunnel.end))
      json["tunnels"].push_back({{"name", tunnel.name}, {"start", tunnel.start}, {"end", tunnel.end}});
  for (const verification::ToolLine& line : tool_lines) json["tool_lines"].push_back(tool_line_json(line));
  return json;
}

Expected<std::string> received_image(const fs::path& image, const std::string& digest) {
  return guarded([&] {
    std::string bytes = value_or_throw(read_file(image, most_file_bytes));
    if (xray::digest(bytes) != digest)
      throw BadInput(Reason::image_changed,
                     fmt::format("{}: is not the image that was received: its file was changed or replaced; "
                                 "acquire this view again",
                                 image.string()));
    return bytes;
  });
}

Expected<Digests> write_operation_case(const fs::path& folder, const OperationPlan& plan,
                                       const std::vector<CaseImage>& images, const guidance::Poses& now,
                                       const std::vector<verification::ToolLine>& tool_lines) {
  return guarded([&] {
    CaseFolder made(folder);
    OperationPlan brought = plan;
    brought.calibrator = made.bring(plan.calibrator);
    if (plan.plate) brought.plate = made.bring(*plan.plate);
    for (const CaseImage& image : images)
      made.add(image.name + ".dcm", value_or_throw(received_image(image.image, image.digest)));
    made.add("case.json", to_text(operation_case_json(brought, images, now, tool_lines)));
    return made.files;
  });
}

Expected<void> check_digests(const fs::path& folder, const Digests& files) {
  return guarded([&] {
    for (const auto& [name, digest] : files)
      if (const auto bytes = read_file(folder / name, most_file_bytes);
          !bytes || xray::digest(*bytes) != digest)
        throw BadInput(Reason::image_changed,
                       fmt::format("{}: was {} after it was written: measure again", (folder / name).string(),
                                   bytes ? "changed" : "removed"));
  });
}

Expected<CaseRun> recompute_case(const fs::path& folder, const OperationPlan& plan,
                                 pipeline::CalibrationCache& cache) {
  return guarded([&] {
    const pipeline::Case given = value_or_throw(pipeline::read_case(folder));
    pipeline::RunOptions options;
    options.max_error_mm = plan.max_error_mm;
    CaseRun run{value_or_throw(cache.run(given, options)), {}, {}};
    run.digest = xray::digest(to_text(without(pipeline::to_json(run.result), "timing_ms")));
    return run;
  });
}

Expected<CaseRun> run_operation_case(const fs::path& folder, const OperationPlan& plan,
                                     pipeline::CalibrationCache& cache) {
  return guarded([&] {
    CaseRun run = value_or_throw(recompute_case(folder, plan, cache));
    value_or_throw(report::write_report(run.result, folder));
    value_or_throw(write_file(folder / "result.json", to_text(pipeline::to_json(run.result))));
    std::vector<std::string> names{"result.json", "report.html"};
    for (std::size_t i = 0; i < run.result.views.size(); ++i)
      if (run.result.views[i].xray_image) names.push_back(report::overlay_name(run.result.views[i].name, i));
    for (const std::string& name : names)
      run.files[name] = xray::digest(value_or_throw(read_file(folder / name, most_file_bytes)));
    return run;
  });
}

}  // namespace helicarm::operation
