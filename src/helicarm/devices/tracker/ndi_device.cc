// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/tracker/ndi_device.h"

#include <algorithm>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <fmt/format.h>

#include "helicarm/core/text.h"

namespace helicarm::tracker {
namespace {

constexpr std::string_view okay = "OKAY";
constexpr int most_handles = 24;

enum class NdiError {
  invalid_command = 0x01,
  bad_crc = 0x04,
  wrong_parameters = 0x07,
  handle = 0x08,
  mode = 0x0C,
  no_tool = 0x0D,
  not_initialised = 0x0E,
  system_not_initialised = 0x10,
  handles_taken = 0x2D,
};

std::string error(NdiError why) { return "ERROR" + hexadecimal(std::uint32_t(why), 2); }

/// No quaternion says anything else.
bool is_pose(const Eigen::Matrix4d& matrix) {
  constexpr double tolerance = 1e-3;
  const Eigen::Matrix3d rotation = matrix.topLeftCorner<3, 3>();
  return matrix.allFinite() && rotation.determinant() > 0 &&
         (rotation.transpose() * rotation - Eigen::Matrix3d::Identity()).norm() < tolerance;
}

}  // namespace

NdiDevice::NdiDevice(const std::vector<std::string>& on_cables) {
  for (const std::string& name : on_cables) {
    if (static_cast<int>(ports_.size()) == most_handles) break;
    const int handle = static_cast<int>(ports_.size()) + 1;
    ports_[handle] = {name, {}, true, false, false};
  }
}

void NdiDevice::measure(const IgtlTracking& tracking) {
  ++frame_;
  for (auto& [name, tool] : newest_) tool.state = NdiToolState::missing;
  for (const IgtlTool& seen : tracking.tools) {
    NdiTool& tool = newest_[seen.name];
    if (!is_pose(seen.matrix)) continue;
    const Eigen::Matrix3d rotation = seen.matrix.topLeftCorner<3, 3>();
    const Eigen::Quaterniond turn(rotation);
    tool.quaternion = turn.coeffs();
    tool.position = seen.matrix.topRightCorner<3, 1>();
    tool.error_mm = 0.1;
    tool.state = NdiToolState::valid;
  }
}

NdiTracking NdiDevice::tracking() const {
  constexpr std::uint32_t occupied = 0x01, initialised = 0x10, enabled = 0x20;
  NdiTracking tracking;
  tracking.system_status = system_status_;
  for (const auto& [handle, port] : ports_) {
    if (!port.enabled) continue;
    const auto found = newest_.find(port.name);
    NdiTool tool = found == newest_.end() ? NdiTool{} : found->second;
    tool.handle = handle;
    tool.frame = frame_;
    tool.port_status = occupied | initialised | enabled;
    tracking.tools.push_back(tool);
  }
  return tracking;
}

std::string NdiDevice::list(std::string_view which) const {
  std::string listed;
  int count = 0;
  for (const auto& [handle, port] : ports_) {
    const bool wanted = which == "00" || (which == "02" && !port.initialised) ||
                        (which == "03" && port.initialised && !port.enabled) ||
                        (which == "04" && port.enabled);
    if (!wanted) continue;
    ++count;
    listed += hexadecimal(std::uint32_t(handle), 2) +
              hexadecimal(1u | (port.initialised ? 0x10u : 0u) | (port.enabled ? 0x20u : 0u), 3);
  }
  return hexadecimal(std::uint32_t(count), 2) + listed;
}

std::string NdiDevice::request_port() {
  for (int handle = 1; handle <= most_handles; ++handle)
    if (ports_.try_emplace(handle).second) return hexadecimal(std::uint32_t(handle), 2);
  return error(NdiError::handles_taken);
}

std::string NdiDevice::load(Port& port, std::string_view parameters) {
  const auto at = parameters.size() == 4 + 2 * ndi_definition_block
                      ? from_hexadecimal(parameters.substr(0, 4))
                      : std::nullopt;
  if (!at || port.on_cable || *at + ndi_definition_block > ndi_largest_definition)
    return error(NdiError::wrong_parameters);
  port.definition.resize(std::max<std::size_t>(port.definition.size(), *at + ndi_definition_block));
  for (std::size_t i = 0; i < ndi_definition_block; ++i) {
    const auto byte = from_hexadecimal(parameters.substr(4 + 2 * i, 2));
    if (!byte) return error(NdiError::wrong_parameters);
    port.definition[*at + i] = static_cast<char>(*byte);
  }
  return std::string(okay);
}

std::string NdiDevice::initialise(int handle) {
  Port& port = ports_.at(handle);
  if (!port.on_cable) port.name = trimmed(std::string_view(port.definition.c_str()));
  if (port.name.empty()) return error(NdiError::no_tool);
  port.initialised = true;
  std::erase_if(ports_,
                [&](const auto& other) { return other.first != handle && other.second.name == port.name; });
  return std::string(okay);
}

std::string NdiDevice::answer_of_port(std::string_view name, std::string_view parameters) {
  const auto handle = from_hexadecimal(parameters.substr(0, 2));
  const auto found = handle ? ports_.find(static_cast<int>(*handle)) : ports_.end();
  if (found == ports_.end()) return error(NdiError::handle);
  const std::string_view rest = parameters.substr(2);
  Port& port = found->second;
  if (name == "PVWR") return load(port, rest);
  if (name == "PINIT") return initialise(found->first);
  if (name == "PHINF")
    return rest != "0004" ? error(NdiError::wrong_parameters)
                          : fmt::format("{:<20}", port.name.substr(0, 20));
  if (name == "PENA") {
    if (!port.initialised) return error(NdiError::not_initialised);
    if (rest != "S" && rest != "D" && rest != "B") return error(NdiError::wrong_parameters);
    port.enabled = true;
  } else {
    ports_.erase(found);  // PHF
  }
  return std::string(okay);
}

std::string NdiDevice::answer_words(std::string_view name, std::string_view parameters) {
  if (name == "INIT") {
    tracking_ = false;
    initialised_ = true;
    return std::string(okay);
  }
  if (!initialised_) return error(NdiError::system_not_initialised);
  if (name == "TSTOP" || name == "BX" || name == "TX") {
    if (!tracking_) return error(NdiError::mode);
    if (name != "TSTOP")
      return parameters == "0001" || parameters.empty() ? std::string() : error(NdiError::wrong_parameters);
    tracking_ = false;
    return std::string(okay);
  }
  if (tracking_) return error(NdiError::mode);
  if (name == "TSTART") {
    tracking_ = true;
    return std::string(okay);
  }
  if (name == "PHSR") return list(parameters);
  if (name == "PHRQ") return request_port();
  for (const std::string_view of_port : {"PVWR", "PINIT", "PENA", "PHINF", "PHF"})
    if (name == of_port && parameters.size() >= 2) return answer_of_port(name, parameters);
  return error(NdiError::invalid_command);
}

std::string NdiDevice::answer(std::string_view command) {
  constexpr std::size_t crc = 4;
  if (command.ends_with('\r')) command.remove_suffix(1);
  const auto end = command.find_first_of(": ");
  const std::string_view name = command.substr(0, end);
  std::string_view parameters = end == command.npos ? std::string_view() : command.substr(end + 1);
  if (end != command.npos && command[end] == ':') {
    const auto stated =
        parameters.size() < crc ? std::nullopt : from_hexadecimal(command.substr(command.size() - crc));
    if (!stated || *stated != ndi_crc(command.substr(0, command.size() - crc)))
      return ndi_text_reply(error(NdiError::bad_crc));
    parameters.remove_suffix(crc);
  }
  const std::string words = answer_words(name, parameters);
  if (words.empty()) return name == "BX" ? ndi_binary_reply(tracking()) : ndi_text_reply(tracking());
  return ndi_text_reply(words);
}

}  // namespace helicarm::tracker
