// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/rows.h"

#include <charconv>
#include <cmath>

#include <fmt/format.h>

#include "helicarm/core/csv.h"
#include "helicarm/track/view_map.h"

namespace helicarm::track {
namespace {

constexpr double degrees_of_rad = 180 / EIGEN_PI;

std::optional<double> number_from(std::string_view text) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size() || !std::isfinite(value)) return std::nullopt;
  return value;
}

/// Fields of a line whose names are in quotes only where they hold commas, which the caller counts from
/// behind.
std::vector<std::string_view> fields_of(std::string_view line) {
  std::vector<std::string_view> fields;
  while (true) {
    const std::size_t comma = line.find(',');
    fields.push_back(line.substr(0, comma));
    if (comma == line.npos) return fields;
    line.remove_prefix(comma + 1);
  }
}

}  // namespace

std::string markers_header() {
  return "frame,name,x_mm,y_mm,z_mm,sx_mm,sy_mm,sz_mm,ray_gap_mm,views,status\n";
}

std::string marker_row(int frame, const std::string& name, const TrackedMarker& marker,
                       const TrackCase& the_case) {
  std::string row = fmt::format("{},{}", frame, csv_field(name));
  if (marker.place) {
    const Eigen::Vector3d& at = marker.place->place;
    const Eigen::Vector3d sigma = marker.place->covariance.diagonal().cwiseSqrt();
    row += fmt::format(",{:.9g},{:.9g},{:.9g},{:.6g},{:.6g},{:.6g}", at.x(), at.y(), at.z(), sigma.x(),
                       sigma.y(), sigma.z());
  } else {
    row += ",,,,,,";
  }
  row += marker.ray_gap_mm ? fmt::format(",{:.6g},", *marker.ray_gap_mm) : ",,";
  std::string views;
  for (const std::size_t k : marker.views)
    views += (views.empty() ? "" : " ") + the_case.views[k].images.name;
  return row + csv_field(views) + "," + std::string(status_words[std::size_t(marker.status)]) + "\n";
}

std::string bodies_header(bool relative) {
  std::string line = relative ? "frame,body,reference,decision" : "frame,body,decision";
  for (int i = 0; i < 16; ++i) line += fmt::format(",m{}{}", i / 4 + 1, i % 4 + 1);
  return line +
         ",sigma_rx_deg,sigma_ry_deg,sigma_rz_deg,sigma_x_mm,sigma_y_mm,sigma_z_mm,markers_used,rms_mm,"
         "code\n";
}

std::string body_row(int frame, const std::string& names, const TrackedBody& body) {
  std::string row = fmt::format("{},{},{}", frame, names, decision_words[std::size_t(body.decision)]);
  if (body.pose) {
    const Eigen::Matrix4d matrix = body.pose->pose.matrix();
    for (int i = 0; i < 16; ++i) row += fmt::format(",{:.12g}", matrix(i / 4, i % 4));
    for (int i = 0; i < 6; ++i)
      row += fmt::format(
          ",{:.6g}", (i < 3 ? degrees_of_rad : 1) * std::sqrt(std::max(0.0, body.pose->covariance(i, i))));
  } else {
    row += std::string(22, ',');
  }
  row += body.markers ? fmt::format(",{},", *body.markers) : ",,";
  if (body.rms_mm) row += fmt::format("{:.6g}", *body.rms_mm);
  return row + "," + (body.reason ? std::string(code(*body.reason)) : "") + "\n";
}

std::string angles_table(const std::vector<int>& frames, const std::vector<std::string>& names,
                         const std::vector<Joint>& joints) {
  std::string table =
      "frame,body,reference,flexion_deg,adduction_deg,rotation_deg,sigma_flexion_deg,sigma_adduction_deg,"
      "sigma_rotation_deg,lateral_mm,anterior_mm,distraction_mm,sigma_lateral_mm,sigma_anterior_mm,"
      "sigma_distraction_mm\n";
  for (std::size_t f = 0; f < frames.size(); ++f)
    for (const Joint& joint : joints) {
      table +=
          fmt::format("{},{},{}", frames[f], csv_field(names[joint.body]), csv_field(names[joint.reference]));
      const auto& at = joint.frames[f];
      for (int i = 0; i < 3; ++i) table += at ? fmt::format(",{:.9g}", degrees_of_rad * at->angles[i]) : ",";
      for (int i = 0; i < 3; ++i)
        table += at ? fmt::format(",{:.6g}", degrees_of_rad * std::sqrt(std::max(0.0, at->covariance(i, i))))
                    : ",";
      const bool has_shift = at && at->shift;
      for (int i = 0; i < 3; ++i) table += has_shift ? fmt::format(",{:.9g}", (*at->shift)[i]) : ",";
      for (int i = 0; i < 3; ++i)
        table +=
            has_shift ? fmt::format(",{:.6g}", std::sqrt(std::max(0.0, at->shift_covariance(i, i)))) : ",";
      table += "\n";
    }
  return table;
}

std::string sights_header() {
  return "frame,marker,view,u_raw,v_raw,sigma_px,radius_px,contrast,background,repaired\n";
}

std::string bodies_table(const std::vector<int>& frames, const std::vector<std::string>& names,
                         const std::vector<BodySequence>& bodies,
                         std::vector<TrackedBody> BodySequence::*rows) {
  std::string csv = bodies_header();
  for (std::size_t f = 0; f < frames.size(); ++f)
    for (std::size_t b = 0; b < bodies.size(); ++b)
      csv += body_row(frames[f], csv_field(names[b]), (bodies[b].*rows)[f]);
  return csv;
}

std::string relative_table(const std::vector<int>& frames, const std::vector<std::string>& names,
                           const std::vector<std::vector<TrackedBody>>& relative) {
  std::string csv = bodies_header(true);
  for (std::size_t f = 0; f < frames.size(); ++f)
    for (std::size_t b = 0; b < relative.size(); ++b)
      csv += body_row(frames[f], csv_field(names[b + 1]) + "," + csv_field(names[0]), relative[b][f]);
  return csv;
}

std::string sights_rows(const FrameSights& sights, const TrackCase& the_case) {
  std::string rows;
  for (std::size_t m = 0; m < sights.of.size(); ++m)
    for (std::size_t k = 0; k < the_case.views.size(); ++k) {
      rows += fmt::format("{},{},{}", sights.frame, csv_field(the_case.markers[m]),
                          csv_field(the_case.views[k].images.name));
      if (const auto& image = sights.of[m][k])
        rows += fmt::format(",{},{},{},{},{},{}", image->uv_raw.x(), image->uv_raw.y(), image->sigma_px,
                            image->radius_px, image->contrast, image->background);
      else
        rows += ",,,,,,";
      rows += fmt::format(",{}\n", sights.repaired);
    }
  return rows;
}

std::vector<FrameSights> sights_from(const std::string& text, const TrackCase& the_case,
                                     const std::vector<int>& frames) {
  std::vector<FrameSights> read;
  if (!text.starts_with(sights_header())) return read;
  std::size_t at = sights_header().size();
  for (const int frame : frames) {
    FrameSights sights{frame, {}, 0};
    for (std::size_t m = 0; m < the_case.markers.size(); ++m) {
      auto& of = sights.of.emplace_back(the_case.views.size());
      for (std::size_t k = 0; k < the_case.views.size(); ++k) {
        const std::size_t end = text.find('\n', at);
        if (end == text.npos) return read;
        const std::string begin = fmt::format("{},{},{},", frame, csv_field(the_case.markers[m]),
                                              csv_field(the_case.views[k].images.name));
        const std::string_view line(text.data() + at, end - at);
        if (!line.starts_with(begin)) return read;
        const auto fields = fields_of(line.substr(begin.size()));
        if (fields.size() != 7) return read;
        const auto repaired = number_from(fields[6]);
        if (!repaired) return read;
        sights.repaired = int(*repaired);
        if (!fields[0].empty()) {
          double values[6];
          for (std::size_t i = 0; i < 6; ++i) {
            const auto value = number_from(fields[i]);
            if (!value) return read;
            values[i] = *value;
          }
          const MarkerImage image{{values[0], values[1]}, values[2], values[3], values[4], values[5]};
          if (rectified_in(the_case.views[k], image.uv_raw)) of[k] = image;
        }
        at = end + 1;
      }
    }
    read.push_back(std::move(sights));
  }
  return read;
}

}  // namespace helicarm::track
