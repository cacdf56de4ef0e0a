// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace helicarm::exchange {

/// Groups, numbers and texts of a small HDF5 file in memory (HDF5 File Format Specification 3.0). Libraries
/// take such files as trustworthy; this reader checks each offset and follows hard links within the file
/// only. It reads one-dimensional datasets of at most 64 elements: IEEE 754 little endian, or text of fixed
/// or variable length; compact, contiguous or in one chunk, as it is or deflated. All functions throw
/// BadInput: `truncated` (an offset outside the file), `bad_value`, `unsupported`, `not_finite`.
class Hdf5File {
 public:
  using Links = std::map<std::string, std::uint64_t>;  ///< names and addresses

  /// `bytes` must outlive the object; `origin` begins the messages.
  Hdf5File(std::string_view bytes, std::string origin) : bytes_(bytes), origin_(std::move(origin)) {}

  static bool is_one(std::string_view bytes) { return bytes.starts_with("\x89HDF\r\n\x1a\n"); }

  Links root() const;
  Links links(std::uint64_t group) const;
  std::vector<double> numbers(std::uint64_t dataset) const;
  /// Without the zeros behind it.
  std::string text(std::uint64_t dataset) const;

 private:
  struct Message {
    int type;
    std::string_view body;
  };
  struct Dataset {
    std::string_view type;  ///< the datatype's message
    std::string raw;        ///< its elements
    std::size_t element_bytes;
  };
  struct Node {
    int level, entries;
    std::uint64_t address;  ///< of the first key
  };

  [[noreturn]] void refuse(const std::string& what) const;
  std::string_view part(std::uint64_t at, std::uint64_t size) const;
  std::uint64_t number(std::uint64_t at, int size = 8) const;
  std::uint64_t field(std::string_view body, std::size_t at, int size = 8) const;
  std::vector<Message> messages(std::uint64_t header) const;
  std::string_view message(const std::vector<Message>& all, int type) const;
  Node node(std::uint64_t at, int type) const;
  void add_symbols(std::uint64_t at, std::uint64_t names, int level, int& budget, Links& links) const;
  void add_link(std::string_view body, Links& links) const;
  Dataset dataset(std::uint64_t header) const;
  std::string chunk(const std::vector<Message>& all, std::string_view layout, std::size_t bytes) const;
  std::string inflated(std::string_view packed, std::size_t bytes) const;
  std::string heap_text(std::string_view reference) const;

  std::string_view bytes_;
  std::string origin_;
};

}  // namespace helicarm::exchange
