// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "command_line.h"
#include "distinct_names.h"
#include "findings.h"
#include "helicarm/core/csv.h"
#include "helicarm/core/earlier_files.h"
#include "helicarm/core/files.h"
#include "helicarm/image/png.h"
#include "helicarm/pipeline/result.h"
#include "helicarm/pipeline/run_fields.h"
#include "helicarm/rectification/displacement_field.h"
#include "helicarm/rectification/distortion_model.h"
#include "helicarm/rectification/inpaint.h"
#include "helicarm/rectification/paper_dots.h"
#include "helicarm/rectification/pixel_map.h"
#include "helicarm/rectification/rectified_dicom.h"
#include "helicarm/rectification/rectify.h"
#include "helicarm/rectification/test_grid.h"
#include "helicarm/xray/read_xray_image.h"
#include "helicarm/xray/uid.h"
#include "helicarm/xray/write_dicom.h"
#include "image_files.h"
#include "measuring.h"
#include "named_files.h"

namespace helicarm::cli {

/// One of: an image with a plate; images, points or an image of the test grid with a map.
struct RectifyArguments {
  std::vector<std::filesystem::path> images;  ///< with a map several, and folders of images
  std::optional<int> frame;
  std::optional<std::string> plate;  ///< plate.json or plate48
  std::optional<std::filesystem::path> map;
  std::optional<std::filesystem::path> points;  ///< CSV: u_px,v_px
  std::optional<double> test_grid_mm;           ///< pitch of the grid of 3.1
  std::filesystem::path out = "helicarm-rectified";
  rectification::Method method = rectification::Method::best;
  std::optional<std::string> model;  ///< distortion model; nothing: automatic
  bool inverse = false;              ///< points: rectified -> raw
  bool stages = false;               ///< also the images of the paper's Fig. 2
  bool field = false;                ///< also displacement.nrrd
  bool keep_patient = false;         ///< written images stay with the patient and the study of theirs
  std::vector<std::filesystem::path> xmalab;  ///< raw and undistorted dots of XMALab's grid
  std::vector<int> size;                      ///< of its image
};

namespace {

void write(const std::filesystem::path& to, xray::DerivedImage image, const std::filesystem::path& source,
           const RectifyArguments& arguments) {
  if (arguments.keep_patient) {
    image.patient_study = value_or_throw(xray::read_patient_study(source));
    // Not those of the image without its patient, which would link the two.
    for (std::string* uid : {&image.instance_uid, &image.series_uid})
      *uid = xray::uid_of(xray::text_key(*uid + image.patient_study->sop_instance_uid));
  }
  value_or_throw(xray::write_dicom(to, image));
}

/// In the pixels of the rectified image that is written; 1 mm where their size is not known.
void write_field(const RectifyArguments& arguments, const rectification::DistortionMap& map,
                 const xray::DerivedImage& rectified) {
  if (!arguments.field) return;
  const Eigen::Vector2d pixel_mm = rectified.acquisition.pixel_mm.value_or(Eigen::Vector2d::Ones());
  value_or_throw(
      write_file(arguments.out / "displacement.nrrd", rectification::displacement_field(map, pixel_mm)));
}

xray::XrayImage read(const std::filesystem::path& image, const RectifyArguments& arguments,
                     Console& console) {
  xray::XrayImage read = value_or_throw(xray::read_xray_image(image, arguments.frame));
  print_warnings(read.warnings, console);
  return read;
}

std::vector<Warning> joined(std::vector<Warning> warnings, const std::vector<Warning>& more) {
  warnings.insert(warnings.end(), more.begin(), more.end());
  return warnings;
}

rectification::DistortionMap map_of(const RectifyArguments& arguments) {
  return value_or_throw(rectification::distortion_map_from_json(value_or_throw(read_json(*arguments.map)),
                                                                arguments.map->filename().string()));
}

Json figures_of(const rectification::Rectification& r, const std::vector<Warning>& warnings) {
  return {{"model", r.map.model->name()},
          {"dots_found", r.dots_found},
          {"dots_expected", r.dots_expected ? Json(*r.dots_expected) : Json(nullptr)},
          {"residual_rms_px", r.map.residual_rms_px},
          {"residual_max_px", r.map.residual_max_px},
          {"held_out_rms_px", r.map.held_out_rms_px},
          {"raw_mean_px", r.raw_mean_px},
          {"raw_max_px", r.raw_max_px},
          {"warnings", pipeline::json_list_of(warnings)}};
}

/// Fig. 2 a to e.
void write_stages(const xray::XrayImage& xray_image, const rectification::Rectification& r,
                  const image::Image<float>& inpainted, const std::filesystem::path& out) {
  const auto stages =
      rectification::paper_stages(xray_image.pixels, xray_image.lowest, xray_image.highest, r.plate_dots);
  const auto last = rectification::displayed(inpainted, xray_image.lowest, xray_image.highest);
  for (const auto& [name, stage] :
       {std::pair{"raw", &stages.raw}, std::pair{"median", &stages.median}, std::pair{"edges", &stages.edges},
        std::pair{"circles", &stages.circles}, std::pair{"inpainted", &last}})
    value_or_throw(write_file(out / fmt::format("stage-{}.png", name), image::encode_png(*stage)));
}

void rectify_image(const RectifyArguments& arguments, Console& console) {
  const xray::XrayImage xray_image = read(arguments.images.front(), arguments, console);
  const rectification::Rectification r = value_or_throw(rectification::rectify(
      xray_image, plate_from(*arguments.plate), {arguments.method, {}, arguments.model.value_or("")}));
  print_warnings(r.warnings, console);
  std::string residuals = "u_px,v_px,residual_px\n";
  for (std::size_t i = 0; i < r.plate_dots.size(); ++i)
    residuals += fmt::format("{},{},{}\n", r.plate_dots[i].centre_px.x(), r.plate_dots[i].centre_px.y(),
                             r.residual_px[i]);
  const std::filesystem::path& source = arguments.images.front();
  const xray::DerivedImage rectified = rectification::rectified_dicom(xray_image, r.map, "rectified");
  write_field(arguments, r.map, rectified);
  write(arguments.out / "rectified.dcm", rectified, source, arguments);
  xray::XrayImage without_dots = xray_image;
  without_dots.pixels = rectification::inpainted(xray_image.pixels, r.plate_dots);
  write(arguments.out / "inpainted.dcm",
        rectification::rectified_dicom(without_dots, r.map, "rectified, plate hidden"), source, arguments);
  if (arguments.stages) write_stages(xray_image, r, without_dots.pixels, arguments.out);
  value_or_throw(write_file(arguments.out / "map.json", to_text(rectification::to_json(r.map)) + "\n"));
  value_or_throw(write_file(arguments.out / "residuals.csv", residuals));
  if (console.json)
    console.out << to_text(figures_of(r, joined(xray_image.warnings, r.warnings))) << '\n';
  else if (!console.quiet)
    console.out << fmt::format(
        "{}: {} dots, residual {:.3f} px rms, {:.3f} max, cross-validated {:.3f}; written to {}\n",
        r.map.model->name(), r.dots_found, r.map.residual_rms_px, r.map.residual_max_px,
        r.map.held_out_rms_px, arguments.out.string());
}

/// The map between XMALab's raw and undistorted dots.
void map_grid(const RectifyArguments& arguments, Console& console) {
  const auto dots = value_or_throw(rectification::read_xmalab_grid(arguments.xmalab[0], arguments.xmalab[1]));
  const auto fit = value_or_throw(rectification::fit_pixel_map(dots, arguments.size[0], arguments.size[1],
                                                               {{}, arguments.model.value_or("")}));
  std::string residuals = "u_px,v_px,residual_px\n";
  for (std::size_t i = 0; i < dots.size(); ++i)
    if (fit.used[i])
      residuals += fmt::format("{},{},{}\n", dots[i].raw_px.x(), dots[i].raw_px.y(), fit.residual_px[i]);
  value_or_throw(write_file(arguments.out / "map.json", to_text(rectification::to_json(fit.map)) + "\n"));
  value_or_throw(write_file(arguments.out / "residuals.csv", residuals));
  const auto used = std::ranges::count(fit.used, true);
  if (console.json)
    console.out << to_text({{"model", fit.map.model->name()},
                            {"dots_found", dots.size()},
                            {"dots_used", used},
                            {"residual_rms_px", fit.map.residual_rms_px},
                            {"residual_max_px", fit.map.residual_max_px},
                            {"held_out_rms_px", fit.map.held_out_rms_px},
                            {"warnings", Json::array()}})
                << '\n';
  else if (!console.quiet)
    console.out << fmt::format(
        "{}: {} of {} dots, residual {:.3f} px rms, {:.3f} max, cross-validated {:.3f}; written to {}\n",
        fit.map.model->name(), used, dots.size(), fit.map.residual_rms_px, fit.map.residual_max_px,
        fit.map.held_out_rms_px, arguments.out.string());
}

/// Refuses an image that the map is not for, or whose plate it does not make straight.
void map_images(const RectifyArguments& arguments, Console& console) {
  const rectification::DistortionMap map = map_of(arguments);
  const std::vector<std::filesystem::path> files = image_files(arguments.images);
  std::vector<std::string> names;
  for (const std::filesystem::path& file : files) names.push_back(file.stem().string());
  names = distinct(names);
  Json written = Json::array();
  std::vector<Warning> warnings;
  for (std::size_t i = 0; i < files.size(); ++i) {
    const xray::XrayImage xray_image = read(files[i], arguments, console);
    const auto mapped =
        value_or_throw(rectification::with_map(xray_image, map, {}).map_error([&](Failure failure) {
          failure.message = fmt::format("{}: {}", files[i].filename().string(), failure.message);
          return failure;
        }));
    warnings = joined(std::move(warnings), joined(xray_image.warnings, mapped.warnings));
    print_warnings(mapped.warnings, console);
    if (!mapped.map_confirmed && !console.quiet)
      console.progress << fmt::format(
          "helicarm: note: {}: no plate in the image confirms the map; it must be of this C-arm position\n",
          files[i].filename().string());
    const std::filesystem::path to =
        arguments.out / (files.size() == 1 ? "rectified.dcm" : names[i] + "_rectified.dcm");
    const xray::DerivedImage rectified = rectification::rectified_dicom(xray_image, map, "rectified");
    if (i == 0) write_field(arguments, map, rectified);
    write(to, rectified, files[i], arguments);
    written.push_back(to.string());
    if (!console.quiet && !console.json)
      console.out << fmt::format("[{}/{}] {}\n", i + 1, files.size(), to.string());
  }
  if (console.json)
    console.out << to_text(
                       Json{{"written", std::move(written)}, {"warnings", pipeline::json_list_of(warnings)}})
                << '\n';
}

void map_points(const RectifyArguments& arguments, Console& console) {
  const rectification::DistortionMap map = map_of(arguments);
  const CsvTable table = value_or_throw(read_csv(*arguments.points, {"u_px", "v_px"}, {}));
  Json points = Json::array();
  for (std::size_t row = 0; row < table.rows(); ++row) {
    const Eigen::Vector2d uv{table.number(row, "u_px"), table.number(row, "v_px")};
    const auto mapped =
        arguments.inverse ? rectification::raw_in_image(map, uv) : rectification::rectified_in_image(map, uv);
    points.push_back(mapped ? Json{{"u", mapped->x()}, {"v", mapped->y()}}
                            : Json{{"u", nullptr}, {"v", nullptr}});
  }
  if (console.json) {
    console.out << to_text(Json{{"points", std::move(points)}}) << '\n';
    return;
  }
  console.out << "u_px,v_px\n";
  for (const Json& point : points) console.out << point["u"].dump() << ',' << point["v"].dump() << '\n';
}

Json crossings_of(const rectification::TestGrid& grid) {
  Json crossings = Json::array();
  for (std::size_t k = 0; k < grid.raw_px.size(); ++k)
    crossings.push_back({{"uv_raw", {grid.raw_px[k].x(), grid.raw_px[k].y()}},
                         {"uv", {grid.rectified_px[k].x(), grid.rectified_px[k].y()}},
                         {"ideal_uv_raw", {grid.raw_ideal_px[k].x(), grid.raw_ideal_px[k].y()}},
                         {"raw_error_px", grid.raw_error_px[k]},
                         {"rectified_error_px", grid.rectified_error_px[k]}});
  return crossings;
}

void measure_grid(const RectifyArguments& arguments, Console& console) {
  const rectification::DistortionMap map = map_of(arguments);
  const xray::XrayImage image = read(arguments.images.front(), arguments, console);
  const rectification::TestGrid grid =
      value_or_throw(rectification::measure_test_grid(rectification::find_grid(image), map));
  value_or_throw(
      rectification::check_pitch(grid, *arguments.test_grid_mm, map, image.acquisition.source_detector_mm));
  const auto json_of = [](const rectification::GridError& error) {
    return Json{{"mean_px", error.mean_px}, {"max_px", error.max_px}};
  };
  if (console.json)
    console.out << to_text(Json{{"raw", json_of(grid.raw)},
                                {"rectified", json_of(grid.rectified)},
                                {"n", grid.crosses},
                                {"crossings", crossings_of(grid)},
                                {"warnings", pipeline::json_list_of(image.warnings)}})
                << '\n';
  else
    console.out << fmt::format(
        "{} crosses; raw {:.3f} px mean, {:.3f} max; rectified {:.3f} mean, {:.3f} max\n", grid.crosses,
        grid.raw.mean_px, grid.raw.max_px, grid.rectified.mean_px, grid.rectified.max_px);
}

/// Whether this program wrote the image.
bool is_own_image(const std::filesystem::path& file) {
  std::string begin(4096, '\0');
  std::ifstream in(file, std::ios::binary);
  in.read(begin.data(), static_cast<std::streamsize>(begin.size()));
  begin.resize(static_cast<std::size_t>(in.gcount()));
  return begin.size() > 132 && begin.compare(128, 4, "DICM") == 0 && begin.find("helicarm") != begin.npos;
}

/// Files of an earlier run, except those that this one reads.
void forget(const RectifyArguments& arguments) {
  std::vector<std::filesystem::path> inputs = arguments.images;
  if (arguments.map) inputs.push_back(*arguments.map);
  if (arguments.plate) inputs.emplace_back(*arguments.plate);
  std::vector<std::string> names{
      "rectified.dcm", "inpainted.dcm",    "map.json",        "residuals.csv",     "displacement.nrrd",
      "stage-raw.png", "stage-median.png", "stage-edges.png", "stage-circles.png", "stage-inpainted.png"};
  std::error_code ec;
  for (std::filesystem::directory_iterator entry(arguments.out, ec), end; !ec && entry != end;
       entry.increment(ec))
    if (const std::string name = entry->path().filename().string();
        name.ends_with("_rectified.dcm") && is_own_image(entry->path()))
      names.push_back(name);
  for (const std::filesystem::path& folder : arguments.images)
    if (std::error_code other; std::filesystem::equivalent(folder, arguments.out, other)) return;
  forget_files(arguments.out, names, inputs);
}

}  // namespace

/// Fits the distortion of an image and writes rectified.dcm, map.json and residuals.csv; or applies a map to
/// images (rectified.dcm, of several NAME_rectified.dcm) or points; or measures the residual errors of a map
/// on the test grid (Eq. 14-15).
CommandResult rectify_command(const RectifyArguments& arguments, Console& console) {
  return guarded([&] {
    const RectifyArguments& a = arguments;
    if (!a.images.empty() && !a.points && !a.test_grid_mm) forget(a);
    if (a.stages && (!a.plate || a.method != rectification::Method::paper))
      throw BadInput(Reason::usage, "rectify: --stages is of IMAGE --plate --method paper");
    if (!a.xmalab.empty()) {
      if (!a.images.empty() || a.plate || a.map || a.points || a.test_grid_mm || a.size.empty())
        throw BadInput(Reason::usage, "rectify: --xmalab INPTS BSPTS goes with --size and without an image");
      return map_grid(a, console);
    }
    if (!a.size.empty()) throw BadInput(Reason::usage, "rectify: --size is of --xmalab");
    if (a.model && (!a.plate || a.method == rectification::Method::paper))
      throw BadInput(Reason::usage, "rectify: --model is of IMAGE --plate --method best");
    if (a.field && (a.images.empty() || a.test_grid_mm))
      throw BadInput(Reason::usage, "rectify: --field is of IMAGE --plate and of IMAGE... --map");
    if (a.points && a.map && a.images.empty()) return map_points(a, console);
    if (a.images.size() == 1 && a.test_grid_mm && a.map) return measure_grid(a, console);
    if (!a.images.empty() && a.map && !a.plate && !a.points && !a.test_grid_mm) return map_images(a, console);
    if (a.images.size() == 1 && a.plate && !a.map && !a.points && !a.test_grid_mm)
      return rectify_image(a, console);
    throw BadInput(Reason::usage,
                   "rectify: give IMAGE --plate, or IMAGE... --map, or --map --points, or IMAGE --map "
                   "--test-grid, or --xmalab (see --help)");
  });
}

void add_rectify(CLI::App& app, Action& action) {
  auto* command = add_command(app, group::images, "rectify",
                              "Correct an intensifier's distortion by its plate, or apply a known map (2.1)",
                              "helicarm rectify AP.dcm --plate plate48 --out rectified\n"
                              "  helicarm rectify series/ --map rectified/map.json --out straight\n"
                              "  helicarm rectify --map rectified/map.json --points raw.csv --json\n"
                              "  helicarm rectify GRID.dcm --map rectified/map.json --test-grid 20 --json");
  auto& a = arguments_of(command, action, rectify_command);
  command->add_option("IMAGE", a.images,
                      "DICOM, PNG, TIFF, JPEG or BMP; with --map several, and folders of images");
  command->add_option("--frame", a.frame, "Number of the image in a multi-frame file, from 1")
      ->check(within(1, 100000));
  command->add_option("--plate", a.plate, "plate.json, or plate48");
  command->add_option("--map", a.map, "map.json of an earlier rectification");
  command->add_option("--points", a.points, "CSV: u_px,v_px, raw pixels");
  command->add_flag("--inverse", a.inverse, "The points are rectified pixels; return raw ones");
  command->add_option("--test-grid", a.test_grid_mm, "Pitch of the test grid, mm: report Eq. 14-15")
      ->check(within(0.1, 1000));
  command
      ->add_option("--xmalab", a.xmalab,
                   "NAME_INPTS.csv and NAME_BSPTS.csv, as XMALab exports them with its look-up table: the "
                   "map into its undistorted image")
      ->expected(2);
  command->add_option("--size", a.size, "With --xmalab: columns and rows of the image")
      ->expected(2)
      ->check(within(1, 16384));
  command
      ->add_option("--out", a.out,
                   "Folder for rectified.dcm (of several images NAME_rectified.dcm), inpainted.dcm, "
                   "map.json and residuals.csv")
      ->capture_default_str();
  command->add_flag("--field", a.field,
                    "Also displacement.nrrd: the map as displacement field of ITK and 3D Slicer");
  command->add_flag("--keep-patient", a.keep_patient,
                    "Written images keep the patient and the study of theirs, to be stored with it (default: "
                    "neither name nor dates nor UIDs)");
  add_field(
      command, field_named<pipeline::RunOptions>(pipeline::run_fields, "method"),
      [&](std::optional<double> number) { a.method = rectification::Method(int(*number)); },
      "best, or paper: Hough circles and a quadratic")
      ->default_str(std::string(word(a.method)));
  command
      ->add_option("--model", a.model,
                   "Distortion model, with --method best: " + rectification::model_names() +
                       " (default: by the number of dots and their held-out errors)")
      ->type_name("WORD");
  command->add_flag("--stages", a.stages,
                    "With --method paper: also the paper's Fig. 2, stage-raw.png to stage-inpainted.png");
}

}  // namespace helicarm::cli
