// SPDX-License-Identifier: Apache-2.0
#include "helicarm/report/exports.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <map>
#include <string>

#include <fmt/format.h>

#include "helicarm/core/csv.h"
#include "helicarm/core/earlier_files.h"
#include "helicarm/core/files.h"
#include "helicarm/core/json.h"
#include "helicarm/measures/object_plane.h"
#include "helicarm/rectification/rectified_dicom.h"
#include "helicarm/report/camera_exports.h"
#include "helicarm/report/overlay.h"

namespace helicarm::report {
namespace {

using Files = std::map<std::string, std::string>;

constexpr std::string_view points_header =
    "name,source,frame,x_mm,y_mm,z_mm,sigma_x_mm,sigma_y_mm,sigma_z_mm,error_95_mm\n";

/// A located point under the name and source that the table states.
struct ExportedPoint {
  std::string name;
  std::string_view source;  ///< pick, target or plan
  const guidance::PointInFrames* located;
};

/// Picks and targets, then the points of registered models' plans.
std::vector<ExportedPoint> exported_points(const pipeline::Result& result) {
  std::vector<ExportedPoint> points;
  for (const pipeline::PointResult& point : result.points)
    if (point.place) points.push_back({point.name, word(point.source), &*point.place});
  for (const pipeline::ModelPoint& point : result.model_points)
    points.push_back({point.name, "plan", &point.place});
  return points;
}

std::string csv_row(const ExportedPoint& point, std::string_view frame, const Eigen::Vector3d& position,
                    const Eigen::Matrix3d& covariance) {
  const Eigen::Vector3d sigma = covariance.diagonal().cwiseMax(0).cwiseSqrt();
  return fmt::format("{},{},{},{},{},{},{},{},{},{}\n", csv_field(point.name), point.source, frame,
                     position.x(), position.y(), position.z(), sigma.x(), sigma.y(), sigma.z(),
                     localization::length_at_95(covariance));
}

std::string points_csv(const pipeline::Result& result) {
  std::string rows;
  for (const ExportedPoint& point : exported_points(result)) {
    const guidance::PointInFrames& at = *point.located;
    rows += csv_row(point, "calibrator", at.in_calibrator, at.covariance_in_calibrator);
    for (const auto& [bone, position] : at.in_bones)
      rows += csv_row(point, csv_field(bone), position.point(), position.covariance);
    if (at.in_tool) rows += csv_row(point, "tool", at.in_tool->point(), at.in_tool->covariance);
  }
  if (rows.empty()) return rows;
  return std::string(points_header) + rows;
}

Json control_point(const std::string& name, const guidance::PointInFrames& located) {
  const Eigen::Vector3d& at = located.in_calibrator;
  return {{"id", name},
          {"label", name},
          {"description", fmt::format("within {:.3f} mm (95 %), calibrator frame",
                                      localization::length_at_95(located.covariance_in_calibrator))},
          {"position", {at.x(), at.y(), at.z()}},
          {"positionStatus", "defined"}};
}

Json markup(const char* type, const std::string& name, Json points) {
  return {{"type", type},
          {"name", name},
          {"description",
           "Coordinates are in helicarm's calibrator frame (mm), not in a patient frame: LPS is only a "
           "label, and L, P, S mean the calibrator's x, y, z. Register them before overlaying them on a CT."},
          {"coordinateSystem", "LPS"},
          {"coordinateUnits", "mm"},
          {"locked", true},
          {"controlPoints", std::move(points)}};
}

std::string slicer_markups(const pipeline::Result& result) {
  Json points = Json::array(), markups = Json::array();
  for (const ExportedPoint& point : exported_points(result))
    points.push_back(control_point(point.name, *point.located));
  if (points.empty()) return {};
  markups.push_back(markup("Fiducial", "helicarm points, calibrator frame", std::move(points)));
  const auto add_line = [&](const std::string& name, const Json& start, const Json& end) {
    markups.push_back(markup("Line", "tunnel " + name, Json::array({start, end})));
  };
  for (std::size_t i = 0; i < result.tunnel_ends.size(); ++i) {
    const pipeline::PointResult& start = result.points[result.tunnel_ends[i].start];
    const pipeline::PointResult& end = result.points[result.tunnel_ends[i].end];
    if (start.place && end.place && i < result.tunnels.size())
      add_line(result.tunnels[i].name, control_point(start.name, *start.place),
               control_point(end.name, *end.place));
  }
  const auto end = [&](std::size_t i) {
    return control_point(result.model_points[i].name, result.model_points[i].place);
  };
  for (const pipeline::ModelTunnel& planned : result.model_tunnels)
    add_line(planned.tunnel.name, end(planned.ends.start), end(planned.ends.end));
  return to_text({{"@schema",
                   "https://raw.githubusercontent.com/slicer/slicer/master/Modules/Loadable/Markups/"
                   "Resources/Schema/markups-schema-v1.0.0.json#"},
                  {"markups", std::move(markups)}}) +
         "\n";
}

/// Among all formats an RTK geometry is left out where RTK cannot represent the camera.
std::string rtk_if_possible(const pipeline::ViewResult& view, bool among_all) {
  const auto text = guarded([&] { return rtk_geometry(view); });
  if (text || among_all) return text.value_or("");
  Failure failure = text.error();
  failure.view = view.name;
  throw BadInput(std::move(failure));
}

Files files_of(const pipeline::Result& result, std::span<const Export> kinds) {
  const auto wanted = [&](Export kind) { return std::ranges::find(kinds, kind) != kinds.end(); };
  Files files;
  const auto add = [&](const std::string& name, std::string text) {
    if (!text.empty() && !files.emplace(name, std::move(text)).second)
      throw BadInput(Reason::name_clash, fmt::format("{}: two views would share this file", name));
  };
  if (wanted(Export::csv)) add("points.csv", points_csv(result));
  if (wanted(Export::slicer)) add("points.mrk.json", slicer_markups(result));
  std::vector<const pipeline::ViewResult*> calibrated;
  for (std::size_t i = 0; i < result.views.size(); ++i) {
    const pipeline::ViewResult& view = result.views[i];
    if (!view.calibrated || !view.xray_image) continue;
    calibrated.push_back(&view);
    const std::string stem = file_stem(view.name, i);
    if (wanted(Export::mayacam)) add(stem + "_mayacam.txt", maya_cam(view));
    if (wanted(Export::matrix)) add(stem + "_matrix.txt", matrix_text(view));
    if (wanted(Export::opencv)) add(stem + "_opencv.yml", opencv_yaml(view));
    if (wanted(Export::itk)) add(stem + "_pose.tfm", itk_pose(view));
    if (wanted(Export::rtk))
      add(stem + "_rtk.xml", rtk_if_possible(view, kinds.size() == every_export.size()));
  }
  if (wanted(Export::dlt) && !calibrated.empty()) add("dlt.csv", dlt_csv(calibrated));
  if (calibrated.empty() || !std::ranges::any_of(requested_export, wanted)) return files;
  const exchange::RunGeometry run = run_geometry(calibrated);
  if (wanted(Export::tigre)) add("views_tigre.json", value_or_throw(exchange::tigre_geometry(run)));
  if (wanted(Export::astra)) add("views_astra.txt", exchange::astra_vectors(run));
  if (wanted(Export::leap)) add("views_leap.json", value_or_throw(exchange::leap_modular(run)));
  if (wanted(Export::diffdrr)) add("views_diffdrr.json", value_or_throw(exchange::diffdrr_cameras(run)));
  if (wanted(Export::deepdrr)) add("views_deepdrr.json", exchange::deepdrr_cameras(run));
  if (wanted(Export::ompl)) add("views_matrices.ompl", exchange::ompl_matrices(run));
  if (wanted(Export::npy)) add("views_matrices.npy", exchange::matrices_npy(run));
  for (std::size_t i = 0; wanted(Export::plastimatch) && i < run.images.size(); ++i)
    add(file_stem(run.images[i].name, i) + "_plastimatch.txt",
        exchange::plastimatch_matrix(run.images[i].view, run.pixel_mm));
  return files;
}

/// End of a file's name, and what the file holds near its begin.
struct ExportedFile {
  std::string_view ending;
  std::string_view mark;
};
constexpr std::array exported_files{ExportedFile{"points.csv", points_header},
                                    ExportedFile{"points.mrk.json", "helicarm"},
                                    ExportedFile{"_mayacam.txt", "image size\n"},
                                    ExportedFile{"_matrix.txt", "# 3x4: calibrator (mm) to rectified pixels"},
                                    ExportedFile{"_opencv.yml", "%YAML:1.0\n---\nimage_width: "},
                                    ExportedFile{"_pose.tfm", "#Insight Transform File"},
                                    ExportedFile{"_rtk.xml", "<!-- Projection image: spacing"},
                                    ExportedFile{"_rectified.dcm", "helicarm"},
                                    ExportedFile{"views_tigre.json", "\"offDetector\""},
                                    ExportedFile{"views_astra.txt", "# ASTRA cone_vec"},
                                    ExportedFile{"views_leap.json", "\"moduleCenters\""},
                                    ExportedFile{"views_diffdrr.json", "\"diffdrr\""},
                                    ExportedFile{"views_deepdrr.json", "\"deepdrr\""},
                                    ExportedFile{"views_matrices.ompl", "["},
                                    ExportedFile{"views_matrices.npy", "NUMPY"},
                                    ExportedFile{"_plastimatch.txt", "\nExtrinsic\n"}};

/// Rows of 11 coefficients of each view, nothing else.
bool is_dlt_table(std::string_view text) {
  return text.find_first_not_of("0123456789+-.eE,\n") == text.npos && std::ranges::count(text, '\n') == 11;
}

bool is_exported(const std::filesystem::path& file) {
  const std::string name = file.filename().string();
  std::string begin(64 << 10, '\0');
  std::ifstream in(file, std::ios::binary);
  in.read(begin.data(), static_cast<std::streamsize>(begin.size()));
  begin.resize(static_cast<std::size_t>(in.gcount()));
  if (name == "dlt.csv") return is_dlt_table(begin);
  return std::ranges::any_of(exported_files, [&](const ExportedFile& kind) {
    const bool is_named = kind.ending.starts_with('_') ? name.ends_with(kind.ending) : name == kind.ending;
    return is_named && begin.find(kind.mark) != begin.npos;
  });
}

/// NAME_rectified.dcm for each calibrated view: the pixels that its projection refers to.
std::map<std::string, xray::DerivedImage> images_of(const pipeline::Result& result,
                                                    std::span<const Export> kinds,
                                                    const std::optional<SpacingObject>& object) {
  std::map<std::string, xray::DerivedImage> images;
  if (std::ranges::find(kinds, Export::images) == kinds.end()) return images;
  const auto spacings =
      object ? value_or_throw(spacings_at(result, *object)) : std::map<std::size_t, xray::ObjectSpacing>();
  for (std::size_t i = 0; i < result.views.size(); ++i) {
    const pipeline::ViewResult& view = result.views[i];
    if (!view.calibrated || !view.xray_image || !view.rectification) continue;
    const std::string name = file_stem(view.name, i) + "_rectified.dcm";
    std::string done = "rectified";
    if (object)
      done += fmt::format(", pixel spacing at {}, {:.3f} mm from the source", object->name,
                          spacings.at(i).source_object_mm);
    xray::DerivedImage image =
        rectification::rectified_dicom(*view.xray_image, view.rectification->map, std::move(done));
    if (object) {
      image.at_object = spacings.at(i);
      image.series_description = "rectified, calibrated pixel spacing";
    }
    if (!images.emplace(name, std::move(image)).second)
      throw BadInput(Reason::name_clash, fmt::format("{}: two views would share this file", name));
  }
  return images;
}

}  // namespace

Expected<std::vector<Export>> exports_named(const std::vector<std::string>& words) {
  std::vector<Export> kinds;
  for (const std::string& word : words) {
    const auto found = std::ranges::find(export_words, word);
    const auto requested = std::ranges::find(requested_words, word);
    if (found != export_words.end())
      kinds.push_back(every_export[std::size_t(found - export_words.begin())]);
    else if (requested != requested_words.end())
      kinds.push_back(requested_export[std::size_t(requested - requested_words.begin())]);
    else
      return fail(Reason::usage,
                  fmt::format("as: \"{}\" is none of: {}, {}", word, fmt::join(export_words, ", "),
                              fmt::join(requested_words, ", ")));
  }
  if (kinds.empty()) kinds.assign(every_export.begin(), every_export.end());
  return kinds;
}

Expected<std::map<std::size_t, xray::ObjectSpacing>> spacings_at(const pipeline::Result& result,
                                                                 const SpacingObject& object) {
  return guarded([&] {
    std::map<std::size_t, xray::ObjectSpacing> spacings;
    for (std::size_t i = 0; i < result.views.size(); ++i) {
      const pipeline::ViewResult& view = result.views[i];
      if (!view.calibrated) continue;
      const geometry::RigidTransform motion =
          i < object.motions.size() ? object.motions[i] : geometry::RigidTransform{};
      auto plane = measures::plane_through(*view.calibrated, motion * object.at,
                                           motion.rotation * object.covariance * motion.rotation.transpose());
      if (!plane) {
        plane.error().view = view.name;
        plane.error().message = fmt::format("{}: {}", object.name, plane.error().message);
        throw BadInput(plane.error());
      }
      const geometry::Intrinsics& k = plane->intrinsics;
      std::optional<double> source_detector_mm;
      if (view.rectification && view.rectification->map.rectified_pixel_mm &&
          view.rectification->map.rectified_plane == rectification::RectifiedPlane::detector)
        source_detector_mm = std::abs(k.fy) * *view.rectification->map.rectified_pixel_mm;
      spacings.emplace(
          i, xray::ObjectSpacing{plane->depth_mm,
                                 source_detector_mm,
                                 {plane->depth_mm / std::abs(k.fx), plane->depth_mm / std::abs(k.fy)},
                                 plane->relative_sigma,
                                 object.name});
    }
    return spacings;
  });
}

std::string one_pixel_size_note(const pipeline::Result& result, std::span<const Export> kinds) {
  constexpr double least_px = 0.01;
  const auto has_one_size = [](Export kind) { return kind == Export::tigre || kind == Export::leap; };
  if (std::ranges::none_of(kinds, has_one_size)) return {};
  std::vector<const pipeline::ViewResult*> calibrated;
  for (const pipeline::ViewResult& view : result.views)
    if (view.calibrated && view.xray_image) calibrated.push_back(&view);
  if (calibrated.empty()) return {};
  const double error = exchange::one_shape_error_px(run_geometry(calibrated));
  if (error < least_px) return {};
  return fmt::format(
      "TIGRE's and LEAP's files have one pixel size for all views: pixels lie up to {:.2f} px off", error);
}

void forget_exports(const std::filesystem::path& folder) {
  std::vector<std::string> names;
  std::error_code ec;
  for (std::filesystem::directory_iterator entry(folder, ec), end; !ec && entry != end; entry.increment(ec))
    if (std::error_code gone; entry->is_regular_file(gone) && is_exported(entry->path()))
      names.push_back(entry->path().filename().string());
  forget_files(folder, names);
}

Expected<std::vector<std::filesystem::path>> write_exports(const pipeline::Result& result,
                                                           const std::filesystem::path& folder,
                                                           std::span<const Export> kinds,
                                                           const std::optional<SpacingObject>& object) {
  forget_exports(folder);
  if (result.failure) return tl::unexpected<Failure>(*result.failure);
  std::vector<std::filesystem::path> paths;
  auto written = guarded([&] {
    const Files files = files_of(result, kinds);
    const auto images = images_of(result, kinds, object);
    for (const auto& [name, text] : files) {
      value_or_throw(write_file(folder / name, text));
      paths.push_back(folder / name);
    }
    for (const auto& [name, image] : images) {
      value_or_throw(xray::write_dicom(folder / name, image));
      paths.push_back(folder / name);
    }
  });
  std::ranges::sort(paths);
  if (written) return paths;
  std::error_code ignored;
  for (const auto& path : paths) std::filesystem::remove(path, ignored);
  return tl::unexpected<Failure>(written.error());
}

}  // namespace helicarm::report
