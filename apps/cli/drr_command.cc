// SPDX-License-Identifier: Apache-2.0
#include "drr_command.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include <fmt/format.h>

#include "command_line.h"
#include "findings.h"
#include "helicarm/core/earlier_files.h"
#include "helicarm/core/files.h"
#include "helicarm/core/json.h"
#include "helicarm/geometry/view_json.h"
#include "helicarm/image/png.h"
#include "helicarm/pipeline/result.h"
#include "helicarm/volume/drr.h"
#include "helicarm/volume/drr_view.h"
#include "helicarm/volume/hounsfield.h"
#include "helicarm/volume/read_volume.h"

namespace helicarm::cli {
namespace {

using Eigen::Vector3d;

volume::Ramp ramp_of(const std::string& values) {
  if (values == "raw") return {};
  if (values != "hu")
    throw BadInput(Reason::usage, fmt::format("--values: \"{}\" is neither hu nor raw", values));
  return volume::attenuation_from_hu;
}

std::string grey_png(const image::Image<float>& integrals, float greatest) {
  image::Image<std::uint16_t> grey(integrals.width(), integrals.height());
  std::ranges::transform(integrals.pixels(), grey.pixels().begin(), [&](float value) {
    return static_cast<std::uint16_t>(
        std::lround(65535 * std::clamp(value / std::max(greatest, 1e-30F), 0.0F, 1.0F)));
  });
  return image::encode_png(grey);
}

void check_outputs(const DrrArguments& arguments, const Console& console) {
  if (arguments.out.empty() && arguments.raw.empty() && !console.json)
    throw BadInput(Reason::usage, "drr: give --out for an image or --raw for the line integrals");
  if (!arguments.out.empty() && arguments.out.extension() != ".png")
    throw BadInput(Reason::usage, fmt::format("--out: {} must end in .png, the only format written",
                                              arguments.out.string()));
}

double milliseconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace

CommandResult drr_command(const DrrArguments& arguments, Console& console) {
  return guarded([&] {
    for (const std::filesystem::path& file : {arguments.out, arguments.raw})
      forget_files(file.parent_path(), {file.filename().string()}, {arguments.volume});
    const volume::Ramp ramp = ramp_of(arguments.values);
    if (!arguments.centre_mm.empty() && arguments.centre_mm.size() != 3)
      throw BadInput(Reason::usage, "--centre takes three numbers");
    check_outputs(arguments, console);
    volume::Volume volume = value_or_throw(volume::read_volume(arguments.volume));
    if (arguments.values == "hu")
      for (Warning& warning :
           value_or_throw(volume::check_hounsfield(volume, arguments.volume.filename().string())))
        volume.warnings.push_back(std::move(warning));
    print_warnings(volume.warnings, console);
    const Vector3d centre =
        arguments.centre_mm.empty() ? volume.centre() : Vector3d::Map(arguments.centre_mm.data());
    const geometry::View view = volume::drr_view(arguments, centre);
    const auto start = std::chrono::steady_clock::now();
    const volume::Absorber absorber(volume, ramp, console.threads);
    const double prepare_ms = milliseconds_since(start);
    const auto prepared = std::chrono::steady_clock::now();
    const image::Image<float> integrals =
        value_or_throw(volume::drr(absorber, view, arguments.size, arguments.size, console.threads));
    const double project_ms = milliseconds_since(prepared);
    const auto [least, greatest] = std::ranges::minmax(integrals.pixels());
    if (!arguments.out.empty()) value_or_throw(write_file(arguments.out, grey_png(integrals, greatest)));
    const auto pixels = integrals.pixels();
    if (!arguments.raw.empty())
      value_or_throw(
          write_file(arguments.raw, {reinterpret_cast<const char*>(pixels.data()), pixels.size_bytes()}));
    if (console.json) {
      console.out << to_text({{"volume_size", volume.size},
                              {"size", {arguments.size, arguments.size}},
                              {"minimum", least},
                              {"maximum", greatest},
                              {"source_mm", geometry::json_list(view.source_in_world())},
                              {"projection", geometry::json_rows(view.projection())},
                              {"warnings", pipeline::json_list_of(volume.warnings)},
                              {"prepare_ms", prepare_ms},
                              {"project_ms", project_ms}})
                  << '\n';
      return;
    }
    console.out << fmt::format("{} x {} pixels, line integrals {:.4g} to {:.4g}, {:.0f} ms\n", arguments.size,
                               arguments.size, least, greatest, prepare_ms + project_ms);
  });
}

void add_drr(CLI::App& app, Action& action) {
  auto* command =
      add_command(app, group::studies, "drr", "Project a CT volume: its line integrals on a flat detector",
                  "helicarm drr knee.nii.gz --angle 90 --out lateral.png --raw lateral.f32");
  auto& a = arguments_of(command, action, drr_command);
  command->add_option("VOLUME", a.volume, "MetaImage, NRRD, NIfTI, or a folder of DICOM CT slices")
      ->required();
  command->add_option("--out", a.out, "PNG, 16 bits: black = no attenuation, white = maximum");
  command->add_option("--raw", a.raw, "The line integrals as 32-bit floats, little endian, row by row");
  command->add_option("--size", a.size, "Pixels per side")->check(within(1, 8192))->capture_default_str();
  command->add_option("--pixel", a.pixel_mm, "Pixel on the detector, mm")
      ->check(within(0.01, 20))
      ->capture_default_str();
  command->add_option("--source-detector", a.source_detector_mm, "mm")
      ->check(within(10, 1e5))
      ->capture_default_str();
  command->add_option("--source-centre", a.source_centre_mm, "mm")
      ->check(within(1, 1e5))
      ->capture_default_str();
  command
      ->add_option("--centre", a.centre_mm,
                   "x,y,z (L, P, S; mm) on the central ray; default: the volume's centre")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->check(within(-1e5, 1e5));
  command->add_option("--angle", a.angle_deg, "Position of the source: 0 anterior, 90 at the patient's left")
      ->check(within(-360, 360))
      ->capture_default_str();
  command->add_option("--tilt", a.tilt_deg, "Tilt of the source towards the head")
      ->check(within(-89, 89))
      ->capture_default_str();
  command
      ->add_option("--values", a.values,
                   "hu: attenuation by Hounsfield units, water 0.02059 / mm, 0 below -800\n"
                   "raw: integrate the voxels' values unchanged")
      ->type_name("WORD")
      ->capture_default_str();
}

}  // namespace helicarm::cli
