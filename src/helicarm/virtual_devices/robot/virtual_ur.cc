// SPDX-License-Identifier: Apache-2.0
#include "helicarm/virtual_devices/robot/virtual_ur.h"

#include <cmath>

#include "helicarm/virtual_devices/robot/virtual_ur_server.h"

namespace helicarm::robot {

VirtualUr::VirtualUr(std::unique_ptr<Server> server) : server_(std::move(server)) {}
VirtualUr::~VirtualUr() = default;

Expected<std::unique_ptr<VirtualUr>> VirtualUr::start(const VirtualUrOptions& options) {
  auto server = std::make_unique<Server>(options);
  if (const auto listening = server->listen(); !listening) return tl::unexpected<Failure>(listening.error());
  return std::unique_ptr<VirtualUr>(new VirtualUr(std::move(server)));
}

std::uint16_t VirtualUr::rtde_port() const { return server_->port(Server::rtde); }
std::uint16_t VirtualUr::dashboard_port() const { return server_->port(Server::dashboard); }
std::uint16_t VirtualUr::script_port() const { return server_->port(Server::script); }
std::uint16_t VirtualUr::primary_port() const { return server_->port(Server::primary); }

void VirtualUr::set(RobotFault fault, bool on) {
  server_->there([&] { server_->set(fault, on); });
}

void VirtualUr::set_at(RobotFault fault, double time_s) {
  server_->there([&] { server_->controller().set_at(fault, time_s); });
}

std::string VirtualUr::dashboard(const std::string& command) {
  return server_->there([&] { return server_->controller().dashboard(command); });
}

void VirtualUr::delay_scripts(std::vector<double> delays_s) {
  server_->there([&] { server_->controller().delay_scripts(std::move(delays_s)); });
}

void VirtualUr::hold_dashboard(bool on) {
  server_->there([&] { server_->hold_dashboard(on); });
}

void VirtualUr::advance(double seconds) {
  server_->there([&] {
    const auto steps = static_cast<int>(std::ceil(seconds * server_->options().controller.rate_hz));
    for (int i = 0; i < steps; ++i) server_->step();
  });
}

VirtualUrCounters VirtualUr::counters() {
  return server_->there([&] { return server_->counters(); });
}

VirtualTruth VirtualUr::truth() {
  return server_->there([&] { return server_->truth(); });
}

}  // namespace helicarm::robot
