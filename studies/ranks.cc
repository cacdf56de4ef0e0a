// SPDX-License-Identifier: Apache-2.0
#include "studies/ranks.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <exception>
#include <numeric>

#ifdef HELICARM_MPI
#include <mpi.h>
#endif

namespace helicarm::study {

#ifdef HELICARM_MPI

namespace {

/// MPI takes 0.3 s to initialise, so only on request.
bool started_by_mpi() {
  return std::ranges::any_of(std::array{"OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "PMIX_RANK"},
                             // Nothing here changes the environment. NOLINTNEXTLINE(concurrency-mt-unsafe)
                             [](const char* name) { return std::getenv(name) != nullptr; });
}

}  // namespace

Ranks::Ranks() : exceptions_(std::uncaught_exceptions()) {
  if (!started_by_mpi()) return;
  int threads = 0;
  MPI_Init_thread(nullptr, nullptr, MPI_THREAD_FUNNELED, &threads);
  MPI_Comm_size(MPI_COMM_WORLD, &count_);
  MPI_Comm_rank(MPI_COMM_WORLD, &own_);
  MPI_Comm here = MPI_COMM_NULL;
  MPI_Comm_split_type(MPI_COMM_WORLD, MPI_COMM_TYPE_SHARED, 0, MPI_INFO_NULL, &here);
  MPI_Comm_size(here, &on_this_machine_);
  MPI_Comm_free(&here);
}

Ranks::~Ranks() {
  int begun = 0;
  MPI_Initialized(&begun);
  if (begun && (count_ == 1 || std::uncaught_exceptions() == exceptions_)) MPI_Finalize();
}

std::vector<double> Ranks::gather(const std::vector<double>& values) const {
  if (count_ == 1) return values;
  const int size = static_cast<int>(values.size());
  std::vector<int> sizes(leads() ? std::size_t(count_) : 0);
  MPI_Gather(&size, 1, MPI_INT, sizes.data(), 1, MPI_INT, 0, MPI_COMM_WORLD);
  std::vector<int> begins(sizes.size());
  std::exclusive_scan(sizes.begin(), sizes.end(), begins.begin(), 0);
  std::vector<double> all(leads() ? std::size_t(begins.back() + sizes.back()) : 0);
  MPI_Gatherv(values.data(), size, MPI_DOUBLE, all.data(), sizes.data(), begins.data(), MPI_DOUBLE, 0,
              MPI_COMM_WORLD);
  return all;
}

std::vector<double> Ranks::from_leader(std::vector<double> values) const {
  if (count_ == 1) return values;
  int size = static_cast<int>(values.size());
  MPI_Bcast(&size, 1, MPI_INT, 0, MPI_COMM_WORLD);
  values.resize(std::size_t(size));
  MPI_Bcast(values.data(), size, MPI_DOUBLE, 0, MPI_COMM_WORLD);
  return values;
}

#else

Ranks::Ranks() : exceptions_(0) {}
Ranks::~Ranks() = default;
std::vector<double> Ranks::gather(const std::vector<double>& values) const { return values; }
std::vector<double> Ranks::from_leader(std::vector<double> values) const { return values; }

#endif

}  // namespace helicarm::study
