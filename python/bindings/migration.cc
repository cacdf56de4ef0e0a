// SPDX-License-Identifier: Apache-2.0
#include "helicarm/migration/migration_files.h"
#include "module.h"

namespace helicarm::python {
namespace {

using Pairs = std::vector<std::pair<std::filesystem::path, std::filesystem::path>>;

/// In the dict's order: the first is the reference.
std::vector<migration::Segment> segments_of(const py::dict& given) {
  std::vector<migration::Segment> segments;
  try {
    for (const auto& [name, markers] : given)
      segments.push_back(value_or_raise(
          migration::segment_of(name.cast<std::string>(), markers.cast<std::vector<std::string>>())));
  } catch (const py::cast_error&) {
    throw py::type_error("segments: must be {name: [names of markers]}");
  }
  return segments;
}

py::object migration_between(const std::filesystem::path& first, const std::filesystem::path& second,
                             const std::optional<py::dict>& segments, const std::string& reference,
                             const std::optional<std::filesystem::path>& axes, std::optional<int> frame,
                             const Pairs& doubles, bool by_name,
                             const std::optional<std::filesystem::path>& out) {
  if (out) migration::forget_migration(*out);
  migration::MigrationRequest request{first, second, doubles, frame, axes};
  if (segments) request.options.segments = segments_of(*segments);
  request.options.reference = reference;
  if (by_name) request.options.matching = migration::Matching::name;
  const auto answer = value_or_raise(
      without_gil([&] { return out ? migration::answer_into(request, *out) : migration::answer(request); }));
  return python_from(migration::to_json(answer));
}

}  // namespace

void add_migration(py::module_& module) {
  module.def(
      "migration", &migration_between, py::arg("first"), py::arg("second"), py::kw_only(),
      py::arg("segments") = py::none(), py::arg("reference") = "", py::arg("axes") = py::none(),
      py::arg("frame") = py::none(), py::arg("double") = Pairs{}, py::arg("by_name") = false,
      py::arg("out") = py::none(),
      R"(Migration of rigid sets of markers between two examinations, as `helicarm migration` computes it.

first, second: CSV of markers, markers.csv or folder of track, result.json or folder of run_case. segments: {name: markers of
the first examination}, in this order; None: as its file names them. reference: segment that counts as fixed, also in the
double examinations; "": the first. axes: CSV axis,x,y,z with unit vectors in the first examination. frame: of a
markers.csv. double: pairs of examinations without motion between them, each examination in one pair. by_name: markers of
equal names correspond, instead of by geometry. out: folder for migration.json, migration.csv and report.html; a refusal is
written to migration.json.

Returns migration.json: bodies (rotation_deg about the fixed axes x, then y, then z, translation_mm of the centre, covariance
(6 x 6; rad, mm), limits_95, mtpm_mm), segments (markers, condition_per_m, mean_error_mm), double and precision.

Raises InputError, and RefusedError for too few, congruent or collinear markers and for a segment that is not rigid.)");
}

}  // namespace helicarm::python
