// SPDX-License-Identifier: Apache-2.0
#include "import_command.h"

#include <algorithm>

#include <fmt/format.h>

#include "command_line.h"
#include "findings.h"
#include "helicarm/core/json.h"
#include "helicarm/core/text.h"
#include "helicarm/devices/tracker/sequence_file.h"
#include "helicarm/exchange/import_matrix.h"
#include "helicarm/exchange/itk_transform.h"
#include "helicarm/exchange/matrix_transform.h"
#include "helicarm/geometry/view_json.h"
#include "helicarm/pipeline/result.h"

namespace helicarm::cli {
namespace {

Json json_of(const exchange::ImportedMatrix& imported) {
  const geometry::View& view = imported.view;
  Json json;
  if (!imported.name.empty()) json["name"] = imported.name;
  json["K"] = geometry::json_rows(view.intrinsics.matrix());
  json["R"] = geometry::json_rows(view.camera_from_world.rotation);
  json["t"] = geometry::json_list(view.camera_from_world.translation);
  json["projection"] = geometry::json_rows(view.projection());
  json["image_size"] = nullptr;
  if (const auto& size = imported.image_size) json["image_size"] = {size->x(), size->y()};
  json["warnings"] = pipeline::json_list_of(imported.warnings);
  return json;
}

void print_table(const exchange::ImportedMatrix& imported, std::ostream& out) {
  const Eigen::IOFormat rows(8, 0, "  ", "\n", "  ");
  const geometry::View& view = imported.view;
  out << "K (px)\n"
      << view.intrinsics.matrix().format(rows) << "\nR\n"
      << view.camera_from_world.rotation.format(rows) << "\nt (mm)\n"
      << view.camera_from_world.translation.transpose().format(rows) << '\n';
  if (const auto& size = imported.image_size)
    out << fmt::format("image size {} x {}\n", size->x(), size->y());
}

/// `fixed_from_moving` is the world_from_model of a model placed below the transform in 3D Slicer.
void print_transform(const geometry::RigidTransform& moving_from_fixed, Console& console) {
  const Eigen::Matrix4d forward = moving_from_fixed.matrix(), back = moving_from_fixed.inverse().matrix();
  if (console.json) {
    console.out << to_text(Json{{"fixed_from_moving", geometry::json_rows(back)},
                                {"moving_from_fixed", geometry::json_rows(forward)}})
                << '\n';
    return;
  }
  const Eigen::IOFormat rows(8, 0, "  ", "\n", "  ");
  console.out << "fixed from moving (LPS, mm)\n"
              << back.format(rows) << "\nmoving from fixed, as in the file\n"
              << forward.format(rows) << '\n';
}

/// Of a 4x4 matrix, which does not state what it connects.
void print_matrix(const geometry::RigidTransform& transform, Console& console) {
  const Eigen::Matrix4d forward = transform.matrix(), back = transform.inverse().matrix();
  if (console.json) {
    console.out << to_text(
                       Json{{"matrix", geometry::json_rows(forward)}, {"inverse", geometry::json_rows(back)}})
                << '\n';
    return;
  }
  const Eigen::IOFormat rows(8, 0, "  ", "\n", "  ");
  console.out << "rigid motion, as in the file (mm)\n"
              << forward.format(rows) << "\ninverse\n"
              << back.format(rows) << '\n';
}

/// Whether the file is a sequence of transforms by its name.
bool is_sequence(const std::filesystem::path& file) {
  return file.extension() == ".mha" || file.extension() == ".mhd";
}

void print_sequence(const tracker::TransformSequence& sequence, Console& console) {
  if (console.json) {
    Json transforms = Json::object();
    for (const auto& [name, of] : sequence.transforms) {
      Json& list = transforms[name] = Json::array();
      for (const auto& pose : of) list.push_back(pose ? geometry::json_rows(pose->matrix()) : Json(nullptr));
    }
    console.out << to_text(Json{{"index", sequence.index}, {"transforms", std::move(transforms)}}) << '\n';
    return;
  }
  console.out << fmt::format("{} items (LPS, mm, to parent)\n", sequence.index.size());
  for (const auto& [name, of] : sequence.transforms)
    console.out << fmt::format("{}: {} poses\n", without_control_characters(name),
                               std::ranges::count_if(of, [](const auto& pose) { return pose.has_value(); }));
}

/// One camera, or the list of several.
void print_cameras(const std::vector<exchange::ImportedMatrix>& cameras, Console& console) {
  if (!console.json)
    for (std::size_t i = 0; i < cameras.size(); ++i) {
      if (cameras.size() > 1)
        console.out << fmt::format("{}camera {}{}{}\n", i == 0 ? "" : "\n", i + 1,
                                   cameras[i].name.empty() ? "" : ": ", cameras[i].name);
      print_table(cameras[i], console.out);
    }
  else if (cameras.size() == 1)
    console.out << to_text(json_of(cameras.front())) << '\n';
  else {
    Json list = Json::array();
    for (const auto& camera : cameras) list.push_back(json_of(camera));
    console.out << to_text(Json{{"cameras", std::move(list)}}) << '\n';
  }
}

/// Of all cameras, each once.
std::vector<Warning> warnings_of(const std::vector<exchange::ImportedMatrix>& cameras) {
  std::vector<Warning> warnings;
  for (std::size_t i = 0; i < cameras.size(); ++i)
    for (Warning warning : cameras[i].warnings) {
      const auto same = [&](const Warning& other) { return other.reason == warning.reason; };
      if (std::ranges::any_of(warnings, same)) continue;
      if (cameras.size() > 1) warning.message = fmt::format("camera {}: {}", i + 1, warning.message);
      warnings.push_back(std::move(warning));
    }
  return warnings;
}

Expected<std::optional<exchange::RowKind>> row_kind(const std::optional<std::string>& word) {
  if (!word) return std::nullopt;
  if (*word == "matrix") return exchange::RowKind::matrix;
  if (*word == "astra") return exchange::RowKind::astra;
  return fail(Reason::usage, fmt::format("--rows: \"{}\" is none of: matrix, astra", *word));
}

Expected<std::optional<double>> mm_per_unit(const std::optional<std::string>& unit) {
  if (!unit) return std::nullopt;
  for (const auto& [word, mm] : {std::pair{"mm", 1.0}, {"cm", 10.0}, {"m", 1000.0}})
    if (*unit == word) return mm;
  return fail(Reason::usage, fmt::format("--unit: \"{}\" is none of: mm, cm, m", *unit));
}

}  // namespace

CommandResult import_command(const ImportArguments& arguments, Console& console) {
  const auto mm = mm_per_unit(arguments.unit);
  if (!mm) return tl::unexpected<Failure>(mm.error());
  const auto rows = row_kind(arguments.rows);
  if (!rows) return tl::unexpected<Failure>(rows.error());
  exchange::ImportOptions options{.mm_per_unit = *mm,
                                  .column = arguments.column,
                                  .undistorted = arguments.undistorted,
                                  .rows = *rows,
                                  .rows_upwards = arguments.rows_upwards};
  if (!arguments.image_size.empty()) options.image_size = {arguments.image_size[0], arguments.image_size[1]};
  if (!arguments.pixel_mm.empty()) options.pixel_mm = {arguments.pixel_mm[0], arguments.pixel_mm[1]};
  if (!arguments.origin_mm.empty()) options.origin_mm = {arguments.origin_mm[0], arguments.origin_mm[1]};
  if (is_sequence(arguments.file)) {
    auto sequence = tracker::read_slicer_sequence(arguments.file);
    if (!sequence) return tl::unexpected<Failure>(sequence.error());
    for (auto& [name, of] : sequence->transforms)
      for (auto& pose : of)
        if (pose) pose->translation *= mm->value_or(1);
    print_sequence(*sequence, console);
    return {};
  }
  for (const auto& [read, print] : {std::pair{&exchange::read_itk_transform, &print_transform},
                                    {&exchange::read_matrix_transform, &print_matrix}}) {
    if (std::filesystem::is_directory(arguments.file)) break;
    auto transform = read(arguments.file);
    if (!transform) return tl::unexpected<Failure>(transform.error());
    if (!*transform) continue;
    (*transform)->translation *= mm->value_or(1);
    print(**transform, console);
    return {};
  }
  const auto cameras = exchange::import_cameras(arguments.file, options);
  if (!cameras) return tl::unexpected<Failure>(cameras.error());
  print_warnings(warnings_of(*cameras), console);
  print_cameras(*cameras, console);
  return {};
}

void add_import(CLI::App& app, Action& action) {
  auto* command = add_command(
      app, group::images, "import",
      "Read cameras or a transform of another program: MayaCam, OpenCV, RTK, TIGRE, ASTRA, LEAP, ITK, ...",
      "helicarm import camera.txt --unit cm --json\n"
      "  helicarm import MergedDlts.csv --column 2 --image-size 1760,1700 --json\n"
      "  helicarm import geometry.xml --pixel-mm 0.388,0.388 --image-size 1024,768 --json\n"
      "  helicarm import my-geometry/geometry/astra.txt --image-size 976,976 --json\n"
      "  helicarm import femur.tfm --json\n"
      "  helicarm import my-motion/smoothed.seq.mha --json");
  auto& a = arguments_of(command, action, import_command);
  command
      ->add_option(
          "FILE", a.file,
          "MayaCam 1 or 2, NRRD header, OpenCV (YAML, XML, JSON), a 3x4 matrix as text or JSON, XMALab's DLT "
          "coefficients, plastimatch's projection matrix; of a whole run RTK (XML), TIGRE, LEAP, DiffDRR, "
          "DeepDRR (JSON), ASTRA's vectors, .ompl, matrices.csv, .npy, or a folder with a file for each "
          "camera; an ITK transform (.tfm, .h5), a rigid 4x4 matrix, or a sequence of transforms of 3D "
          "Slicer "
          "(.seq.mha, RAS, as track and register write it)")
      ->required();
  command
      ->add_option(
          "--unit", a.unit,
          "Unit of length in the file: mm, cm or m; needed where mm would be implausible (RTK: of its "
          "distances, not of --pixel-mm)")
      ->type_name("WORD");
  command
      ->add_option("--column", a.column, "This camera of a file of several, from 1 (default: all, as a list)")
      ->check(within(1, 10000));
  command
      ->add_option("--image-size", a.image_size,
                   "Width,height in px, where the file does not state them; needed for DLT coefficients, "
                   "ASTRA, RTK")
      ->delimiter(',')
      ->expected(2)
      ->check(within(1, 16384));
  command->add_option("--pixel-mm", a.pixel_mm, "RTK: spacing of the projection images, column,row")
      ->delimiter(',')
      ->expected(2)
      ->check(within(1e-4, 100));
  command
      ->add_option("--origin-mm", a.origin_mm,
                   "RTK: origin of the projection images (default: the image's centre is 0,0)")
      ->delimiter(',')
      ->expected(2)
      ->check(within(-1e5, 1e5));
  command
      ->add_option("--rows", a.rows,
                   "What rows of 12 numbers without a word on them are: matrix (3x4, row by row) or astra "
                   "(cone_vec)")
      ->type_name("WORD");
  command->add_flag("--rows-upwards", a.rows_upwards,
                    "The file's images have their last row first (RTK): row = height - 1 - v");
  command->add_flag("--undistorted", a.undistorted,
                    "The images are undistorted already: a lens distortion in the file is left out");
}

}  // namespace helicarm::cli
