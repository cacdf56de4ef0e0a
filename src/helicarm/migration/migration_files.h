// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "helicarm/core/json.h"
#include "helicarm/migration/double_examinations.h"

namespace helicarm::migration {

/// What is asked for: a migration, and double examinations of the same segments.
struct MigrationRequest {
  std::filesystem::path first, second;
  std::vector<std::pair<std::filesystem::path, std::filesystem::path>> doubles = {};
  std::optional<int> frame = {};  ///< of each examination that is a markers.csv of several frames
  std::optional<std::filesystem::path> axes = {};  ///< CSV axis,x,y,z
  MigrationOptions options = {};
};

struct MigrationAnswer {
  NamedMigration migration;
  std::vector<NamedMigration> doubles;
  std::vector<Precision> precision;
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();
};

/// Reads the examinations and computes everything; the double examinations against the migration's reference.
/// Fails as `read_exam`, `migrate` and `require_new_exams`; a failure of a double examination names it.
Expected<MigrationAnswer> answer(const MigrationRequest& request);

/// The same, written into the folder, from which what was written earlier is removed: the three files, of a
/// refusal (exit code 3) migration.json alone, of unusable input none.
Expected<MigrationAnswer> answer_into(const MigrationRequest& request, const std::filesystem::path& folder);

/// Of the migration, then of each double examination, which they name.
std::vector<Warning> all_warnings(const MigrationAnswer& answer);

/// Columns x, y, z of a CSV `axis,x,y,z` whose rows are named x, y and z: unit vectors in the first
/// examination's laboratory. bad_value where they are not perpendicular and right-handed.
Expected<Eigen::Matrix3d> read_axes(const std::filesystem::path& path);

/// migration.json, migration.csv (docs/formats.md) and report.html.
Json to_json(const MigrationAnswer& answer);
Json refused_json(const Failure& refusal);
std::string migration_csv(const MigrationAnswer& answer);
std::string migration_report(const MigrationAnswer& answer);

/// Writes the three files.
Expected<void> write_migration(const MigrationAnswer& answer, const std::filesystem::path& folder);

/// Removes what `write_migration` wrote into the folder earlier.
void forget_migration(const std::filesystem::path& folder);

}  // namespace helicarm::migration
