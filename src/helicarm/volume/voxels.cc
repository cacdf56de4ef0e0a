// SPDX-License-Identifier: Apache-2.0
#include "helicarm/volume/voxels.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <new>

#include <fmt/format.h>
#define ZLIB_CONST
#include <zlib.h>

#include "helicarm/core/files.h"
#include "helicarm/xray/dicom_elements.h"

namespace helicarm::volume {
namespace {

template <class Stored>
void decode(std::string_view bytes, bool swap, std::vector<float>& voxels, const std::string& origin) {
  const char* from = bytes.data();
  for (float& voxel : voxels) {
    char word[sizeof(Stored)];
    std::memcpy(word, from, sizeof word);
    if (swap) std::reverse(word, word + sizeof word);
    Stored stored;
    std::memcpy(&stored, word, sizeof word);
    voxel = static_cast<float>(stored);
    if constexpr (std::is_floating_point_v<Stored>)
      if (!std::isfinite(voxel))
        throw BadInput(Reason::not_finite,
                       fmt::format("{}: voxel {} is {}", origin,
                                   static_cast<std::size_t>(from - bytes.data()) / sizeof word, stored));
    from += sizeof word;
  }
}

// One byte of deflate yields at most 1032 (RFC 1951: 258 bytes for two bits).
constexpr std::size_t most_from_a_byte = 1032;
// Limit of an uncompressed file: the voxels after the longest header. zlib counts in 32 bits.
constexpr std::size_t most_unpacked = max_volume_bytes + 1'000'000;

/// zlib or gzip data, decompressed piece by piece; the members of a gzip file follow one another.
class Inflater {
 public:
  Inflater(std::string_view packed, const std::string& origin) : origin_(origin) {
    constexpr int zlib_or_gzip = 15 + 32;
    if (inflateInit2(&stream_, zlib_or_gzip) != Z_OK) throw std::bad_alloc();
    stream_.next_in = reinterpret_cast<const Bytef*>(packed.data());
    stream_.avail_in = static_cast<uInt>(packed.size());
  }
  ~Inflater() { inflateEnd(&stream_); }
  Inflater(const Inflater&) = delete;
  Inflater& operator=(const Inflater&) = delete;

  /// Number of bytes written, less than `size` at the end only.
  std::size_t take(char* out, std::size_t size) {
    stream_.next_out = reinterpret_cast<Bytef*>(out);
    stream_.avail_out = static_cast<uInt>(size);
    while (stream_.avail_out > 0 && !ended_) {
      const int state = ::inflate(&stream_, Z_SYNC_FLUSH);
      if (state == Z_STREAM_END) {
        next_member();
      } else if (state == Z_BUF_ERROR || (state == Z_OK && stream_.avail_in == 0 && stream_.avail_out > 0)) {
        ended_ = true;  // the data are cut
      } else if (state != Z_OK) {
        throw BadInput(Reason::bad_value, fmt::format("{}: the compressed voxels are damaged after {} bytes",
                                                      origin_, before_ + stream_.total_out));
      }
    }
    return size - stream_.avail_out;
  }
  /// Bytes behind the last member, without padding.
  std::size_t trailing() const { return ended_ ? trailing_ : 0; }

 private:
  void next_member() {
    const std::string_view rest(reinterpret_cast<const char*>(stream_.next_in), stream_.avail_in);
    if (rest.starts_with("\x1f\x8b")) {
      before_ += stream_.total_out;
      inflateReset(&stream_);
      return;
    }
    ended_ = true;
    if (rest.find_first_not_of(std::string_view("\0\r\n", 3)) != std::string_view::npos)
      trailing_ = rest.size();
  }

  z_stream stream_{};
  const std::string& origin_;
  std::size_t before_ = 0, trailing_ = 0;
  bool ended_ = false;
};

}  // namespace

std::size_t VoxelFormat::bytes() const {
  switch (kind) {
    case Kind::int8:
    case Kind::uint8:
      return 1;
    case Kind::int16:
    case Kind::uint16:
      return 2;
    case Kind::int32:
    case Kind::uint32:
    case Kind::float32:
      return 4;
    default:
      return 8;
  }
}

std::vector<float> decode_voxels(std::string_view bytes, std::size_t count, const VoxelFormat& format,
                                 const std::string& origin) {
  if (bytes.size() / format.bytes() < count)
    throw BadInput(Reason::truncated, fmt::format("{}: {} bytes of voxels, {} are needed", origin,
                                                  bytes.size(), count * format.bytes()));
  std::vector<float> voxels(count);
  using Kind = VoxelFormat::Kind;
  const auto as = [&]<class Stored>(Stored) { decode<Stored>(bytes, format.big_endian, voxels, origin); };
  switch (format.kind) {
    case Kind::int8:
      as(std::int8_t{});
      break;
    case Kind::uint8:
      as(std::uint8_t{});
      break;
    case Kind::int16:
      as(std::int16_t{});
      break;
    case Kind::uint16:
      as(std::uint16_t{});
      break;
    case Kind::int32:
      as(std::int32_t{});
      break;
    case Kind::uint32:
      as(std::uint32_t{});
      break;
    case Kind::int64:
      as(std::int64_t{});
      break;
    case Kind::uint64:
      as(std::uint64_t{});
      break;
    case Kind::float32:
      as(float{});
      break;
    case Kind::float64:
      as(double{});
      break;
  }
  return voxels;
}

std::string inflate(std::string_view packed, std::size_t size, const std::string& origin,
                    std::size_t* surplus) {
  const auto short_of = [&](std::size_t found) {
    return BadInput(Reason::truncated, fmt::format("{}: {} compressed bytes hold at most {}, {} are needed",
                                                   origin, packed.size(), found, size));
  };
  if (size > most_unpacked)
    throw BadInput(Reason::bad_size,
                   fmt::format("{}: {} bytes after decompression, limit {}", origin, size, most_unpacked));
  if (size / most_from_a_byte > packed.size()) throw short_of(packed.size() * most_from_a_byte);
  Inflater inflater(packed, origin);
  std::string bytes(size, '\0');
  const std::size_t found = inflater.take(bytes.data(), size);
  if (found < size) throw short_of(found);
  if (!surplus) return bytes;
  std::string aside(std::size_t{1} << 16, '\0');
  *surplus = 0;
  for (std::size_t more = 1; more > 0 && *surplus < most_surplus; *surplus += more)
    more = inflater.take(aside.data(), aside.size());
  *surplus += inflater.trailing();
  return bytes;
}

std::string inflate_end(std::string_view packed, std::size_t size, const std::string& origin) {
  if (size > most_unpacked || size / most_from_a_byte > packed.size()) return inflate(packed, size, origin);
  Inflater inflater(packed, origin);
  constexpr std::size_t chunk = std::size_t{1} << 20;
  std::string bytes;
  for (std::size_t total = 0, more = chunk; more == chunk; total += more) {
    if (total > most_unpacked)
      throw BadInput(Reason::bad_size,
                     fmt::format("{}: over {} bytes after decompression", origin, most_unpacked));
    // Of what is decompressed only the end is kept.
    if (bytes.size() > 2 * size + chunk) bytes.erase(0, bytes.size() - size);
    const std::size_t before = bytes.size();
    bytes.resize(before + chunk);
    more = inflater.take(bytes.data() + before, chunk);
    bytes.resize(before + more);
  }
  if (bytes.size() < size)
    throw BadInput(Reason::truncated, fmt::format("{}: {} compressed bytes hold {}, {} are needed", origin,
                                                  packed.size(), bytes.size(), size));
  return bytes.substr(bytes.size() - size);
}

void warn_of_surplus(Volume& volume, std::size_t surplus, std::size_t needed, const std::string& origin) {
  if (surplus == 0) return;
  volume.warnings.push_back(
      {Reason::surplus_data,
       fmt::format("{}: {}{} bytes follow the {} bytes of the {} x {} x {} voxels that the header states: "
                   "check its size, or remove them",
                   origin, surplus >= most_surplus ? "over " : "", std::min(surplus, most_surplus), needed,
                   volume.size.x(), volume.size.y(), volume.size.z()),
       {},
       {{"surplus_bytes", double(surplus)}, {"voxel_bytes", double(needed)}}});
}

void warn_of_surplus(Volume& volume, std::string_view behind, std::size_t needed, const std::string& origin) {
  if (behind != "\n" && behind != "\r\n") warn_of_surplus(volume, behind.size(), needed, origin);
}

double uneven_mm(double usual_mm) {
  // The relative part allows for more rounding in thick slices.
  return std::max(std::min(0.1, 0.25 * usual_mm), 0.02 * usual_mm);
}

void check_spacings(const Eigen::Vector3d& spacings, const std::string& field) {
  if ((spacings.array() > 0).all()) return;
  throw BadInput(
      Reason::bad_value,
      fmt::format("{} is {:.6g} {:.6g} {:.6g}, must be positive: programs mirror the volume or not; "
                  "write it again with its orientation in the axes' directions",
                  field, spacings.x(), spacings.y(), spacings.z()));
}

Warning size_not_stated(const std::string& field) {
  return {Reason::spacing_missing,
          field + " is missing: 1 is assumed, in the file's unit (mm unless it says so)",
          {},
          {{"assumed", 1}}};
}

bool differ(double a, double b, double part) {
  return !(std::abs(a - b) <= part * std::max(std::abs(a), std::abs(b)));
}

std::vector<double> read_numbers(std::string_view text, std::size_t count, const std::string& origin,
                                 std::string_view separators) {
  std::vector<double> numbers;
  const std::string between = " \t\r\n" + std::string(separators);
  for (std::size_t at = text.find_first_not_of(between);
       at != std::string_view::npos && numbers.size() <= count;) {
    const std::size_t end = std::min(text.find_first_of(between, at), text.size());
    std::string_view word = text.substr(at, end - at);
    if (word.starts_with('+')) word.remove_prefix(1);
    double number = 0;
    const auto [stop, error] = std::from_chars(word.data(), word.data() + word.size(), number);
    if (error != std::errc{} || stop != word.data() + word.size())
      throw BadInput(Reason::bad_value, fmt::format("{}: {} is not a number", origin, xray::quote(word)));
    if (!std::isfinite(number))
      throw BadInput(Reason::not_finite, fmt::format("{}: {} is not finite", origin, xray::quote(word)));
    numbers.push_back(number);
    at = text.find_first_not_of(between, end);
  }
  if (numbers.size() != count)
    throw BadInput(Reason::bad_value,
                   fmt::format("{}: {} must be {} number(s)", origin, xray::quote(text), count));
  return numbers;
}

std::string read_volume_file(const std::filesystem::path& path) {
  return value_or_throw(read_file(path, max_volume_bytes));
}

std::string read_data_file(const std::filesystem::path& header, const std::string& name) {
  return read_volume_file(
      value_or_throw(path_inside(header.parent_path().empty() ? "." : header.parent_path(), name)));
}

std::string_view take_line(std::string_view& rest) {
  const std::size_t end = rest.find('\n');
  const std::string_view line = rest.substr(0, end);
  rest.remove_prefix(end == std::string_view::npos ? rest.size() : end + 1);
  return line.ends_with('\r') ? line.substr(0, line.size() - 1) : line;
}

}  // namespace helicarm::volume
