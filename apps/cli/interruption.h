// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <csignal>

#include <unistd.h>

namespace helicarm::cli {

/// Ctrl-C or SIGTERM during a long command, seen between two of its steps. A second signal ends the program
/// at once. A signal that the program was started to ignore, as a shell's background job is, stays ignored.
/// One object at a time.
class Interruption {
 public:
  /// Thrown by the step after which the command stops.
  struct Requested {};

  Interruption() {
    signal_ = 0;
    struct sigaction action = {};
    action.sa_handler = &note;
    action.sa_flags = static_cast<int>(SA_RESETHAND) | SA_RESTART;
    catch_signal(SIGINT, action, earlier_int_);
    catch_signal(SIGTERM, action, earlier_term_);
  }
  ~Interruption() { restore(); }
  Interruption(const Interruption&) = delete;
  Interruption& operator=(const Interruption&) = delete;

  bool is_requested() const { return signal_ != 0; }

  /// Ends the program as the signal does that was received.
  void end_program() {
    restore();
    std::raise(signal_);
  }

 private:
  static void note(int signal) {
    signal_ = signal;
    constexpr char text[] = "\nhelicarm: interrupted: stops after this frame (once more: at once)\n";
    static_cast<void>(!::write(STDERR_FILENO, text, sizeof text - 1));
  }
  static void catch_signal(int signal, const struct sigaction& action, struct sigaction& earlier) {
    sigaction(signal, nullptr, &earlier);
    if (earlier.sa_handler != SIG_IGN) sigaction(signal, &action, nullptr);
  }
  void restore() const {
    sigaction(SIGINT, &earlier_int_, nullptr);
    sigaction(SIGTERM, &earlier_term_, nullptr);
  }

  static inline volatile std::sig_atomic_t signal_ = 0;
  struct sigaction earlier_int_ = {}, earlier_term_ = {};
};

}  // namespace helicarm::cli
