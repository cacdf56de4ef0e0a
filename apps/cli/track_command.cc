// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <filesystem>
#include <string>

#include <fmt/format.h>

#include "command_line.h"
#include "findings.h"
#include "helicarm/core/files.h"
#include "helicarm/core/json.h"
#include "helicarm/track/track.h"
#include "interruption.h"
#include "progress_line.h"
#include "resumed_sequence.h"
#include "several_cases.h"

namespace helicarm::cli {

struct TrackArguments {
  SeveralCases several = {};
  std::filesystem::path out = "helicarm-track";
  std::string frames;  ///< A-B[:STEP]
  std::filesystem::path axes;
  std::optional<double> butterworth_hz;
  int butterworth_order = track::Butterworth{}.order;
  bool resume = false;
  std::filesystem::path picks, points;  ///< of XMALab; empty: the case's picks
  track::PointsFile counting;           ///< of either
};
namespace {

std::optional<track::PointsFile> points_file(const TrackArguments& arguments) {
  if (arguments.picks.empty() && arguments.points.empty()) return std::nullopt;
  track::PointsFile file = arguments.counting;
  file.of_all_frames = arguments.picks.empty();
  file.file = file.of_all_frames ? arguments.points : arguments.picks;
  return file;
}

std::string summary_of(const track::Sequence& sequence, const track::TrackCase& the_case) {
  std::array<int, 4> counts{};
  for (const auto& frame : sequence.markers)
    for (const track::TrackedMarker& marker : frame) ++counts[std::size_t(marker.status)];
  std::string text = fmt::format("  {} frames, {} with all {} markers tracked\n", sequence.frames.size(),
                                 sequence.complete, the_case.markers.size());
  text += fmt::format("  places: {} tracked, {} by one view, {} predicted, {} lost; {} exchanges repaired\n",
                      counts[0], counts[1], counts[2], counts[3], sequence.repaired);
  for (std::size_t k = 1; k < the_case.views.size(); ++k)
    if (sequence.delays[k].is_known)
      text += fmt::format("  delay of {}: {:.4f} frames, standard deviation {:.4f}\n",
                          the_case.views[k].images.name, sequence.delays[k].frames, sequence.delays[k].sigma);
  for (std::size_t b = 0; b < the_case.bodies.size(); ++b) {
    int decisions[3] = {};
    for (const track::TrackedBody& frame : sequence.bodies[b].frames) ++decisions[int(frame.decision)];
    text += fmt::format("  {}: {} accepted, {} warned, {} refused; markers deviate by {:.3f} mm per axis\n",
                        the_case.bodies[b].name, decisions[0], decisions[1], decisions[2],
                        sequence.bodies[b].deviation_mm);
  }
  return text;
}

/// Follows markers and writes the tables, track.json and report.html. A refusal is written to track.json and
/// then fails with its reason; unusable input leaves none.
Expected<track::Sequence> tracked(const TrackArguments& arguments, const std::filesystem::path& folder,
                                  const std::filesystem::path& out, Console& console) {
  return guarded([&] {
    value_or_throw(check_can_write(out));
    if (!arguments.resume) track::forget_track(out);
    const auto range = value_or_throw(case_registration::frame_range_from(arguments.frames));
    const auto refuse = [&](const Failure& failure) {
      if (exit_code(failure.reason) == 3) {
        track::forget_track(out);
        value_or_throw(write_file(out / "track.json", to_text(track::refused_json(failure)) + "\n"));
      }
      throw BadInput(failure);
    };
    auto the_case = track::read_track_case(folder, range, points_file(arguments));
    if (!the_case) refuse(the_case.error());
    if (!arguments.axes.empty())
      the_case->axes = value_or_throw(track::read_body_axes(arguments.axes, *the_case));
    if (arguments.butterworth_hz)
      the_case->butterworth = track::Butterworth{*arguments.butterworth_hz, arguments.butterworth_order};
    track::check_butterworth(*the_case, range.step);
    ProgressLine progress(console);
    Interruption interruption;
    int followed = 0;
    const auto on_frame = [&](int done) {
      followed = done;
      progress.notify(double(done) / range.count());
      if (interruption.is_requested() && done < range.count()) throw Interruption::Requested();
    };
    const auto sequence = [&] {
      try {
        return track::run_track(
            *the_case, range, {.out = out, .resume = arguments.resume, .on_note = noted(console)}, on_frame);
      } catch (const Interruption::Requested&) {
        console.progress << kept_after_interruption("track", folder, arguments.frames, out, followed,
                                                    range.count())
                         << std::flush;
        interruption.end_program();
        throw;
      }
    }();
    if (!sequence) refuse(sequence.error());
    value_or_throw(track::write_track(*sequence, *the_case, out));
    print_warnings(sequence->warnings, console);
    if (console.json)
      console.out << to_text(track::to_json(*sequence, *the_case)) << '\n';
    else if (!console.quiet)
      console.out << summary_of(*sequence, *the_case)
                  << fmt::format("  {:.1f} s, {:.1f} frames/s\n\n  written to {}\n", sequence->seconds,
                                 double(sequence->frames.size()) / sequence->seconds, out.string());
    return *sequence;
  });
}

constexpr std::initializer_list<const char*> track_columns{"status",   "code",     "message", "frames",
                                                           "complete", "repaired", "warnings"};

std::string line_of_track(const CaseRow& row) {
  return fmt::format("{:.0f} frames, {:.0f} with all markers tracked, {:.0f} warnings",
                     row.figures[0].value_or(0), row.figures[1].value_or(0), row.figures[3].value_or(0));
}

}  // namespace

/// Of one sequence or several.
CommandResult track_command(const TrackArguments& arguments, Console& console) {
  if (arguments.several.cases.size() > 1) {
    const auto one_case = [&](const std::filesystem::path& the_case, const std::filesystem::path& out,
                              Console& silent) {
      const track::Sequence sequence = value_or_throw(tracked(arguments, the_case, out, silent));
      return CaseRow{{},
                     sequence.failure,
                     {double(sequence.frames.size()), double(sequence.complete), double(sequence.repaired),
                      double(sequence.warnings.size())}};
    };
    return do_cases(arguments.several,
                    {arguments.out, track_columns, one_case, line_of_track, track::forget_track}, console);
  }
  return guarded([&] {
    const track::Sequence sequence =
        value_or_throw(tracked(arguments, arguments.several.cases.front(), arguments.out, console));
    if (!sequence.failure) return;
    console.answered = console.json;
    throw BadInput(*sequence.failure);
  });
}

void add_track(CLI::App& app, Action& action) {
  auto* command = add_command(
      app, group::motion, "track", "Follow markers and bodies through a sequence of two views or more",
      "helicarm track my-sequence --frames 1-435 --out my-motion\n\n"
      "case.json names the views, the markers' size, a pick of each marker in each view of the first frame, "
      "and "
      "the bodies:\n"
      "  {\"format\": \"helicarm-case/2\",\n"
      "   \"views\": [{\"name\": \"cam1\", \"image\": \"cam1_{frame:04d}.png\", \"camera\": "
      "\"camera1.json\"},\n"
      "             {\"name\": \"cam2\", \"image\": \"cam2_{frame:04d}.png\", \"camera\": \"camera2.json\", "
      "\"frame_offset\": 0}],\n"
      "   \"markers\": {\"diameter_mm\": 1.0},\n"
      "   \"picks\": [{\"name\": \"J1\", \"view\": \"cam1\", \"frame\": 1, \"uv\": [653.9, 642.5]}, ...],\n"
      "   \"bodies\": [{\"name\": \"jaw\", \"markers\": [\"J1\", \"J2\", \"J3\"], \"geometry\": null}]}\n\n"
      "\"camera\" is what `helicarm import --json` prints (MayaCam, OpenCV, a matrix); or \"calibration\": "
      "\"result.json\",\nor the case's calibrator in the first images. Picks are raw pixels, within 6 px and "
      "a radius of "
      "the "
      "marker.\n\n"
      "Writes markers.csv, bodies.csv (poses against the first frame), smoothed.csv, relative.csv, "
      "track.json, "
      "report.html,\npoints2d.csv and points3d.csv for XMALab, NAME.tra for Autoscoper. Every place and pose "
      "has "
      "its standard\ndeviations; a marker that is hidden is placed by its body. An interrupted run goes on "
      "with "
      "--resume.\nExit code 3: the picks contradict each other, or nothing was followed. See "
      "docs/motion.md.");
  auto& a = arguments_of(command, action, track_command);
  add_cases(command, a.several);
  command->add_option("--frames", a.frames, "Frames A-B[:STEP]; the markers are picked in frame A")
      ->required();
  command->add_option("--out", a.out, "Folder for the tables, track.json and report.html")
      ->capture_default_str();
  command->add_option(
      "--axes", a.axes,
      "CSV body,axis,x,y,z: unit vectors x, y, z, and origin, of two bodies or more in the first frame's "
      "world; or 3D Slicer's markups (.mrk.json, .fcsv) of the points BODY_origin, BODY_z, BODY_x: "
      "angles.csv then has joint angles and translations (Grood and Suntay)");
  command->add_option(
      "--butterworth", a.butterworth_hz,
      "Cut-off in Hz: butterworth.csv then has the places of markers.csv filtered forwards and "
      "backwards, for comparison; the case states frame_rate_hz");
  command->add_option("--butterworth-order", a.butterworth_order, "Of both passes together: 2 or 4")
      ->capture_default_str();
  auto* picks = command->add_option("--picks", a.picks,
                                    "XMALab's 2-D points (NAME_cam1_X, ...; cam1 is the case's first view): "
                                    "those of the first frame are the picks");
  auto* points = command->add_option(
      "--points", a.points,
      "XMALab's 2-D points of all frames, which are placed as they are: no image is read");
  picks->excludes(points);
  command
      ->add_option("--points-first", a.counting.first_frame,
                   "With --picks or --points: frame of the file's first row")
      ->capture_default_str();
  command->add_flag("--points-from-one", a.counting.from_one, "The file counts pixels from 1");
  command->add_flag("--points-y-up", a.counting.y_up, "The file counts rows upwards");
  command->add_flag("--points-undistorted", a.counting.undistorted,
                    "The file's points were undistorted by XMALab");
  command
      ->add_option("--points-sigma", a.counting.sigma_px,
                   fmt::format("With --points: standard deviation of a point per axis, px, before the rays "
                               "show it (default {:g})",
                               track::TrackCase{}.point_sigma_px))
      ->check(CLI::Range(0.01, 10.0));
  command->add_flag("--resume", a.resume, "Go on after the frames that an interrupted run left in --out");
}

}  // namespace helicarm::cli
