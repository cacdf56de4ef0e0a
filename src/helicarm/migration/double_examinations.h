// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "helicarm/migration/migrate.h"

namespace helicarm::migration {

/// Two examinations between which nothing moved, or a migration to be known.
struct NamedMigration {
  std::string first, second;  ///< the examinations' names
  Migration migration;
};

/// One of the six numbers over the double examinations.
struct ZeroMotion {
  double mean = 0;
  double sd = 0;            ///< about the mean, n - 1
  double limit_95 = 0;      ///< of a single examination: the mean and t(n - 1) standard deviations about it
  double stated_sigma = 0;  ///< root mean square of the standard deviations that the migrations state
};

/// Precision of a body's migration by double examinations: rotations in degrees, then translations in mm.
struct Precision {
  std::string body;
  int n = 0;
  std::array<ZeroMotion, 6> numbers = {};
  double mtpm_mean_mm = 0, mtpm_largest_mm = 0;
};

/// Of each body that two double examinations or more have.
std::vector<Precision> precision_of(const std::vector<NamedMigration>& doubles);

}  // namespace helicarm::migration
