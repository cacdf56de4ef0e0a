// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "helicarm/core/json.h"

namespace helicarm::cli {

/// Processes that work together.
struct Launch {
  std::string key;            ///< their common word
  std::size_t processes = 0;  ///< 0: not known
};
/// Those that mpirun (Open MPI) or srun started together with this one; none for a process that is alone.
std::optional<Launch> launch_of_environment();

/// A list of items that several processes, also of several machines, do together, by files in a folder that
/// all of them see: each takes the next item that no other holds. An item whose process ended before it was
/// done is taken over once; if that process ends too, the item is given up. Every item's row of results stays
/// in the folder until all are done.
class SharedWork {
 public:
  struct Item {
    std::size_t index;
    bool taken_over;  ///< its former process ended before it was done
    int lock;         ///< a descriptor, closed by `done`
  };

  /// What else the rows depend on, by name: the command, its options, where each case lies.
  using Terms = std::map<std::string, std::string>;

  /// `first` is called by one process before any item is taken. Throws
  /// BadInput: usage if another process has the same key for other names or terms, cannot_write.
  SharedWork(const std::filesystem::path& folder, const Launch& launch, const std::vector<std::string>& names,
             const std::function<void()>& first, const Terms& terms = {});

  /// The next item for this process; waits while others hold all that are left. None when all are done.
  /// `given_up` makes the row of an item whose processes ended.
  std::optional<Item> next(const std::function<Json(std::size_t)>& given_up);
  void done(const Item& item, const Json& row);

  /// Called when no item is left, by the process that comes first, with the rows in the order of the names;
  /// whether it was this one. The folder's files are then removed.
  bool finish(const std::function<void(const std::vector<Json>&)>& summarise);

 private:
  std::filesystem::path file(std::size_t index, const char* what) const;
  std::optional<Item> take(std::size_t index, const std::function<Json(std::size_t)>& given_up);

  std::filesystem::path folder_;
  std::size_t processes_;
  std::vector<bool> known_done_;
};

}  // namespace helicarm::cli
