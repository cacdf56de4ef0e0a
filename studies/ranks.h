// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

namespace helicarm::study {

/// The processes that share a study's work: MPI ranks, or one process without MPI or mpirun. Create it once
/// per program. A rank that ends by an exception does not finalize MPI: mpirun then ends all ranks.
class Ranks {
 public:
  Ranks();
  ~Ranks();
  Ranks(const Ranks&) = delete;
  Ranks& operator=(const Ranks&) = delete;

  int count() const { return count_; }
  int own() const { return own_; }
  bool leads() const { return own_ == 0; }
  int on_this_machine() const { return on_this_machine_; }

  /// The values of all ranks, in order, at the leader; empty elsewhere.
  std::vector<double> gather(const std::vector<double>& values) const;
  /// The leader's values, at all ranks.
  std::vector<double> from_leader(std::vector<double> values) const;

 private:
  int count_ = 1;
  int own_ = 0;
  int on_this_machine_ = 1;
  int exceptions_;  ///< in flight at construction
};

}  // namespace helicarm::study
