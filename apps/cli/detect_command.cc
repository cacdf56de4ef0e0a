// SPDX-License-Identifier: Apache-2.0
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "command_line.h"
#include "findings.h"
#include "helicarm/core/csv.h"
#include "helicarm/core/earlier_files.h"
#include "helicarm/core/files.h"
#include "helicarm/core/json.h"
#include "helicarm/detection/find_marks.h"
#include "helicarm/pipeline/result.h"
#include "helicarm/xray/read_xray_image.h"
#include "image_files.h"

namespace helicarm::cli {

struct DetectArguments {
  std::vector<std::filesystem::path> images;  ///< and folders of images
  std::optional<int> frame;
  std::string kind = "balls";                     ///< balls, holes or crosses
  std::optional<std::filesystem::path> out = {};  ///< CSV
};

namespace {

struct Detected {
  std::string image;
  std::vector<detection::Dot> dots;
  std::vector<Warning> warnings;
};

Json json_of(const std::vector<detection::Dot>& dots) {
  Json list = Json::array();
  for (const detection::Dot& dot : dots)
    list.push_back({{"u", dot.centre_px.x()},
                    {"v", dot.centre_px.y()},
                    {"sigma_px", dot.sigma_px},
                    {"radius_px", dot.radius_px}});
  return list;
}

Json json_of(const std::vector<Detected>& all) {
  if (all.size() == 1)
    return {{"dots", json_of(all[0].dots)}, {"warnings", pipeline::json_list_of(all[0].warnings)}};
  Json list = Json::array();
  for (const Detected& one : all)
    list.push_back({{"image", one.image},
                    {"dots", json_of(one.dots)},
                    {"warnings", pipeline::json_list_of(one.warnings)}});
  return {{"images", std::move(list)}};
}

std::string csv_of(const std::vector<Detected>& all) {
  std::string csv = "image,u_px,v_px,sigma_px,radius_px\n";
  for (const Detected& one : all)
    for (const detection::Dot& dot : one.dots)
      csv += fmt::format("{},{},{},{},{}\n", csv_field(one.image), dot.centre_px.x(), dot.centre_px.y(),
                         dot.sigma_px, dot.radius_px);
  return csv;
}

void print_table(const std::vector<Detected>& all, std::ostream& out) {
  for (const Detected& one : all) {
    if (all.size() > 1) out << one.image << '\n';
    out << fmt::format("{:>10} {:>10} {:>9} {:>9}\n", "u px", "v px", "sigma px", "radius px");
    for (const detection::Dot& dot : one.dots)
      out << fmt::format("{:>10.3f} {:>10.3f} {:>9.3f} {:>9.2f}\n", dot.centre_px.x(), dot.centre_px.y(),
                         dot.sigma_px, dot.radius_px);
  }
}

}  // namespace

/// Sub-pixel positions of all dots or wire crossings in X-ray images, raw px. One image is printed as
/// {"dots", "warnings"}, several as {"images": [{"image", "dots", "warnings"}]}.
CommandResult detect_command(const DetectArguments& arguments, Console& console) {
  return guarded([&] {
    if (arguments.out)
      forget_files(arguments.out->parent_path(), {arguments.out->filename().string()}, arguments.images);
    const detection::MarkKind kind = value_or_throw(detection::mark_kind(arguments.kind));
    const std::vector<std::filesystem::path> files = image_files(arguments.images);
    std::vector<Detected> all;
    for (std::size_t i = 0; i < files.size(); ++i) {
      const xray::XrayImage image = value_or_throw(xray::read_xray_image(files[i], arguments.frame));
      print_warnings(image.warnings, console);
      all.push_back({files[i].string(), detection::find_marks(image, kind), image.warnings});
      if (files.size() > 1 && !console.quiet)
        console.progress << fmt::format("[{}/{}] {}: {} {}\n", i + 1, files.size(), files[i].string(),
                                        all.back().dots.size(), arguments.kind);
    }
    if (arguments.out) value_or_throw(write_file(*arguments.out, csv_of(all)));
    if (console.json)
      console.out << to_text(json_of(all)) << '\n';
    else if (!arguments.out)
      print_table(all, console.out);
  });
}

void add_detect(CLI::App& app, Action& action) {
  auto* command = add_command(app, group::images, "detect",
                              "Detect balls, holes or wire crossings with sub-pixel precision",
                              "helicarm detect AP.dcm --kind balls --json\n"
                              "  helicarm detect series/ --out dots.csv");
  auto& a = arguments_of(command, action, detect_command);
  command->add_option("IMAGE", a.images, "DICOM, PNG, TIFF, JPEG or BMP; several, and folders of images")
      ->required();
  command->add_option("--frame", a.frame, "Number of the image in a multi-frame file, from 1")
      ->check(within(1, 100000));
  command->add_option("--kind", a.kind, "balls, holes or crosses")->type_name("WORD")->capture_default_str();
  command->add_option("--out", a.out, "CSV: image,u_px,v_px,sigma_px,radius_px of all images");
}

}  // namespace helicarm::cli
