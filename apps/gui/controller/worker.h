// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>

namespace helicarm::gui {

/// One thread that runs jobs in order, so that the interface never blocks.
class Worker {
 public:
  using Job = std::function<void()>;

  Worker() : thread_([this](const std::stop_token& stop) { run(stop); }) {}
  /// Drops the queued jobs and waits for the running one.
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
