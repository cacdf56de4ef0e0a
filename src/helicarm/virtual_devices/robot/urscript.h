// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "helicarm/core/failure.h"

namespace helicarm::robot {

/// A value of the URScript subset: a number (one element; True is 1), a list or a pose.
using UrValue = std::vector<double>;

/// Interface for a script's commands.
class UrScriptHost {
 public:
  virtual ~UrScriptHost() = default;
  virtual bool moving() const = 0;
  /// A command that starts a motion and lasts until it ends: movel, movej, stopj. Throws BadInput.
  virtual void start_motion(const std::string& command, const std::vector<UrValue>& arguments,
                            const std::map<std::string, double>& named) = 0;
  /// Any other command or function, without duration. Throws BadInput for an unknown one.
  virtual UrValue call(const std::string& name, const std::vector<UrValue>& arguments) = 0;
};

/// Interpreter for the URScript subset that our scripts use: one program with threads, while, if and else,
/// assignments, run, kill, halt, sync, numbers, comparisons, and, or, not, lists and calls. For the virtual
/// robot.
class UrScript {
 public:
  /// Refuses `unsupported` and `bad_value` with the line number.
  static Expected<UrScript> parse(std::string_view text);

  /// One controller period. False when the program has ended; a failure is a runtime error, as is a thread
  /// that does not pause within 1000 commands.
  Expected<bool> step(UrScriptHost& host);

 private:
  class Reader;
  enum class Kind { assign, run, kill, halt, call, branch_unless, jump };
  struct Command {
    Kind kind;
    std::string name;        ///< variable, or the thread's handle
    std::string expression;  ///< or the thread's name
    std::size_t target = 0;
    int line = 0;
  };
  using Code = std::vector<Command>;
  struct Thread {
    std::string code;
    std::string handle;
    std::size_t at = 0;
    bool in_motion = false;
    bool ended = false;
  };

  /// False if the program halts.
  bool run(Thread& thread, UrScriptHost& host);
  void kill(const std::string& handle);

  std::map<std::string, Code> codes_;  ///< the main program is ""
  std::vector<std::unique_ptr<Thread>> threads_;
  std::map<std::string, UrValue> variables_;
};

}  // namespace helicarm::robot
