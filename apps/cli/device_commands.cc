// SPDX-License-Identifier: Apache-2.0
#include "command_line.h"
#include "receive_command.h"
#include "tracker_command.h"

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

void add_tracker(CLI::App& app, Action& action) {
  auto* tracker =
      add_command(app, "tracker", "Watch, record or play a tracker (OpenIGTLink); calibrate a pointer",
                  "helicarm tracker watch 127.0.0.1:18944\n"
                  "  helicarm tracker record 127.0.0.1:18944 poses.mha --seconds 20\n"
                  "  helicarm tracker replay poses.mha --port 18944\n"
                  "  helicarm tracker pivot poses.mha --tool PointerToTracker");
  tracker->require_subcommand(1);
  auto* watch = tracker->add_subcommand("watch", "What comes, tool by tool");
  add_tracker_link(watch, arguments_of(watch, action, tracker_watch_command));

  auto* record = tracker->add_subcommand("record", "Into a MetaImage sequence file");
  auto& recorded = arguments_of(record, action, tracker_record_command);
  add_tracker_link(record, recorded);
  record->add_option("FILE", recorded.file, "The file to write")->required();

  auto* replay = tracker->add_subcommand("replay", "A MetaImage sequence file as a tracker, over and over");
  auto& replayed = arguments_of(replay, action, tracker_replay_command);
  replay->add_option("FILE", replayed.file, "The file to play")->required();
  replay->add_option("--port", replayed.options.port, "Port to listen at; 0: any")->capture_default_str();
  replay
      ->add_option("--address", replayed.options.address,
                   "Address to listen at: whoever reaches it may connect")
      ->capture_default_str();
  replay->add_option("--seconds", replayed.seconds, "End by itself; otherwise when interrupted")
      ->check(within(0, 1e6));
  replay->add_flag("--tdata", replayed.as_tracking,
                   "Send TDATA to those who ask instead of TRANSFORM to all");

  auto* pivot = tracker->add_subcommand("pivot", "A pointer's tip from a file of it turning about its tip");
  auto& turned = arguments_of(pivot, action, tracker_pivot_command);
  pivot->add_option("FILE", turned.file, "A MetaImage sequence file")->required();
  pivot->add_option("--tool", turned.tool, "The pointer's name in the file")->required();
}

}  // namespace

void add_device_commands(CLI::App& app, Action& action) {
  add_receive(app, action);
  add_tracker(app, action);
}

}  // namespace helicarm::cli
