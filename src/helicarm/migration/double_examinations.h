// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>
#include <string>
#include <utility>
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
  double sd = 0;        ///< about the mean, n - 1
  double limit_95 = 0;  ///< t(n - 1) standard deviations: of a patient's migration about zero, without bias
  double stated_sigma = 0;  ///< root mean square of the standard deviations that the migrations state
};

/// Precision of a body's migration by double examinations: rotations in degrees, then translations in mm.
struct Precision {
  std::string body;
  int n = 0;
  std::array<ZeroMotion, 6> numbers = {};
  double mtpm_mean_mm = 0, mtpm_largest_mm = 0;
};

using ExamPair = std::pair<Exam, Exam>;

/// Throws bad_value for a pair with an examination of an earlier one, by its markers' places and in either
/// order: their migrations are not independent, and the standard deviation about their mean is too small.
void require_new_exams(const ExamPair& pair, const std::vector<ExamPair>& earlier);

/// Of each body that two double examinations or more have; all migrate against the same reference.
std::vector<Precision> precision_of(const std::vector<NamedMigration>& doubles);

}  // namespace helicarm::migration
