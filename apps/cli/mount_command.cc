// SPDX-License-Identifier: Apache-2.0
#include "mount_command.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <unistd.h>

#include "command_line.h"
#include "findings.h"
#include "helicarm/core/earlier_files.h"
#include "helicarm/core/file_lock.h"
#include "helicarm/core/files.h"
#include "helicarm/core/json.h"
#include "helicarm/core/text.h"
#include "helicarm/devices/tracker/mount_calibration.h"
#include "helicarm/devices/tracker/pose_board.h"
#include "helicarm/devices/tracker/sequence_stream.h"
#include "helicarm/devices/tracker/tracker_registry.h"
#include "helicarm/geometry/view_json.h"
#include "helicarm/operation/plan.h"
#include "helicarm/phantom/calibrator.h"
#include "helicarm/pipeline/result.h"
#include "line_input.h"
#include "stop_signal.h"
#include "touch_points.h"
#include "tracker_command.h"

namespace helicarm::cli {

struct MountArguments {
  TrackerLinkArguments link;           ///< its peer is empty if all places come from recordings
  std::string facet;                   ///< name of the calibrator's marker
  std::string pointer = "pointer";     ///< name of the pointer's marker
  std::filesystem::path tip;           ///< as `tracker pivot --json` writes
  std::string calibrator;              ///< a built-in or a file; empty: the plan's, or the UDCSC
  std::vector<std::string> divots;     ///< NAME=X,Y,Z in the calibrator's frame, mm
  std::vector<std::string> touch;      ///< places to touch, in order
  std::vector<std::string> recorded;   ///< LABEL=FILE: the pointer at rest on a place
  std::vector<std::string> pivoted;    ///< LABEL=FILE: the calibrator turned about a place
  std::optional<double> tip_sigma_mm;  ///< per axis, of a tip whose file has no covariance
  double tip_radius_mm = 0;            ///< of the pointer, on balls
  std::filesystem::path out = "mount.json";
  std::filesystem::path plan;  ///< its facet of this name is replaced or added
  tracker::MountOptions options;
};
namespace {

using geometry::RigidTransform;
using Observations = std::vector<tracker::MountObservation>;

struct CalibratedTip {
  Eigen::Vector3d tip_in_pointer;
  std::optional<Eigen::Matrix3d> covariance = {};
};

phantom::Calibrator calibrator_of(const std::string& name, const std::filesystem::path& folder) {
  return name == phantom::udcsc().name ? phantom::udcsc()
                                       : value_or_throw(phantom::read_calibrator(folder / name));
}

/// The plan's, of which the stated one must not differ: a facet belongs to one calibrator.
phantom::Calibrator calibrator_of(const MountArguments& arguments) {
  const std::string& stated = arguments.calibrator;
  if (arguments.plan.empty()) return calibrator_of(stated.empty() ? phantom::udcsc().name : stated, {});
  const operation::OperationPlan plan = value_or_throw(
      operation::plan_from(value_or_throw(read_json(arguments.plan)), arguments.plan.string()));
  phantom::Calibrator planned = calibrator_of(plan.calibrator, plan.folder);
  if (!stated.empty() && phantom::to_json(calibrator_of(stated, {})) != phantom::to_json(planned))
    throw BadInput(
        Reason::bad_value,
        fmt::format("--calibrator: {} differs from \"calibrator\" of {}, {}: leave it out, or state "
                    "it in the plan",
                    without_control_characters(stated), arguments.plan.string(),
                    without_control_characters(plan.calibrator)));
  return planned;
}

/// "NAME=VALUE".
std::pair<std::string, std::string> split(const std::string& option, const std::string& text) {
  const auto equals = text.find('=');
  if (equals == text.npos || equals == 0 || equals + 1 == text.size())
    throw BadInput(Reason::usage,
                   fmt::format("{}: \"{}\" is not NAME=VALUE", option, without_control_characters(text)));
  return {text.substr(0, equals), text.substr(equals + 1)};
}

CalibratedTip tip_of(const MountArguments& arguments) {
  const Json json = value_or_throw(read_json(arguments.tip));
  JsonReader reader(json, arguments.tip.string());
  CalibratedTip tip{Eigen::Vector3d(reader.numbers("tip_in_tool", 3, {-1000, 1000}).data())};
  if (reader.has("covariance_mm2")) {
    const auto numbers = reader.matrix("covariance_mm2", 6, 6, {-1000, 1000});
    tip.covariance =
        Eigen::Map<const Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>(numbers.data()).topLeftCorner<3, 3>();
    if (arguments.tip_sigma_mm)
      throw BadInput(Reason::usage, fmt::format("--tip-sigma: {} states covariance_mm2: omit one of the two",
                                                arguments.tip.string()));
  } else if (arguments.tip_sigma_mm) {
    tip.covariance = *arguments.tip_sigma_mm * *arguments.tip_sigma_mm * Eigen::Matrix3d::Identity();
  }
  return tip;
}

Warning without_covariance(const MountArguments& arguments, const tracker::MountCalibration& mount) {
  return {Reason::covariance_missing,
          fmt::format("{}: covariance_mm2 is missing: the tip is not taken as exact but estimated from the "
                      "touches, {:.2f} mm from the file's position; `helicarm tracker pivot --json` measures "
                      "it, --tip-sigma states its standard deviation",
                      arguments.tip.string(), mount.tip_shift_mm.norm()),
          {},
          {{"tip_shift_mm", mount.tip_shift_mm.norm()}}};
}

std::map<std::string, tracker::MountPlace> places_of(const phantom::Calibrator& calibrator,
                                                     const MountArguments& arguments) {
  std::map<std::string, tracker::MountPlace> places;
  const auto covariances = phantom::ball_covariances(calibrator);
  for (std::size_t i = 0; i < calibrator.balls.size(); ++i) {
    const phantom::CalibratorBall& ball = calibrator.balls[i];
    places[ball.label] = {ball.centre_in_calibrator, ball.diameter_mm / 2 + arguments.tip_radius_mm,
                          covariances.empty() ? Eigen::Matrix3d(Eigen::Matrix3d::Zero()) : covariances[i]};
  }
  for (const std::string& divot : arguments.divots) {
    const auto [name, text] = split("--divot", divot);
    const std::string origin = "--divot " + without_control_characters(name);
    const Json json = value_or_throw(parse_json(fmt::format("{{\"xyz_mm\": [{}]}}", text), origin));
    const Eigen::Vector3d at(JsonReader(json, origin).numbers("xyz_mm", 3, {-1000, 1000}).data());
    if (!places.emplace(name, tracker::MountPlace{at}).second)
      throw BadInput(Reason::name_clash, fmt::format("--divot: \"{}\" is a place already", name));
  }
  return places;
}

/// Mean of a body at rest; the samples' times do not matter.
RigidTransform at_rest(const std::vector<tracker::SequenceFrame>& frames, const std::string& tool,
                       const std::string& file) {
  constexpr double spacing_s = 0.02;
  std::vector<tracker::PoseSample> samples;
  for (const RigidTransform& pose : tracker::gated_poses(frames, tool).tracker_from_tool)
    samples.push_back({spacing_s * static_cast<double>(samples.size()), 0, 0, pose});
  tracker::ExposurePoseOptions whole;
  whole.window_s = spacing_s * static_cast<double>(samples.size());
  const auto mean = tracker::exposure_pose(samples, whole.window_s / 2, whole);
  if (!mean) throw BadInput(mean.error().reason, fmt::format("{}: {}: {}", file, tool, mean.error().message));
  return mean->tracker_from_tool;
}

void add_recorded(Observations& observations, const MountArguments& arguments, const CalibratedTip& tip) {
  for (const std::string& one : arguments.recorded) {
    const auto [label, file] = split("--recorded", one);
    const auto frames = value_or_throw(tracker::read_sequence(file));
    observations.push_back(tracker::touched_place(label, at_rest(frames, arguments.facet, file),
                                                  at_rest(frames, arguments.pointer, file),
                                                  tip.tip_in_pointer, arguments.options));
  }
  for (const std::string& one : arguments.pivoted) {
    const auto [label, file] = split("--pivoted", one);
    const auto frames = value_or_throw(tracker::read_sequence(file));
    const auto pivot =
        tracker::calibrate_pivot(tracker::gated_poses(frames, arguments.facet).tracker_from_tool,
                                 {arguments.options.sigma_mm, arguments.options.sigma_deg});
    if (!pivot) throw BadInput(pivot.error().reason, fmt::format("{}: {}", file, pivot.error().message));
    observations.push_back(tracker::pivoted_place(label, *pivot));
  }
}

/// Asks for each place at the terminal and reads both markers while the pointer is still.
void add_touched(Observations& observations, const MountArguments& arguments, const CalibratedTip& tip,
                 Console& console) {
  constexpr double reading_s = 0.6;
  StopSignal stop;
  tracker::PoseBoard board;
  const auto source = value_or_throw(
      tracker::open_tracker(value_or_throw(tracker_address(arguments.link)), tracker::onto(board)));
  LineInput input(STDIN_FILENO);
  const auto wait = [&](double seconds) {
    if (stop.wait(seconds)) throw BadInput(Reason::interrupted, "stopped by signal");
  };
  for (const std::string& label : arguments.touch) {
    for (bool done = false; !done;) {
      ask_to_touch(label, input, console);
      while (!input.next(50)) wait(0.01);
      wait(reading_s);
      const double middle_s = tracker::monotonic_seconds() - reading_s / 2;
      const auto facet = board.at(arguments.facet, middle_s), pointer = board.at(arguments.pointer, middle_s);
      done = facet && pointer;
      if (done) {
        observations.push_back(tracker::touched_place(label, facet->tracker_from_tool,
                                                      pointer->tracker_from_tool, tip.tip_in_pointer,
                                                      arguments.options));
        continue;
      }
      const Failure& why = facet ? pointer.error() : facet.error();
      if (!operation::is_of_a_reading(why)) throw BadInput(why);
      console.progress << fmt::format("{}: {}; again\n", code(why.reason),
                                      without_control_characters(why.message))
                       << std::flush;
    }
  }
}

double per_axis(const tracker::PoseCovariance& covariance, Eigen::Index from) {
  return std::sqrt(covariance.diagonal().segment<3>(from).sum() / 3);
}

/// The entry of "facets" in plan.json.
Json facet_json(const tracker::MountCalibration& mount, const std::string& name) {
  return {{"name", name},
          {"calibrator_from_facet", geometry::json_rows(mount.calibrator_from_facet.matrix())},
          {"sigma_mm", per_axis(mount.covariance, 0)},
          {"sigma_deg", per_axis(mount.covariance, 3) * 180 / std::numbers::pi}};
}

Json mount_json(const tracker::MountCalibration& mount, const MountArguments& arguments,
                const std::string& calibrator) {
  Json residuals = Json::array();
  for (const tracker::MountResidual& one : mount.residuals)
    residuals.push_back({{"label", one.label}, {"distance_mm", one.distance_mm}});
  return {{"format", "helicarm-mount/1"},
          {"calibrator", calibrator},
          {"facet", facet_json(mount, arguments.facet)},
          {"covariance", geometry::json_rows(mount.covariance)},
          {"fre_mm", mount.fre_mm},
          {"chi2", mount.chi2},
          {"dof", mount.dof},
          {"tip_shift_mm", geometry::json_list(mount.tip_shift_mm)},
          {"residuals", std::move(residuals)},
          {"tre_mm", mount.tre_mm},
          {"exchangeable", mount.exchangeable}};
}

void put_into_plan(const std::filesystem::path& file, const Json& facet) {
  const FileLock lock = value_or_throw(FileLock::of(file));
  Json plan = value_or_throw(read_json(lock.file()));
  Json& facets = plan["tracker"]["facets"];
  const auto known =
      std::ranges::find_if(facets, [&](const Json& one) { return one["name"] == facet["name"]; });
  if (known == facets.end())
    facets.push_back(facet);
  else
    *known = facet;
  value_or_throw(operation::plan_from(plan, file.string()));
  value_or_throw(write_file(lock.file(), to_text(plan)));
}

void print(const tracker::MountCalibration& mount, const MountArguments& arguments, Console& console) {
  const auto worst =
      std::ranges::max_element(mount.tre_mm, {}, &std::pair<const std::string, double>::second);
  for (const tracker::MountResidual& one : mount.residuals)
    console.out << fmt::format("  {:<8} {:.2f} mm\n", without_control_characters(one.label), one.distance_mm);
  console.out << fmt::format(
      "{} in the calibrator: FRE {:.2f} mm rms; predicted error at most {:.2f} mm rms (at {}), {:.2f} "
      "degrees "
      "per axis\n",
      without_control_characters(arguments.facet), mount.fre_mm, worst->second, worst->first,
      per_axis(mount.covariance, 3) * 180 / std::numbers::pi);
  for (const auto& [a, b] : mount.exchangeable)
    console.progress << fmt::format(
        "warning: these places would not show an exchange of \"{}\" and \"{}\": touch further places\n",
        without_control_characters(a), without_control_characters(b));
  console.out << arguments.out.string() << " is written\n";
  if (!arguments.plan.empty())
    console.out << fmt::format("{} has the facet \"{}\" now\n", arguments.plan.string(),
                               without_control_characters(arguments.facet));
}

}  // namespace

/// Finds `calibrator_from_facet` of the user's own mount and writes it with its covariance.
CommandResult calibrate_mount_command(const MountArguments& arguments, Console& console) {
  return guarded([&] {
    forget_files(arguments.out.parent_path(), {arguments.out.filename().string()},
                 {arguments.tip, arguments.calibrator, arguments.plan});
    if (arguments.link.peer.empty() != arguments.touch.empty())
      throw BadInput(Reason::usage, "--touch and the tracker's address:port belong together");
    const bool touches = !arguments.touch.empty() || !arguments.recorded.empty();
    if (touches && arguments.tip.empty())
      throw BadInput(Reason::usage, "touches need --tip: the file written by `tracker pivot --json`");
    const phantom::Calibrator calibrator = calibrator_of(arguments);
    const auto places = places_of(calibrator, arguments);
    for (const std::string& label : arguments.touch)
      if (!places.contains(label))
        throw BadInput(Reason::bad_value, fmt::format("--touch: {} has no \"{}\"", calibrator.name,
                                                      without_control_characters(label)));
    tracker::MountOptions options = arguments.options;
    const CalibratedTip tip =
        touches ? tip_of(arguments)
                : CalibratedTip{Eigen::Vector3d::Zero(), Eigen::Matrix3d(Eigen::Matrix3d::Zero())};
    options.tip_covariance = tip.covariance;
    Observations observations;
    add_recorded(observations, arguments, tip);
    if (!arguments.touch.empty()) add_touched(observations, arguments, tip, console);
    const auto mount = value_or_throw(tracker::calibrate_mount(places, observations, options));
    Json json = mount_json(mount, arguments, calibrator.name);
    json["warnings"] = Json::array();
    if (!tip.covariance) {
      const Warning warning = without_covariance(arguments, mount);
      json["warnings"].push_back(pipeline::to_json(warning));
      print_finding("warning", warning, console);
    }
    value_or_throw(write_file(arguments.out, to_text(json)));
    if (!arguments.plan.empty()) put_into_plan(arguments.plan, json["facet"]);
    if (console.json)
      console.out << to_text(json) << '\n';
    else
      print(mount, arguments, console);
  });
}

void add_calibrate_mount(CLI::App* tracker, Action& action) {
  auto* command = tracker->add_subcommand(
      "calibrate-mount", "Find the pose of your marker in the calibrator by touching its balls or divots");
  auto& a = arguments_of(command, action, calibrate_mount_command);
  command->add_option("PEER", a.link.peer,
                      "address:port of an OpenIGTLink server, or ndi:ADDRESS[:PORT], for --touch");
  add_definitions(command, a.link);
  command->add_option("--facet", a.facet, "Name of the calibrator's marker")->required();
  command->add_option("--pointer", a.pointer, "Name of the pointer's marker")->capture_default_str();
  command->add_option("--tip", a.tip, "The pointer's tip, as `tracker pivot --json` prints it");
  command
      ->add_option(
          "--tip-sigma", a.tip_sigma_mm,
          "Standard deviation of the tip per axis, mm, if its file has no covariance; without either "
          "the touches determine the tip")
      ->check(within(0, 10));
  command->add_option("--tip-radius", a.tip_radius_mm, "Radius of the pointer's tip, mm; counts on balls")
      ->check(within(0, 20))
      ->capture_default_str();
  command->add_option("--calibrator", a.calibrator,
                      "A built-in or a file. Default: that of --plan, without a plan udcsc");
  command->add_option("--divot", a.divots,
                      "NAME=X,Y,Z: a point of the calibrator that holds the tip, mm; repeatable");
  command
      ->add_option("--touch", a.touch,
                   "Balls and divots to touch in this order, each as often as it is named")
      ->delimiter(',');
  command->add_option("--recorded", a.recorded,
                      "LABEL=FILE: a recording of the pointer at rest on it; repeatable");
  command->add_option(
      "--pivoted", a.pivoted,
      "LABEL=FILE: a recording of the calibrator turned about this point; repeatable. It gives "
      "one point: three are needed");
  command->add_option("--sigma-mm", a.options.sigma_mm, "Error of a reading per axis, mm")
      ->check(within(0, 10))
      ->capture_default_str();
  command->add_option("--sigma-deg", a.options.sigma_deg, "Error of a reading per axis, degrees")
      ->check(within(0, 10))
      ->capture_default_str();
  command->add_option("--seat", a.options.seat_mm, "Error of the tip in a divot or on a ball per axis, mm")
      ->check(within(0.001, 10))
      ->capture_default_str();
  command->add_option("--max-error", a.options.max_tre_mm, "Largest predicted error at a ball, mm")
      ->check(within(0.01, 100))
      ->capture_default_str();
  command->add_option("--out", a.out, "The file to write")->capture_default_str();
  command->add_option("--plan", a.plan, "A plan.json whose facet of this name is replaced or added");
}

}  // namespace helicarm::cli
