// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/receiver/image_source.h"

#include "helicarm/core/files.h"

namespace helicarm::receiver {

bool take_file(const std::filesystem::path& file, Inbox& inbox, const ReceiverHooks& hooks) {
  constexpr std::uintmax_t most_bytes = std::uintmax_t{256} << 20;
  const std::string origin = file.filename().string();
  const auto arrival = read_file(file, most_bytes).and_then([&](const std::string& bytes) {
    return inbox.store(bytes, origin);
  });
  if (arrival)
    hooks.arrived(*arrival);
  else
    hooks.refused(arrival.error());
  return arrival.has_value();
}

}  // namespace helicarm::receiver
