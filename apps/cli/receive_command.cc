// SPDX-License-Identifier: Apache-2.0
#include <chrono>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "command_line.h"
#include "helicarm/core/json.h"
#include "helicarm/core/text.h"
#include "helicarm/devices/receiver/image_registry.h"
#include "helicarm/devices/receiver/receiver.h"
#include "helicarm/devices/receiver/receiver_fields.h"
#include "helicarm/pipeline/result.h"
#include "stop_signal.h"

namespace helicarm::cli {

struct ReceiveArguments {
  std::filesystem::path out = "inbox";
  receiver::ReceiverOptions receiver;
  std::vector<std::string> report_peers;                ///< TITLE=ADDRESS:PORT
  std::filesystem::path certificate, key, authorities;  ///< all or none
  std::filesystem::path watch;                          ///< empty: listen
  std::optional<std::uint64_t> count;
  std::optional<double> seconds;
};

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

  /// Whether `count` images have arrived.
  bool is_complete() {
    const std::lock_guard lock(mutex_);
    return left_ == 0;
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
    if (left_ && *left_ > 0 && --*left_ == 0) stop_.raise();
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

/// Prints one line (or one line of JSON) for each image until stopped.
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
    const bool is_stopped = stop.wait(arguments.seconds);
    constexpr std::chrono::seconds to_release{5};  // an association whose last image was counted
    if (is_stopped && tale.is_complete()) source->await_idle(to_release);
  });
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

}  // namespace helicarm::cli
