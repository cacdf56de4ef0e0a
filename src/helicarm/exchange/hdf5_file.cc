// SPDX-License-Identifier: Apache-2.0
#include "helicarm/exchange/hdf5_file.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include <fmt/format.h>
#include <zlib.h>

#include "helicarm/core/failure.h"

namespace helicarm::exchange {
namespace {

constexpr int most_nodes = 64, most_messages = 256, most_blocks = 16;
constexpr std::uint64_t most_elements = 64, most_element_bytes = 256, most_name_bytes = 64;

/// Types of a header's messages.
enum : int {
  dataspace = 1,
  datatype = 3,
  link = 6,
  data_layout = 8,
  filter_pipeline = 0xB,
  continuation = 0x10,
  symbol_table = 0x11
};

std::uint64_t little_endian(std::string_view bytes) {
  std::uint64_t value = 0;
  for (std::size_t i = bytes.size(); i-- > 0;) value = value << 8 | std::uint8_t(bytes[i]);
  return value;
}

std::string until_zero(std::string_view text) { return std::string(text.substr(0, text.find('\0'))); }

}  // namespace

void Hdf5File::refuse(const std::string& what) const {
  throw BadInput(Reason::unsupported, fmt::format("{}: an HDF5 file with {} is not read", origin_, what));
}

std::string_view Hdf5File::part(std::uint64_t at, std::uint64_t size) const {
  if (at > bytes_.size() || size > bytes_.size() - at)
    throw BadInput(Reason::truncated, fmt::format("{}: HDF5: {} bytes at {} lie outside the file of {} bytes",
                                                  origin_, size, at, bytes_.size()));
  return bytes_.substr(at, size);
}

std::uint64_t Hdf5File::number(std::uint64_t at, int size) const {
  return little_endian(part(at, std::uint64_t(size)));
}

std::uint64_t Hdf5File::field(std::string_view body, std::size_t at, int size) const {
  if (at > body.size() || std::size_t(size) > body.size() - at)
    throw BadInput(Reason::truncated, fmt::format("{}: HDF5: a message ends early", origin_));
  return little_endian(body.substr(at, std::size_t(size)));
}

Hdf5File::Links Hdf5File::root() const {
  const int version = int(number(8, 1));
  if (version > 3) refuse(fmt::format("superblock version {}", version));
  const bool old = version < 2;
  const std::uint64_t base = version == 0 ? 24 : version == 1 ? 28 : 12;
  if (number(old ? 13 : 9, 2) != 0x0808) refuse("offsets or lengths of other than 8 bytes");
  if (number(base) != 0) refuse("a base address");
  return links(number(old ? base + 40 : base + 24));
}

/// Of an object header of version 1, or 2 ("OHDR"), with its continuation blocks.
std::vector<Hdf5File::Message> Hdf5File::messages(std::uint64_t header) const {
  const bool second = part(header, 4) == "OHDR";
  const int flags = second ? int(number(header + 5, 1)) : 0;
  if (number(second ? header + 4 : header, 1) != (second ? 2u : 1u)) refuse("another object header");
  std::vector<std::string_view> blocks;
  if (second) {
    const std::uint64_t at = header + 6 + (flags & 0x20 ? 16 : 0) + (flags & 0x10 ? 4 : 0);
    const int width = 1 << (flags & 3);
    blocks.push_back(part(at + std::uint64_t(width), number(at, width)));
  } else {
    blocks.push_back(part(header + 16, number(header + 8, 4)));
  }
  const std::size_t head = !second ? 8 : flags & 4 ? 6 : 4;
  std::vector<Message> all;
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    std::string_view rest = blocks[i];
    while (rest.size() >= head) {
      const int type = int(field(rest, 0, second ? 1 : 2));
      const std::size_t size = field(rest, second ? 1 : 2, 2);
      if (size > rest.size() - head)
        throw BadInput(Reason::truncated, fmt::format("{}: HDF5: a message ends early", origin_));
      const std::string_view body = rest.substr(head, size);
      const bool shared = field(rest, second ? 3 : 4, 1) & 2;
      if (shared && (type == dataspace || type == datatype || type == filter_pipeline))
        refuse("shared messages");
      all.push_back({type, body});
      if (type == continuation) {
        const std::string_view block = part(field(body, 0), field(body, 8));
        if (second && (block.size() < 8 || !block.starts_with("OCHK"))) refuse("a wrong continuation");
        blocks.push_back(second ? block.substr(4, block.size() - 8) : block);
      }
      if (all.size() > most_messages || blocks.size() > most_blocks) refuse("so long an object header");
      rest.remove_prefix(head + size);
    }
  }
  return all;
}

std::string_view Hdf5File::message(const std::vector<Message>& all, int type) const {
  for (const Message& one : all)
    if (one.type == type) return one.body;
  throw BadInput(Reason::truncated, fmt::format("{}: HDF5: a dataset without message {}", origin_, type));
}

Hdf5File::Node Hdf5File::node(std::uint64_t at, int type) const {
  if (part(at, 4) != "TREE" || number(at + 4, 1) != std::uint64_t(type)) refuse("a wrong tree");
  return {int(number(at + 5, 1)), int(number(at + 6, 2)), at + 24};
}

/// `names`: address of the local heap's data.
void Hdf5File::add_symbols(std::uint64_t at, std::uint64_t names, int level, int& budget,
                           Links& links) const {
  const Node tree = node(at, 0);
  if (tree.level >= level || (budget -= tree.entries + 1) < 0) refuse("so large a group");
  for (int i = 0; i < tree.entries; ++i) {
    const std::uint64_t child = number(tree.address + 8 + 16 * std::uint64_t(i));
    if (tree.level > 0) {
      add_symbols(child, names, tree.level, budget, links);
      continue;
    }
    const int symbols = int(number(child + 6, 2));
    if (part(child, 4) != "SNOD" || (budget -= symbols) < 0) refuse("so large a group");
    for (int k = 0; k < symbols; ++k) {
      const std::uint64_t entry = child + 8 + 40 * std::uint64_t(k), name = names + number(entry);
      constexpr std::uint64_t soft_link = 2;
      part(name, 1);
      if (number(entry + 16, 4) != soft_link)
        links[until_zero(bytes_.substr(name, most_name_bytes))] = number(entry + 8);
    }
  }
}

void Hdf5File::add_link(std::string_view body, Links& links) const {
  const int flags = int(field(body, 1, 1)), width = 1 << (flags & 3);
  std::size_t at = 2;
  if (flags & 8 && field(body, at++, 1) != 0) return;  // soft or external
  at += (flags & 4 ? 8 : 0) + (flags & 0x10 ? 1 : 0);
  const std::uint64_t length = field(body, at, width);
  at += std::size_t(width);
  if (length > most_name_bytes) return;
  const std::uint64_t address = field(body, at + length);
  links[std::string(body.substr(at, length))] = address;
}

Hdf5File::Links Hdf5File::links(std::uint64_t group) const {
  Links links;
  for (const Message& one : messages(group)) {
    if (one.type == link) add_link(one.body, links);
    if (one.type != symbol_table) continue;
    const std::uint64_t heap = field(one.body, 8);
    if (part(heap, 4) != "HEAP") refuse("a wrong heap");
    int budget = most_nodes;
    constexpr int deepest = 4;
    add_symbols(field(one.body, 0), number(heap + 24), deepest, budget, links);
  }
  return links;
}

Hdf5File::Dataset Hdf5File::dataset(std::uint64_t header) const {
  const auto all = messages(header);
  const std::string_view space = message(all, dataspace), type = message(all, datatype),
                         layout = message(all, data_layout);
  const std::uint64_t rank = field(space, 1, 1);
  if (rank > 1) refuse(fmt::format("parameters of {} dimensions", rank));
  const std::uint64_t count = rank == 0 ? 1 : field(space, field(space, 0, 1) == 1 ? 8 : 4);
  const std::uint64_t element = field(type, 4, 4);
  if (count > most_elements) refuse(fmt::format("{} parameters, limit {},", count, most_elements));
  if (element > most_element_bytes) refuse(fmt::format("elements of {} bytes", element));
  const std::size_t bytes = count * element;
  const auto version = field(layout, 0, 1), kind = field(layout, 1, 1);
  if (version != 3 && version != 4) refuse(fmt::format("data layout version {}", version));
  if (bytes == 0) return {type, {}, element};
  if (kind == 2) return {type, chunk(all, layout, bytes), element};
  if (kind == 1) return {type, std::string(part(field(layout, 2), bytes)), element};
  if (kind != 0 || layout.size() < 4 + bytes) refuse("such a data layout");
  return {type, std::string(layout.substr(4, bytes)), element};
}

/// One chunk that holds all; by a tree (layout version 3) or alone (version 4).
std::string Hdf5File::chunk(const std::vector<Message>& all, std::string_view layout,
                            std::size_t bytes) const {
  bool deflated = false;
  for (const Message& one : all)
    if (one.type == filter_pipeline) {
      const std::size_t first = field(one.body, 0, 1) == 1 ? 8 : 2;
      if (field(one.body, 1, 1) != 1 || field(one.body, first, 2) != 1) refuse("filters other than deflate");
      deflated = true;
    }
  std::uint64_t address = 0, size = bytes, mask = 0;
  if (field(layout, 0, 1) == 3) {
    const Node tree = node(field(layout, 3), 1);
    if (field(layout, 2, 1) != 2 || tree.level != 0 || tree.entries != 1) refuse("several chunks");
    size = number(tree.address, 4);
    mask = number(tree.address + 4, 4);
    address = number(tree.address + 24);
  } else {
    const int flags = int(field(layout, 2, 1)), width = int(field(layout, 4, 1));
    if (field(layout, 3, 1) != 2 || width < 1 || width > 8) refuse("several chunks");
    std::size_t at = 5 + 2 * std::size_t(width);
    if (field(layout, at++, 1) != 1) refuse("several chunks");
    if (flags & 2) {
      size = field(layout, at);
      mask = field(layout, at + 8, 4);
      at += 12;
    }
    address = field(layout, at);
  }
  const std::string_view stored = part(address, size);
  if (deflated && !(mask & 1)) return inflated(stored, bytes);
  if (stored.size() < bytes) refuse("several chunks");
  return std::string(stored.substr(0, bytes));
}

std::string Hdf5File::inflated(std::string_view packed, std::size_t bytes) const {
  std::string raw(bytes, '\0');
  uLongf size = bytes;
  const int code = uncompress(reinterpret_cast<Bytef*>(raw.data()), &size,
                              reinterpret_cast<const Bytef*>(packed.data()), packed.size());
  if (code != Z_OK || size != bytes)
    throw BadInput(Reason::bad_value,
                   fmt::format("{}: HDF5: deflated data are not {} bytes (zlib {})", origin_, bytes, code));
  return raw;
}

std::vector<double> Hdf5File::numbers(std::uint64_t header) const {
  const Dataset data = dataset(header);
  using namespace std::string_view_literals;
  // Byte order and sign; offset, precision, exponent's place and size, mantissa's place and size, bias.
  constexpr auto ieee_double = "\0\0\x40\0\x34\x0B\0\x34\xFF\x03\0\0"sv;
  constexpr auto ieee_float = "\0\0\x20\0\x17\x08\0\x17\x7F\0\0\0"sv;
  const bool little = (field(data.type, 0, 1) & 15) == 1 && (field(data.type, 1, 1) & 0x41) == 0;
  const auto properties = data.type.size() >= 20 ? data.type.substr(8, 12) : "";
  const bool wide = properties == ieee_double && data.element_bytes == 8;
  if (!little || !(wide || (properties == ieee_float && data.element_bytes == 4)))
    refuse("parameters that are no little-endian float or double");
  std::vector<double> numbers;
  for (std::size_t at = 0; at < data.raw.size(); at += data.element_bytes) {
    const std::uint64_t bits = field(data.raw, at, int(data.element_bytes));
    numbers.push_back(wide ? std::bit_cast<double>(bits) : double(std::bit_cast<float>(std::uint32_t(bits))));
    if (!std::isfinite(numbers.back()))
      throw BadInput(Reason::not_finite,
                     fmt::format("{}: HDF5: parameter {} is not finite", origin_, numbers.size()));
  }
  return numbers;
}

std::string Hdf5File::text(std::uint64_t header) const {
  const Dataset data = dataset(header);
  const int kind = int(field(data.type, 0, 1) & 15);
  constexpr int fixed = 3, variable = 9;
  if (data.raw.size() != data.element_bytes) refuse("several texts in place of one");
  if (kind == fixed) return until_zero(data.raw);
  if (kind != variable || (field(data.type, 1, 1) & 15) != 1) refuse("a text that is none");
  return heap_text(data.raw);
}

/// `reference`: length, address of the global heap's collection, index.
std::string Hdf5File::heap_text(std::string_view reference) const {
  const std::uint64_t length = field(reference, 0, 4), collection = field(reference, 4);
  const std::uint64_t index = field(reference, 12, 4);
  const std::uint64_t collection_bytes = number(collection + 8);
  if (part(collection, 4) != "GCOL" || collection_bytes < 16) refuse("a wrong heap");
  std::string_view rest = part(collection, collection_bytes).substr(16);
  while (rest.size() >= 16 && field(rest, 0, 2) != 0) {
    const std::uint64_t size = field(rest, 8);
    if (size > rest.size() - 16 || length > most_element_bytes) break;
    if (field(rest, 0, 2) == index && length <= size) return until_zero(rest.substr(16, length));
    rest.remove_prefix(std::min<std::size_t>(rest.size(), 16 + (size + 7) / 8 * 8));
  }
  throw BadInput(Reason::truncated, fmt::format("{}: HDF5: a text is missing from its heap", origin_));
}

}  // namespace helicarm::exchange
