// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>

namespace helicarm::gui {

/// One thread that does what it is given, in order, so that the interface never waits.
class Worker {
 public:
  using Job = std::function<void()>;

  Worker() : thread_([this](const std::stop_token& stop) { run(stop); }) {}
  /// Drops what has not begun and waits for the job that runs.
  ~Worker();

  void post(Job job);

 private:
  void run(const std::stop_token& stop);

  std::mutex mutex_;
  std::condition_variable_any news_;
  std::deque<Job> jobs_;
  std::jthread thread_;
};

}  // namespace helicarm::gui
