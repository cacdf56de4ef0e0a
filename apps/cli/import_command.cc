// SPDX-License-Identifier: Apache-2.0
#include "import_command.h"

#include <fmt/format.h>

#include "helicarm/core/json.h"
#include "helicarm/geometry/import_matrix.h"
#include "helicarm/geometry/itk_transform.h"
#include "helicarm/geometry/view_json.h"

namespace helicarm::cli {
namespace {

Json json_of(const geometry::ImportedMatrix& imported) {
  const geometry::View& view = imported.view;
  Json json;
  json["K"] = geometry::json_rows(view.intrinsics.matrix());
  json["R"] = geometry::json_rows(view.camera_from_world.rotation);
  json["t"] = geometry::json_list(view.camera_from_world.translation);
  json["projection"] = geometry::json_rows(view.projection());
  json["image_size"] = nullptr;
  if (const auto& size = imported.image_size) json["image_size"] = {size->x(), size->y()};
  return json;
}

void print_table(const geometry::ImportedMatrix& imported, std::ostream& out) {
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

}  // namespace

CommandResult import_command(const ImportArguments& arguments, Console& console) {
  if (arguments.unit != "mm" && arguments.unit != "cm")
    return fail(Reason::usage, fmt::format("--unit: \"{}\" is neither mm nor cm", arguments.unit));
  geometry::ImportOptions options{.mm_per_unit = arguments.unit == "cm" ? 10.0 : 1.0,
                                  .column = arguments.column,
                                  .undistorted = arguments.undistorted};
  if (!arguments.image_size.empty()) options.image_size = {arguments.image_size[0], arguments.image_size[1]};
  if (!arguments.pixel_mm.empty()) options.pixel_mm = {arguments.pixel_mm[0], arguments.pixel_mm[1]};
  if (!arguments.origin_mm.empty()) options.origin_mm = {arguments.origin_mm[0], arguments.origin_mm[1]};
  auto transform = geometry::read_itk_transform(arguments.file);
  if (!transform) return tl::unexpected<Failure>(transform.error());
  if (*transform) {
    (*transform)->translation *= options.mm_per_unit;
    print_transform(**transform, console);
    return {};
  }
  const auto imported = geometry::import_matrix(arguments.file, options);
  if (!imported) return tl::unexpected<Failure>(imported.error());
  const auto& size = imported->image_size;
  const geometry::Intrinsics& k = imported->view.intrinsics;
  if (size && !(k.u0 > 0 && k.v0 > 0 && k.u0 < size->x() && k.v0 < size->y()))
    console.progress << fmt::format(
        "helicarm: warning: the central ray ({:.0f}, {:.0f}) lies outside the image of {} x {}: check the "
        "image size\n",
        k.u0, k.v0, size->x(), size->y());
  if (console.json)
    console.out << to_text(json_of(*imported)) << '\n';
  else
    print_table(*imported, console.out);
  return {};
}

}  // namespace helicarm::cli
