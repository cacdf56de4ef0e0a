// SPDX-License-Identifier: Apache-2.0
#include "bundle_command.h"
#include "command_line.h"
#include "helicarm/pipeline/run_fields.h"
#include "helicarm/xray/dicom_acquisition.h"
#include "new_command.h"
#include "pick_command.h"

namespace helicarm::cli {
namespace {

void add_new(CLI::App& app, Action& action) {
  auto* command = add_command(
      app, group::measure, "new",
      "Make a case of image files: what they show decides the views and the plate",
      "helicarm new IM0001 IM0002 --calibrator my-phantom/calibrator.json --out my-case\n"
      "  helicarm new AP=front.png LAT=side.png --calibrator udcsc --plate none --out my-case\n"
      "  helicarm new AP=run.dcm:12 LAT=run.dcm:40 --calibrator c.json --plate plate.json --out my-case");
  auto& a = arguments_of(command, action, new_command);
  command
      ->add_option("IMAGE", a.images,
                   "[VIEW=]FILE[:FRAME]; points need two or more: DICOM, PNG, TIFF, JPEG or BMP. Without "
                   "VIEW the views "
                   "are AP and LAT "
                   "by their positioner angles, or named as the files")
      ->required();
  command->add_option("--calibrator", a.calibrator, "calibrator.json, or udcsc");
  command->add_option("--plate", a.plate,
                      "plate.json, plate48, or none for images free of distortion (default: by the images)");
  command
      ->add_option("--plate-image", a.plate_images,
                   "VIEW=FILE: an image of the plate alone in the same C-arm position; repeatable")
      ->allow_extra_args(false);
  command->add_option("--map", a.maps, "VIEW=FILE: a map.json of rectify; repeatable")
      ->allow_extra_args(false);
  command
      ->add_option("--pixel-mm", a.pixel_mm,
                   "Pixel size in the receiver's plane, mm, of images whose files do not state it")
      ->check(CLI::Range(xray::min_pixel_mm, xray::max_pixel_mm));
  command
      ->add_option("--source-detector-mm", a.source_detector_mm,
                   "Distance of source and receiver, mm, of images whose files do not state it")
      ->check(CLI::Range(xray::min_source_detector_mm, xray::max_source_detector_mm));
  command->add_option("--out", a.out, "Folder for the case")->required();
}

void add_pick(CLI::App& app, Action& action) {
  auto* command = add_command(app, group::measure, "pick",
                              "Pick points in a case: in the desktop application, or by a table",
                              "helicarm pick my-case\n"
                              "  helicarm pick my-case --csv picks.csv");
  auto& a = arguments_of(command, action, pick_command);
  command->add_option("CASE", a.folder, "Folder that holds case.json")->required();
  command->add_option(
      "--csv", a.csv,
      "name,view,u_px,v_px[,sigma_px], raw pixels: written into case.json; a pick of the same "
      "name and view is replaced");
}

void add_bundle(CLI::App& app, Action& action) {
  auto* command =
      add_command(app, group::measure, "bundle",
                  "Pack a de-identified case with its result and a log into one file for a bug report",
                  "helicarm bundle my-case --result my-result --out report.tar.gz");
  auto& a = arguments_of(command, action, bundle_command);
  command->add_option("CASE", a.folder, "Folder that holds case.json")->required();
  command->add_option("--result", a.result,
                      "Folder of an earlier run: its result.json is added without its texts");
  command->add_option("--out", a.out, "The file: a gzip-compressed tar archive")->capture_default_str();
  command->add_flag("--no-run", a.no_run, "Do not measure the packed case, for a case that ends the program");
  add_fields(command, a.options, pipeline::run_fields);
}

}  // namespace

void add_case_commands(CLI::App& app, Action& action) {
  add_new(app, action);
  add_pick(app, action);
  add_bundle(app, action);
}

}  // namespace helicarm::cli
