// SPDX-License-Identifier: Apache-2.0
#include "helicarm/core/files.h"

#include <array>
#include <map>

#include "arrays.h"
#include "helicarm/case_registration/measured_object.h"
#include "helicarm/core/earlier_files.h"
#include "helicarm/core/private_files.h"
#include "helicarm/operation/schemas.h"
#include "helicarm/pipeline/case_bundle.h"
#include "helicarm/pipeline/new_case.h"
#include "helicarm/report/exports.h"
#include "module.h"

namespace helicarm::python {
namespace {

using NamedPaths = std::map<std::string, std::filesystem::path>;

std::vector<std::string> exported(const case_registration::Measurement& measured,
                                  const std::filesystem::path& folder,
                                  const std::optional<std::vector<std::string>>& as,
                                  const std::optional<std::string>& at) {
  const auto kinds = value_or_raise(report::exports_named(as.value_or(std::vector<std::string>{})));
  report::forget_exports(folder);
  if (at && std::ranges::find(kinds, report::Export::images) == kinds.end())
    raise({Reason::usage, "at is of the rectified images: as_ lacks images", {}, {}});
  std::optional<report::SpacingObject> object;
  if (at && !measured.result.failure) object = value_or_raise(case_registration::object_named(measured, *at));
  const auto written = value_or_raise(
      without_gil([&] { return report::write_exports(measured.result, folder, kinds, object); }));
  if (const std::string note = report::one_pixel_size_note(measured.result, kinds); !note.empty())
    if (PyErr_WarnEx(PyExc_UserWarning, note.c_str(), 1) != 0) throw py::error_already_set();
  std::vector<std::string> files;
  for (const auto& path : written) files.push_back(path.string());
  return files;
}

py::dict new_case(const std::vector<std::string>& images, const std::filesystem::path& out,
                  const std::string& calibrator, const std::optional<std::string>& plate,
                  const NamedPaths& plate_images, const NamedPaths& maps, std::optional<double> pixel_mm,
                  std::optional<double> source_detector_mm,
                  const std::map<std::string, std::array<double, 2>>& angles) {
  const auto written = value_or_raise(without_gil([&] {
    return guarded([&] {
      std::vector<pipeline::InspectedImage> inspected;
      for (const std::string& word : images)
        inspected.push_back(value_or_throw(pipeline::inspect_image(pipeline::new_image_from(word))));
      pipeline::name_views(inspected);
      const pipeline::NewCaseOptions options{calibrator,
                                             plate,
                                             {maps.begin(), maps.end()},
                                             {plate_images.begin(), plate_images.end()},
                                             {pixel_mm, source_detector_mm},
                                             {angles.begin(), angles.end()}};
      auto fresh = value_or_throw(pipeline::new_case(std::move(inspected), options, out));
      value_or_throw(pipeline::write_new_case(fresh, out));
      return fresh;
    });
  }));
  py::dict answer;
  answer["case"] = (out / "case.json").string();
  answer["findings"] = written.findings;
  answer["warnings"] = warning_list(written.warnings);
  return answer;
}

py::dict bundle(const std::filesystem::path& folder, const std::filesystem::path& out,
                const std::optional<std::filesystem::path>& result, bool measure, unsigned threads) {
  const auto written = value_or_raise(without_gil([&] {
    return guarded([&] {
      value_or_throw(pipeline::check_bundle_file(out, folder, result));
      forget_files(out.parent_path(), {out.filename().string()});
      pipeline::BundleOptions options;
      options.measure = measure;
      options.run.threads = threads;
      if (result)
        options.result = value_or_throw(
            read_json(std::filesystem::is_directory(*result) ? *result / "result.json" : *result));
      auto packed = value_or_throw(pipeline::bundle_case(folder, options));
      value_or_throw(make_private_folder(out.has_parent_path() ? out.parent_path() : "."));
      value_or_throw(write_private_file(out, pipeline::tar_gz(packed.files)));
      return packed;
    });
  }));
  py::dict answer, files;
  for (const pipeline::ArchivedFile& file : written.files) files[file.name.c_str()] = file.bytes.size();
  answer["written"] = out.string();
  answer["files"] = files;
  answer["left_out"] = written.left_out;
  return answer;
}

py::object schema(const std::string& file) {
  const auto& all = operation::schemas();
  if (const auto found = all.find(file); found != all.end()) return python_from(found->second());
  std::vector<std::string> names;
  for (const auto& [name, written] : all) names.push_back(name);
  raise({Reason::usage, fmt::format("file: \"{}\" is none of: {}", file, fmt::join(names, ", ")), {}, {}});
}

}  // namespace

void add_files(py::module_& module) {
  module.def("_export", &exported);
  module.def("new_case", &new_case, py::arg("images"), py::arg("out"), py::kw_only(), py::arg("calibrator"),
             py::arg("plate") = py::none(), py::arg("plate_images") = NamedPaths{},
             py::arg("maps") = NamedPaths{}, py::arg("pixel_mm") = py::none(),
             py::arg("source_detector_mm") = py::none(),
             py::arg("angles") = std::map<std::string, std::array<double, 2>>{},
             R"(Makes a case of image files, as `helicarm new` does.

images: [VIEW=]FILE[:FRAME] each. out: folder for the case. calibrator: calibrator.json or "udcsc". plate: plate.json,
"plate48" or "none"; None: by the images. plate_images, maps: {view: file}. pixel_mm, source_detector_mm: of images whose
files do not state them. angles: {view: (primary, secondary)}, the positioner's, degrees, likewise. Returns {"case", "findings", "warnings"}. Raises InputError: usage where the images do not decide
the plate, name_clash, bad_value, cannot_write, and as read_image.)");
  module.def("bundle", &bundle, py::arg("folder"), py::kw_only(), py::arg("out"),
             py::arg("result") = py::none(), py::arg("run") = true, py::arg("threads") = 0u,
             R"(Packs a de-identified case into one file for a bug report, as `helicarm bundle` does.

out: the file (tar.gz). result: result.json of an earlier run, or its folder. run: measure the packed case. Returns {"written",
"files": {name: bytes}, "left_out"}. Text within the images' pixels stays. Raises InputError: name_clash where out is a file of
the case or of result, and as read_case.)");
  module.def(
      "schema", &schema, py::arg("file"),
      "The JSON Schema of a file that helicarm reads (calibrator, case, machine, plan, plate, session) or "
      "writes\n(registration, result, sweep). Raises "
      "InputError: usage.");
}

}  // namespace helicarm::python
