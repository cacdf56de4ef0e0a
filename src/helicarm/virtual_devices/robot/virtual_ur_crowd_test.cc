// SPDX-License-Identifier: Apache-2.0
#include <chrono>
#include <mutex>
#include <thread>

#include <asio.hpp>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include "helicarm/devices/robot/robot_scene_test.h"
#include "helicarm/devices/robot/rtde_message.h"
#include "helicarm/virtual_devices/robot/virtual_ur.h"

namespace helicarm::robot {
namespace {

using asio::ip::tcp;

/// A virtual robot, its log, and clients without protocol limits.
class VirtualUrCrowd : public testing::Test {
 protected:
  VirtualUrCrowd() {
    VirtualUrOptions options;
    options.tool = drill();
    options.joints = resting_joints();
    options.rtde_port = options.dashboard_port = options.script_port = 0;
    options.lockstep = true;
    options.on_notice = [this](const std::string& line) {
      const std::lock_guard lock(mutex_);
      notes_ += line + "\n";
    };
    robot_ = VirtualUr::start(options).value();
  }

  tcp::socket connected(std::uint16_t port) {
    tcp::socket socket(io_, tcp::v4());
    socket.set_option(asio::socket_base::receive_buffer_size(4096));
    socket.connect({asio::ip::address_v4::loopback(), port});
    return socket;
  }
  static bool is_closed(tcp::socket& socket) {
    asio::error_code error;
    char bytes[4096];
    while (!error) socket.read_some(asio::buffer(bytes), error);
    return true;
  }
  template <class Condition>
  static bool eventually(Condition condition) {
    for (int i = 0; i < 3000 && !condition(); ++i) std::this_thread::sleep_for(std::chrono::milliseconds(10));
    return condition();
  }
  bool noted(const std::string& words) {
    const std::lock_guard lock(mutex_);
    return notes_.find(words) != notes_.npos;
  }

  asio::io_context io_;
  std::mutex mutex_;
  std::string notes_;
  std::unique_ptr<VirtualUr> robot_;
};

TEST_F(VirtualUrCrowd, ClientThatDoesNotReadItsStatesIsDisconnected) {
  tcp::socket sleeper = connected(robot_->rtde_port());
  std::string fields = "actual_q";
  for (int i = 1; i < 400; ++i) fields += ",actual_q";
  asio::write(sleeper,
              asio::buffer(to_bytes({RtdeKind::outputs, std::string(8, '\0') + fields}) + request_start()));
  // 19 kB each: the socket buffers fill first.
  for (int i = 0; i < 1000 && robot_->counters().cut == 0; ++i) robot_->advance(0.04);
  EXPECT_EQ(robot_->counters().cut, 1u);
  EXPECT_TRUE(noted("does not read"));
  EXPECT_TRUE(is_closed(sleeper));
}

TEST_F(VirtualUrCrowd, ClientThatDoesNotReadItsAnswersIsDisconnected) {
  tcp::socket sleeper = connected(robot_->dashboard_port());
  sleeper.non_blocking(true);
  std::string questions;
  for (int i = 0; i < 200; ++i) questions += "PolyscopeVersion\n";
  EXPECT_TRUE(eventually([&] {
    asio::error_code full_or_closed;
    for (int i = 0; i < 100; ++i) sleeper.write_some(asio::buffer(questions), full_or_closed);
    return robot_->counters().cut == 1;
  }));
}

TEST_F(VirtualUrCrowd, OldestClientOfAFullPortIsReplaced) {
  for (const std::uint16_t port : {robot_->rtde_port(), robot_->dashboard_port(), robot_->script_port()}) {
    const std::uint64_t cut = robot_->counters().cut;
    std::vector<tcp::socket> clients;
    for (int i = 0; i < most_clients_of_port + 3; ++i) clients.push_back(connected(port));
    EXPECT_TRUE(eventually([&] { return robot_->counters().cut == cut + 3; }));
    for (int i = 0; i < 3; ++i) EXPECT_TRUE(is_closed(clients[static_cast<std::size_t>(i)]));
  }
  EXPECT_TRUE(noted("replaced by another"));
}

TEST_F(VirtualUrCrowd, CommandingClientIsNeverReplaced) {
  tcp::socket commands = connected(robot_->rtde_port());
  asio::write(commands, asio::buffer(request_inputs()));
  char answer[8];
  asio::read(commands, asio::buffer(answer, 3));
  std::vector<tcp::socket> crowd;
  for (int i = 0; i < 3 * most_clients_of_port; ++i) crowd.push_back(connected(robot_->rtde_port()));
  EXPECT_TRUE(eventually([&] { return robot_->counters().cut == 2u * most_clients_of_port + 1; }));
  tcp::socket second = connected(robot_->rtde_port());
  asio::write(second, asio::buffer(request_inputs()));
  asio::streambuf heard;
  asio::read(second, heard, asio::transfer_at_least(10));
  EXPECT_NE(std::string(asio::buffers_begin(heard.data()), asio::buffers_end(heard.data())).find("IN_USE"),
            std::string::npos);
}

TEST_F(VirtualUrCrowd, ReconnectingClientsLeaveNothing) {
  for (int i = 0; i < 40; ++i) {
    connected(robot_->rtde_port());
    connected(robot_->script_port());
  }
  EXPECT_TRUE(eventually([&] { return robot_->counters().connections == 80; }));
  EXPECT_TRUE(eventually([&] { return robot_->counters().clients == 0; }));
}

TEST_F(VirtualUrCrowd, WithoutDescriptorsItWaitsAndRecovers) {
#ifdef __SANITIZE_ADDRESS__
  GTEST_SKIP() << "the sanitizer opens a pipe to probe the memory of an object";
#endif
  tcp::socket waiting(io_, tcp::v4());
  rlimit usual;
  ::getrlimit(RLIMIT_NOFILE, &usual);
  const int lowest_free = ::dup(0);
  ::close(lowest_free);
  const rlimit none{static_cast<rlim_t>(lowest_free), usual.rlim_max};
  ::setrlimit(RLIMIT_NOFILE, &none);
  waiting.connect({asio::ip::address_v4::loopback(), robot_->dashboard_port()});
  EXPECT_TRUE(eventually([&] { return robot_->counters().accept_failures > 0; }));
  std::this_thread::sleep_for(std::chrono::milliseconds(500));
  EXPECT_LT(robot_->counters().accept_failures, 10u);  // one per 100 ms, fewer on a loaded machine
  ::setrlimit(RLIMIT_NOFILE, &usual);
  char greeting = 0;
  asio::read(waiting, asio::buffer(&greeting, 1));
  EXPECT_EQ(greeting, 'C');
}

}  // namespace
}  // namespace helicarm::robot
