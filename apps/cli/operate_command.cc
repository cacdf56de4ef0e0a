// SPDX-License-Identifier: Apache-2.0
#include <atomic>
#include <filesystem>
#include <mutex>
#include <thread>

#include <fmt/format.h>

#include "command_line.h"
#include "helicarm/core/files.h"
#include "helicarm/core/parallel.h"
#include "helicarm/rehearsal/rehearsal_files.h"
#include "stop_signal.h"

namespace helicarm::cli {

struct OperateArguments {
  int cases = 4;  ///< pairs of bones
  int size = 1024;
  double rate_hz = 60;
  bool ct = false;       ///< planned in a CT, not picked
  bool by_hand = false;  ///< a drill in a person's hand, not a robot
  std::filesystem::path out = "operate";
};

namespace {

/// Two at a time: a small machine still serves the robots in time.
constexpr unsigned most_at_once = 2;
constexpr int most_attempts = 3;

/// Failures caused by a machine that is too busy to serve the robot in time; none of them moves the robot.
bool is_timing_failure(const Failure& failure) {
  return failure.reason == Reason::stale_state || failure.reason == Reason::stale_pose ||
         failure.reason == Reason::robot_stopped;
}

void refuse_earlier_operation(const std::filesystem::path& folder) {
  if (std::filesystem::exists(folder / "case-1"))
    throw BadInput(Reason::cannot_write,
                   fmt::format("{}: holds an earlier operation; give another folder", folder.string()));
}

}  // namespace

/// Table 2's experiment with virtual devices, end to end over sockets.
CommandResult operate_command(const OperateArguments& arguments, Console& console) {
  return guarded([&] {
    refuse_earlier_operation(arguments.out);
    StopSignal signal;
    std::atomic<bool> told{false};
    const std::jthread ear([&](const std::stop_token& over) {
      constexpr double glance_s = 0.05;
      while (!over.stop_requested() && !told) told = signal.wait(glance_s);
    });
    const auto check = [&] {
      if (told)
        throw BadInput(
            Reason::interrupted,
            fmt::format("stopped by signal; the sessions in {} are incomplete", arguments.out.string()));
    };
    std::mutex telling;
    std::vector<Expected<rehearsal::Rehearsal>> done(static_cast<std::size_t>(arguments.cases),
                                                     fail(Reason::not_connected, "not started"));
    const unsigned crew = console.threads == 0 ? most_at_once : console.threads;
    parallel_for(done.size(), crew, [&](std::size_t i) {
      rehearsal::RehearsalOptions options;
      options.image_size = arguments.size;
      options.tracker_rate_hz = arguments.rate_hz;
      options.ct_plan = arguments.ct;
      const auto say = [&](const std::string& what) {
        if (console.quiet) return;
        const std::lock_guard lock(telling);
        console.progress << fmt::format("bones {}: {}\n", i + 1, what) << std::flush;
      };
      options.notify = [&](const std::string& what) {
        check();
        say(what);
      };
      for (int attempt = 1; attempt <= most_attempts; ++attempt) {
        const std::string folder =
            attempt == 1 ? fmt::format("case-{}", i + 1) : fmt::format("case-{}-{}", i + 1, attempt);
        done[i] = guarded([&] {
          const auto carry_out = arguments.by_hand ? rehearsal::rehearse_freehand : rehearsal::rehearse;
          rehearsal::Rehearsal whole =
              value_or_throw(carry_out(console.seed + i, arguments.out / folder, options));
          whole.attempts = attempt;
          return whole;
        });
        if (done[i] || told || !is_timing_failure(done[i].error())) break;
        say(fmt::format("aborted ({}: {})", code(done[i].error().reason), done[i].error().message));
      }
    });
    check();
    std::vector<rehearsal::Rehearsal> rehearsals;
    for (Expected<rehearsal::Rehearsal>& each : done) rehearsals.push_back(value_or_throw(std::move(each)));
    Json json = rehearsal::to_json(rehearsals);
    json["plan"] = arguments.ct ? "ct" : "picks";
    json["tool"] = arguments.by_hand ? "drill" : "robot";
    value_or_throw(write_file(arguments.out / "operate.json", to_text(json)));
    value_or_throw(write_file(arguments.out / "operate.csv", rehearsal::to_csv(rehearsals)));
    if (console.json)
      console.out << to_text(json) << '\n';
    else
      console.out << rehearsal::table_of(rehearsals);
  });
}

void add_operate(CLI::App& app, Action& action) {
  auto* command = add_command(
      app, group::operation, "operate", "Table 2's experiment with virtual devices, end to end",
      "helicarm operate --cases 4 --out operate\n"
      "helicarm operate --cases 4 --ct --by-hand --out by-ct\n\n"
      "Each case is a whole operation over the real protocols: images, measurement, registration of "
      "the robot,\norders, closed loop, verification. The tool's axis is compared with the balls at "
      "the ends of the tunnels.");
  auto& a = arguments_of(command, action, operate_command);
  command->add_option("--cases", a.cases, "Number of simulated pairs of bones, with four points each")
      ->check(within(1, 1000))
      ->capture_default_str();
  command->add_option("--out", a.out, "Folder for operate.csv, operate.json and the sessions")
      ->capture_default_str();
  command->add_flag("--ct", a.ct,
                    "The tunnels are lines in a CT of the knee, which is registered, not picked points");
  command->add_flag("--by-hand", a.by_hand, "A virtual person guides a drill; without a robot");
  command->add_option("--size", a.size, "Pixels per side: 512 or 1024")->capture_default_str();
  command->add_option("--rate", a.rate_hz, "Rate of the tracker, Hz")
      ->check(within(5, 1000))
      ->capture_default_str();
}

}  // namespace helicarm::cli
