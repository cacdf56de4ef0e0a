// SPDX-License-Identifier: Apache-2.0
#include "progress_line.h"

#include <iostream>

#include <fmt/format.h>
#include <unistd.h>

namespace helicarm::cli {
namespace {

constexpr double silent_s = 1;
constexpr double between_lines_s = 0.2;
constexpr double between_shares = 0.1;
constexpr double between_tags = 0.01;

double seconds(std::chrono::steady_clock::duration time) {
  return std::chrono::duration<double>(time).count();
}

std::string span_of(double s) {
  if (s < 90) return fmt::format("{:.0f} s", s);
  if (s < 5400) return fmt::format("{:.0f} min", s / 60);
  return fmt::format("{:.1f} h", s / 3600);
}

}  // namespace

ProgressLine::ProgressLine(const Console& console, const std::string& of)
    : out_(console.quiet ? nullptr : &console.progress),
      terminal_(&console.progress == &std::cerr && ::isatty(STDERR_FILENO)),
      begin_(fmt::format("helicarm: {}{}", of, of.empty() ? "" : ": ")),
      tags_(console.tags),
      start_(Clock::now()),
      reported_(start_) {}

ProgressLine::~ProgressLine() {
  if (begun_ && terminal_) *out_ << '\n';
}

void ProgressLine::notify(double share) {
  if (!out_) return;
  if (tags_) {
    if (told_share_ > 0 && share - told_share_ < between_tags && share < 1) return;
    *out_ << fmt::format("<filter-progress>{:.2f}</filter-progress>\n", share) << std::flush;
    told_share_ = share;
    return;
  }
  const auto now = Clock::now();
  if (first_share_ < 0) first_share_ = told_share_ = share, start_ = now;
  const double passed = seconds(now - start_);
  if (passed < silent_s) return;
  if (terminal_ ? seconds(now - reported_) < between_lines_s && share < 1
                : share - told_share_ < between_shares)
    return;
  const double done = share - first_share_;
  const std::string left = done > 0 ? span_of(passed * (1 - share) / done) + " left" : "";
  *out_ << fmt::format("{}{}{:.0f} % done, {}{}", terminal_ ? "\r" : "", begin_, 100 * share, left,
                       terminal_ ? "   " : "\n")
        << std::flush;
  begun_ = true;
  reported_ = now;
  told_share_ = share;
}

}  // namespace helicarm::cli
