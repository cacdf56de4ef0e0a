// SPDX-License-Identifier: Apache-2.0
#include "command_line.h"
#include "receive_command.h"

namespace helicarm::cli {
namespace {

void add_receive(CLI::App& app, Action& action) {
  auto* command = add_command(app, "receive", "Take X-rays from a C-arm by DICOM (C-STORE), or from a folder",
                              "helicarm receive --out inbox\n"
                              "  helicarm receive --out inbox --address 192.168.7.2 --peer C_ARM\n"
                              "  helicarm receive --out inbox --watch /mnt/c-arm");
  auto& a = arguments_of(command, action, receive_command);
  command->add_option("--out", a.out, "Folder for the pictures: one program at a time")
      ->capture_default_str();
  command
      ->add_option("--address", a.receiver.address,
                   "Where to listen; other than 127.0.0.1 opens the port to the network")
      ->capture_default_str();
  command->add_option("--port", a.receiver.port, "Port; 0: any that is free")->capture_default_str();
  command->add_option("--title", a.receiver.negotiation.title, "Our application entity title")
      ->capture_default_str();
  command->add_option("--peer", a.receiver.negotiation.peers,
                      "Title of a C-arm that may send; repeatable (default: any)");
  auto* certificate = command->add_option("--tls-certificate", a.certificate, "PEM: speak TLS only, as this");
  auto* key = command->add_option("--tls-key", a.key, "PEM: key of the certificate");
  auto* authorities =
      command->add_option("--tls-authorities", a.authorities, "PEM: who signs the C-arms' certificates");
  certificate->needs(key, authorities);
  key->needs(certificate);
  authorities->needs(certificate);
  command->add_option("--watch", a.watch, "Take pictures from this folder instead; its files stay");
  command->add_option("--count", a.count, "End after so many pictures")->check(within(1, 1e9));
  command->add_option("--seconds", a.seconds, "End after this time")->check(within(0, 1e9));
}

}  // namespace

void add_device_commands(CLI::App& app, Action& action) { add_receive(app, action); }

}  // namespace helicarm::cli
