// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

namespace helicarm {

/// The processes that share a study's work: MPI's ranks, or one alone where MPI is not built in or the
/// program was not started by mpirun or the like. One at a time, once in a program. A rank that leaves by an
/// exception takes no leave of the others: mpirun then ends them all.
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

  /// Every rank's values, one rank after the other, at the leader; empty elsewhere.
  std::vector<double> gather(const std::vector<double>& values) const;
  /// The leader's values, everywhere.
  std::vector<double> from_leader(std::vector<double> values) const;

 private:
  int count_ = 1;
  int own_ = 0;
  int on_this_machine_ = 1;
  int exceptions_;  ///< on the way when the ranks met
};

}  // namespace helicarm
