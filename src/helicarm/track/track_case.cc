// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/track_case.h"

#include <algorithm>
#include <map>
#include <set>

#include <fmt/format.h>

#include "helicarm/calibration/saved_calibration.h"
#include "helicarm/case_registration/load.h"
#include "helicarm/core/csv.h"
#include "helicarm/core/files.h"
#include "helicarm/exchange/import_matrix.h"
#include "helicarm/pipeline/case_frames.h"
#include "helicarm/track/case_points.h"
#include "helicarm/track/first_markers.h"
#include "helicarm/track/view_map.h"
#include "helicarm/track/xmalab_points.h"

namespace helicarm::track {
namespace {

namespace fs = std::filesystem;

/// Cameras of files, or of saved calibrations.
void read_cameras(TrackCase& read, const pipeline::Case& the_case, const std::string& origin) {
  constexpr Eigen::Index each = calibration::view_parameters;
  std::map<fs::path, calibration::SavedCalibration> calibrations;
  std::vector<fs::path> files(read.views.size());
  for (std::size_t i = 0; i < read.views.size(); ++i) {
    TrackView& view = read.views[i];
    const std::string where = fmt::format("{}: views[{}]", origin, i);
    if (view.images.camera) {
      const exchange::ImportedMatrix camera = value_or_throw(exchange::import_matrix(*view.images.camera));
      view.camera = camera.view;
      view.image_size = camera.image_size;
      if (view.images.map)
        take_map(view,
                 value_or_throw(rectification::distortion_map_from_json(
                     value_or_throw(read_json(*view.images.map)), view.images.map->filename().string())),
                 where);
      read.warnings.insert(read.warnings.end(), camera.warnings.begin(), camera.warnings.end());
      continue;
    }
    const fs::path& stated = view.images.calibration ? *view.images.calibration : *the_case.calibration;
    std::error_code ignored;
    const fs::path same = fs::weakly_canonical(stated, ignored);
    const fs::path& file = files[i] = ignored ? stated : same;
    if (!calibrations.contains(file))
      calibrations[file] = value_or_throw(calibration::saved_calibration_from_json(
          value_or_throw(read_json(file)), file.filename().string()));
    const calibration::SavedCalibration& saved = calibrations[file];
    const auto found = std::ranges::find(saved.views, view.images.name, &calibration::CalibratedView::name);
    if (found == saved.views.end())
      throw BadInput(Reason::bad_value, fmt::format("{}: {} has no view named \"{}\"", where,
                                                    file.filename().string(), view.images.name));
    const auto index = std::size_t(found - saved.views.begin());
    view.camera = found->view;
    take_map(view, saved.maps[index], where);
    if (saved.joint_covariance.size() == 0) continue;
    const auto n = each * Eigen::Index(read.views.size());
    if (read.camera_covariance.size() == 0) read.camera_covariance = Eigen::MatrixXd::Zero(n, n);
    for (std::size_t k = 0; k <= i; ++k) {
      if (files[k] != file) continue;  // calibrated apart
      const auto other =
          std::ranges::find(saved.views, read.views[k].images.name, &calibration::CalibratedView::name);
      const auto at = Eigen::Index(other - saved.views.begin());
      const Eigen::MatrixXd block =
          saved.joint_covariance.block(each * Eigen::Index(index), each * at, each, each);
      read.camera_covariance.block(each * Eigen::Index(i), each * Eigen::Index(k), each, each) = block;
      read.camera_covariance.block(each * Eigen::Index(k), each * Eigen::Index(i), each, each) =
          block.transpose();
    }
  }
}

/// Cameras by the calibrator in the first images.
void calibrate(TrackCase& read, const pipeline::Case& base, const case_registration::FrameRange& frames) {
  const pipeline::Case first = value_or_throw(pipeline::at_frame(base, frames.first));
  const auto loaded = value_or_throw(case_registration::load_views(first, {}));
  for (std::size_t i = 0; i < read.views.size(); ++i) {
    read.views[i].camera = loaded.views[i].view;
    take_map(read.views[i], loaded.maps[i], read.views[i].images.name);
  }
  read.camera_covariance = loaded.camera_covariance;
  read.warnings.insert(read.warnings.end(), loaded.warnings.begin(), loaded.warnings.end());
}

std::size_t marker_named(TrackCase& read, const std::string& name) {
  const auto found = std::ranges::find(read.markers, name);
  if (found != read.markers.end()) return std::size_t(found - read.markers.begin());
  if (read.markers.size() == most_markers)
    throw BadInput(Reason::bad_value, fmt::format("case.json: more than {} markers", most_markers));
  read.markers.push_back(name);
  return read.markers.size() - 1;
}

/// Refuses picks of frames before the first and of frames that the range leaves out.
void check_frames_of_picks(const std::vector<pipeline::Pick>& picks,
                           const case_registration::FrameRange& frames, bool is_found,
                           const std::string& origin) {
  const int first = frames.first;
  std::set<int> others;
  for (const pipeline::Pick& pick : picks)
    if (pick.frame && *pick.frame != first) {
      others.insert(*pick.frame);
      const int behind_first = *pick.frame - first;
      if (behind_first > 0 && *pick.frame <= frames.last && behind_first % frames.step != 0)
        throw BadInput(
            Reason::bad_value,
            fmt::format("{}: picks: \"{}\" of frame {}: is not among the frames, every {}th from {} on",
                        origin, pick.name, *pick.frame, frames.step, first));
    }
  if (others.empty()) return;
  const bool none = std::ranges::none_of(
      picks, [&](const pipeline::Pick& pick) { return pick.frame.value_or(first) == first; });
  if (is_found || (!none && *others.begin() > first)) return;
  throw BadInput(
      Reason::bad_value,
      none ? fmt::format("{}: picks: none is of the first frame, {}; they are of frame {}: begin "
                         "--frames there, or pick the markers in frame {}",
                         origin, first, fmt::join(others, ", "), first)
           : fmt::format("{}: picks: of the frames {} beside the first frame, {}: picks begin with the "
                         "first frame",
                         origin, fmt::join(others, ", "), first));
}

/// As the search of the first frame names markers.
bool is_name_of_found(const std::string& name) {
  return name.size() > 1 && name[0] == 'M' && name.find_first_not_of("0123456789", 1) == name.npos;
}

/// Picks of later frames, of markers that the first one has; those behind the last frame count in a longer
/// run.
void take_corrections(TrackCase& read, const pipeline::Case& base,
                      const case_registration::FrameRange& frames, const std::string& origin) {
  for (const pipeline::Pick& pick : base.picks) {
    const int frame = pick.frame.value_or(frames.first);
    if (frame <= frames.first || frame > frames.last) continue;
    const auto marker = std::ranges::find(read.markers, pick.name);
    if (marker == read.markers.end())
      throw BadInput(
          Reason::bad_value,
          fmt::format("{}: picks: \"{}\" of frame {}: the first frame, {}, has no such marker: pick "
                      "it there",
                      origin, pick.name, frame, frames.first));
    const auto view = std::ranges::find(base.views, pick.view, &pipeline::CaseView::name);
    read.corrections.push_back({std::size_t(marker - read.markers.begin()),
                                std::size_t(view - base.views.begin()), pick.uv_raw, frame});
  }
}

std::vector<Eigen::Vector3d> geometry_from(const fs::path& file, const TrackCase& read,
                                           const BodyPlan& body) {
  std::vector<std::string> names;
  for (const std::size_t marker : body.markers) names.push_back(read.markers[marker]);
  if (auto of_xmalab = value_or_throw(read_xmalab_points3d(file, names))) return *std::move(of_xmalab);
  const CsvTable table = value_or_throw(read_csv(file, {"name", "x_mm", "y_mm", "z_mm"}, {}));
  std::vector<Eigen::Vector3d> places;
  for (const std::size_t marker : body.markers) {
    std::optional<Eigen::Vector3d> place;
    for (std::size_t row = 0; row < table.rows(); ++row)
      if (table.text(row, "name") == read.markers[marker]) {
        if (place)
          throw BadInput(Reason::name_clash, fmt::format("{}: \"{}\" is given twice",
                                                         file.filename().string(), read.markers[marker]));
        place =
            Eigen::Vector3d(table.number(row, "x_mm"), table.number(row, "y_mm"), table.number(row, "z_mm"));
      }
    if (!place)
      throw BadInput(Reason::bad_value,
                     fmt::format("{}: \"{}\" of the body \"{}\" is missing", file.filename().string(),
                                 read.markers[marker], body.name));
    places.push_back(*place);
  }
  return places;
}

/// `is_picked`: by the user.
void read_bodies(TrackCase& read, const std::vector<pipeline::CaseBody>& bodies, bool is_picked,
                 const std::string& origin) {
  std::map<std::size_t, std::string> taken;
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    const auto refuse = [&](Reason reason, const std::string& problem) {
      throw BadInput(reason, fmt::format("{}: bodies[{}]: \"markers\": {}", origin, i, problem));
    };
    BodyPlan body{bodies[i].name, {}, {}};
    std::vector<std::string> missing;
    for (const std::string& name : bodies[i].markers)
      if (std::ranges::find(read.markers, name) == read.markers.end()) missing.push_back('"' + name + '"');
    if (!missing.empty())
      refuse(
          Reason::bad_value,
          is_picked
              ? fmt::format("{} {} no pick", fmt::join(missing, ", "), missing.size() == 1 ? "has" : "have")
              : fmt::format("{} {} not among the {} markers found in the first frame{}: pick {}",
                            fmt::join(missing, ", "), missing.size() == 1 ? "is" : "are", read.markers.size(),
                            read.markers.empty() ? "" : fmt::format(", M1 to M{}", read.markers.size()),
                            missing.size() == 1 ? "it" : "them"));
    for (const std::string& name : bodies[i].markers) {
      const auto found = std::ranges::find(read.markers, name);
      const auto index = std::size_t(found - read.markers.begin());
      if (const auto [other, is_new] = taken.emplace(index, body.name); !is_new)
        refuse(Reason::name_clash,
               fmt::format("\"{}\" is given twice, in \"{}\" and \"{}\"", name, other->second, body.name));
      body.markers.push_back(index);
    }
    if (bodies[i].geometry) body.geometry = geometry_from(*bodies[i].geometry, read, body);
    read.bodies.push_back(std::move(body));
  }
}

}  // namespace

std::vector<std::string> names_of_views(const TrackCase& the_case) {
  std::vector<std::string> names;
  for (const TrackView& view : the_case.views) names.push_back(view.images.name);
  return names;
}

void check_butterworth(const TrackCase& the_case, int step) {
  if (!the_case.butterworth) return;
  const Butterworth& filter = *the_case.butterworth;
  if (!the_case.frame_rate_hz)
    throw BadInput(Reason::bad_value,
                   "butterworth: its cut-off is in Hz, and \"frame_rate_hz\" is not stated");
  const double limit = *the_case.frame_rate_hz / step / 2;
  if (!(filter.cut_off_hz > 0 && filter.cut_off_hz < limit))
    throw BadInput(
        Reason::bad_value,
        fmt::format("butterworth: the cut-off of {:g} Hz is not between 0 and half the frame rate, {:g} Hz",
                    filter.cut_off_hz, limit));
  if (filter.order != 2 && filter.order != 4)
    throw BadInput(Reason::bad_value,
                   fmt::format("butterworth: the order is {}, it is 2 or 4", filter.order));
}

Expected<TrackCase> read_track_case(const fs::path& path, const case_registration::FrameRange& frames,
                                    const std::optional<PointsFile>& points) {
  return guarded([&] {
    const std::string origin = pipeline::case_file(path).filename().string();
    const pipeline::Case base = value_or_throw(pipeline::read_case(path, pipeline::Purpose::track));
    if (points && !base.picks.empty())
      throw BadInput(
          Reason::bad_value,
          fmt::format("{}: \"picks\" and a file of points name the markers: leave one out", origin));
    // Picks of later frames may correct markers that were found, which have these names.
    const bool is_found = !points && std::ranges::all_of(base.picks, [&](const pipeline::Pick& pick) {
      return pick.frame.value_or(frames.first) > frames.first && is_name_of_found(pick.name);
    });
    check_frames_of_picks(base.picks, frames, is_found, origin);
    TrackCase read;
    read.folder = base.folder;
    read.warnings = base.warnings;
    for (const pipeline::CaseView& images : base.views) {
      TrackView& view = read.views.emplace_back();
      view.images = images;
      view.frame_offset = images.frame_offset.value_or(0);
    }
    if (read.views.size() < 2)
      throw BadInput(Reason::too_few_views, fmt::format("{}: markers are located in two views or more; the "
                                                        "case has {}",
                                                        origin, read.views.size()));
    const bool is_placed = points && points->of_all_frames;
    if (!base.markers && !is_placed)
      throw BadInput(
          Reason::bad_value,
          fmt::format("{}: \"markers\" is missing: {{\"diameter_mm\": 1.0}} states the markers' size",
                      origin));
    if (base.markers) read.diameter_mm = base.markers->diameter_mm;
    read.frame_rate_hz = base.frame_rate_hz;
    for (const pipeline::Pick& pick : base.picks) {
      if (pick.frame.value_or(frames.first) != frames.first) continue;
      const auto view = std::ranges::find(base.views, pick.view, &pipeline::CaseView::name);
      read.picks.push_back(
          {marker_named(read, pick.name), std::size_t(view - base.views.begin()), pick.uv_raw});
    }
    if (pipeline::brings_cameras(base))
      read_cameras(read, base, origin);
    else
      calibrate(read, base, frames);
    if (points) take_points(read, *points, frames);
    check_picks_in_maps(read, frames.first);
    if (!is_placed) complete_picks(read, frames);
    take_corrections(read, base, frames, origin);
    check_picks_in_maps(read, frames.first);
    read_bodies(read, base.bodies, points || !is_found, origin);
    if (is_placed) check_geometry_of_points(read, points->file.filename().string());
    return read;
  });
}

}  // namespace helicarm::track
