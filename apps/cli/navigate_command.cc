// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <chrono>
#include <filesystem>
#include <numbers>
#include <optional>
#include <thread>

#include <Eigen/Geometry>
#include <fmt/format.h>
#include <unistd.h>

#include "command_line.h"
#include "consent.h"
#include "findings.h"
#include "guide_by_hand.h"
#include "helicarm/core/files.h"
#include "helicarm/core/private_files.h"
#include "helicarm/core/text.h"
#include "helicarm/devices/receiver/receiver.h"
#include "helicarm/devices/receiver/receiver_fields.h"
#include "helicarm/operation/connections.h"
#include "helicarm/operation/plan_fields.h"
#include "helicarm/phantom/calibrator.h"
#include "helicarm/phantom/plate.h"
#include "helicarm/pipeline/run_fields.h"
#include "line_input.h"
#include "measuring.h"
#include "touch_points.h"

namespace helicarm::cli {

struct NavigateArguments {
  std::filesystem::path plan;
  std::filesystem::path out = "session";
  std::filesystem::path picks;                    ///< awaited after the images; empty: those of the plan
  Overrides<operation::OperationPlan> overrides;  ///< of the plan
  std::optional<std::filesystem::path> history;   ///< the C-arm's, read only
  receiver::ReceiverOptions receiver;
  bool dicom = false;  ///< also a DICOM measurement report and registrations
  bool yes = false;    ///< confirm every order automatically: for rehearsals
};

namespace {

namespace fs = std::filesystem;

constexpr std::chrono::seconds connect_patience{10};

/// Checks for errors that can be detected before the first X-ray image.
void check_before_images(const operation::OperationPlan& plan, const NavigateArguments& arguments) {
  const auto refuse = [&](Reason reason, const std::string& problem) {
    throw BadInput(reason, fmt::format("{}: {}", arguments.plan.string(), problem));
  };
  if (!plan.drill && !arguments.yes && !::isatty(STDIN_FILENO))
    throw BadInput(Reason::order_not_confirmed,
                   "there is no terminal to confirm orders at; --yes confirms all orders: use it only where "
                   "no person can be injured");
  if (plan.tunnels.empty()) refuse(Reason::bad_value, "\"tunnels\" is empty");
  if (plan.calibrator != phantom::udcsc().name && !fs::exists(plan.folder / plan.calibrator))
    refuse(Reason::missing_file,
           fmt::format("\"calibrator\": {}: no such file", (plan.folder / plan.calibrator).string()));
  if (plan.plate && *plan.plate != phantom::plate48().name && !fs::exists(plan.folder / *plan.plate))
    refuse(Reason::missing_file,
           fmt::format("\"plate\": {}: no such file", (plan.folder / *plan.plate).string()));
  if (!arguments.picks.empty()) return;
  for (const operation::OperationTunnel& tunnel : plan.tunnels)
    for (const std::string& end : {tunnel.start, tunnel.end})
      if (!tunnel.of_model && std::ranges::find(plan.picks, end, &pipeline::Pick::name) == plan.picks.end())
        refuse(Reason::bad_value, fmt::format("tunnel \"{}\": \"{}\" is not a pick", tunnel.name, end));
}

/// Markers of the plan that the tracker does not report now; one facet suffices.
std::string not_seen(const operation::OperationPlan& plan, const tracker::PoseBoard& board) {
  const auto seen = [&](const std::string& tool) {
    return board.latest(tool, tracker::monotonic_seconds()).has_value();
  };
  std::string missing;
  for (const auto& [bone, marker] : plan.tracker.markers)
    if (!seen(marker)) missing += " " + marker;
  if (!seen(plan.tracker.tool)) missing += " " + plan.tracker.tool;
  if (std::ranges::none_of(plan.tracker.facets,
                           [&](const tracker::Facet& facet) { return seen(facet.name); }))
    missing += " calibrator";
  return missing;
}

/// Waits for tracker and robot, if any, and prints what is missing.
void wait_for_devices(const operation::OperationPlan& plan, operation::Connections& devices,
                      const Ending& ending, Console& console) {
  std::string last_printed;
  ending.wait_until([&] {
    std::string wants;
    if (const std::string missing = not_seen(plan, devices.board()); !missing.empty())
      wants =
          fmt::format("tracker {} port {}: not visible:{}", plan.tracker.address, plan.tracker.port, missing);
    else if (plan.drill)
      wants.clear();
    else if (const auto state = devices.robot().wait_connected({}); !state)
      wants = fmt::format("robot {}: {}", plan.robot.address, state.error().message);
    else if (const auto why = robot::why_stopped(*state))
      wants = fmt::format("robot {}: {}", plan.robot.address, why->message);
    if (!wants.empty() && wants != last_printed && !console.quiet)
      console.progress << "waiting: " << without_control_characters(wants) << std::endl;
    last_printed = wants;
    return wants.empty();
  });
  // The pose window of an acquisition is the 1.5 s before an image's arrival.
  const auto full = std::chrono::steady_clock::now() + std::chrono::milliseconds(1600);
  ending.wait_until([&] { return std::chrono::steady_clock::now() > full; });
}

std::vector<pipeline::Pick> picks_in(const fs::path& file, const operation::OperationPlan& plan) {
  const Json json = value_or_throw(read_json(file));
  JsonReader reader(json, file.string());
  return value_or_throw(operation::picks_of(plan, reader.raw("picks"), file.string()));
}

void print_points(const pipeline::Result& result, Console& console) {
  if (console.json) {
    console.out << Json{{"points", pipeline::to_json(result).at("points")}}.dump() << std::endl;
    return;
  }
  for (const pipeline::PointResult& point : result.points)
    if (point.place) {
      const Eigen::Vector3d& at = point.place->in_calibrator;
      console.out << fmt::format("  {:<8} {:9.3f} {:9.3f} {:9.3f}  +- {:.3f} mm\n", point.name, at.x(),
                                 at.y(), at.z(), std::sqrt(point.place->covariance_in_calibrator.trace()));
    }
}

/// Prints the robot's moves for hand-eye calibration, relative to its present pose.
void print_tour(const std::vector<robot::RobotOrder>& orders, Console& console) {
  if (console.quiet || orders.empty()) return;
  const geometry::RigidTransform home = orders.back().waypoints.back().base_from_tcp;  // where it stands now
  console.progress << fmt::format(
      "hand-eye calibration: {} moves at {:g} mm/s about the tool's current pose\n", orders.size(),
      orders.front().waypoints.back().speed_mm_s);
  for (std::size_t i = 0; i < orders.size(); ++i) {
    const geometry::RigidTransform there = orders[i].waypoints.back().base_from_tcp;
    const Eigen::Vector3d shift = there.translation - home.translation;
    const double turn_rad = Eigen::AngleAxisd(home.rotation.transpose() * there.rotation).angle();
    console.progress << fmt::format(
        "  {}: tip {:+.0f} {:+.0f} {:+.0f} mm along the axes of the robot's base, rotated by {:.0f} "
        "degrees\n",
        i + 1, shift.x(), shift.y(), shift.z(), turn_rad * 180 / std::numbers::pi);
  }
  console.progress << std::flush;
}

void print_outcome(const operation::TunnelOutcome& outcome, Console& console) {
  console.out << fmt::format(
      "{}: distance from the tool's axis: start {:.2f} mm (predicted {:.2f}), end {:.2f} mm (predicted "
      "{:.2f}), after {} corrections{}\n",
      outcome.tunnel, outcome.start.distance_mm(), outcome.start.predicted_mm(), outcome.end.distance_mm(),
      outcome.end.predicted_mm(), outcome.loop.empty() ? 0 : outcome.loop.size() - 1,
      outcome.replans == 0 ? "" : fmt::format(", planned again {} times", outcome.replans));
}

bool is_near(const robot::RobotLink& robot, const robot::RobotState& rest) {
  constexpr double near_mm = 1;
  const auto state = robot.status().state;
  return state && (state->base_from_tcp.translation - rest.base_from_tcp.translation).norm() <= near_mm;
}

/// To a tunnel and back to where the tool was. After a stop (`Operation::plan_again`) the person at the
/// terminal may unlock the robot, bring the tool back and have the tunnel planned again.
void go_to(const operation::OperationTunnel& tunnel, operation::Operation& operation, robot::RobotLink& robot,
           const fs::path& out, Consent& consent, LineInput& input, const Ending& ending, Console& console) {
  const robot::RobotState rest = value_or_throw(robot.wait_connected(std::chrono::seconds(5)));
  std::optional<robot::RobotOrder> begun;  // the tool is on its way by this order, or there
  bool reached = false;
  const auto withdraw = [&] {
    value_or_throw(operation.withdraw(*begun, rest, [&](const robot::RobotOrder& order) {
      return consent(order, [&] { return operation.recorded(); });
    }));
    begun.reset();
  };
  const auto approach = [&] {
    for (const std::string& name : operation.checks_to_come(tunnel.bone))
      touch_point(operation, name, input, ending, console);
    const robot::RobotOrder order = value_or_throw(operation.plan_order(tunnel.name));
    console.progress << fmt::format("preview: {}\n", (out / ("preview-" + tunnel.name + "-*.png")).string())
                     << std::flush;
    const std::string token = value_or_throw(consent(order, [&] { return operation.check_plan(order); }));
    begun = order;
    print_outcome(value_or_throw(operation.go(order, token)), console);
    reached = true;
  };
  while (!reached || begun) {
    const auto done = guarded([&] { begun ? withdraw() : approach(); });
    if (done) continue;
    value_or_throw(operation.plan_again(tunnel.name, done.error(), consent.again()));
    if (begun && is_near(robot, rest)) begun.reset();
  }
}

std::unique_ptr<operation::Operation> begin(const operation::OperationPlan& plan, const fs::path& folder,
                                            operation::Connections& devices, Console& console) {
  const auto notify = [&console](operation::Step step, const std::string& what) {
    if (!console.quiet)
      console.progress << fmt::format("{}: {}\n", operation::name_of(step), without_control_characters(what))
                       << std::flush;
  };
  return value_or_throw(
      plan.drill ? operation::Operation::begin_freehand(plan, folder, devices.board(), notify)
                 : operation::Operation::begin(plan, folder, devices.board(), devices.robot(), notify));
}

/// Each view of the plan; an image that is refused must be acquired again.
void take_images(operation::Operation& operation, operation::Connections& devices, const Ending& ending,
                 Console& console) {
  while (!operation.views_to_come().empty()) {
    const std::string view = operation.views_to_come().front();
    if (!console.quiet)
      console.progress << fmt::format("waiting for {} at port {}\n", view, devices.receiver_port())
                       << std::flush;
    std::optional<operation::DatedArrival> image;
    ending.wait_until([&] { return (image = devices.next_image(0)).has_value(); });
    const auto taken = operation.take(view, image->arrival, image->time_s);
    if (!taken && taken.error().reason == Reason::record_lost) throw BadInput(taken.error());
    if (!taken)
      console.progress << fmt::format("{}: {}: {}; acquire this view again\n", view,
                                      code(taken.error().reason),
                                      without_control_characters(taken.error().message))
                       << std::flush;
  }
}

/// Registers the plan's models. A person compares the outlines with the bones before they guide anything.
void register_models(const NavigateArguments& arguments, operation::Operation& operation, LineInput& input,
                     const Ending& ending, Console& console) {
  const auto registered = operation.register_models();
  if (operation.registration()) {
    for (const auto& model : operation.registration()->models)
      print_warnings(model.registration.warnings, console);
    if (console.json)
      console.out
          << Json{{"models", case_registration::to_json(*operation.registration()).at("models")}}.dump()
          << std::endl;
    else if (!console.quiet)
      console.out << summary_of(*operation.registration()) << std::flush;
  }
  value_or_throw(registered);
  if (!arguments.yes) {
    const std::string report =
        without_control_characters((arguments.out / "case-1/registration/report.html").string());
    input.discard();
    console.progress
        << fmt::format(
               "Compare the outlines with the bones in every view: {}\nType \"yes\" if they follow "
               "the bones everywhere:\n",
               report)
        << std::flush;
    std::optional<std::string> answer;
    ending.wait_until([&] {
      value_or_throw(operation.recorded());
      return (answer = input.next(0)).has_value();
    });
    if (*answer != "yes")
      throw BadInput(
          Reason::registration_not_confirmed,
          "the registration of the plan's models was not confirmed: correct the start or the models, "
          "and begin a new operation");
  }
  value_or_throw(operation.confirm_registration());
}

/// Registers the robot and moves its tool to each tunnel.
void drive_robot(const operation::OperationPlan& plan, const NavigateArguments& arguments,
                 operation::Operation& operation, robot::RobotLink& robot, LineInput& input,
                 const Ending& ending, Console& console) {
  Consent consent(robot, ending, arguments.yes, console);
  const auto until = std::chrono::steady_clock::now() + connect_patience;
  ending.wait_until([&] { return robot.wait_connected({}) || std::chrono::steady_clock::now() > until; });
  consent.unlock();
  print_tour(value_or_throw(operation.preview_tour()), console);
  value_or_throw(operation.register_robot(
      [&](const robot::RobotOrder& order) { return consent(order, [&] { return operation.recorded(); }); },
      consent.again()));
  for (const operation::OperationTunnel& tunnel : plan.tunnels)
    go_to(tunnel, operation, robot, arguments.out, consent, input, ending, console);
}

/// From the first image to the last tunnel.
void carry_out(const operation::OperationPlan& plan, const NavigateArguments& arguments,
               operation::Operation& operation, operation::Connections& devices, StopSignal& stop,
               Console& console) {
  const Ending ending(stop, plan.drill ? nullptr : &devices.robot(), operation);
  operation.confirmed_by(arguments.yes ? "--yes" : "the person at the terminal");
  wait_for_devices(plan, devices, ending, console);
  LineInput input(STDIN_FILENO);
  for (const operation::PlannedCheck& each : plan.check_points)
    touch_point(operation, each.name, input, ending, console);
  take_images(operation, devices, ending, console);
  if (!arguments.picks.empty()) {
    ending.wait_until([&] { return fs::exists(arguments.picks); });
    operation.pick(picks_in(arguments.picks, plan));
  }
  value_or_throw(operation.measure());
  print_points(operation.result(), console);
  if (!plan.models.empty()) register_models(arguments, operation, input, ending, console);
  if (plan.drill)
    for (const operation::OperationTunnel& tunnel : plan.tunnels)
      guide_by_hand(tunnel, operation, input, ending, console);
  else
    drive_robot(plan, arguments, operation, devices.robot(), input, ending, console);
}

/// What the command line states instead of the plan.
void put_options(const NavigateArguments& arguments, operation::OperationPlan& plan) {
  for (const auto& [field, number] : arguments.overrides) field->set(plan, number);
  if (arguments.history)
    plan.measuring.run.history = value_or_throw(calibration::read_history(*arguments.history));
}

/// What was measured, and the tunnels that were reached.
void write_dicom_of(const operation::Operation& operation, const fs::path& folder, Console& console) {
  write_dicom_files(*operation.measured_case(), value_or_throw(operation.measurement()), folder,
                    folder / "registration", console);
}

}  // namespace

/// A whole operation from a plan: images, measurement, robot or hand-held drill, verification.
CommandResult navigate_command(const NavigateArguments& arguments, Console& console) {
  return guarded([&] {
    operation::OperationPlan plan = value_or_throw(
        operation::plan_from(value_or_throw(read_json(arguments.plan)), arguments.plan.string()));
    put_options(arguments, plan);
    plan.measuring.run.threads = console.threads;
    check_before_images(plan, arguments);
    StopSignal stop;
    value_or_throw(make_private_folder(arguments.out));
    operation::Connections devices(plan, value_or_throw(receiver::Inbox::open(arguments.out / "inbox")));
    value_or_throw(devices.listen(arguments.receiver));
    const auto operation = begin(plan, arguments.out, devices, console);
    const auto done = guarded([&] { carry_out(plan, arguments, *operation, devices, stop, console); });
    const auto recorded = operation->finish(done ? std::nullopt : std::optional(done.error()));
    Expected<void> written;
    if (arguments.dicom && operation->measured_case())
      written = guarded([&] { write_dicom_of(*operation, arguments.out, console); });
    value_or_throw(done);
    value_or_throw(recorded);
    value_or_throw(written);
  });
}

void add_navigate(CLI::App& app, Action& action) {
  auto* command = add_command(
      app, group::operation, "navigate",
      "Carry out an operation by a plan: X-ray images, measurement, robot or drill held by hand, "
      "verification",
      "helicarm virtual-or --plan plan.json        (in one terminal; --freehand: without a robot)\n"
      "  helicarm navigate plan.json --out session   (in another; then: shoot AP, shoot LAT)\n"
      "  helicarm navigate plan.json --json          (freehand: a line of JSON ten times a second)");
  auto& a = arguments_of(command, action, navigate_command);
  command->add_option("PLAN", a.plan, "plan.json (docs/formats.md)")->required();
  command->add_option("--out", a.out, "Folder of the session: images, cases, record")->capture_default_str();
  command->add_option(
      "--picks", a.picks,
      "JSON file with \"picks\" as in case.json; it may be written after the images have arrived");
  command->add_option("--address", a.receiver.address, "Address to listen on for images")
      ->capture_default_str();
  add_overrides(command, a.overrides, "the plan", operation::plan_fields);
  command->add_option("--machine", a.history, "The C-arm's history (JSON), read only");
  add_dicom_option(command, a.dicom);
  add_fields(command, a.receiver, receiver::receiver_fields);
  command->add_option("--title", a.receiver.negotiation.title, "Application entity title of this receiver")
      ->capture_default_str();
  command->add_flag("--yes", a.yes,
                    "Confirm every order automatically; use it only where no person can be injured");
}

}  // namespace helicarm::cli
