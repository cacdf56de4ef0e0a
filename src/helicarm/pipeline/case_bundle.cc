// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/case_bundle.h"

#include <algorithm>
#include <array>
#include <map>
#include <span>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "helicarm/core/files.h"
#include "helicarm/core/program_version.h"
#include "helicarm/core/temporary_folder.h"
#include "helicarm/pipeline/case.h"
#include "helicarm/pipeline/measure.h"
#include "helicarm/pipeline/poses_json.h"
#include "helicarm/pipeline/view_image.h"
#include "helicarm/xray/derived_image.h"

namespace helicarm::pipeline {
namespace {

namespace fs = std::filesystem;

constexpr std::uintmax_t most_bundled_bytes = std::uintmax_t{256} << 20;

using Renamed = std::map<std::string, std::string>;

void keep_only(Json& object, std::span<const std::string_view> keys) {
  for (auto entry = object.begin(); entry != object.end();)
    entry = std::ranges::find(keys, entry.key()) == keys.end() ? object.erase(entry) : std::next(entry);
}

/// New names of a list's entries, numbered in their order.
Renamed numbered(const Json& json, const char* list, const char* stem) {
  Renamed names;
  for (const Json& entry : json.value(list, Json::array()))
    if (const auto name = entry["name"].get<std::string>(); !names.count(name))
      names.emplace(name, fmt::format("{}{}", stem, names.size() + 1));
  return names;
}

Json listed(const Json& json, const char* list) {
  const Json all = json.value(list, Json::array());
  return all.is_null() ? Json::array() : all;
}

/// The folder of the bundled case, while it is made.
class Bundler {
 public:
  Bundler(const Case& the_case, Json json) : given_(the_case), json_(std::move(json)) {
    for (const char* list : {"picks", "tunnels", "tool_lines"}) json_[list] = listed(json_, list);
    views_ = numbered(json_, "views", "V");
    picks_ = numbered(json_, "picks", "pick");
    tunnels_ = numbered(json_, "tunnels", "tunnel");
    lines_ = numbered(json_, "tool_lines", "line");
    if (given_.bones != guidance::knee_bones())
      for (const guidance::Bone& bone : given_.bones)
        tracked_.emplace(bone, fmt::format("tracked_bone{}", tracked_.size() + 1));
  }

  void write() {
    leave_out_models();
    leave_out_lines_of_models();
    keep_only(json_, packed_keys);
    for (Json& view : json_["views"]) keep_only(view, packed_view_keys);
    write_descriptions();
    rename_tracked_bones();
    for (std::size_t i = 0; i < given_.views.size(); ++i) write_view(i);
    for (Json& pick : json_["picks"]) {
      rename(pick, "name", picks_);
      rename(pick, "view", views_);
      if (!tracked_.empty() && pick.contains("moves_with") && !pick["moves_with"].is_null())
        rename(pick, "moves_with", tracked_);
      if (pick.contains("bone") && pick["bone"].is_object()) {
        const auto name = pick["bone"]["name"].get<std::string>();
        pick["bone"]["name"] =
            bones_.try_emplace(name, fmt::format("bone{}", bones_.size() + 1)).first->second;
      }
    }
    for (Json& tunnel : json_["tunnels"]) {
      rename(tunnel, "name", tunnels_);
      rename(tunnel, "start", picks_);
      rename(tunnel, "end", picks_);
    }
    for (Json& line : json_["tool_lines"]) {
      rename(line, "name", lines_);
      rename(line, "tunnel", tunnels_);
    }
    add_json("case.json", json_);
  }

  const fs::path& folder() const { return folder_.path(); }
  CaseBundle& bundle() { return bundle_; }
  const std::string& log() const { return log_; }
  bool has_all_images() const { return whole_; }

  /// Every new name by the old one.
  Renamed names() const {
    Renamed all = views_;
    for (const Renamed* some : {&picks_, &tunnels_, &lines_, &bones_, &tracked_, &models_})
      all.insert(some->begin(), some->end());
    return all;
  }

 private:
  static void rename(Json& entry, const char* key, const Renamed& names) {
    entry[key] = names.at(entry[key].get<std::string>());
  }

  void rename_tracked_bones() {
    if (tracked_.empty()) return;
    Json bones = Json::array();
    for (const guidance::Bone& bone : given_.bones) bones.push_back(tracked_.at(bone));
    json_["bones"] = bones;
    if (json_.contains("poses_now"))
      json_["poses_now"] = to_json(renamed(given_.poses_now), OtherMarker::tool);
    for (std::size_t i = 0; i < given_.views.size(); ++i)
      if (Json& view = json_["views"][i]; view.contains("poses"))
        view["poses"] = to_json(renamed(given_.views[i].poses), OtherMarker::calibrator);
  }

  guidance::Poses renamed(guidance::Poses poses) const {
    std::map<guidance::Bone, geometry::RigidTransform> by_new_name;
    for (const auto& [bone, pose] : poses.tracker_from_bone) by_new_name.emplace(tracked_.at(bone), pose);
    poses.tracker_from_bone = std::move(by_new_name);
    return poses;
  }

  void add_json(const std::string& name, const Json& json) {
    value_or_throw(write_file(folder() / name, to_text(json) + "\n"));
    add(name);
  }

  void add(const std::string& name) {
    bundle_.files.push_back({name, value_or_throw(read_file(folder() / name, most_bundled_bytes))});
  }

  void leave_out(const std::string& name, const Failure& why) {
    bundle_.left_out.push_back(fmt::format("{}: {}", name, code(why.reason)));
    whole_ = false;
  }

  /// A CT shows a person's face, and files of models are named by their users.
  void leave_out_models() {
    const Json models = listed(json_, "models");
    for (std::size_t i = 0; i < models.size(); ++i) {
      const std::string name = fmt::format("model{}", i + 1);
      if (models[i].is_object() && models[i].value("name", Json()).is_string())
        models_.emplace(models[i]["name"].get<std::string>(), name);
      bundle_.left_out.push_back(name + ": models are not packed");
    }
  }

  /// Their places are of the models' files.
  void leave_out_lines_of_models() {
    std::erase_if(json_["tunnels"].get_ref<Json::array_t&>(), [&](const Json& tunnel) {
      if (!tunnel.contains("model")) return false;
      bundle_.left_out.push_back(tunnels_.at(tunnel["name"].get<std::string>()) +
                                 ": is a line of a model, which is not packed");
      return true;
    });
  }

  void write_descriptions() {
    if (const Json& name = json_["calibrator"]; name.is_string() && name != phantom::udcsc().name) {
      phantom::Calibrator calibrator = given_.calibrator;
      if (calibrator.name != phantom::udcsc().name) calibrator.name = "calibrator";
      calibrator.measured = nullptr;
      json_["calibrator"] = "calibrator.json";
      add_json("calibrator.json", phantom::to_json(calibrator));
    }
    if (!given_.plate || json_["plate"] == phantom::plate48().name) return;
    phantom::Plate plate = *given_.plate;
    if (plate.name != phantom::plate48().name) plate.name = "plate";
    json_["plate"] = "plate.json";
    add_json("plate.json", phantom::to_json(plate));
  }

  void write_view(std::size_t index) {
    const CaseView& view = given_.views[index];
    Json& entry = json_["views"][index];
    rename(entry, "name", views_);
    const auto name = entry["name"].get<std::string>();
    entry["image"] = write_image(image_of(view), name);
    entry.erase("frame");
    if (view.plate_image) entry["plate_image"] = write_image(plate_image_of(view), name + "_plate");
    if (!view.map) return;
    entry["map"] = name + "_map.json";
    const auto map = read_json(*view.map).and_then(
        [&](const Json& json) { return rectification::distortion_map_from_json(json, name); });
    if (map)
      add_json(name + "_map.json", rectification::to_json(*map));
    else
      leave_out(name + "_map.json", map.error());
  }

  std::string write_image(const Expected<xray::XrayImage>& image, const std::string& name) {
    if (!image) {
      leave_out(name + ".dcm", image.error());
      return name + ".dcm";
    }
    const xray::Acquisition& a = image->acquisition;
    std::vector<std::string_view> codes;
    for (const Warning& warning : image->warnings) codes.push_back(code(warning.reason));
    log_ += fmt::format(
        "{}: {} x {} pixels of {} mm, grey {:g} to {:g}, source to detector {} mm; read with: {}\n", name,
        image->pixels.width(), image->pixels.height(),
        a.pixel_mm ? fmt::format("{:g} x {:g}", a.pixel_mm->x(), a.pixel_mm->y()) : "unknown", image->lowest,
        image->highest, a.source_detector_mm ? fmt::format("{:g}", *a.source_detector_mm) : "unknown",
        codes.empty() ? "no warning" : fmt::format("{}", fmt::join(codes, ", ")));
    value_or_throw(xray::write_dicom(folder() / (name + ".dcm"), de_identify_(*image)));
    add(name + ".dcm");
    return name + ".dcm";
  }

  const Case& given_;
  Json json_;
  Renamed views_, picks_, tunnels_, lines_, bones_, tracked_, models_;
  xray::DeIdentification de_identify_;
  TemporaryFolder folder_;
  CaseBundle bundle_;
  std::string log_;
  bool whole_ = true;  ///< every file of the views was read
};

/// All texts and keys of a value.
void collect_texts(const Json& json, Renamed& texts) {
  if (json.is_string()) texts.emplace(json.get<std::string>(), json.get<std::string>());
  if (json.is_object())
    for (const auto& [key, value] : json.items()) {
      texts.emplace(key, key);
      collect_texts(value, texts);
    }
  if (json.is_array())
    for (const Json& value : json) collect_texts(value, texts);
}

std::string line_of(const char* kind, const Failure& failure) {
  return fmt::format("{}: {}: {}{}{}\n", kind, code(failure.reason), failure.view,
                     failure.view.empty() ? "" : ": ", failure.message);
}

/// result.json of the bundled case without times, which differ from run to run.
Json measured(const Case& bundled, const RunOptions& options, std::string& log) {
  const Result result = value_or_throw(measure(bundled, options));
  if (result.failure) log += line_of("refused", *result.failure);
  for (const Warning& warning : result.warnings) log += line_of("warning", warning);
  Json json = to_json(result);
  json.erase("timing_ms");
  return json;
}

}  // namespace

Json without_texts(const Json& result, const std::map<std::string, std::string>& known) {
  const auto shown = [&](const std::string& text) {
    const auto found = known.find(text);
    return found == known.end() ? std::string("(removed)") : found->second;
  };
  if (result.is_string()) return shown(result.get<std::string>());
  if (result.is_array()) {
    Json list = Json::array();
    for (const Json& value : result) list.push_back(without_texts(value, known));
    return list;
  }
  if (!result.is_object()) return result;
  Json object = Json::object();
  for (const auto& [key, value] : result.items()) object[shown(key)] = without_texts(value, known);
  return object;
}

namespace {

/// Keys and words of result.json that say why a case was refused; a measured result adds all of its own.
constexpr std::array always_kept{"format",  "helicarm-result/1", "status", "ok",       "refused", "failure",
                                 "code",    "message",           "view",   "figures",  "causes",  "next",
                                 "points",  "warnings",          "notes",  "views",    "name",    "reason",
                                 "version", "options",           "method", "accuracy", "best",    "paper"};

}  // namespace

Expected<void> check_bundle_file(const fs::path& out, const fs::path& path,
                                 const std::optional<fs::path>& result) {
  std::error_code ignored;
  if (!fs::exists(out, ignored)) return {};
  const fs::path folder = folder_of_case(path), file = case_file(path);
  std::vector<fs::path> read{file};
  if (result) read.push_back(fs::is_directory(*result, ignored) ? *result / "result.json" : *result);
  Renamed texts;
  if (const auto json = read_json(file)) collect_texts(*json, texts);
  for (const auto& [text, same] : texts) {
    if (text.find('\0') != std::string::npos) continue;
    read.push_back(folder / text);
    read.push_back(folder / (text + ".json"));
  }
  const fs::path out_folder = out.has_parent_path() ? out.parent_path() : fs::path(".");
  for (const fs::path& input : read)
    if (fs::equivalent(out, input, ignored) ||
        (fs::is_directory(input, ignored) && fs::equivalent(out_folder, input, ignored) &&
         !fs::equivalent(out_folder, folder, ignored)))
      return fail(
          Reason::name_clash,
          fmt::format("{}: is a file that the bundle is made of ({}); give another file for the bundle",
                      out.string(), input.string()));
  return {};
}

Expected<CaseBundle> bundle_case(const fs::path& path, const BundleOptions& options) {
  return guarded([&] {
    const Case the_case = value_or_throw(read_case(path));
    Bundler bundler(the_case, value_or_throw(read_json(case_file(path))));
    bundler.write();
    CaseBundle bundle = std::move(bundler.bundle());
    std::string log =
        fmt::format("helicarm {}, compiler {}\n", program_version(), __VERSION__) + bundler.log();
    for (const std::string& missing : bundle.left_out) log += fmt::format("not packed: {}\n", missing);
    Renamed known = bundler.names();
    if (options.measure && bundler.has_all_images()) {
      const Json result = measured(value_or_throw(read_case(bundler.folder())), options.run, log);
      bundle.files.push_back({"result.json", to_text(result) + "\n"});
      if (options.result) collect_texts(result, known);
    }
    for (const Reason reason : all_reasons()) known.emplace(code(reason), code(reason));
    for (const char* text : always_kept) known.emplace(text, text);
    if (options.result)
      bundle.files.push_back({"given_result.json", to_text(without_texts(*options.result, known)) + "\n"});
    bundle.files.push_back({"log.txt", log});
    return bundle;
  });
}

}  // namespace helicarm::pipeline
