// SPDX-License-Identifier: Apache-2.0
#include "receive_command.h"

#include <fmt/format.h>

#include "helicarm/core/json.h"
#include "helicarm/core/text.h"
#include "helicarm/devices/receiver/image_registry.h"
#include "helicarm/pipeline/result.h"
#include "stop_signal.h"

namespace helicarm::cli {
namespace {

/// Prints images as they arrive, from any thread.
class ReceptionLog {
 public:
  ReceptionLog(Console& console, std::optional<std::uint64_t> count, StopSignal& stop)
      : console_(console), left_(count), stop_(stop) {}

  receiver::ReceiverHooks hooks() {
    return {[this](const receiver::Arrival& arrival) { notify(arrival); },
            [this](const Failure& why) { notify("refused", why); },
            [this](const Failure& why) { notify("interrupted", why); }};
  }

 private:
  void notify(const receiver::Arrival& arrival) {
    const std::lock_guard lock(mutex_);
    if (console_.json) {
      Json warnings = Json::array();
      for (const Warning& warning : arrival.warnings) warnings.push_back(pipeline::to_json(warning));
      console_.out << Json{{"file", arrival.path.string()},
                           {"digest", arrival.digest},
                           {"repeated", arrival.repeated},
                           {"warnings", std::move(warnings)}}
                          .dump()
                   << std::endl;
    } else {
      console_.out << arrival.path.string() << (arrival.repeated ? " (again)" : "") << std::endl;
      for (const Warning& warning : arrival.warnings)
        console_.progress << code(warning.reason) << ": " << warning.message << std::endl;
    }
    if (left_ && --*left_ == 0) stop_.raise();
  }
  void notify(const char* what, const Failure& failure) {
    const std::lock_guard lock(mutex_);
    console_.progress << fmt::format("{}: {}: {}\n", what, code(failure.reason),
                                     without_control_characters(failure.message))
                      << std::flush;
  }

  Console& console_;
  std::optional<std::uint64_t> left_;
  StopSignal& stop_;
  std::mutex mutex_;
};

void check_titles(const receiver::dicom::NegotiationOptions& options) {
  const auto check = [](const char* option, const std::string& title) {
    if (!receiver::dicom::is_title(title))
      throw BadInput(Reason::usage, fmt::format("{}: \"{}\" is not a valid title: it must have 1 to 16 "
                                                "printable characters without a backslash",
                                                option, without_control_characters(title)));
  };
  check("--title", options.title);
  for (const std::string& peer : options.peers) check("--peer", peer);
}

}  // namespace

CommandResult receive_command(const ReceiveArguments& arguments, Console& console) {
  return guarded([&] {
    receiver::ReceiverOptions options = arguments.receiver;
    check_titles(options.negotiation);
    for (const std::string& peer : arguments.report_peers)
      options.report_peers.push_back(value_or_throw(receiver::read_report_peer(peer)));
    if (!arguments.certificate.empty())
      options.tls = receiver::TlsFiles{arguments.certificate, arguments.key, arguments.authorities};
    StopSignal stop;
    ReceptionLog tale(console, arguments.count, stop);
    const auto inbox = value_or_throw(receiver::Inbox::open(arguments.out));
    std::unique_ptr<receiver::ImageSource> source;
    if (arguments.watch.empty()) {
      source = value_or_throw(receiver::open_images(options, *inbox, tale.hooks()));
      if (!console.quiet)
        console.progress << fmt::format("{} listens on {} port {}{}; Ctrl-C ends\n",
                                        options.negotiation.title, options.address, source->port(),
                                        options.tls ? ", TLS" : "")
                         << std::flush;
    } else {
      if (!std::filesystem::is_directory(arguments.watch))
        throw BadInput(Reason::missing_file,
                       fmt::format("--watch: {}: no such folder", arguments.watch.string()));
      if (std::filesystem::equivalent(arguments.watch, arguments.out))
        throw BadInput(Reason::usage, "--watch and --out name the same folder; give another one");
      source = value_or_throw(receiver::open_images(
          receiver::FolderOptions{.folder = arguments.watch, .most = arguments.count}, *inbox, tale.hooks()));
    }
    stop.wait(arguments.seconds);
  });
}

}  // namespace helicarm::cli
