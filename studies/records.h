// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <span>
#include <vector>

namespace helicarm::study {

/// A record is a struct of doubles only: the form in which blocks return their results to the engine.
template <class Record>
inline constexpr std::size_t numbers_in = sizeof(Record) / sizeof(double);

template <class Record>
using NumbersOf = std::array<double, numbers_in<Record>>;

template <class Record>
NumbersOf<Record> numbers_of(const Record& record) {
  return std::bit_cast<NumbersOf<Record>>(record);
}

/// Writes a record to the front of `to`, and advances `to`.
template <class Record>
void put_record(const Record& record, std::span<double>& to) {
  std::ranges::copy(numbers_of(record), to.begin());
  to = to.subspan(numbers_in<Record>);
}

/// Takes a record from the front of `from`.
template <class Record>
Record take_record(std::span<const double>& from) {
  NumbersOf<Record> numbers;
  std::copy_n(from.begin(), numbers.size(), numbers.begin());
  from = from.subspan(numbers.size());
  return std::bit_cast<Record>(numbers);
}

/// The first `count` records.
template <class Record>
std::vector<Record> records_of(std::span<const double> from, std::size_t count) {
  std::vector<Record> records;
  while (records.size() < count) records.push_back(take_record<Record>(from));
  return records;
}

}  // namespace helicarm::study
