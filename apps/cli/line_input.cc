// SPDX-License-Identifier: Apache-2.0
#include "line_input.h"

#include <array>
#include <cerrno>
#include <utility>

#include <fmt/format.h>
#include <poll.h>
#include <termios.h>
#include <unistd.h>

#include "helicarm/core/failure.h"

namespace helicarm::cli {

std::optional<std::string> LineInput::next(int patience_ms) {
  for (;;) {
    const std::size_t end = held_.find('\n');
    if (end != held_.npos && end <= longest) {
      std::string line = held_.substr(0, end);
      held_.erase(0, end + 1);
      return line;
    }
    if (held_.size() > longest)
      throw BadInput(Reason::bad_size, fmt::format("standard input: a line over {} bytes", longest));
    if (ended_ && held_.empty()) throw BadInput(Reason::interrupted, "the input ended");
    if (ended_) return std::exchange(held_, {});
    pollfd input{descriptor_, POLLIN, 0};
    if (::poll(&input, 1, patience_ms) <= 0) return std::nullopt;
    std::array<char, longest> bytes;
    const ssize_t size = ::read(descriptor_, bytes.data(), bytes.size());
    if (size < 0 && errno == EINTR) continue;
    if (size <= 0)
      ended_ = true;
    else
      held_.append(bytes.data(), static_cast<std::size_t>(size));
  }
}

void LineInput::discard() {
  if (::isatty(descriptor_) != 1) return;
  ::tcflush(descriptor_, TCIFLUSH);
  held_.clear();
}

}  // namespace helicarm::cli
