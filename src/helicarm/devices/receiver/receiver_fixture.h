// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <filesystem>
#include <mutex>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "helicarm/core/temporary_folder.h"
#include "helicarm/devices/receiver/peer.h"
#include "helicarm/devices/receiver/receiver.h"

namespace helicarm::receiver {

/// For tests: PDU types of a receiver's answers.
inline constexpr int accepted = 2, rejected = 3, data = 4, released = 6, aborted = 7, closed = 0;

/// For tests: a receiver on a free port with its own inbox.
class ReceiverAtWork : public testing::Test {
 protected:
  void SetUp() override {
    inbox_ = Inbox::open(folder_).value();
    options_.port = 0;
    open();
  }
  void TearDown() override { receiver_.reset(); }
  void open() {
    receiver_.reset();
    ReceiverHooks hooks;
    hooks.refused = [this](const Failure& why) { note(why); };
    hooks.cut = [this](const Failure& why) { note(why); };
    receiver_ = DicomReceiver::open(options_, *inbox_, std::move(hooks)).value();
  }

  RawClient client() const { return RawClient(receiver_->port()); }
  RawClient associated() const {
    RawClient client(receiver_->port());
    client.send(peer::Request().bytes());
    EXPECT_EQ(client.receive_type(), accepted);
    return client;
  }
  /// PDU type of the receiver's answer to these bytes.
  int answer_to(const std::string& bytes) const {
    RawClient client(receiver_->port());
    client.send(bytes);
    return client.receive_type();
  }
  int answer_in_association(const std::string& bytes) const {
    RawClient client = associated();
    client.send(bytes);
    return client.receive_type();
  }
  void expect_alive() const {
    RawClient client = associated();
    client.send(peer::echo());
    EXPECT_EQ(client.receive_status(), 0);
  }

  /// Messages of refused and incomplete images, as logged.
  std::vector<Failure> lines() const {
    const std::lock_guard lock(mutex_);
    return lines_;
  }
  /// Waits for the first message that contains `words`; empty if none comes within 30 s.
  Failure line_with(const std::string& words) const {
    for (int i = 0; i < 3000; ++i) {
      for (const Failure& line : lines())
        if (line.message.find(words) != std::string::npos) return line;
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    return {Reason::usage, ""};
  }
  template <class Condition>
  static bool eventually(Condition condition) {
    for (int i = 0; i < 3000 && !condition(); ++i) std::this_thread::sleep_for(std::chrono::milliseconds(10));
    return condition();
  }

  TemporaryFolder temporary_;
  std::filesystem::path folder_ = temporary_.path();
  std::unique_ptr<Inbox> inbox_;
  ReceiverOptions options_;
  std::unique_ptr<DicomReceiver> receiver_;

 private:
  void note(const Failure& why) {
    const std::lock_guard lock(mutex_);
    lines_.push_back(why);
  }
  mutable std::mutex mutex_;
  std::vector<Failure> lines_;
};

}  // namespace helicarm::receiver
