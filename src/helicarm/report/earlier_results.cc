// SPDX-License-Identifier: Apache-2.0
#include "helicarm/report/earlier_results.h"

#include "helicarm/core/earlier_files.h"
#include "helicarm/core/json.h"
#include "helicarm/report/overlay.h"

namespace helicarm::report {
namespace fs = std::filesystem;

namespace {

/// Overlays of the views in a list of objects with names.
void add_overlays(const Json& views, std::vector<std::string>& files) {
  if (!views.is_array()) return;
  for (std::size_t i = 0; i < views.size(); ++i)
    if (const Json& view = views[i]; view.is_object() && view.contains("name") && view["name"].is_string())
      files.push_back(overlay_name(view["name"].get<std::string>(), i));
}

/// Overlays and DICOM registrations that a result.json or registration.json belongs to.
std::vector<std::string> overlays_of(const fs::path& json_file) {
  std::vector<std::string> files;
  const auto json = read_json(json_file);
  if (!json || !json->is_object()) return files;
  if (json->contains("views")) add_overlays((*json)["views"], files);
  if (json->contains("models") && (*json)["models"].is_array()) {
    const Json& models = (*json)["models"];
    for (std::size_t i = 0; i < models.size(); ++i) {
      const Json& model = models[i];
      if (model.is_object() && model.contains("views")) add_overlays(model["views"], files);
      if (model.is_object() && model.value("name", Json()).is_string())
        files.push_back(dicom_registration_name(model["name"].get<std::string>(), i));
    }
  }
  return files;
}

}  // namespace

std::string dicom_registration_name(const std::string& model, std::size_t index) {
  return file_stem(model, index) + "_registration.dcm";
}

void forget_registration(const fs::path& folder) {
  std::error_code ignored;
  if (!fs::is_directory(folder, ignored)) return;
  forget_files(folder, overlays_of(folder / "registration.json"));
  // The file that names the overlays last: an interrupted removal can be repeated.
  forget_files(folder, {"report.html", "registration.csv", "relative.csv", "bodies.csv", "smoothed.csv",
                        "smoothed.seq.mha", "frames.jsonl", "sequence.json", dicom_measurements_name,
                        "registration.json"});
}

void forget_results(const fs::path& folder) {
  std::error_code ignored;
  if (!fs::is_directory(folder, ignored)) return;
  const fs::path of_models = folder / "registration";
  forget_registration(of_models);
  if (fs::is_directory(of_models, ignored) && fs::is_empty(of_models, ignored))
    fs::remove(of_models, ignored);
  forget_files(folder, overlays_of(folder / "result.json"));
  forget_registration(folder);
  forget_files(folder, {"result.json"});
}

}  // namespace helicarm::report
