// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/tracker/ndi_client.h"

#include <algorithm>
#include <condition_variable>
#include <mutex>
#include <thread>

#include <asio.hpp>
#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/core/real_time.h"
#include "helicarm/core/text.h"
#include "helicarm/devices/tracker/igtl_connection.h"
#include "helicarm/devices/tracker/ndi_message.h"
#include "helicarm/devices/tracker/pose_board.h"

namespace helicarm::tracker {
namespace {

using NdiClock = std::chrono::steady_clock;

NdiClock::time_point seconds_from_now(double seconds) {
  return NdiClock::now() +
         std::chrono::duration_cast<NdiClock::duration>(std::chrono::duration<double>(seconds));
}

/// One connection; each call returns within its time, or when the token requests a stop and the context is
/// stopped.
class NdiLink {
 public:
  explicit NdiLink(asio::io_context& io, std::stop_token stop) : io_(io), stop_(std::move(stop)) {}

  /// Both throw BadInput with `not_connected`.
  void connect(const asio::ip::tcp::endpoint& endpoint, double seconds) {
    socket_.async_connect(endpoint, [this](asio::error_code error) { done(error); });
    finish(seconds, "no answer");
    asio::error_code ignored;
    socket_.set_option(asio::ip::tcp::no_delay(true), ignored);
  }
  /// The whole reply to a command.
  std::string exchange(const std::string& command, double seconds) {
    received_.clear();
    asio::async_write(socket_, asio::buffer(command), [this](asio::error_code error, std::size_t) {
      if (error) return done(error);
      read();
    });
    finish(seconds,
           fmt::format("no reply to {} within {:g} s", command.substr(0, command.find(':')), seconds));
    return received_;
  }
  /// A last command, whose reply is not awaited.
  void say(const std::string& command) {
    asio::error_code ignored;
    asio::write(socket_, asio::buffer(command), ignored);
  }

 private:
  void done(asio::error_code error) {
    error_ = error;
    ended_ = true;
  }
  void read() {
    socket_.async_read_some(asio::buffer(segment_), [this](asio::error_code error, std::size_t size) {
      if (error) return done(error);
      received_.append(segment_.data(), size);
      const auto whole = ndi_reply_size(received_);
      if (!whole) return done(asio::error::message_size);
      if (!*whole) return read();
      received_.resize(**whole);
      done({});
    });
  }
  void finish(double seconds, const std::string& timeout) {
    ended_ = false;
    io_.restart();
    const auto until = seconds_from_now(seconds);
    while (!ended_ && !stop_.stop_requested() && NdiClock::now() < until)
      if (io_.run_one_until(until) == 0) break;
    if (ended_ && !error_) return;
    const std::string why = ended_ ? error_.message() : timeout;
    asio::error_code ignored;
    socket_.close(ignored);
    io_.restart();
    while (!ended_ && io_.run_one() > 0) {
    }
    throw BadInput(Reason::not_connected, why);
  }

  asio::io_context& io_;
  std::stop_token stop_;
  asio::ip::tcp::socket socket_{io_};
  std::array<char, 4096> segment_{};
  std::string received_;
  asio::error_code error_;
  bool ended_ = false;
};

/// Port handles in a reply to PHSR: their count, then two digits of a handle and three of its state each.
std::vector<std::string> handles_of(const std::string& reply) {
  constexpr std::size_t each = 5;
  const auto count = from_hexadecimal(std::string_view(reply).substr(0, 2));
  if (!count || reply.size() != 2 + each * *count)
    throw BadInput(Reason::bad_value, "the tracker's list of port handles has another length than it states");
  std::vector<std::string> handles;
  for (std::size_t i = 0; i < *count; ++i) handles.push_back(reply.substr(2 + each * i, 2));
  return handles;
}

int handle_number(const std::string& handle) {
  const auto number = from_hexadecimal(handle);
  if (!number || handle.size() != 2)
    throw BadInput(Reason::bad_value, "the tracker's port handle is no number");
  return static_cast<int>(*number);
}

Expected<std::string> definition_of(const std::filesystem::path& file) {
  auto bytes = read_file(file, ndi_largest_definition);
  if (bytes && bytes->empty()) return fail(Reason::bad_size, file.string() + ": an empty tool definition");
  return bytes;
}

}  // namespace

struct NdiClient::Impl {
  void run(const std::stop_token& stop);
  void connection(const std::stop_token& stop);
  std::string ask(NdiLink& link, std::string_view name, std::string_view parameters = {});
  void load(NdiLink& link, const std::string& name, const std::string& definition);
  /// Tools by the number of their handle.
  std::map<int, std::string> enabled_tools(NdiLink& link);
  void watch(NdiLink& link, const std::map<int, std::string>& tools, const std::stop_token& stop);
  Expected<NdiTracking> poses(NdiLink& link);
  void pass_on(const NdiTracking& tracking, const std::map<int, std::string>& tools);
  void count(std::string_view event);
  void set_state(LinkState state, const std::string& trouble = {});
  bool wait(const std::stop_token& stop, NdiClock::time_point until);

  NdiClientOptions options;
  asio::ip::tcp::endpoint endpoint;
  TrackerListener listener;
  std::map<std::string, std::string> definitions;  ///< bytes by tool
  std::map<int, std::string> loaded;               ///< in this connection
  std::map<int, std::uint32_t> frames;             ///< newest of each tool in this connection
  std::uint16_t system_status = 0;
  bool binary = true;

  asio::io_context io{1};
  std::mutex pause_mutex;
  std::condition_variable_any pause;
  mutable std::mutex mutex;  ///< guards the next member
  TrackerLinkStatus status;
  std::jthread thread;
};

void NdiClient::Impl::count(std::string_view event) {
  const std::lock_guard lock(mutex);
  ++status.counters[std::string(event)];
}

void NdiClient::Impl::set_state(LinkState state, const std::string& trouble) {
  const std::lock_guard lock(mutex);
  status.state = state;
  if (!trouble.empty()) status.trouble = trouble;
}

bool NdiClient::Impl::wait(const std::stop_token& stop, NdiClock::time_point until) {
  std::unique_lock lock(pause_mutex);
  pause.wait_until(lock, stop, until, [] { return false; });
  return !stop.stop_requested();
}

std::string NdiClient::Impl::ask(NdiLink& link, std::string_view name, std::string_view parameters) {
  return value_or_throw(ndi_text(link.exchange(ndi_command(name, parameters), options.reply_s)));
}

void NdiClient::Impl::load(NdiLink& link, const std::string& name, const std::string& definition) {
  const auto done = guarded([&] {
    // Any device, any system, wireless passive tool, any port.
    const std::string handle = ask(link, "PHRQ", "*********1****");
    loaded[handle_number(handle)] = name;
    for (std::size_t at = 0; at < definition.size(); at += ndi_definition_block) {
      std::string block;
      for (std::size_t i = at; i < at + ndi_definition_block; ++i)
        block += hexadecimal(i < definition.size() ? std::uint8_t(definition[i]) : 0, 2);
      ask(link, "PVWR", fmt::format("{}{}{}", handle, hexadecimal(std::uint32_t(at), 4), block));
    }
  });
  if (!done) throw BadInput(done.error().reason, fmt::format("tool \"{}\": {}", name, done.error().message));
}

std::map<int, std::string> NdiClient::Impl::enabled_tools(NdiLink& link) {
  constexpr const char *to_free = "01", *occupied = "02", *initialised = "03", *part_number = "0004";
  for (const std::string& handle : handles_of(ask(link, "PHSR", to_free))) ask(link, "PHF", handle);
  loaded.clear();
  for (const auto& [name, definition] : definitions) load(link, name, definition);
  for (const std::string& handle : handles_of(ask(link, "PHSR", occupied))) ask(link, "PINIT", handle);
  std::map<int, std::string> tools;
  for (const std::string& handle : handles_of(ask(link, "PHSR", initialised))) {
    ask(link, "PENA", handle + "D");
    const int number = handle_number(handle);
    const auto by_file = loaded.find(number);
    std::string name = by_file != loaded.end()
                           ? by_file->second
                           : std::string(trimmed(ask(link, "PHINF", handle + part_number)));
    tools[number] = name.empty() ? "handle " + handle : without_control_characters(name);
  }
  if (tools.empty())
    throw BadInput(Reason::no_pose, "the tracker has no tool: state the passive tools' definitions (.rom)");
  return tools;
}

Expected<NdiTracking> NdiClient::Impl::poses(NdiLink& link) {
  constexpr std::uint32_t invalid_command = 1;
  auto tracking = ndi_tracking(link.exchange(ndi_command(binary ? "BX" : "TX", "0001"), options.silence_s));
  if (!tracking && binary && tracking.error().figures.contains("code") &&
      tracking.error().figures.at("code") == invalid_command) {
    binary = false;
    return poses(link);
  }
  return tracking;
}

void NdiClient::Impl::pass_on(const NdiTracking& tracking, const std::map<int, std::string>& tools) {
  IgtlMessage message{"ndi", 0, IgtlTracking{}};
  auto& all = std::get<IgtlTracking>(message.content).tools;
  for (const NdiTool& tool : tracking.tools) {
    const auto named = tools.find(tool.handle);
    if (named == tools.end() || tool.state == NdiToolState::disabled) continue;
    const auto [known, is_new] = frames.try_emplace(tool.handle, tool.frame);
    if (!is_new && std::exchange(known->second, tool.frame) == tool.frame) {
      count("repeated");
      continue;
    }
    const bool valid = tool.state == NdiToolState::valid;
    all.push_back(
        {named->second, 2,
         valid ? matrix_from(tool.position, tool.quaternion) : Eigen::Matrix4d(Eigen::Matrix4d::Identity())});
    if (!valid || (tool.port_status & ndi_out_of_volume) != 0)
      message.metadata[named->second + "Status"] = valid ? "OUT_OF_VOLUME" : "MISSING";
  }
  const double now = monotonic_seconds();
  if (std::exchange(system_status, tracking.system_status) != tracking.system_status) {
    const std::string trouble = ndi_trouble(tracking.system_status);
    listener.message(
        {"ndi", 0, IgtlStatus{std::uint16_t(trouble.empty() ? 1 : 19), tracking.system_status, "", trouble}},
        now);
  }
  if (all.empty()) return;
  count("messages");
  listener.message(message, now);
}

void NdiClient::Impl::watch(NdiLink& link, const std::map<int, std::string>& tools,
                            const std::stop_token& stop) {
  constexpr int most_bad = 3;  // replies in succession
  for (int bad = 0; !stop.stop_requested();) {
    const auto next = seconds_from_now(1 / options.rate_hz);
    const auto tracking = poses(link);
    count("replies");
    if (tracking) {
      bad = 0;
      pass_on(*tracking, tools);
    } else {
      if (tracking.error().figures.contains("crc")) count("bad_crc");
      if (++bad == most_bad || tracking.error().figures.contains("code")) throw BadInput(tracking.error());
    }
    wait(stop, next);
  }
}

void NdiClient::Impl::connection(const std::stop_token& stop) {
  set_state(LinkState::connecting);
  count("attempts");
  NdiLink link(io, stop);
  link.connect(endpoint, options.connect_s);
  // Of a device that a previous program left tracking; an error of one that is not.
  link.exchange(ndi_command("TSTOP"), options.reply_s);
  ask(link, "INIT");
  const auto tools = enabled_tools(link);
  ask(link, "TSTART");
  frames.clear();
  system_status = 0;
  set_state(LinkState::connected);
  count("connections");
  listener.connected();
  watch(link, tools, stop);
  link.say(ndi_command("TSTOP"));
}

void NdiClient::Impl::run(const std::stop_token& stop) {
  const RealTime priority;
  double pause_s = options.first_pause_s;
  std::uint64_t messages = 0;
  while (!stop.stop_requested()) {
    const auto ended = guarded([&] { connection(stop); });
    set_state(LinkState::waiting, ended ? std::string() : ended.error().message);
    {
      const std::lock_guard lock(mutex);
      if (std::exchange(messages, status.counters["messages"]) != status.counters["messages"])
        pause_s = options.first_pause_s;
    }
    wait(stop, seconds_from_now(pause_s));
    pause_s = std::min(2 * pause_s, options.last_pause_s);
  }
}

NdiClient::NdiClient(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
NdiClient::~NdiClient() { stop(); }

Expected<std::unique_ptr<NdiClient>> NdiClient::start(const NdiClientOptions& options,
                                                      TrackerListener listener) {
  const auto endpoint = endpoint_of(options.address, options.port);
  if (!endpoint) return tl::unexpected(endpoint.error());
  auto impl = std::make_unique<Impl>();
  impl->options = options;
  impl->endpoint = *endpoint;
  impl->listener = std::move(listener);
  for (const auto& [name, file] : options.definitions) {
    auto bytes = definition_of(file);
    if (!bytes) return tl::unexpected(bytes.error());
    impl->definitions[name] = *std::move(bytes);
  }
  impl->thread = std::jthread([raw = impl.get()](const std::stop_token& stop) { raw->run(stop); });
  return std::unique_ptr<NdiClient>(new NdiClient(std::move(impl)));
}

TrackerLinkStatus NdiClient::status() const {
  const std::lock_guard lock(impl_->mutex);
  return impl_->status;
}

void NdiClient::stop() {
  impl_->thread.request_stop();
  impl_->io.stop();
  if (impl_->thread.joinable()) impl_->thread.join();
}

}  // namespace helicarm::tracker
