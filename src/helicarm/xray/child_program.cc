// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/child_program.h"

#include <array>
#include <cerrno>
#include <csignal>
#include <cstdint>

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <spawn.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "helicarm/core/system_message.h"

extern char** environ;  // NOLINT(readability-redundant-declaration): POSIX declares it nowhere

namespace helicarm::xray {
namespace {

constexpr std::size_t most_message_bytes = 4096;
constexpr int patience_ms = 60'000;

struct Pipe {
  int from = -1, to = -1;
  Pipe() {
    int ends[2];
    if (::pipe2(ends, O_CLOEXEC) != 0)
      throw BadInput(Reason::cannot_write, fmt::format("no pipe: {}", system_message(errno)));
    from = ends[0];
    to = ends[1];
  }
  ~Pipe() {
    for (const int end : {from, to})
      if (end >= 0) ::close(end);
  }
  Pipe(const Pipe&) = delete;
  Pipe& operator=(const Pipe&) = delete;
};

void limit_memory([[maybe_unused]] pid_t child) {
#ifdef __linux__
  constexpr rlim_t most_bytes = rlim_t(4) << 30;
  const rlimit limit{most_bytes, most_bytes};
  ::prlimit(child, RLIMIT_AS, &limit, nullptr);
#endif
}

int end_of(pid_t child) {
  int status = 0;
  while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  return status;
}

pid_t started(const std::vector<std::string>& words, int output, int errors) {
  std::vector<char*> arguments;
  for (const std::string& word : words) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, output, STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, errors, STDERR_FILENO);
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
  posix_spawnattr_setpgroup(&attributes, 0);
  pid_t child = -1;
  const int error = posix_spawnp(&child, arguments[0], &actions, &attributes, arguments.data(), environ);
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&actions);
  if (error)
    throw BadInput(Reason::missing_file, fmt::format("{}: {}", words.front(), system_message(error)));
  limit_memory(child);
  return child;
}

}  // namespace

ChildProgram::ChildProgram(const std::vector<std::string>& words) : name_(words.front()) {
  Pipe output, errors;
  child_ = started(words, output.to, errors.to);
  std::swap(output_, output.from);
  std::swap(errors_, errors.from);
}

ChildProgram::~ChildProgram() {
  for (const int pipe : {output_, errors_})
    if (pipe >= 0) ::close(pipe);
  if (child_ < 0) return;
  ::kill(child_, SIGKILL);
  end_of(child_);
}

/// Reads once; closes the pipe at its end.
bool ChildProgram::take(int& pipe, std::span<char> into, std::size_t& got) {
  const ssize_t count = ::read(pipe, into.data(), into.size());
  if (count < 0 && errno == EINTR) return true;
  if (count <= 0) {
    ::close(pipe);
    pipe = -1;
    return false;
  }
  got += std::size_t(count);
  return true;
}

std::size_t ChildProgram::read(std::span<char> into) {
  std::size_t got = 0;
  while (got < into.size() && (output_ >= 0 || errors_ >= 0)) {
    std::array<pollfd, 2> pipes{{{output_, POLLIN, 0}, {errors_, POLLIN, 0}}};
    const int ready = ::poll(pipes.data(), pipes.size(), patience_ms);
    if (ready < 0 && errno == EINTR) continue;
    if (ready <= 0) {
      ::kill(child_, SIGKILL);
      throw BadInput(Reason::bad_value,
                     fmt::format("{} wrote nothing for {} s and was ended", name_, patience_ms / 1000));
    }
    if (pipes[1].revents) {
      std::array<char, 512> text;
      std::size_t count = 0;
      take(errors_, text, count);
      if (messages_.size() < most_message_bytes) messages_.append(text.data(), count);
    }
    if (pipes[0].revents) take(output_, into.subspan(got), got);
  }
  return got;
}

bool ChildProgram::ended_well() {
  if (child_ < 0) return false;
  const int status = end_of(child_);
  child_ = -1;
  return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

std::string ChildProgram::first_error() const {
  std::string line = messages_.substr(0, messages_.find('\n'));
  // "[h264 @ 0x55d0c8e4b2c0] ...": the address differs from run to run.
  if (line.starts_with('['))
    if (const std::size_t end = line.find("] "); end != line.npos) line.erase(0, end + 2);
  return line;
}

}  // namespace helicarm::xray
