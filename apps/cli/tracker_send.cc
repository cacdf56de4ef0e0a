// SPDX-License-Identifier: Apache-2.0
#include "tracker_send.h"

#include <limits>

#include <fmt/format.h>

#include "command_line.h"
#include "helicarm/core/json.h"
#include "helicarm/devices/tracker/pose_board.h"
#include "helicarm/operation/view_messages.h"
#include "stop_signal.h"

namespace helicarm::cli {
namespace {

/// Sends until the time is over or the user interrupts.
void send_repeatedly(tracker::IgtlServer& server, std::vector<tracker::IgtlMessage> messages,
                     const TrackerSendArguments& arguments, StopSignal& interrupt) {
  constexpr double look_again_s = 0.2;
  constexpr double never = std::numeric_limits<double>::infinity();
  const double until = arguments.seconds ? tracker::monotonic_seconds() + *arguments.seconds : never;
  std::uint64_t connections = 0;
  double due = 0;
  while (true) {
    const double now = tracker::monotonic_seconds();
    const auto& counters = server.status().counters;
    const auto counted = counters.find("connections");
    const std::uint64_t seen = counted == counters.end() ? 0 : counted->second;
    if (seen > connections || now >= due) {
      connections = seen;
      due = now + arguments.interval_s;
      for (tracker::IgtlMessage& message : messages) {
        message.stamp = tracker::stamp_from_seconds(double(std::time(nullptr)));
        server.send(message);
      }
    }
    if (now >= until || interrupt.wait(std::min(look_again_s, until - now))) return;
  }
}

}  // namespace

CommandResult tracker_send_command(const TrackerSendArguments& arguments, Console& console) {
  return guarded([&] {
    StopSignal interrupt;  // before the measurement's threads
    const case_registration::Measurement measured = value_or_throw(measured_case(arguments.run, console));
    const auto messages = value_or_throw(operation::messages_of_views(measured.result));
    const auto server = value_or_throw(tracker::IgtlServer::start(arguments.options));
    if (!console.quiet)
      console.progress << fmt::format("{} images and cameras at {} port {}\n", messages.size() / 2,
                                      arguments.options.address, server->port())
                       << std::flush;
    send_repeatedly(*server, messages, arguments, interrupt);
    const tracker::IgtlServerStatus status = server->status();
    if (console.json)
      console.out << to_text({{"clients", status.clients}, {"counters", status.counters}}) << '\n';
  });
}

void add_tracker_send(CLI::App* tracker, Action& action) {
  auto* send = tracker->add_subcommand("send",
                                       "Measure a case and send its rectified images (IMAGE) and cameras "
                                       "(TRANSFORM) to clients such as 3D Slicer");
  auto& a = arguments_of(send, action, tracker_send_command);
  send->add_option("CASE", a.run.folder, "Folder that holds case.json")->required();
  add_port(send, "--port", a.options.port, "Port to listen on; 0: any free port");
  send->add_option("--address", a.options.address,
                   "Address to listen on; every host that reaches it may connect and gets the images")
      ->capture_default_str();
  send->add_option("--seconds", a.seconds, "End after this time, s; default: when interrupted")
      ->check(within(0, 1e6));
  send->add_option("--interval", a.interval_s, "Send again after this time, s")
      ->check(within(0.1, 1e6))
      ->capture_default_str();
  add_run_options(send, a.run, "The C-arm's history (JSON), read only");
}

}  // namespace helicarm::cli
