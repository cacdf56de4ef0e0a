// SPDX-License-Identifier: Apache-2.0
#include <map>

#include "arrays.h"
#include "helicarm/core/files.h"
#include "helicarm/segmentation/segment_files.h"
#include "helicarm/volume/declared.h"
#include "module.h"
#include "signals.h"

namespace helicarm::python {
namespace {

using Labels = std::map<std::string, std::vector<int>>;

/// (z, y, x), 0 outside the bones.
py::array array_of_labels(std::vector<std::uint8_t> labels, const Eigen::Vector3i& size) {
  auto* held = new std::vector<std::uint8_t>(std::move(labels));
  const py::capsule owner(held, [](void* memory) { delete static_cast<std::vector<std::uint8_t>*>(memory); });
  return py::array_t<std::uint8_t>({py::ssize_t(size.z()), py::ssize_t(size.y()), py::ssize_t(size.x())},
                                   held->data(), owner);
}

py::object segment_ct(const std::filesystem::path& ct, const py::dict& seeds, const std::string& space,
                      std::optional<double> threshold_hu, double gap_mm, double neck,
                      const std::optional<std::filesystem::path>& label_map, const Labels& labels,
                      const std::optional<Doubles>& voxel_mm, double tiff_offset_hu,
                      const std::optional<std::filesystem::path>& out, const py::object& progress) {
  segmentation::SegmentRequest request{.ct = ct,
                                       .options = {threshold_hu, gap_mm, neck},
                                       .label_map = label_map,
                                       .labels = labels,
                                       .tiff_offset_hu = tiff_offset_hu};
  const Eigen::Vector3d to_lps =
      value_or_raise(guarded([&] { return volume::declared_space(space, "space"); }));
  for (const auto& [name, point] : seeds) {
    const auto word = name.cast<std::string>();
    check_plain(point, "seeds: " + word);
    request.seeds.push_back({word, row_of<3>(point.cast<Doubles>(), "seeds: " + word).cwiseProduct(to_lps)});
  }
  if (voxel_mm) request.voxel_mm = row_of<3>(*voxel_mm, "voxel_mm");
  const RunHooks hooks = run_hooks(progress);
  const pipeline::Progress steps{hooks.on_stage, hooks.on_view};
  if (out) value_or_raise(check_can_write(*out));
  Json json;
  auto made = value_or_raise(without_gil([&] {
    if (out) segmentation::forget_segmentation(*out, request);
    return segmentation::answer(request, steps).and_then([&](segmentation::SegmentAnswer answer) {
      return segmentation::write_segmentation(answer, out, steps).map([&](Json written) {
        json = std::move(written);
        return std::move(answer.segmentation);
      });
    });
  }));
  py::dict result = python_from(json);
  result["labels"] = array_of_labels(std::move(made.labels), made.size);
  return result;
}

}  // namespace

void add_segmentation(py::module_& module) {
  const segmentation::SegmentOptions defaults;
  module.def(
      "segment", &segment_ct, py::arg("ct"), py::arg("seeds") = py::dict(), py::kw_only(),
      py::arg("space") = "LPS", py::arg("threshold_hu") = py::none(), py::arg("gap_mm") = defaults.gap_mm,
      py::arg("neck") = defaults.neck, py::arg("label_map") = py::none(), py::arg("labels") = Labels{},
      py::arg("voxel_mm") = py::none(), py::arg("tiff_offset_hu") = 0.0, py::arg("out") = py::none(),
      py::arg("progress") = py::none(),
      R"(Masks and surfaces of the bones of a CT, by one point on each, as `helicarm segment` makes them.

ct: MetaImage, NRRD, NIfTI, TIFF stack (with voxel_mm and tiff_offset_hu), or a folder of DICOM slices. seeds: {name: (x, y,
z)} in the volume's patient frame, mm; space: of the seeds, "LPS", "RAS" or "LAS". threshold_hu: bone is what has at least this
value; None: 200, more in a noisy CT. gap_mm: gaps of the cortex up to twice this width do not open the marrow cavity. neck:
parts are one bone where the neck between them has at least this share of the smaller part's radius within four times its own. label_map, labels:
instead of seeds, a label map on the CT's grid and {name: [label, ...]}. out: folder for the masks (NRRD), surfaces (STL),
segment.png and segment.json, or None. progress: called with the name of each step.

Returns segment.json (threshold_hu, bones with volume_cm3, surface_cm2, centre_mm, box_mm, cut_off, contacts, left_out_cm3, left_out_percent; warnings, notes)
and labels: (z, y, x) bytes with each bone's label, 0 elsewhere.

Raises InputError, and RefusedError for a seed on no bone and for two seeds on one.)");
}

}  // namespace helicarm::python
