// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <future>
#include <list>
#include <thread>
#include <utility>
#include <vector>

#include <asio.hpp>

#include "helicarm/core/line_limit.h"
#include "helicarm/virtual_devices/robot/virtual_ur.h"
#include "helicarm/virtual_devices/robot/virtual_ur_client.h"

namespace helicarm::robot {

/// The ports of a virtual robot and the clock of its controller, on one thread. Members other than `listen`,
/// `port` and `there` are called on this thread.
class VirtualUr::Server {
 public:
  enum Port : std::size_t { rtde, dashboard, script, primary, ports };

  explicit Server(const VirtualUrOptions& options)
      : options_(options), controller_(options.controller, options.tool, options.joints) {}
  ~Server();

  Expected<void> listen();
  std::uint16_t port(Port port) const { return acceptors_[port].local_endpoint().port(); }

  /// Runs on the server's own thread and waits for it.
  template <class Work>
  auto there(Work work) {
    std::packaged_task<std::invoke_result_t<Work>()> task(std::move(work));
    auto result = task.get_future();
    asio::post(io_, [&task] { task(); });
    return result.get();
  }

  void set(RobotFault fault, bool on);
  void step();
  VirtualController& controller() { return controller_; }
  void hold_dashboard(bool on);
  VirtualTruth truth() const;
  const VirtualUrOptions& options() const { return options_; }
  VirtualUrCounters counters() const;

 private:
  using Handle = void (Server::*)(VirtualUrClient&, std::string_view);

  void accept(std::size_t port, Handle handle);
  void welcome(std::size_t port, asio::ip::tcp::socket socket, Handle handle);
  void make_room(std::size_t port);
  void note(const std::string& line);
  void read(const std::shared_ptr<VirtualUrClient>& client, Handle handle);
  void tick(std::chrono::steady_clock::time_point due);

  void hear_dashboard(VirtualUrClient& client, std::string_view bytes);
  void answer_dashboard(const std::shared_ptr<VirtualUrClient>& client, const std::string& line);
  void hear_script(VirtualUrClient& client, std::string_view bytes);
  void tell_modes();

  // RTDE: virtual_ur_rtde.cc.
  void hear_rtde(VirtualUrClient& client, std::string_view bytes);
  void answer(VirtualUrClient& client, const RtdeMessage& message);
  std::string outputs(VirtualUrClient& client, std::string_view wanted);
  std::string take_inputs(VirtualUrClient& client, std::string_view wanted);
  void tell_state();

  VirtualUrOptions options_;
  VirtualController controller_;
  asio::io_context io_;
  std::array<asio::ip::tcp::acceptor, ports> acceptors_{
      asio::ip::tcp::acceptor(io_), asio::ip::tcp::acceptor(io_), asio::ip::tcp::acceptor(io_),
      asio::ip::tcp::acceptor(io_)};
  asio::steady_timer timer_{io_};
  std::array<asio::steady_timer, ports> retry_timers_{asio::steady_timer(io_), asio::steady_timer(io_),
                                                      asio::steady_timer(io_), asio::steady_timer(io_)};
  double modes_due_s_ = 0;
  std::list<std::shared_ptr<VirtualUrClient>> clients_;
  VirtualUrCounters counters_;
  LineLimit lines_{20};
  bool dashboard_held_ = false;
  std::vector<std::pair<std::shared_ptr<VirtualUrClient>, std::string>> held_questions_;
  std::thread thread_;
};

}  // namespace helicarm::robot
