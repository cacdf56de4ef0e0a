// SPDX-License-Identifier: Apache-2.0
#include "command_line.h"
#include "helicarm/devices/receiver/receiver_fields.h"
#include "helicarm/operation/plan_fields.h"
#include "helicarm/virtual_devices/virtual_devices_fields.h"
#include "mount_command.h"
#include "navigate_command.h"
#include "operate_command.h"
#include "receive_command.h"
#include "replay_command.h"
#include "robot_command.h"
#include "tracker_command.h"
#include "virtual_or_command.h"

namespace helicarm::cli {
namespace {

CLI::Option* add_port(CLI::App* command, const char* name, std::uint16_t& port, const char* what) {
  return command->add_option(name, port, what)->check(within(0, 65535))->capture_default_str();
}

void add_receive(CLI::App& app, Action& action) {
  auto* command = add_command(app, group::operation, "receive",
                              "Receive X-ray images from a C-arm by DICOM (C-STORE) or from a folder",
                              "helicarm receive --out inbox\n"
                              "  helicarm receive --out inbox --address 192.168.7.2 --peer C_ARM\n"
                              "  helicarm receive --out inbox --watch /mnt/c-arm");
  auto& a = arguments_of(command, action, receive_command);
  command->add_option("--out", a.out, "Folder for the images; one program at a time")->capture_default_str();
  auto* address = command
                      ->add_option("--address", a.receiver.address,
                                   "Address to listen on; other than 127.0.0.1 opens the port to the network")
                      ->capture_default_str();
  add_fields(command, a.receiver, receiver::receiver_fields);
  auto* port = command->get_option("--port");
  auto* title =
      command
          ->add_option("--title", a.receiver.negotiation.title, "Application entity title of this receiver")
          ->capture_default_str();
  auto* peer = command->add_option("--peer", a.receiver.negotiation.peers,
                                   "Title of a C-arm that may send; repeatable (default: any)");
  auto* commitment =
      command->add_option("--commitment", a.report_peers,
                          "TITLE=ADDRESS:PORT: where this C-arm or archive listens for storage commitment "
                          "reports; repeatable (default: on its own association)");
  auto* certificate =
      command->add_option("--tls-certificate", a.certificate,
                          "PEM file of this receiver's certificate; only TLS connections are then accepted");
  auto* key = command->add_option("--tls-key", a.key, "PEM file of the certificate's private key");
  auto* authorities = command->add_option("--tls-authorities", a.authorities,
                                          "PEM file of the authorities that sign the C-arms' certificates");
  certificate->needs(key, authorities);
  key->needs(certificate);
  authorities->needs(certificate);
  auto* watch =
      command->add_option("--watch", a.watch, "Read images from this folder instead; its files are kept");
  for (auto* of_network : {address, port, title, peer, commitment, certificate}) watch->excludes(of_network);
  command->add_option("--count", a.count, "End after this number of images")->check(within(1, 1e9));
  command->add_option("--seconds", a.seconds, "End after this time")->check(within(0, 1e9));
}

void add_tracker_link(CLI::App* command, TrackerLinkArguments& a) {
  command->add_option("PEER", a.peer, "address:port of an OpenIGTLink server, or file:PATH of a recording")
      ->required();
  command->add_option("--seconds", a.seconds, "End after this time, s; default: when interrupted")
      ->check(within(0, 1e6));
  command->add_option("--rate", a.tracker.rate_hz, "Rate to request, Hz; default: 60")
      ->check(within(1, 1000));
  command->add_flag("--ask,!--no-ask", a.tracker.ask_for_tracking,
                    "Request tracking (STT_TDATA), which some servers require (default)");
}

void add_calibrate_mount(CLI::App* tracker, Action& action) {
  auto* command = tracker->add_subcommand(
      "calibrate-mount", "Find the pose of your marker in the calibrator by touching its balls or divots");
  auto& a = arguments_of(command, action, calibrate_mount_command);
  command->add_option("PEER", a.link.peer, "address:port of an OpenIGTLink server, for --touch");
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
  command->add_option("--calibrator", a.calibrator, "A built-in or a file")->capture_default_str();
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

void add_tracker(CLI::App& app, Action& action) {
  auto* tracker = add_command(
      app, group::operation, "tracker",
      "Watch, record or play a tracker (OpenIGTLink); calibrate pointer and mount",
      "helicarm tracker watch 127.0.0.1:18944\n"
      "  helicarm tracker record 127.0.0.1:18944 poses.mha --seconds 20\n"
      "  helicarm tracker replay poses.mha --port 18944\n"
      "  helicarm tracker pivot poses.mha --tool PointerToTracker\n"
      "  helicarm tracker calibrate-mount 127.0.0.1:18944 --facet calibrator --tip tip.json --touch "
      "P1,P1,P1,P4,P4,P4,P8,P8,P8,P11,P11,P11");
  tracker->require_subcommand(1);
  auto* watch = tracker->add_subcommand("watch", "Print the received poses of each tool");
  add_tracker_link(watch, arguments_of(watch, action, tracker_watch_command));

  auto* record = tracker->add_subcommand("record", "Record into a MetaImage sequence file");
  auto& recorded = arguments_of(record, action, tracker_record_command);
  add_tracker_link(record, recorded);
  record->add_option("FILE", recorded.file, "The file to write")->required();

  auto* replay = tracker->add_subcommand("replay", "Play a MetaImage sequence file as a tracker, repeatedly");
  auto& replayed = arguments_of(replay, action, tracker_replay_command);
  replay->add_option("FILE", replayed.file, "The file to play")->required();
  add_port(replay, "--port", replayed.options.port, "Port to listen on; 0: any free port");
  replay
      ->add_option("--address", replayed.options.address,
                   "Address to listen on; every host that reaches it may connect")
      ->capture_default_str();
  replay->add_option("--seconds", replayed.seconds, "End after this time, s; default: when interrupted")
      ->check(within(0, 1e6));
  replay->add_flag("--tdata", replayed.as_tracking, "Send TDATA on request instead of TRANSFORM to all");

  auto* pivot = tracker->add_subcommand(
      "pivot", "Calibrate a pointer's tip from a recording of rotations about the tip");
  auto& turned = arguments_of(pivot, action, tracker_pivot_command);
  pivot->add_option("FILE", turned.file, "A MetaImage sequence file")->required();
  pivot->add_option("--tool", turned.tool, "The pointer's name in the file")->required();
  add_calibrate_mount(tracker, action);
}

void add_robot(CLI::App& app, Action& action) {
  auto* robot =
      add_command(app, group::operation, "robot", "Watch a robot's state (RTDE); nothing is written to it",
                  "helicarm robot watch 192.168.7.5\n"
                  "  helicarm robot watch --seconds 2 --json");
  robot->require_subcommand(1);
  auto* watch = robot->add_subcommand("watch", "Print the robot's modes, pose and whether it may move");
  auto& a = arguments_of(watch, action, robot_watch_command);
  watch->add_option("ADDRESS", a.robot.address, "Numeric address of the robot")->capture_default_str();
  add_port(watch, "--port", a.robot.rtde_port, "Port of RTDE");
  watch->add_option("--rate", a.robot.rate_hz, "Requested states per second")
      ->check(within(1, 500))
      ->capture_default_str();
  watch->add_option("--seconds", a.seconds, "End after this time, s; default: when interrupted")
      ->check(within(0, 1e6));
}

void add_virtual_or(CLI::App& app, Action& action) {
  auto* command =
      add_command(app, group::operation, "virtual-or",
                  "Virtual C-arm, tracker and robot on the protocols of the real ones",
                  "helicarm virtual-or --plan plan.json\n"
                  "  (then type: shoot AP, shoot LAT, fault hide:femur on, fault cut_cable on, where, quit)");
  auto& a = arguments_of(command, action, virtual_or_command);
  command->add_option("--plan", a.plan, "Write a plan for navigate, with simulated picks");
  command->add_flag("--check-points", a.check_points, "The plan requires a check point on each bone");
  command->add_flag(
      "--freehand", a.virtual_or.freehand,
      "A person holds the drill; there is no robot, and the plan is one for freehand navigation");
  add_fields(command, a.virtual_or, virtual_devices::virtual_devices_fields);
  add_port(command, "--tracker-port", a.virtual_or.tracker_port,
           "Port of the tracker (OpenIGTLink); 0: a free port, as for the ports below");
  add_port(command, "--rtde-port", a.virtual_or.rtde_port, "of the robot");
  add_port(command, "--dashboard-port", a.virtual_or.dashboard_port, "of the robot");
  add_port(command, "--script-port", a.virtual_or.script_port, "of the robot");
  a.virtual_or.primary_port = 30001;
  add_port(command, "--primary-port", a.virtual_or.primary_port, "of the robot");
  add_port(command, "--receiver-port", a.receiver.port, "Port to which the C-arm sends its images");
  command->add_option("--receiver-title", a.receiver.title, "Application entity title of the receiver")
      ->capture_default_str();
  command->add_option("--seconds", a.seconds, "End after this time")->check(within(0, 1e9));
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
  constexpr auto& age = field_named<operation::OperationPlan>(operation::plan_fields, "plan_stale_s");
  command
      ->add_option("--plan-age", a.plan_age_s,
                   "Age in s at which an unconfirmed plan expires; overrides the plan's plan_stale_s")
      ->check(within(age.range.low, age.range.high));
  add_fields(command, a.receiver, receiver::receiver_fields);
  command->add_option("--title", a.receiver.negotiation.title, "Application entity title of this receiver")
      ->capture_default_str();
  command->add_flag("--yes", a.yes,
                    "Confirm every order automatically; use it only where no person can be injured");
}

void add_operate(CLI::App& app, Action& action) {
  auto* command =
      add_command(app, group::operation, "operate", "Table 2's experiment with virtual devices, end to end",
                  "helicarm operate --cases 4 --out operate");
  auto& a = arguments_of(command, action, operate_command);
  command->add_option("--cases", a.cases, "Number of simulated pairs of bones, with four points each")
      ->check(within(1, 1000))
      ->capture_default_str();
  command->add_option("--out", a.out, "Folder for operate.csv, operate.json and the sessions")
      ->capture_default_str();
  command->add_option("--size", a.size, "Pixels per side: 512 or 1024")->capture_default_str();
  command->add_option("--rate", a.rate_hz, "Rate of the tracker, Hz")
      ->check(within(5, 1000))
      ->capture_default_str();
}

void add_replay(CLI::App& app, Action& action) {
  auto* command = add_command(app, group::operation, "replay",
                              "Recompute an operation from its record and compare bit for bit",
                              "helicarm replay operate/case-1");
  auto& a = arguments_of(command, action, replay_command);
  command->add_option("SESSION", a.session, "Folder that holds session.log")->required();
}

}  // namespace

void add_device_commands(CLI::App& app, Action& action) {
  add_receive(app, action);
  add_tracker(app, action);
  add_robot(app, action);
  add_virtual_or(app, action);
  add_navigate(app, action);
  add_operate(app, action);
  add_replay(app, action);
}

}  // namespace helicarm::cli
