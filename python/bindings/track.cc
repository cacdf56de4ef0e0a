// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/track.h"

#include <limits>
#include <memory>

#include "arrays.h"
#include "checks.h"
#include "helicarm/calibration/calibrated_view.h"
#include "helicarm/core/files.h"
#include "helicarm/exchange/import_matrix.h"
#include "helicarm/track/view_map.h"
#include "module.h"
#include "signals.h"

namespace helicarm::python {
namespace {

constexpr double unplaced = std::numeric_limits<double>::quiet_NaN();

/// A sequence with the case that it is of.
struct Tracked {
  track::TrackCase the_case;
  track::Sequence sequence;
};

std::unique_ptr<Tracked> tracked(const std::filesystem::path& folder, const std::string& frames,
                                 const std::optional<std::filesystem::path>& out, bool resume,
                                 const std::optional<std::filesystem::path>& axes,
                                 std::optional<double> butterworth_hz, int butterworth_order,
                                 const std::optional<std::filesystem::path>& picks,
                                 const std::optional<std::filesystem::path>& points, int points_first,
                                 bool points_from_one, bool points_y_up, bool points_undistorted,
                                 std::optional<double> points_sigma, const py::object& progress) {
  std::optional<track::PointsFile> of_points;
  if (picks || points)
    of_points = track::PointsFile{points ? *points : *picks,
                                  points.has_value(),
                                  points_first,
                                  points_from_one,
                                  points_y_up,
                                  points_undistorted,
                                  checked(points_sigma, {0.01, 10}, "points_sigma")};
  const py::object nothing = py::none();
  const RunHooks hooks = run_hooks(nothing);
  return value_or_raise(without_gil([&] {
    return guarded([&] {
      if (picks && points) throw BadInput(Reason::usage, "picks and points: only one of them");
      if (out) value_or_throw(check_can_write(*out));
      if (out && !resume) track::forget_track(*out);
      const auto range = value_or_throw(case_registration::frame_range_from(frames));
      auto made = std::make_unique<Tracked>();
      made->the_case = value_or_throw(track::read_track_case(folder, range, of_points));
      if (butterworth_hz) made->the_case.butterworth = track::Butterworth{*butterworth_hz, butterworth_order};
      track::check_butterworth(made->the_case, range.step);
      if (axes) made->the_case.axes = value_or_throw(track::read_body_axes(*axes, made->the_case));
      made->sequence = value_or_throw(
          track::run_track(made->the_case, range, {.out = out, .resume = resume}, [&](int done) {
            hooks.on_view();
            if (progress.is_none()) return;
            const py::gil_scoped_acquire acquire;
            progress(double(done) / range.count());
          }));
      if (out) value_or_throw(track::write_track(made->sequence, made->the_case, *out));
      if (made->sequence.failure) throw BadInput(*made->sequence.failure);
      return made;
    });
  }));
}

std::unique_ptr<Tracked> tracked_images(
    const std::vector<std::tuple<std::string, std::vector<std::shared_ptr<xray::XrayImage>>,
                                 exchange::ImportedMatrix, std::optional<rectification::DistortionMap>>>&
        views,
    const std::optional<Doubles>& camera_covariance, const std::vector<std::string>& markers,
    const std::vector<std::tuple<std::size_t, std::size_t, double, double>>& picks,
    const std::vector<std::tuple<std::string, std::vector<std::size_t>, std::optional<Doubles>>>& bodies,
    double diameter_mm, std::optional<double> frame_rate_hz, const std::optional<std::filesystem::path>& out,
    const std::vector<std::pair<std::size_t, Doubles>>& axes, std::optional<double> butterworth_hz,
    int butterworth_order,
    const std::vector<std::tuple<std::size_t, std::size_t, int, double, double>>& corrections,
    const py::object& progress) {
  auto made = std::make_unique<Tracked>();
  track::TrackCase& the_case = made->the_case;
  for (const auto& [name, images, camera, map] : views) {
    track::TrackView& view = the_case.views.emplace_back();
    view.images.name = name;
    view.images.image = name;
    view.image_size = camera.image_size;
    view.camera = camera.view;
    value_or_raise(guarded([&] { track::take_map(view, map, name); }));
    std::vector<xray::XrayImage> frames;
    for (const auto& image : images) frames.push_back(*image);
    view.opened = value_or_raise(xray::ImageFile::of(std::move(frames)));
  }
  const auto size = py::ssize_t(calibration::view_parameters * views.size());
  if (camera_covariance)
    the_case.camera_covariance = checked_covariance(
        matrix_of(*camera_covariance, size, size, "camera_covariance"), "camera_covariance");
  the_case.diameter_mm = checked(diameter_mm, {0.1, 30}, "diameter_mm");
  the_case.frame_rate_hz = checked(frame_rate_hz, {0.01, 1e5}, "frame_rate_hz");
  the_case.markers = markers;
  for (const auto& [marker, view, u, v] : picks) the_case.picks.push_back({marker, view, {u, v}});
  for (const auto& [marker, view, frame, u, v] : corrections)
    the_case.corrections.push_back({marker, view, {u, v}, frame});
  for (const auto& [name, of, geometry] : bodies)
    the_case.bodies.push_back(
        {name, of, geometry ? rows_of<3>(*geometry, "bodies: " + name) : std::vector<Eigen::Vector3d>{}});
  for (const auto& [body, matrix] : axes) {
    const bool has_origin = matrix.ndim() == 2 && matrix.shape(1) == 4;
    const Eigen::MatrixXd given =
        matrix_of(matrix, 3, has_origin ? 4 : 3, "axes: " + the_case.bodies[body].name);
    track::BodyAxes& of = the_case.axes.emplace_back(track::BodyAxes{body, given.leftCols<3>()});
    if (has_origin) of.origin = given.col(3);
  }
  if (butterworth_hz) the_case.butterworth = track::Butterworth{*butterworth_hz, butterworth_order};
  value_or_raise(guarded([&] { track::check_butterworth(the_case, 1); }));
  if (!axes.empty())
    value_or_raise(guarded([&] { track::check_body_axes(the_case.axes, the_case, "axes"); }));
  const case_registration::FrameRange range{1, int(std::get<1>(views.front()).size()), 1};
  const RunHooks hooks = run_hooks(py::none());
  value_or_raise(without_gil([&] {
    return guarded([&] {
      if (out) {
        value_or_throw(check_can_write(*out));
        track::forget_track(*out);
      }
      made->sequence = value_or_throw(track::run_track(the_case, range, {.out = out}, [&](int done) {
        hooks.on_view();
        if (progress.is_none()) return;
        const py::gil_scoped_acquire acquire;
        progress(double(done) / range.count());
      }));
      if (out) value_or_throw(track::write_track(made->sequence, the_case, *out));
      if (made->sequence.failure) throw BadInput(*made->sequence.failure);
    });
  }));
  return made;
}

/// (n, markers, ...) of the places, NaN where a marker is lost.
template <class Write>
py::array places_array(const Tracked& t, std::vector<py::ssize_t> rest, Write write) {
  std::vector<py::ssize_t> shape{py::ssize_t(t.sequence.frames.size()),
                                 py::ssize_t(t.the_case.markers.size())};
  py::ssize_t each = 1;
  for (const py::ssize_t size : rest) shape.push_back(size), each *= size;
  py::array_t<double> array(shape);
  double* at = array.mutable_data();
  for (const auto& frame : t.sequence.markers)
    for (const track::TrackedMarker& marker : frame) {
      std::fill(at, at + each, unplaced);
      if (marker.place) write(*marker.place, at);
      at += each;
    }
  return read_only(array);
}

/// (n, size, size) of each body by its name, NaN where a frame has no pose.
template <class Value>
py::dict bodies_dict(const Tracked& t, std::vector<track::TrackedBody> track::BodySequence::*frames, int size,
                     Value value) {
  py::dict dict;
  for (std::size_t b = 0; b < t.the_case.bodies.size(); ++b) {
    const auto& of = t.sequence.bodies[b].*frames;
    py::array_t<double> array({py::ssize_t(of.size()), py::ssize_t(size), py::ssize_t(size)});
    double* at = array.mutable_data();
    for (const track::TrackedBody& frame : of) {
      Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> block(at, size,
                                                                                               size);
      if (frame.pose)
        block = value(*frame.pose);
      else
        block.setConstant(unplaced);
      at += size * size;
    }
    dict[py::str(t.the_case.bodies[b].name)] = read_only(array);
  }
  return dict;
}

/// (n, 3) or (n, 3, 3) of each joint by its body's name, NaN where it has no angles.
template <class Write>
py::dict joints_dict(const Tracked& t, std::vector<py::ssize_t> rest, Write write) {
  py::dict dict;
  for (const track::Joint& joint : t.sequence.joints) {
    std::vector<py::ssize_t> shape{py::ssize_t(joint.frames.size())};
    py::ssize_t each = 1;
    for (const py::ssize_t size : rest) shape.push_back(size), each *= size;
    py::array_t<double> array(shape);
    double* at = array.mutable_data();
    for (const auto& frame : joint.frames) {
      std::fill(at, at + each, unplaced);
      if (frame) write(*frame, at);
      at += each;
    }
    dict[py::str(t.the_case.bodies[joint.body].name)] = read_only(array);
  }
  return dict;
}

Eigen::MatrixXd pose_matrix(const track::FramePose& pose) { return pose.pose.matrix(); }
Eigen::MatrixXd pose_covariance(const track::FramePose& pose) { return pose.covariance; }

}  // namespace

void add_track(py::module_& module) {
  py::class_<Tracked>(
      module, "Track",
      "The answer of track; to_dict() is track.json. n is the number of frames, m of markers.")
      .def_property_readonly(
          "frames", [](const Tracked& t) { return t.sequence.frames; }, "Number of each frame.")
      .def_property_readonly(
          "markers", [](const Tracked& t) { return t.the_case.markers; }, "Names, in the arrays' order.")
      .def_property_readonly(
          "places",
          [](const Tracked& t) {
            return places_array(t, {3}, [](const track::FramePlace& place, double* at) {
              Eigen::Map<Eigen::Vector3d>{at} = place.place;
            });
          },
          "(n, m, 3): mm, NaN where a marker is lost.")
      .def_property_readonly(
          "covariances",
          [](const Tracked& t) {
            return places_array(t, {3, 3}, [](const track::FramePlace& place, double* at) {
              Eigen::Map<Eigen::Matrix3d>{at} = place.covariance;
            });
          },
          "(n, m, 3, 3): mm^2.")
      .def_property_readonly(
          "status",
          [](const Tracked& t) {
            std::vector<std::vector<std::string>> words;
            for (const auto& frame : t.sequence.markers) {
              auto& row = words.emplace_back();
              for (const track::TrackedMarker& marker : frame)
                row.emplace_back(track::status_words[std::size_t(marker.status)]);
            }
            return words;
          },
          "n lists of m words: tracked, one_view, predicted, lost.")
      .def_property_readonly(
          "bodies",
          [](const Tracked& t) { return bodies_dict(t, &track::BodySequence::frames, 4, pose_matrix); },
          "{name: (n, 4, 4)}: world_from_body of each frame against the first, NaN where it has no pose.")
      .def_property_readonly(
          "body_covariances",
          [](const Tracked& t) { return bodies_dict(t, &track::BodySequence::frames, 6, pose_covariance); },
          "{name: (n, 6, 6)}: rotation vector in rad, then mm, in world axes about the body's centroid.")
      .def_property_readonly(
          "smoothed",
          [](const Tracked& t) { return bodies_dict(t, &track::BodySequence::smoothed, 4, pose_matrix); },
          "{name: (n, 4, 4)}: likewise, of one estimate over all frames, gaps filled.")
      .def_property_readonly(
          "smoothed_covariances",
          [](const Tracked& t) { return bodies_dict(t, &track::BodySequence::smoothed, 6, pose_covariance); },
          "{name: (n, 6, 6)}.")
      .def_property_readonly(
          "butterworth",
          [](const Tracked& t) -> py::object {
            const auto places = track::butterworth_places(t.sequence, t.the_case);
            if (places.empty()) return py::none();
            const auto frames = py::ssize_t(t.sequence.frames.size());
            py::array_t<double> array({frames, py::ssize_t(places.size()), py::ssize_t(3)});
            auto at = array.mutable_unchecked<3>();
            for (py::ssize_t f = 0; f < frames; ++f)
              for (py::ssize_t m = 0; m < py::ssize_t(places.size()); ++m)
                for (py::ssize_t k = 0; k < 3; ++k) {
                  const auto& place = places[std::size_t(m)][std::size_t(f)];
                  at(f, m, k) = place ? (*place)[k] : unplaced;
                }
            return read_only(array);
          },
          "(n, m, 3): places filtered forwards and backwards, mm, NaN where lost; None without "
          "butterworth_hz.")
      .def_property_readonly(
          "joint_angles",
          [](const Tracked& t) {
            return joints_dict(t, {3}, [](const track::JointAngles& angles, double* at) {
              Eigen::Map<Eigen::Vector3d>{at} = angles.angles;
            });
          },
          "{name: (n, 3)}: flexion, adduction and external rotation against the first body of `axes` (Grood "
          "and "
          "Suntay), rad, by the smoothed poses; NaN where a pose is missing. Empty without axes.")
      .def_property_readonly(
          "joint_covariances",
          [](const Tracked& t) {
            return joints_dict(t, {3, 3}, [](const track::JointAngles& angles, double* at) {
              Eigen::Map<Eigen::Matrix3d>{at} = angles.covariance;
            });
          },
          "{name: (n, 3, 3)}: rad^2; the axes are taken as exact.")
      .def_property_readonly(
          "joint_translations",
          [](const Tracked& t) {
            return joints_dict(t, {3}, [](const track::JointAngles& joint, double* at) {
              if (joint.shift) Eigen::Map<Eigen::Vector3d>{at} = *joint.shift;
            });
          },
          "{name: (n, 3)}: the body's origin from that of the first body of `axes`, mm, along x of the "
          "latter, "
          "the floating axis (anterior) and against z of the body (distraction); NaN without origins.")
      .def_property_readonly(
          "joint_translation_covariances",
          [](const Tracked& t) {
            return joints_dict(t, {3, 3}, [](const track::JointAngles& joint, double* at) {
              if (joint.shift) Eigen::Map<Eigen::Matrix3d>{at} = joint.shift_covariance;
            });
          },
          "{name: (n, 3, 3)}: mm^2.")
      .def_property_readonly("warnings", [](const Tracked& t) { return warning_list(t.sequence.warnings); })
      .def(
          "to_dict", [](const Tracked& t) { return python_from(track::to_json(t.sequence, t.the_case)); },
          "The content of track.json.")
      .def(
          "write",
          [](const Tracked& t, const std::filesystem::path& folder) {
            value_or_raise(check_can_write(folder));
            track::forget_track(folder);
            value_or_raise(without_gil([&] { return track::write_track(t.sequence, t.the_case, folder); }));
          },
          py::arg("folder"), "All files of `helicarm track`. Raises InputError: cannot_write.")
      .def("__repr__", [](const Tracked& t) {
        return fmt::format("<Track: {} frames, {} markers, {} bodies>", t.sequence.frames.size(),
                           t.the_case.markers.size(), t.the_case.bodies.size());
      });
  module.def(
      "_track_images", &tracked_images, py::arg("views"), py::arg("camera_covariance"), py::arg("markers"),
      py::arg("picks"), py::arg("bodies"), py::kw_only(), py::arg("diameter_mm"),
      py::arg("frame_rate_hz") = py::none(), py::arg("out") = py::none(),
      py::arg("axes") = std::vector<std::pair<std::size_t, Doubles>>{},
      py::arg("butterworth_hz") = py::none(), py::arg("butterworth_order") = track::Butterworth{}.order,
      py::arg("corrections") = std::vector<std::tuple<std::size_t, std::size_t, int, double, double>>{},
      py::arg("progress") = py::none());
  const track::TrackOptions usual;
  const track::PointsFile counting;
  module.def("track", &tracked, py::arg("case"), py::kw_only(), py::arg("frames"),
             py::arg("out") = py::none(), py::arg("resume") = usual.resume, py::arg("axes") = py::none(),
             py::arg("butterworth_hz") = py::none(),
             py::arg("butterworth_order") = track::Butterworth{}.order, py::arg("picks") = py::none(),
             py::arg("points") = py::none(), py::arg("points_first") = counting.first_frame,
             py::arg("points_from_one") = counting.from_one, py::arg("points_y_up") = counting.y_up,
             py::arg("points_undistorted") = counting.undistorted, py::arg("points_sigma") = py::none(),
             py::arg("progress") = py::none(),
             R"(Follows markers and bodies through a sequence, as `helicarm track` does.

case: folder that holds case.json. frames: "A-B" or "A-B:STEP"; the markers are picked in frame A. out: folder for all
files, whose rows are written as they are computed. resume: go on after the frames of an interrupted run in `out`.
axes: CSV body,axis,x,y,z of two bodies or more, or 3D Slicer's markups: joint angles against the first one. butterworth_hz, butterworth_order
(2 or 4, of both passes): cut-off of the filtered places; the case states frame_rate_hz.
picks: path of XMALab's 2-D points, whose first frame are the picks; points: likewise, whose points of all frames are placed as they
are, without images. points_first: frame of the file's first row; points_from_one, points_y_up, points_undistorted: how it counts;
points_sigma: of a point per axis, px, before the rays show it (default 0.3).
progress: called with the share of the frames that are done; an exception from it ends the run, and Ctrl-C does.
Releases the GIL. Returns a Track.
Raises InputError; RefusedError if the picks contradict each other or the geometry given.)");
}

}  // namespace helicarm::python
