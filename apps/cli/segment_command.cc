// SPDX-License-Identifier: Apache-2.0
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "command_line.h"
#include "findings.h"
#include "helicarm/core/files.h"
#include "helicarm/core/json.h"
#include "helicarm/segmentation/segment_files.h"
#include "helicarm/volume/declared.h"

namespace helicarm::cli {

struct SegmentArguments {
  std::filesystem::path ct;
  std::filesystem::path out = "helicarm-segment";
  std::vector<std::string> seeds;  ///< NAME=x,y,z
  std::string space = "LPS";       ///< of the seeds
  segmentation::SegmentOptions options;
  std::optional<std::filesystem::path> label_map;
  std::vector<std::string> labels;  ///< NAME=N[,M]
  std::vector<double> voxel_mm;     ///< three numbers or none
  double tiff_offset_hu = 0;
};

namespace {

segmentation::SegmentRequest request_of(const SegmentArguments& arguments) {
  segmentation::SegmentRequest request{.ct = arguments.ct,
                                       .options = arguments.options,
                                       .label_map = arguments.label_map,
                                       .tiff_offset_hu = arguments.tiff_offset_hu};
  const Eigen::Vector3d to_lps = volume::declared_space(arguments.space, "--space");
  for (const std::string& text : arguments.seeds) {
    segmentation::Seed seed = value_or_throw(segmentation::seed_from(text));
    seed.point = seed.point.cwiseProduct(to_lps);
    request.seeds.push_back(std::move(seed));
  }
  for (const std::string& text : arguments.labels) {
    auto [name, labels] = value_or_throw(segmentation::choice_from(text));
    if (!request.labels.emplace(name, std::move(labels)).second)
      throw BadInput(Reason::name_clash, fmt::format("--label: {} is given twice", name));
  }
  if (!arguments.voxel_mm.empty()) {
    if (arguments.voxel_mm.size() != 3) throw BadInput(Reason::usage, "--voxel takes three numbers");
    request.voxel_mm = Eigen::Vector3d::Map(arguments.voxel_mm.data());
  }
  return request;
}

std::string segment_text(const Json& json) {
  std::string text;
  if (!json["threshold_hu"].is_null())
    text += fmt::format("  bone from {:g} HU on\n", json["threshold_hu"].get<double>());
  for (const Json& bone : json["bones"]) {
    const auto centre = bone["centre_mm"].get<std::vector<double>>();
    const double left_out_cm3 = bone.value("left_out_cm3", 0.0);
    text += fmt::format(
        "  {}: {:.1f} cm3, {} voxels, surface {:.1f} cm2, centre {:.1f} {:.1f} {:.1f} mm{}{}\n",
        bone["name"].get<std::string>(), bone["volume_cm3"].get<double>(), bone["voxels"].get<std::size_t>(),
        bone["surface_cm2"].get<double>(), centre[0], centre[1], centre[2],
        bone["cut_off"].empty()
            ? ""
            : fmt::format(", reaches the volume's end: {}",
                          fmt::join(bone["cut_off"].get<std::vector<std::string>>(), ", ")),
        left_out_cm3 == 0 ? ""
                          : fmt::format("; {:.1f} cm3 of bone without a seed hang together with it and "
                                        "are left out ({:.0f} %)",
                                        left_out_cm3, bone["left_out_percent"].get<double>()));
  }
  return text;
}

}  // namespace

/// Writes segment.json, segment.png, NAME.nrrd and NAME.stl. A refusal is written to segment.json and then
/// fails with its reason; unusable input leaves none.
CommandResult segment_command(const SegmentArguments& arguments, Console& console) {
  return guarded([&] {
    const segmentation::SegmentRequest request = request_of(arguments);
    value_or_throw(check_can_write(arguments.out));
    segmentation::forget_segmentation(arguments.out, request);
    pipeline::Progress progress;
    if (!console.quiet)
      progress.stage = [&](std::string_view stage) {
        console.progress << fmt::format("helicarm: {}\n", stage);
      };
    const auto made = segmentation::answer(request, progress);
    if (!made) {
      if (exit_code(made.error().reason) == 3)
        value_or_throw(write_file(arguments.out / "segment.json",
                                  to_text(segmentation::refused_json(made.error())) + "\n"));
      throw BadInput(made.error());
    }
    const Json json = value_or_throw(segmentation::write_segmentation(*made, arguments.out, progress));
    print_warnings(made->segmentation.warnings, console);
    print_notes(made->segmentation.notes, console);
    if (console.json)
      console.out << to_text(json) << '\n';
    else if (!console.quiet)
      console.out << segment_text(json) << fmt::format("\n  written to {}\n", arguments.out.string());
  });
}

void add_segment(CLI::App& app, Action& action) {
  auto* command = add_command(
      app, group::motion, "segment",
      "Masks and surfaces of the bones of a CT, by one click on each, or from a label map",
      "helicarm segment ct.nrrd --seed femur=-12.5,40,871 --seed tibia=-10,43,815 --out my-bones\n\n"
      "A seed is a point in the bone or on its cortex, in the CT's patient frame (mm). Bone is what has at "
      "least the\n"
      "threshold, with the cavities that it encloses; bones that touch are separated at the neck between "
      "them, also\n"
      "from those without a seed. Writes for each bone NAME.nrrd (\"mask\" of a model in case.json) and "
      "NAME.stl,\n"
      "segment.png, which shows the outlines (look at it), and segment.json.\n\n"
      "Label maps of other programs:\n"
      "  helicarm segment ct.nrrd --labels totalsegmentator.nii.gz --label femur=75 --out my-bones\n"
      "Exit code 3: a seed is on no bone, or two are on one. See docs/registration.md.");
  auto& a = arguments_of(command, action, segment_command);
  command->add_option("CT", a.ct, "MetaImage, NRRD, NIfTI, TIFF stack, or a folder of DICOM CT slices")
      ->required();
  command->add_option("--seed", a.seeds, "NAME=x,y,z of a bone; once for each")->allow_extra_args(false);
  command->add_option("--space", a.space, "Space of the seeds: LPS, RAS (3D Slicer shows this) or LAS")
      ->type_name("WORD")
      ->capture_default_str();
  add_fields(command, a.options, segmentation::segment_fields);
  command->add_option("--labels", a.label_map, "A label map on the CT's grid instead of seeds");
  command
      ->add_option(
          "--label", a.labels,
          "NAME=N or NAME=N,M: labels that are a bone; once for each. Not needed for a map with one label")
      ->allow_extra_args(false);
  command->add_option("--voxel", a.voxel_mm, "x,y,z: size of a TIFF stack's voxels, mm")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->check(within(1e-3, 100));
  command->add_option("--tiff-offset", a.tiff_offset_hu, "Added to a TIFF stack's values to give HU")
      ->check(within(-32768, 32767))
      ->capture_default_str();
  command->add_option("--out", a.out, "Folder for the masks, surfaces, segment.png and segment.json")
      ->capture_default_str();
}

}  // namespace helicarm::cli
