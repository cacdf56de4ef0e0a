// SPDX-License-Identifier: Apache-2.0
#include "import_command.h"

#include <fmt/format.h>

#include "command_line.h"
#include "findings.h"
#include "helicarm/core/json.h"
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
  exchange::ImportOptions options{
      .mm_per_unit = *mm, .column = arguments.column, .undistorted = arguments.undistorted};
  if (!arguments.image_size.empty()) options.image_size = {arguments.image_size[0], arguments.image_size[1]};
  if (!arguments.pixel_mm.empty()) options.pixel_mm = {arguments.pixel_mm[0], arguments.pixel_mm[1]};
  if (!arguments.origin_mm.empty()) options.origin_mm = {arguments.origin_mm[0], arguments.origin_mm[1]};
  for (const auto& [read, print] : {std::pair{&exchange::read_itk_transform, &print_transform},
                                    {&exchange::read_matrix_transform, &print_matrix}}) {
    auto transform = read(arguments.file);
    if (!transform) return tl::unexpected<Failure>(transform.error());
    if (!*transform) continue;
    (*transform)->translation *= mm->value_or(1);
    print(**transform, console);
    return {};
  }
  const auto imported = exchange::import_matrix(arguments.file, options);
  if (!imported) return tl::unexpected<Failure>(imported.error());
  print_warnings(imported->warnings, console);
  if (console.json)
    console.out << to_text(json_of(*imported)) << '\n';
  else
    print_table(*imported, console.out);
  return {};
}

void add_import(CLI::App& app, Action& action) {
  auto* command = add_command(
      app, group::images, "import",
      "Read a projection or transform of another program: MayaCam, DLT, NRRD, OpenCV, RTK, ITK",
      "helicarm import camera.txt --unit cm --json\n"
      "  helicarm import MergedDlts.csv --column 2 --image-size 1760,1700 --json\n"
      "  helicarm import geometry.xml --column 1 --pixel-mm 0.388,0.388 --image-size 1024,768 --json\n"
      "  helicarm import femur.tfm --json");
  auto& a = arguments_of(command, action, import_command);
  command
      ->add_option(
          "FILE", a.file,
          "MayaCam 1 or 2, NRRD header, OpenCV (YAML, XML, JSON), RTK (XML), a 3x4 matrix as text or JSON, "
          "XMALab's DLT coefficients, an ITK transform (.tfm, .h5), or a rigid 4x4 matrix")
      ->required();
  command
      ->add_option("--unit", a.unit,
                   "Unit of length in the file: mm, cm or m; needed where mm would be implausible")
      ->type_name("WORD");
  command
      ->add_option("--column", a.column,
                   "Camera of DLT coefficients, projection of RTK, image of OpenCV; from 1")
      ->check(within(1, 100));
  command
      ->add_option("--image-size", a.image_size,
                   "Width,height in px; DLT coefficients count rows upwards from 1, RTK's mm from the centre")
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
  command->add_flag("--undistorted", a.undistorted,
                    "The images are undistorted already: a lens distortion in the file is left out");
}

}  // namespace helicarm::cli
