// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "helicarm/core/csv.h"
#include "helicarm/core/earlier_files.h"
#include "helicarm/core/files.h"
#include "helicarm/geometry/view_json.h"
#include "helicarm/pipeline/result.h"
#include "helicarm/track/rows.h"
#include "helicarm/track/slicer_sequence.h"
#include "helicarm/track/track.h"

namespace helicarm::track {
namespace {

using geometry::json_list, geometry::json_rows;

Json optional_json(const std::optional<double>& value) { return value ? Json(*value) : Json(nullptr); }

template <class Items, class Item>
std::array<int, 4> counts_of(const Items& items, Item kind) {
  std::array<int, 4> counts{};
  for (const auto& item : items) ++counts[std::size_t(kind(item))];
  return counts;
}

std::array<int, 4> decisions_of(const std::vector<TrackedBody>& frames) {
  return counts_of(frames, [](const TrackedBody& frame) { return frame.decision; });
}

Json decisions_json(const std::vector<TrackedBody>& frames) {
  const auto counts = decisions_of(frames);
  return {{"accept", counts[0]}, {"warn", counts[1]}, {"refuse", counts[2]}};
}

Json json_of(const Warning& warning) {
  Json json = {{"code", code(warning.reason)},
               {"message", warning.message},
               {"view", warning.view.empty() ? Json(nullptr) : Json(warning.view)},
               {"figures", Json::object()}};
  for (const auto& [name, value] : warning.figures) json["figures"][name] = value;
  return json;
}

Json json_of(const BodySequence& body, const BodyPlan& plan, const TrackCase& the_case) {
  Json json = {{"name", plan.name}, {"markers", Json::array()}};
  for (const PlacedMarker& marker : body.markers)
    json["markers"].push_back(
        {{"name", the_case.markers[marker.marker]},
         {"in_body_mm", marker.in_body ? json_list(marker.in_body->place) : Json(nullptr)},
         {"covariance_mm2", marker.in_body ? json_rows(marker.in_body->covariance) : Json(nullptr)},
         {"deviation_mm", marker.loose_mm},
         {"moved_at", marker.moved_at ? Json(*marker.moved_at) : Json(nullptr)}});
  json["geometry"] = plan.geometry.empty() ? "learnt" : "given";
  json["deviation_mm"] = body.deviation_mm;
  json["condition_per_m"] = body.condition_per_m;
  double squares = 0;
  int count = 0;
  for (const TrackedBody& frame : body.frames)
    if (frame.rms_mm) squares += *frame.rms_mm * *frame.rms_mm, ++count;
  json["rms_mm"] = count > 0 ? Json(std::sqrt(squares / count)) : Json(nullptr);
  json["decisions"] = decisions_json(body.frames);
  json["prior"] = body.prior ? Json{{"turn_rad2_per_frame5", body.prior->turn},
                                    {"shift_mm2_per_frame5", body.prior->shift}}
                             : Json(nullptr);
  return json;
}

std::vector<std::string> names_of(const TrackCase& the_case) {
  std::vector<std::string> bodies;
  for (const BodyPlan& body : the_case.bodies) bodies.push_back(body.name);
  return bodies;
}

constexpr std::array file_names{"markers.csv",     "bodies.csv",      "smoothed.csv", "relative.csv",
                                "track.json",      "points2d.csv",    "points3d.csv", "report.html",
                                "sights.csv",      "sights.id",       "images.csv",   "angles.csv",
                                "butterworth.csv", "smoothed.seq.mha"};

}  // namespace

Json refused_json(const Failure& refusal) {
  return {{"format", "helicarm-track/1"},
          {"status", "refused"},
          {"failure", pipeline::to_json(refusal)},
          {"warnings", Json::array()},
          {"version", HELICARM_VERSION}};
}

Json to_json(const Sequence& sequence, const TrackCase& the_case) {
  Json json = {{"format", "helicarm-track/1"},
               {"status", sequence.failure ? "refused" : "ok"},
               {"failure", sequence.failure ? pipeline::to_json(*sequence.failure) : Json()},
               {"warnings", Json::array()},
               {"notes", Json::array()},
               {"frames", sequence.frames.size()},
               {"first_frame", sequence.frames.front()},
               {"last_frame", sequence.frames.back()},
               {"complete_frames", sequence.complete},
               {"swaps_repaired", sequence.repaired},
               {"error_correlation", sequence.correlation},
               {"views", Json::array()},
               {"markers", Json::array()},
               {"bodies", Json::array()},
               {"distances", Json::array()},
               {"decisions", Json::object()}};
  for (const Warning& warning : sequence.warnings) json["warnings"].push_back(json_of(warning));
  for (std::size_t k = 0; k < the_case.views.size(); ++k) {
    const ViewDelay& delay = sequence.delays[k];
    std::optional<double> milliseconds;
    if (delay.is_known && the_case.frame_rate_hz)
      milliseconds = 1000 * delay.frames / *the_case.frame_rate_hz;
    json["views"].push_back({{"name", the_case.views[k].images.name},
                             {"frame_offset", the_case.views[k].frame_offset},
                             {"delay_frames", delay.is_known ? Json(delay.frames) : Json(nullptr)},
                             {"delay_sigma_frames", delay.is_known ? Json(delay.sigma) : Json(nullptr)},
                             {"delay_ms", optional_json(milliseconds)}});
  }
  for (std::size_t m = 0; m < the_case.markers.size(); ++m) {
    std::array<int, 4> counts{};
    for (const auto& frame : sequence.markers) ++counts[std::size_t(frame[m].status)];
    Json marker = {{"name", the_case.markers[m]}};
    for (std::size_t i = 0; i < counts.size(); ++i) marker[std::string(status_words[i])] = counts[i];
    marker["sigma_factor"] = sequence.sigma_factor[m];
    json["markers"].push_back(std::move(marker));
  }
  for (std::size_t b = 0; b < the_case.bodies.size(); ++b) {
    json["bodies"].push_back(json_of(sequence.bodies[b], the_case.bodies[b], the_case));
    json["decisions"][the_case.bodies[b].name] = decisions_json(sequence.bodies[b].frames);
  }
  for (const MarkerDistance& distance : sequence.distances)
    json["distances"].push_back(
        {{"markers", {the_case.markers[distance.first], the_case.markers[distance.second]}},
         {"mean_mm", distance.mean_mm},
         {"sd_mm", distance.deviation_mm},
         {"frames", distance.frames}});
  json["seconds"] = sequence.seconds;
  json["version"] = HELICARM_VERSION;
  return json;
}

std::string markers_csv(const Sequence& sequence, const TrackCase& the_case) {
  std::string csv = markers_header();
  for (std::size_t f = 0; f < sequence.frames.size(); ++f)
    for (std::size_t m = 0; m < the_case.markers.size(); ++m)
      csv += marker_row(sequence.frames[f], the_case.markers[m], sequence.markers[f][m], the_case);
  return csv;
}

std::string bodies_csv(const Sequence& sequence, const TrackCase& the_case) {
  return bodies_table(sequence.frames, names_of(the_case), sequence.bodies, &BodySequence::frames);
}

std::string smoothed_csv(const Sequence& sequence, const TrackCase& the_case) {
  return bodies_table(sequence.frames, names_of(the_case), sequence.bodies, &BodySequence::smoothed);
}

std::string relative_csv(const Sequence& sequence, const TrackCase& the_case) {
  return relative_table(sequence.frames, names_of(the_case), sequence.relative);
}

std::vector<std::vector<std::optional<Eigen::Vector3d>>> butterworth_places(const Sequence& sequence,
                                                                            const TrackCase& the_case) {
  std::vector<std::vector<std::optional<Eigen::Vector3d>>> made;
  if (!the_case.butterworth || !the_case.frame_rate_hz) return made;
  const std::size_t frames = sequence.frames.size();
  const int step = frames > 1 ? sequence.frames[1] - sequence.frames[0] : 1;
  for (std::size_t m = 0; m < the_case.markers.size(); ++m) {
    std::vector<std::optional<Eigen::Vector3d>> places(frames);
    for (std::size_t f = 0; f < frames; ++f)
      if (const auto& place = sequence.markers[f][m].place) places[f] = place->place;
    made.push_back(butterworth_filtered(places, *the_case.frame_rate_hz / step, *the_case.butterworth));
  }
  return made;
}

std::string butterworth_csv(const Sequence& sequence, const TrackCase& the_case) {
  const auto places = butterworth_places(sequence, the_case);
  std::string csv = "frame,name,x_mm,y_mm,z_mm\n";
  for (std::size_t f = 0; f < sequence.frames.size(); ++f)
    for (std::size_t m = 0; m < places.size(); ++m) {
      csv += fmt::format("{},{}", sequence.frames[f], csv_field(the_case.markers[m]));
      const auto& place = places[m][f];
      csv += place ? fmt::format(",{:.9g},{:.9g},{:.9g}\n", place->x(), place->y(), place->z()) : ",,,\n";
    }
  return csv;
}

std::string angles_csv(const Sequence& sequence, const TrackCase& the_case) {
  return angles_table(sequence.frames, names_of(the_case), sequence.joints);
}

std::string points2d_csv(const Sequence& sequence, const TrackCase& the_case) {
  std::string csv;
  for (const std::string& marker : the_case.markers)
    for (std::size_t k = 0; k < the_case.views.size(); ++k)
      for (const char axis : {'X', 'Y'})
        csv += fmt::format("{}{}", csv.empty() ? "" : ",",
                           csv_field(fmt::format("{}_cam{}_{}", marker, k + 1, axis)));
  csv += "\n";
  for (const auto& frame : sequence.images) {
    bool is_first = true;
    for (const auto& image : frame) {
      csv += is_first ? "" : ",";
      is_first = false;
      csv += image ? fmt::format("{:.9g},{:.9g}", image->uv_raw.x(), image->uv_raw.y()) : "NaN,NaN";
    }
    csv += "\n";
  }
  return csv;
}

std::string points3d_csv(const Sequence& sequence, const TrackCase& the_case) {
  std::string csv;
  for (const std::string& marker : the_case.markers)
    for (const char axis : {'X', 'Y', 'Z'})
      csv += fmt::format("{}{}", csv.empty() ? "" : ",", csv_field(fmt::format("{}_{}", marker, axis)));
  csv += "\n";
  for (const auto& frame : sequence.markers) {
    bool is_first = true;
    for (const TrackedMarker& marker : frame) {
      csv += is_first ? "" : ",";
      is_first = false;
      csv += marker.place ? fmt::format("{:.12g},{:.12g},{:.12g}", marker.place->place.x(),
                                        marker.place->place.y(), marker.place->place.z())
                          : "NaN,NaN,NaN";
    }
    csv += "\n";
  }
  return csv;
}

std::string tra_of(const BodySequence& body) {
  std::string text;
  for (const TrackedBody& frame : body.smoothed) {
    for (int i = 0; i < 16; ++i) {
      text += i == 0 ? "" : ",";
      text += frame.pose ? fmt::format("{:.12g}", frame.pose->pose.matrix()(i / 4, i % 4)) : "NaN";
    }
    text += "\n";
  }
  return text;
}

void forget_track(const std::filesystem::path& folder) {
  std::vector<std::string> files(file_names.begin(), file_names.end());
  std::error_code ignored;
  // Bodies of an earlier run may have other names.
  if (std::filesystem::exists(folder / "track.json", ignored))
    for (const auto& entry : std::filesystem::directory_iterator(folder, ignored))
      if (entry.path().extension() == ".tra") files.push_back(entry.path().filename().string());
  forget_files(folder, files);
}

Expected<void> write_track(const Sequence& sequence, const TrackCase& the_case,
                           const std::filesystem::path& folder) {
  return guarded([&] {
    const auto write = [&](const std::string& name, const std::string& text) {
      value_or_throw(write_file(folder / name, text));
    };
    write("markers.csv", markers_csv(sequence, the_case));
    write("bodies.csv", bodies_csv(sequence, the_case));
    write("smoothed.csv", smoothed_csv(sequence, the_case));
    write("relative.csv", relative_csv(sequence, the_case));
    if (the_case.butterworth) write("butterworth.csv", butterworth_csv(sequence, the_case));
    if (!the_case.axes.empty()) write("angles.csv", angles_csv(sequence, the_case));
    write("points2d.csv", points2d_csv(sequence, the_case));
    write("points3d.csv", points3d_csv(sequence, the_case));
    for (std::size_t b = 0; b < the_case.bodies.size(); ++b)
      write(the_case.bodies[b].name + ".tra", tra_of(sequence.bodies[b]));
    write("smoothed.seq.mha",
          slicer_sequence(names_of(the_case), sequence.frames, sequence.bodies, the_case.frame_rate_hz));
    write("report.html", track_report(sequence, the_case));
    write("track.json", to_text(to_json(sequence, the_case)) + "\n");
  });
}

}  // namespace helicarm::track
