// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/case_of.h"

#include <algorithm>

#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/core/private_files.h"
#include "helicarm/report/overlay.h"
#include "helicarm/report/report.h"
#include "helicarm/xray/digest.h"

namespace helicarm::operation {
namespace fs = std::filesystem;

namespace {

constexpr std::uintmax_t most_file_bytes = std::uintmax_t{256} << 20;

/// Reads what a plan names: a file where there is one, else a built-in.
class NamedFiles {
 public:
  explicit NamedFiles(fs::path folder) : folder_(std::move(folder)) {}

  template <class Read, class Named>
  auto read(const fs::path& file, const std::string& name, std::string& name_in_case, Read from_json,
            Named built_in) {
    if (!fs::is_regular_file(folder_ / file)) {
      name_in_case = name;
      return value_or_throw(built_in(name, folder_));
    }
    name_in_case = file.filename().string();
    std::string bytes = value_or_throw(read_file(folder_ / file, most_file_bytes));
    auto read = value_or_throw(from_json(value_or_throw(parse_json(bytes, name_in_case)), name_in_case));
    if (!files.emplace(name_in_case, std::move(bytes)).second)
      throw BadInput(Reason::name_clash,
                     fmt::format("{}: calibrator and plate have the same file name", name_in_case));
    return read;
  }

  std::map<std::string, std::string> files;

 private:
  fs::path folder_;
};

PlanFiles read_files(const OperationPlan& plan, const fs::path& folder, bool by_name_alone) {
  const auto place_of = [&](const std::string& name) {
    return by_name_alone ? fs::path(name).filename() : fs::path(name);
  };
  NamedFiles named(folder);
  PlanFiles read;
  read.calibrator = named.read(place_of(plan.calibrator), plan.calibrator, read.calibrator_name,
                               phantom::calibrator_from_json, phantom::calibrator_named);
  if (plan.plate)
    read.plate = named.read(place_of(*plan.plate), *plan.plate, read.plate_name.emplace(),
                            phantom::plate_from_json, phantom::plate_named);
  read.files = std::move(named.files);
  return read;
}

bool is_picked(const OperationPlan& plan, const std::string& name) {
  return std::ranges::find(plan.picks, name, &pipeline::Pick::name) != plan.picks.end();
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

  Digests files;

 private:
  fs::path folder_;
};

}  // namespace

Expected<PlanFiles> files_of(const OperationPlan& plan) {
  return guarded([&] { return read_files(plan, plan.folder, false); });
}

Expected<PlanFiles> files_of_case(const OperationPlan& plan, const fs::path& folder) {
  return guarded([&] { return read_files(plan, folder, true); });
}

Expected<pipeline::Case> operation_case(const fs::path& folder, const OperationPlan& plan,
                                        const PlanFiles& files, const std::vector<CaseImage>& images,
                                        const guidance::Poses& now,
                                        const std::vector<guidance::ToolLine>& tool_lines) {
  pipeline::Case the_case;
  the_case.folder = folder;
  the_case.calibrator_name = files.calibrator_name;
  the_case.calibrator = files.calibrator;
  the_case.plate_name = files.plate_name;
  the_case.plate = files.plate;
  the_case.bones = plan.bones;
  for (const CaseImage& image : images) {
    pipeline::CaseView view;
    view.name = image.name;
    view.image = folder / (image.name + ".dcm");
    view.poses = image.poses;
    the_case.views.push_back(std::move(view));
  }
  the_case.poses_now = now;
  the_case.tracker = plan.tracker.noise();
  the_case.picks = plan.picks;
  for (const OperationTunnel& tunnel : plan.tunnels)
    if (!tunnel.of_model && is_picked(plan, tunnel.start) && is_picked(plan, tunnel.end))
      the_case.tunnels.push_back({tunnel.name, tunnel.start, tunnel.end});
  the_case.tool_lines = tool_lines;
  return pipeline::checked_case(std::move(the_case));
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

Expected<Digests> write_operation_case(const pipeline::Case& written, const PlanFiles& files,
                                       const std::vector<CaseImage>& images) {
  return guarded([&] {
    CaseFolder case_folder(written.folder);
    for (const auto& [name, bytes] : files.files) case_folder.add(name, bytes);
    for (const CaseImage& image : images)
      case_folder.add(image.name + ".dcm", value_or_throw(received_image(image.image, image.digest)));
    case_folder.add("case.json", to_text(pipeline::to_json(written)));
    return case_folder.files;
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

Expected<pipeline::Result> measure_by_plan(const pipeline::Case& the_case, const OperationPlan& plan,
                                           const std::optional<pipeline::Result>& earlier) {
  return pipeline::measure_again(earlier, the_case, measuring_options(plan).run);
}

Json without_timing(Json result) {
  result.erase("timing_ms");
  return result;
}

std::string digest_of(const Json& result) { return xray::digest(to_text(without_timing(result))); }

Expected<Digests> write_result(const pipeline::Result& result, const fs::path& folder) {
  return guarded([&] {
    value_or_throw(report::write_result(result, folder));
    std::vector<std::string> names{"result.json", "report.html"};
    for (std::size_t i = 0; i < result.views.size(); ++i)
      if (result.views[i].xray_image) names.push_back(report::overlay_name(result.views[i].name, i));
    Digests files;
    for (const std::string& name : names)
      files[name] = xray::digest(value_or_throw(read_file(folder / name, most_file_bytes)));
    return files;
  });
}

}  // namespace helicarm::operation
