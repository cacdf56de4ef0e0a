// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace helicarm::volume {

/// Lines `field: value` of a NRRD header up to an empty one, removed from `rest`. Letters of either case, as
/// Teem reads them. All members throw BadInput; the message names file, field and value.
class NrrdHeader {
 public:
  /// Throws bad_value (no field, a field twice), unknown_key.
  NrrdHeader(std::string_view& rest, std::string origin);

  std::string field(const std::string& name) const;
  const std::string& origin() const { return origin_; }
  bool ended_without_blank() const { return detached_end_; }
  /// As in the file; empty if the field is absent.
  std::string text(const std::string& name) const;
  /// In small letters, words one blank apart.
  std::string word(const std::string& name) const;
  /// Values in quotes, or apart by blanks; in small letters.
  std::vector<std::string> words(const std::string& name) const;
  /// Empty if the field is absent.
  std::vector<double> numbers(const std::string& name, std::size_t count) const;
  /// 0 if the field is absent.
  double whole_number(const std::string& name, double low, double high) const;

 private:
  std::string origin_;
  std::map<std::string, std::string> values_;
  bool detached_end_ = false;
};

}  // namespace helicarm::volume
