// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "helicarm/devices/tracker/igtl_message.h"
#include "helicarm/devices/tracker/ndi_message.h"

namespace helicarm::tracker {

/// What an NDI tracker answers to one program: the virtual twin of the device, without a network. Tools on
/// cables are there from the start; a tool whose definition is loaded by PVWR is the one that the definition
/// names in plain text (those of real tools describe markers, which no virtual tracker can see).
class NdiDevice {
 public:
  explicit NdiDevice(const std::vector<std::string>& on_cables);

  /// The next measurement: tools that are absent, or no rigid motion, are missing.
  void measure(const IgtlTracking& tracking);
  void set_system_status(std::uint16_t status) { system_status_ = status; }
  /// The reply to a command that ends with a carriage return, with or without CRC.
  std::string answer(std::string_view command);

 private:
  struct Port {
    std::string name;        ///< empty: a definition has yet to be loaded
    std::string definition;  ///< as loaded
    bool on_cable = false, initialised = false, enabled = false;
  };
  std::string answer_words(std::string_view name, std::string_view parameters);
  std::string answer_of_port(std::string_view name, std::string_view parameters);
  std::string list(std::string_view which) const;
  std::string request_port();
  std::string load(Port& port, std::string_view parameters);
  std::string initialise(int handle);
  NdiTracking tracking() const;

  std::map<int, Port> ports_;
  std::map<std::string, NdiTool, std::less<>> newest_;
  std::uint32_t frame_ = 0;
  std::uint16_t system_status_ = 0;
  bool initialised_ = false, tracking_ = false;
};

}  // namespace helicarm::tracker
