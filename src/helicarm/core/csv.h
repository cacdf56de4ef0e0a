// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <initializer_list>
#include <optional>
#include <string>
#include <vector>

#include "helicarm/core/failure.h"

namespace helicarm {

/// Table from a CSV file with a header line. Fields are kept as text and converted on access.
class CsvTable {
 public:
  std::size_t rows() const { return cells_.size(); }
  bool has(const std::string& column) const;
  const std::string& text(std::size_t row, const std::string& column) const;
  /// Throws BadInput (bad_value, not_finite) that names file, row and column. Independent of the locale.
  double number(std::size_t row, const std::string& column) const;
  /// Empty if the column is absent or the field is empty.
  std::optional<double> optional_number(std::size_t row, const std::string& column) const;

 private:
  friend Expected<CsvTable> read_csv(const std::filesystem::path&, std::initializer_list<const char*>,
                                     std::initializer_list<const char*>);
  std::string origin_;
  std::vector<std::string> columns_;
  std::vector<std::vector<std::string>> cells_;
};

/// Reads a comma-separated file. Every `required` column must exist; a column in neither list is
/// `unknown_key`, a control character `bad_value`.
Expected<CsvTable> read_csv(const std::filesystem::path& path, std::initializer_list<const char*> required,
                            std::initializer_list<const char*> optional);

/// A field in the form of RFC 4180: with commas, quotes or line ends in quotes.
std::string csv_field(const std::string& text);

}  // namespace helicarm
