// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <charconv>
#include <filesystem>
#include <iostream>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <unistd.h>

#include "command_line.h"
#include "findings.h"
#include "helicarm/pipeline/new_case.h"
#include "helicarm/xray/dicom_acquisition.h"

namespace helicarm::cli {

struct NewArguments {
  std::vector<std::string> images;                     ///< [VIEW=]FILE[:FRAME]
  std::string calibrator;                              ///< a built-in or a file; empty: asked for
  std::optional<std::string> plate;                    ///< a built-in, a file or none; nothing: by the images
  std::vector<std::string> plate_images;               ///< VIEW=FILE
  std::vector<std::string> maps;                       ///< VIEW=FILE
  std::vector<std::string> angles;                     ///< VIEW=PRIMARY,SECONDARY
  std::optional<double> pixel_mm, source_detector_mm;  ///< of every view, where the images do not state it
  std::filesystem::path out;
};

namespace {

bool may_ask(const Console& console) {
  return !console.json && !console.quiet && ::isatty(STDIN_FILENO) != 0 && ::isatty(STDERR_FILENO) != 0;
}

/// The line typed at the terminal; empty at the end of the input.
std::string answer_to(const std::string& question, Console& console) {
  console.progress << question << std::flush;
  std::string line;
  std::getline(std::cin, line);
  return line;
}

std::vector<std::pair<std::string, std::filesystem::path>> files_by_view(
    const std::vector<std::string>& words, const char* option) {
  std::vector<std::pair<std::string, std::filesystem::path>> files;
  for (const std::string& word : words) {
    const std::size_t equals = word.find('=');
    if (equals == word.npos || equals == 0 || equals + 1 == word.size())
      throw BadInput(Reason::usage, fmt::format("{}: \"{}\" is not VIEW=FILE", option, word));
    files.emplace_back(word.substr(0, equals), word.substr(equals + 1));
  }
  return files;
}

std::optional<double> angle_in(const std::string& text) {
  double deg = 0;
  const char* const end = text.data() + text.size();
  const auto [next, error] = std::from_chars(text.data(), end, deg);
  return error == std::errc() && next == end ? std::optional(deg) : std::nullopt;
}

std::vector<std::pair<std::string, std::array<double, 2>>> angles_by_view(
    const std::vector<std::string>& words) {
  std::vector<std::pair<std::string, std::array<double, 2>>> angles;
  for (const std::string& word : words) {
    const std::size_t equals = word.find('='), comma = word.find(',', std::min(equals, word.size()));
    const bool is_pair = equals != word.npos && equals > 0 && comma != word.npos;
    const auto primary = is_pair ? angle_in(word.substr(equals + 1, comma - equals - 1)) : std::nullopt;
    const auto secondary = is_pair ? angle_in(word.substr(comma + 1)) : std::nullopt;
    if (!primary || !secondary)
      throw BadInput(Reason::usage,
                     fmt::format("--angles: \"{}\" is not VIEW=PRIMARY,SECONDARY in degrees", word));
    angles.push_back({word.substr(0, equals), {*primary, *secondary}});
  }
  return angles;
}

pipeline::InspectedImage inspected(pipeline::NewImage image, Console& console) {
  auto seen = pipeline::inspect_image(image);
  if (!seen && seen.error().figures.count("frames") && may_ask(console)) {
    const std::string line = answer_to(seen.error().message + "\nFrame: ", console);
    image = pipeline::new_image_from(image.file.string() + ":" + line);
    seen = pipeline::inspect_image(image);
  }
  return value_or_throw(std::move(seen));
}

/// Asks at a terminal for what the images leave open.
void ask(pipeline::NewCaseOptions& options, const std::vector<pipeline::InspectedImage>& images,
         Console& console) {
  if (!may_ask(console)) return;
  if (options.calibrator.empty())
    options.calibrator =
        answer_to("Calibrator (a calibrator.json, or udcsc for the built-in one): ", console);
  if (options.plate || options.maps.size() == images.size()) return;
  const pipeline::PlateChoice choice = pipeline::choose_plate(images);
  options.plate = choice.plate;
  if (options.plate) return;
  const std::string line = answer_to(
      fmt::format("{}.\nPlate (a plate.json, plate48, or none if the images are free of distortion): ",
                  choice.why),
      console);
  if (!line.empty()) options.plate = line;
}

void print(const pipeline::NewCase& draft, const std::filesystem::path& out, Console& console) {
  const std::string file = (out / "case.json").string();
  const std::vector<std::string> next{fmt::format("helicarm pick {}", out.string()),
                                      fmt::format("helicarm run {}", out.string())};
  if (console.json) {
    Json json = {{"case", file}, {"findings", draft.findings}, {"warnings", Json::array()}, {"next", next}};
    for (const Warning& warning : draft.warnings)
      json["warnings"].push_back(
          {{"code", code(warning.reason)}, {"view", warning.view}, {"message", warning.message}});
    console.out << to_text(json) << '\n';
    return;
  }
  for (const std::string& finding : draft.findings) console.out << "  " << finding << '\n';
  console.out << fmt::format(
      "\n  written to {}{}\n  Next:\n    {}    picks points; --csv FILE takes them from a table\n    {}    "
      "measures the case\n",
      file, draft.copies.empty() ? "" : " with copies of the files, patient data included", next[0], next[1]);
}

}  // namespace

/// Makes a case of image files. What the images do not decide is asked for on a terminal, else refused with
/// the option's name.
CommandResult new_command(const NewArguments& arguments, Console& console) {
  return guarded([&] {
    pipeline::NewCaseOptions options{arguments.calibrator,
                                     arguments.plate,
                                     files_by_view(arguments.maps, "--map"),
                                     files_by_view(arguments.plate_images, "--plate-image"),
                                     {arguments.pixel_mm, arguments.source_detector_mm},
                                     angles_by_view(arguments.angles)};
    std::vector<pipeline::InspectedImage> images;
    for (const std::string& word : arguments.images)
      images.push_back(inspected(pipeline::new_image_from(word), console));
    pipeline::name_views(images);
    ask(options, images, console);
    const pipeline::NewCase draft =
        value_or_throw(pipeline::new_case(std::move(images), options, arguments.out));
    value_or_throw(pipeline::write_new_case(draft, arguments.out));
    print_warnings(draft.warnings, console);
    print(draft, arguments.out, console);
  });
}

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
  command
      ->add_option(
          "--angles", a.angles,
          "VIEW=PRIMARY,SECONDARY: positioner angles, degrees, of an image whose file does not state "
          "them; repeatable")
      ->allow_extra_args(false);
  command->add_option("--out", a.out, "Folder for the case")->required();
}

}  // namespace helicarm::cli
