// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/case_points.h"

#include <cmath>

#include <fmt/format.h>

#include "helicarm/core/statistics.h"
#include "helicarm/geometry/absolute_pose.h"
#include "helicarm/track/exchanged_views.h"
#include "helicarm/track/sighted_point.h"
#include "helicarm/track/view_map.h"
#include "helicarm/track/xmalab_points.h"

namespace helicarm::track {
namespace {

/// A point of the file in raw pixels from 0, y downwards. `what`: marker and frame.
Eigen::Vector2d raw_point(Eigen::Vector2d at, const TrackView& view, const PointsFile& points,
                          const std::string& origin, const std::string& what) {
  if (points.from_one) at.array() -= 1;
  if (points.y_up) {
    if (!view.image_size)
      throw BadInput(Reason::bad_value, fmt::format("{}: y upwards: the camera of {} states no image size",
                                                    origin, view.images.name));
    at.y() = view.image_size->y() - 1 - at.y();
  }
  if (!rectified_in(view, at)) refuse_outside_map(fmt::format("{}: {}", origin, what), view, at);
  return at;
}

void check_points_meet(const TrackCase& read, const std::string& origin) {
  constexpr double most_mm = 2;
  const auto gap = median_gap_mm(read.views, read.points);
  if (!gap)
    throw BadInput(Reason::not_seen,
                   fmt::format("{}: no marker has a point in two views of a frame", origin));
  if (const auto exchanged = exchanged_views(read.views, read.points))
    throw BadInput({Reason::residual_too_large,
                    fmt::format("{}: {}: they have each other's columns: correct the header, or exchange the "
                                "cameras of the case",
                                origin, exchanged_text(read.views, *exchanged)),
                    {},
                    {{"gap_mm", exchanged->gap_mm}, {"exchanged_mm", exchanged->exchanged_mm}}});
  if (*gap > most_mm)
    throw BadInput(
        {Reason::residual_too_large,
         fmt::format(
             "{}: the rays of its points miss each other by {:.2f} mm (median), limit {:g} mm: the views' "
             "order or cameras are others, or the file counts y upwards, has undistorted points, or begins "
             "at another frame in one view",
             origin, *gap, most_mm),
         {},
         {{"gap_mm", *gap}}});
}

/// Of a body's markers about its geometry in one frame; nothing without four of them in two views.
std::optional<double> geometry_misfit(const TrackCase& read, const BodyPlan& body, std::size_t frame) {
  constexpr std::size_t fewest = 4;  // three fit a mirrored geometry too
  std::vector<Eigen::Vector3d> known, placed;
  for (std::size_t i = 0; i < body.markers.size(); ++i) {
    std::vector<Sight> seen;
    for (std::size_t k = 0; k < read.views.size(); ++k)
      if (const auto& raw = read.points[frame][body.markers[i] * read.views.size() + k])
        seen.push_back(
            {&read.views[k].camera, rectified_in(read.views[k], *raw).value(), read.point_sigma_px});
    const auto met = seen.size() >= 2 ? sighted_point(seen) : std::nullopt;
    if (!met) continue;
    known.push_back(body.geometry[i]);
    placed.push_back(met->place);
  }
  if (known.size() < fewest) return std::nullopt;
  const geometry::RigidTransform pose = geometry::absolute_pose(known, placed);
  double squares = 0;
  for (std::size_t i = 0; i < known.size(); ++i) squares += (pose * known[i] - placed[i]).squaredNorm();
  return std::sqrt(squares / double(known.size()));
}

}  // namespace

void take_points(TrackCase& read, const PointsFile& points, const case_registration::FrameRange& frames) {
  const std::string origin = points.file.filename().string();
  const XmalabPoints2d given = value_or_throw(read_xmalab_points2d(points.file, read.views.size()));
  if (points.undistorted)
    for (const TrackView& view : read.views)
      if (view.map)
        throw BadInput(
            Reason::bad_value,
            fmt::format("{}: XMALab's undistorted points are not those of the distortion map of {}: export "
                        "the distorted ones",
                        origin, view.images.name));
  const int last = points.first_frame + int(given.rows.size()) - 1;
  const std::vector<int> numbers = points.of_all_frames ? frames.numbers() : std::vector{frames.first};
  for (const int number : {numbers.front(), numbers.back()})
    if (number < points.first_frame || number > last)
      throw BadInput(Reason::bad_value,
                     fmt::format("{}: has a row for each of the frames {} to {}, but frame {} is asked for",
                                 origin, points.first_frame, last, number));
  if (given.markers.size() > most_markers)
    throw BadInput(Reason::bad_value, fmt::format("{}: more than {} markers", origin, most_markers));
  read.markers = given.markers;
  for (const int number : numbers) {
    auto row = given.rows[std::size_t(number - points.first_frame)];
    for (std::size_t i = 0; i < row.size(); ++i)
      if (row[i])
        row[i] = raw_point(*row[i], read.views[i % read.views.size()], points, origin,
                           fmt::format("\"{}\" of frame {}", given.markers[i / read.views.size()], number));
    if (number == numbers.front())
      for (std::size_t i = 0; i < row.size(); ++i)
        if (row[i]) read.picks.push_back({i / read.views.size(), i % read.views.size(), *row[i]});
    if (points.of_all_frames) read.points.push_back(std::move(row));
  }
  if (points.of_all_frames) {
    read.point_sigma_px = points.sigma_px.value_or(read.point_sigma_px);
    check_points_meet(read, origin);
  } else if (read.picks.empty()) {
    throw BadInput(Reason::bad_value, fmt::format("{}: has no point in frame {}", origin, frames.first));
  }
}

void check_geometry_of_points(const TrackCase& read, const std::string& origin) {
  constexpr double most_mm = 0.5;
  for (const BodyPlan& body : read.bodies) {
    if (body.geometry.empty()) continue;
    std::vector<double> misfits;
    for (std::size_t frame = 0; frame < read.points.size(); ++frame)
      if (const auto misfit = geometry_misfit(read, body, frame)) misfits.push_back(*misfit);
    if (misfits.empty()) continue;
    const double usual = median(std::move(misfits));
    if (usual > most_mm)
      throw BadInput(
          {Reason::residual_too_large,
           fmt::format(
               "{}: the markers of the body \"{}\" differ from its geometry by {:.2f} mm rms (median of the "
               "frames), "
               "limit {:g} mm: it is of another body, in another unit, or has other names, or the file "
               "counts otherwise than stated, which mirrors the world",
               origin, body.name, usual, most_mm),
           {},
           {{"rms_mm", usual}, {"limit_mm", most_mm}}});
  }
}

}  // namespace helicarm::track
