// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/robot/rtde_client.h"

#include <condition_variable>
#include <mutex>

#include "helicarm/core/real_time.h"
#include "helicarm/devices/robot/rtde_message.h"
#include "helicarm/devices/robot/timed_socket.h"

namespace helicarm::robot {
namespace {

using Clock = std::chrono::steady_clock;

Clock::duration seconds(double s) {
  return std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(s));
}

/// Interval at which a wait checks for its end.
constexpr auto poll_interval = std::chrono::milliseconds(20);

/// A connection that returns whole messages.
struct Line {
  TimedSocket socket;
  RtdeStream stream = {};

  /// Empty if none arrives in this time.
  Expected<std::optional<RtdeMessage>> receive(Clock::duration patience) {
    auto message = stream.next();
    if (!message || *message) return message;
    const auto bytes = socket.receive(patience);
    if (!bytes) return tl::unexpected<Failure>(bytes.error());
    stream.append(*bytes);
    return stream.next();
  }

  /// The answer of this kind; text and other messages in between are skipped.
  RtdeMessage ask(const std::string& request, RtdeKind kind, Clock::duration patience,
                  const std::stop_token& stop) {
    value_or_throw(socket.send(request, patience));
    for (const auto until = Clock::now() + patience; Clock::now() < until && !stop.stop_requested();)
      if (auto message = value_or_throw(receive(poll_interval)); message && message->kind == kind)
        return *std::move(message);
    throw BadInput(Reason::not_connected,
                   std::string("RTDE: timeout of the request of kind ") + static_cast<char>(kind));
  }
};

}  // namespace

RtdeClient::RtdeClient(RtdeOptions options, RobotListener listener)
    : options_(std::move(options)),
      listener_(std::move(listener)),
      thread_([this](const std::stop_token& stop) { run(stop); }) {}

RtdeClient::~RtdeClient() = default;

void RtdeClient::run(const std::stop_token& stop) {
  const RealTime priority;
  std::mutex guard;
  std::condition_variable_any ended;
  double retry_s = 0.1;
  while (!stop.stop_requested()) {
    const auto begun = Clock::now();
    const auto served = serve(stop);
    if (stop.stop_requested()) return;
    if (!served) listener_.lost(served.error());
    retry_s = Clock::now() - begun > seconds(10) ? 0.1 : std::min(2 * retry_s, options_.longest_retry_s);
    std::unique_lock lock(guard);
    ended.wait_for(lock, stop, seconds(retry_s), [] { return false; });
  }
}

Expected<void> RtdeClient::serve(const std::stop_token& stop) {
  return guarded([&] {
    const auto patience = seconds(options_.handshake_s);
    Line line{value_or_throw(TimedSocket::connect(options_.address, options_.port, patience))};
    const auto granted = [&](const std::string& request, RtdeKind kind) {
      return value_or_throw(read_granted(line.ask(request, kind, patience, stop), kind));
    };
    if (!granted(request_version(), RtdeKind::version))
      throw BadInput(Reason::not_connected, "RTDE: the controller does not support version 2");
    const auto version = value_or_throw(read_controller_version(
        line.ask(request_controller_version(), RtdeKind::controller_version, patience, stop)));
    const auto states = value_or_throw(
        read_recipe(line.ask(request_outputs(options_.rate_hz), RtdeKind::outputs, patience, stop),
                    state_names, state_types));
    std::uint8_t heartbeats = 0;
    if (options_.commands)
      heartbeats = value_or_throw(read_recipe(line.ask(request_inputs(), RtdeKind::inputs, patience, stop),
                                              heartbeat_names, heartbeat_types));
    if (!granted(request_start(), RtdeKind::start))
      throw BadInput(Reason::not_connected, "RTDE: the controller does not start the data stream");
    listener_.connected(version);

    auto heard = Clock::now();
    while (!stop.stop_requested()) {
      const auto message = value_or_throw(line.receive(poll_interval));
      if (message && message->kind == RtdeKind::data) {
        const Heartbeat heartbeat = listener_.state(value_or_throw(read_state(*message, states)));
        heard = Clock::now();
        if (options_.commands)
          value_or_throw(line.socket.send(heartbeat_message(heartbeats, heartbeat), patience));
      } else if (Clock::now() - heard > seconds(options_.silence_s)) {
        throw BadInput(Reason::stale_state, "RTDE: no robot state received in time");
      }
    }
  });
}

}  // namespace helicarm::robot
