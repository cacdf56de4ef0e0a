// SPDX-License-Identifier: Apache-2.0
#include "shared_work.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cstdlib>
#include <fstream>
#include <thread>

#include <fcntl.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sys/file.h>
#include <unistd.h>

#include "helicarm/core/file_lock.h"
#include "helicarm/core/files.h"
#include "helicarm/core/private_files.h"
#include "helicarm/core/system_message.h"

namespace helicarm::cli {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::milliseconds look_again{50};
constexpr std::chrono::seconds longest_arrival{10};
constexpr std::size_t most_processes_of_an_item = 2;

std::string variable(const char* name) {
  // Nothing here changes the environment. NOLINTNEXTLINE(concurrency-mt-unsafe)
  const char* const value = std::getenv(name);
  return value ? value : "";
}

/// Letters and digits of a key, which becomes a folder's name.
std::string as_name(std::string key) {
  std::erase_if(key, [](unsigned char c) { return !std::isalnum(c) && c != '-' && c != '_'; });
  return key;
}

void write_or_throw(const fs::path& path, const Json& json) {
  value_or_throw(write_file(path, to_text(json)));
}

/// Refuses work that differs from the one begun.
void check_same_work(const Json& begun, const Json& mine, const std::string& word) {
  if (begun == mine) return;
  const std::string refusal = fmt::format("the processes of \"{}\" have begun other work: ", word);
  if (!begun.is_object() || begun.value("names", Json()) != mine["names"])
    throw BadInput(Reason::usage, refusal + "they have a different list of cases; give another word");
  const Json terms = begun.value("terms", Json::object());
  const auto value_in = [](const Json& of, const std::string& name) {
    return of.is_object() && of.contains(name) ? to_text(of[name]) : std::string("not given");
  };
  std::vector<std::string> different;
  Json all = mine["terms"];
  if (terms.is_object()) all.update(terms);
  for (const auto& [name, ignored] : all.items())
    if (value_in(terms, name) != value_in(mine["terms"], name))
      different.push_back(
          fmt::format("{} was {} and is {}", name, value_in(terms, name), value_in(mine["terms"], name)));
  throw BadInput(Reason::usage,
                 fmt::format("{}{}; give the same, or another word", refusal, fmt::join(different, "; ")));
}

}  // namespace

std::optional<Launch> launch_of_environment() {
  struct Words {
    const char *processes, *job, *step;
  };
  // Open MPI (PMIx), srun.
  for (const Words& words : {Words{"OMPI_COMM_WORLD_SIZE", "PMIX_NAMESPACE", "OMPI_MCA_ess_base_jobid"},
                             Words{"SLURM_STEP_NUM_TASKS", "SLURM_JOB_ID", "SLURM_STEP_ID"}}) {
    const std::string count = variable(words.processes);
    std::size_t processes = 0;
    std::from_chars(count.data(), count.data() + count.size(), processes);
    const std::string key = as_name(variable(words.job) + "-" + variable(words.step));
    if (processes > 1 && key.size() > 1) return Launch{key, processes};
  }
  return std::nullopt;
}

SharedWork::SharedWork(const fs::path& folder, const Launch& launch, const std::vector<std::string>& names,
                       const std::function<void()>& first, const Terms& terms)
    : folder_(folder / (".shared-" + as_name(launch.key))),
      processes_(launch.processes),
      known_done_(names.size(), false) {
  if (as_name(launch.key).empty())
    throw BadInput(Reason::usage, "the common word of the processes has neither letter nor digit");
  value_or_throw(make_private_folder(folder_));
  const fs::path list = folder_ / "names.json";
  const FileLock lock = value_or_throw(FileLock::of(list));
  const Json mine{{"names", names}, {"terms", Json(terms)}};
  std::error_code ignored;
  if (fs::exists(list, ignored)) {
    check_same_work(value_or_throw(read_json(list)), mine, launch.key);
  } else {
    first();
    write_or_throw(list, mine);
  }
  std::ofstream(folder_ / "arrived", std::ios::app) << '+';
}

fs::path SharedWork::file(std::size_t index, const char* what) const {
  return folder_ / fmt::format("{}.{}", index, what);
}

std::optional<SharedWork::Item> SharedWork::take(std::size_t index,
                                                 const std::function<Json(std::size_t)>& given_up) {
  std::error_code ignored;
  const int lock = ::open(file(index, "held").c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_APPEND, 0600);
  if (lock < 0) {
    if (!fs::exists(folder_, ignored))
      known_done_.assign(known_done_.size(), true);  // all is done, and removed
    if (known_done_[index]) return std::nullopt;
    throw BadInput(Reason::cannot_write,
                   fmt::format("{}: {}", file(index, "held").string(), system_message(errno)));
  }
  const auto leave = [&] {
    ::close(lock);
    return std::nullopt;
  };
  if (::flock(lock, LOCK_EX | LOCK_NB) != 0) return leave();
  // The row first: where the folder is still there afterwards, the row was not removed with it.
  if (fs::exists(file(index, "row"), ignored)) {
    known_done_[index] = true;
    return leave();
  }
  if (!fs::exists(folder_, ignored)) {
    known_done_.assign(known_done_.size(), true);
    return leave();
  }
  // A byte for each process that began it.
  const auto begun = fs::file_size(file(index, "held"), ignored);
  if (begun >= most_processes_of_an_item) {
    done({index, true, lock}, given_up(index));
    return std::nullopt;
  }
  if (::write(lock, "+", 1) != 1) {
    ::close(lock);
    throw BadInput(Reason::cannot_write,
                   fmt::format("{}: {}", file(index, "held").string(), system_message(errno)));
  }
  return Item{index, begun > 0, lock};
}

std::optional<SharedWork::Item> SharedWork::next(const std::function<Json(std::size_t)>& given_up) {
  while (!std::ranges::all_of(known_done_, [](bool done) { return done; })) {
    for (std::size_t i = 0; i < known_done_.size(); ++i)
      if (!known_done_[i])
        if (const auto item = take(i, given_up)) return item;
    if (!std::ranges::all_of(known_done_, [](bool done) { return done; }))
      std::this_thread::sleep_for(look_again);
  }
  return std::nullopt;
}

void SharedWork::done(const Item& item, const Json& row) {
  write_or_throw(file(item.index, "row"), row);
  known_done_[item.index] = true;
  ::close(item.lock);
}

bool SharedWork::finish(const std::function<void(const std::vector<Json>&)>& summarise) {
  std::error_code ignored;
  if (!fs::exists(folder_, ignored)) return false;
  // One that comes after the folder's end would begin anew.
  for (const auto until = std::chrono::steady_clock::now() + longest_arrival;
       std::chrono::steady_clock::now() < until && fs::exists(folder_, ignored) &&
       fs::file_size(folder_ / "arrived", ignored) < processes_;)
    std::this_thread::sleep_for(look_again);
  const auto lock = FileLock::of(folder_ / "names.json");
  if (!lock || !fs::exists(folder_ / "names.json", ignored)) return false;
  std::vector<Json> rows;
  for (std::size_t i = 0; i < known_done_.size(); ++i)
    rows.push_back(value_or_throw(read_json(file(i, "row"))));
  summarise(rows);
  fs::path ended = folder_;
  ended += ".ended";
  fs::rename(folder_, ended, ignored);  // at once for the others
  fs::remove_all(ended, ignored);
  return true;
}

}  // namespace helicarm::cli
