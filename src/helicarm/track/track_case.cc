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
#include "helicarm/pipeline/case_json.h"
#include "helicarm/pipeline/registration_case.h"

namespace helicarm::track {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t most_bodies = 50, most_markers = 200;

/// What the case's other readers do not know, taken out of case.json.
struct SequenceKeys {
  Json markers, bodies, calibration, frame_rate;
  std::vector<Json> cameras, calibrations, offsets;  ///< of each view
  std::vector<Json> pick_frames;
};

Json take(Json& from, const char* key) {
  Json value;
  if (!from.is_object()) return value;
  if (const auto found = from.find(key); found != from.end()) {
    value = *found;
    from.erase(key);
  }
  return value;
}

SequenceKeys take_sequence_keys(Json& json, const std::string& origin) {
  SequenceKeys keys;
  if (!json.is_object()) throw BadInput(Reason::bad_value, fmt::format("{}: is not an object", origin));
  keys.markers = take(json, "markers");
  keys.bodies = take(json, "bodies");
  keys.calibration = take(json, "calibration");
  keys.frame_rate = take(json, "frame_rate_hz");
  if (json.contains("views") && json["views"].is_array())
    for (Json& view : json["views"]) {
      keys.cameras.push_back(take(view, "camera"));
      keys.calibrations.push_back(take(view, "calibration"));
      keys.offsets.push_back(take(view, "frame_offset"));
    }
  // Picks of one name and view in several frames are no clash, but only those of the first frame are used.
  if (json.contains("picks") && json["picks"].is_array())
    for (Json& pick : json["picks"]) keys.pick_frames.push_back(take(pick, "frame"));
  return keys;
}

std::string text_of(const Json& value, const std::string& where) {
  if (!value.is_string()) throw BadInput(Reason::bad_value, fmt::format("{}: is not a file name", where));
  return value.get<std::string>();
}

int integer_of(const Json& value, const std::string& where, int low, int high) {
  if (!value.is_number_integer() || value.get<long long>() < low || value.get<long long>() > high)
    throw BadInput(Reason::bad_value,
                   fmt::format("{}: {} is not a whole number from {} to {}", where, value.dump(), low, high));
  return value.get<int>();
}

/// Cameras of files, or of saved calibrations.
void read_cameras(TrackCase& read, const SequenceKeys& keys, const std::string& origin) {
  constexpr Eigen::Index each = calibration::view_parameters;
  std::map<fs::path, calibration::SavedCalibration> calibrations;
  for (std::size_t i = 0; i < read.views.size(); ++i) {
    TrackView& view = read.views[i];
    const std::string where = fmt::format("{}: views[{}]", origin, i);
    if (!keys.cameras[i].is_null()) {
      const std::string name = text_of(keys.cameras[i], where + ": \"camera\"");
      const exchange::ImportedMatrix camera =
          value_or_throw(exchange::import_matrix(value_or_throw(path_inside(read.folder, name))));
      view.camera = camera.view;
      view.image_size = camera.image_size;
      read.warnings.insert(read.warnings.end(), camera.warnings.begin(), camera.warnings.end());
      continue;
    }
    const Json& named = keys.calibrations[i].is_null() ? keys.calibration : keys.calibrations[i];
    const fs::path file =
        value_or_throw(path_inside(read.folder, text_of(named, where + ": \"calibration\"")));
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
    view.map = saved.maps[index];
    if (saved.joint_covariance.size() == 0) continue;
    const auto n = each * Eigen::Index(read.views.size());
    if (read.camera_covariance.size() == 0) read.camera_covariance = Eigen::MatrixXd::Zero(n, n);
    for (std::size_t k = 0; k <= i; ++k) {
      const auto other =
          std::ranges::find(saved.views, read.views[k].images.name, &calibration::CalibratedView::name);
      if (other == saved.views.end() || (k < i && !keys.cameras[k].is_null())) continue;
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
  pipeline::RegistrationCase first{base, {}, {}};
  for (std::size_t i = 0; i < read.views.size(); ++i) {
    pipeline::RegistrationCase one;
    one.base.views = {base.views[i]};
    first.base.views[i] =
        value_or_throw(pipeline::at_frame(std::move(one), frames.first + read.views[i].frame_offset))
            .base.views.front();
  }
  const auto loaded = value_or_throw(case_registration::load_views(first, {}));
  for (std::size_t i = 0; i < read.views.size(); ++i) {
    read.views[i].camera = loaded.views[i].view;
    read.views[i].map = loaded.maps[i];
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

/// The case without picks of other frames, which its reader would take for clashes.
void keep_picks_of(Json& json, SequenceKeys& keys, int first, const std::string& origin) {
  if (keys.pick_frames.empty()) return;
  Json kept = Json::array();
  std::set<int> others;
  for (std::size_t i = 0; i < keys.pick_frames.size(); ++i) {
    const int frame =
        keys.pick_frames[i].is_null()
            ? first
            : integer_of(keys.pick_frames[i], fmt::format("{}: picks[{}]: \"frame\"", origin, i), 0, 1000000);
    if (frame == first)
      kept.push_back(json["picks"][i]);
    else
      others.insert(frame);
  }
  if (kept.empty())
    throw BadInput(Reason::bad_value,
                   fmt::format("{}: picks: none is of the first frame, {}; they are of frame {}: begin "
                               "--frames there, or pick the markers in frame {}",
                               origin, first, fmt::join(others, ", "), first));
  if (!others.empty())
    throw BadInput(Reason::bad_value,
                   fmt::format("{}: picks: of the frames {} beside the first frame, {}: only the first frame "
                               "is picked",
                               origin, fmt::join(others, ", "), first));
  json["picks"] = std::move(kept);
}

std::vector<Eigen::Vector3d> geometry_from(const fs::path& file, const TrackCase& read,
                                           const BodyPlan& body) {
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

void read_bodies(TrackCase& read, const Json& bodies, const std::string& origin) {
  const Json json = {{"bodies", bodies}};
  JsonReader reader(json, origin);
  std::set<std::string> names;
  std::map<std::size_t, std::string> taken;
  for (JsonReader& entry : reader.objects("bodies", false, most_bodies)) {
    BodyPlan body;
    body.name = entry.text("name", 100);
    if (body.name.empty()) entry.refuse(Reason::bad_value, "name", "is empty");
    if (body.name.find_first_of("/\\") != std::string::npos || body.name.starts_with('.'))
      entry.refuse(Reason::bad_value, "name", "is no file name: NAME.tra is written");
    if (!names.insert(body.name).second)
      entry.refuse(Reason::name_clash, "name", fmt::format("\"{}\" is given twice", body.name));
    const Json& markers = entry.raw("markers");
    if (!markers.is_array() || markers.empty())
      entry.refuse(Reason::bad_value, "markers", "is not a list of markers' names");
    for (const Json& marker : markers) {
      if (!marker.is_string()) entry.refuse(Reason::bad_value, "markers", "is not a list of markers' names");
      const auto name = marker.get<std::string>();
      const auto found = std::ranges::find(read.markers, name);
      if (found == read.markers.end())
        entry.refuse(Reason::bad_value, "markers", fmt::format("\"{}\" has no pick", name));
      const auto index = std::size_t(found - read.markers.begin());
      if (const auto [other, is_new] = taken.emplace(index, body.name); !is_new)
        entry.refuse(
            Reason::name_clash, "markers",
            fmt::format("\"{}\" is given twice, in \"{}\" and \"{}\"", name, other->second, body.name));
      body.markers.push_back(index);
    }
    if (const auto file = entry.optional_text("geometry", 1000))
      body.geometry = geometry_from(value_or_throw(path_inside(read.folder, *file)), read, body);
    entry.finish();
    read.bodies.push_back(std::move(body));
  }
}

}  // namespace

Expected<TrackCase> read_track_case(const fs::path& path, const case_registration::FrameRange& frames) {
  return guarded([&] {
    const fs::path file = fs::absolute(pipeline::case_file(path));
    const std::string origin = file.filename().string();
    Json json = value_or_throw(read_json(file));
    SequenceKeys keys = take_sequence_keys(json, origin);
    keep_picks_of(json, keys, frames.first, origin);
    const auto named = [](const Json& value) { return !value.is_null(); };
    const auto cameras = std::size_t(std::ranges::count_if(keys.cameras, named));
    std::size_t brought = cameras;
    for (std::size_t i = 0; i < keys.cameras.size(); ++i) {
      if (named(keys.cameras[i]) && named(keys.calibrations[i]))
        throw BadInput(
            Reason::bad_value,
            fmt::format("{}: views[{}]: \"camera\" and \"calibration\" are both given", origin, i));
      if (!named(keys.cameras[i]) && (named(keys.calibrations[i]) || named(keys.calibration))) ++brought;
    }
    if (brought != 0 && brought != keys.cameras.size())
      throw BadInput(Reason::bad_value,
                     fmt::format("{}: views: \"camera\" or \"calibration\" must be given for all views or "
                                 "for none: their world is one",
                                 origin));
    const bool is_calibrated = brought > 0;
    TrackCase read;
    const pipeline::Case base =
        pipeline::case_of(json, origin, file.parent_path(),
                          is_calibrated ? pipeline::Purpose::cameras : pipeline::Purpose::registration);
    read.folder = base.folder;
    read.warnings = base.warnings;
    for (std::size_t i = 0; i < base.views.size(); ++i) {
      TrackView& view = read.views.emplace_back();
      view.images = base.views[i];
      if (named(keys.offsets[i]))
        view.frame_offset = integer_of(
            keys.offsets[i], fmt::format("{}: views[{}]: \"frame_offset\"", origin, i), -1000000, 1000000);
    }
    if (read.views.size() < 2)
      throw BadInput(Reason::too_few_views, fmt::format("{}: markers are located in two views or more; the "
                                                        "case has {}",
                                                        origin, read.views.size()));
    if (keys.markers.is_null())
      throw BadInput(
          Reason::bad_value,
          fmt::format("{}: \"markers\" is missing: {{\"diameter_mm\": 1.0}} states the markers' size",
                      origin));
    JsonReader markers(keys.markers, origin + ": markers");
    read.diameter_mm = markers.number("diameter_mm", {0.1, 30});
    markers.finish();
    if (named(keys.frame_rate)) {
      const Json rate = {{"frame_rate_hz", keys.frame_rate}};
      read.frame_rate_hz = JsonReader(rate, origin).number("frame_rate_hz", {0.01, 1e5});
    }
    for (const pipeline::Pick& pick : base.picks) {
      const auto view = std::ranges::find(base.views, pick.view, &pipeline::CaseView::name);
      read.picks.push_back(
          {marker_named(read, pick.name), std::size_t(view - base.views.begin()), pick.uv_raw});
    }
    if (read.picks.empty())
      throw BadInput(
          Reason::bad_value,
          fmt::format("{}: \"picks\" is missing: each marker is picked in the first frame", origin));
    read_bodies(read, keys.bodies, origin);
    if (is_calibrated)
      read_cameras(read, keys, origin);
    else
      calibrate(read, base, frames);
    return read;
  });
}

}  // namespace helicarm::track
