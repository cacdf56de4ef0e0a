// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/vtp.h"

#include <cmath>
#include <cstring>
#include <map>
#include <optional>

#include <fmt/format.h>

#include "helicarm/core/text.h"
#include "helicarm/registration/surface.h"
#include "helicarm/volume/declared.h"
#include "helicarm/volume/voxels.h"

namespace helicarm::registration {
namespace {

using Attributes = std::map<std::string, std::string, std::less<>>;

constexpr std::size_t most_values = 3 * max_triangles, most_head = 100'000;

struct Tag {
  std::string name;  ///< of an end tag with its slash
  Attributes attributes;
};

/// Tags of an XML text one after the other; comments and what is between tags are passed over.
class Tags {
 public:
  Tags(std::string_view text, const std::string& origin) : text_(text), origin_(origin) {}

  std::optional<Tag> next() {
    while ((at_ = text_.find('<', at_)) != std::string_view::npos) {
      const bool comment = text_.substr(at_).starts_with("<!--");
      const std::size_t end = text_.find(comment ? "-->" : ">", at_);
      if (end == std::string_view::npos)
        throw BadInput(Reason::truncated, fmt::format("{}: a tag has no end", origin_));
      const std::string_view inner = text_.substr(at_ + 1, end - at_ - 1);
      at_ = end + 1;
      if (!comment) return parsed(inner);
    }
    return std::nullopt;
  }
  /// What follows the tag that `next` returned.
  std::string_view rest() const { return text_.substr(at_); }

 private:
  Tag parsed(std::string_view inner) const {
    constexpr std::string_view blanks = " \t\r\n";
    Tag tag;
    tag.name = inner.substr(0, inner.find_first_of(" \t\r\n"));
    for (std::size_t at = tag.name.size();;) {
      const std::size_t equals = inner.find('=', at);
      if (equals == std::string_view::npos) return tag;
      const std::size_t open = inner.find_first_not_of(blanks, equals + 1);
      const char quote = open == std::string_view::npos ? ' ' : inner[open];
      const std::size_t close = quote == '"' || quote == '\'' ? inner.find(quote, open + 1) : open;
      if (close == open || close == std::string_view::npos)
        throw BadInput(Reason::bad_value,
                       fmt::format("{}: tag \"{}\": an attribute is not quoted", origin_, tag.name));
      tag.attributes.emplace(trimmed(inner.substr(at, equals - at)),
                             inner.substr(open + 1, close - open - 1));
      at = close + 1;
    }
  }

  std::string_view text_;
  std::size_t at_ = 0;
  const std::string& origin_;
};

/// Bytes of an array, raw or base64. Header and data may each end with padding.
class Stream {
 public:
  Stream(std::string_view text, bool base64, const std::string& origin)
      : text_(text), base64_(base64), origin_(origin) {}

  std::string take(std::size_t count) {
    if (count > text_.size() + buffer_.size()) ends();
    if (!base64_) {
      std::string taken(text_.substr(0, count));
      text_.remove_prefix(count);
      return taken;
    }
    while (buffer_.size() < count) decode_group();
    std::string taken = buffer_.substr(0, count);
    buffer_.erase(0, count);
    return taken;
  }

 private:
  [[noreturn]] void ends() const {
    throw BadInput(Reason::truncated, fmt::format("{}: ends within a DataArray", origin_));
  }
  void decode_group() {
    std::uint32_t bits = 0;
    int digits = 0, padding = 0;
    while (digits + padding < 4) {
      if (text_.empty()) ends();
      const char c = text_.front();
      text_.remove_prefix(1);
      if (c == ' ' || c == '\n' || c == '\r' || c == '\t') continue;
      constexpr std::string_view alphabet =
          "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
      const std::size_t value = alphabet.find(c);
      if (value == std::string_view::npos && c == '<') ends();
      if ((value == std::string_view::npos) != (c == '=') || (padding > 0 && c != '='))
        throw BadInput(Reason::bad_value, fmt::format("{}: a DataArray is not base64", origin_));
      c == '=' ? ++padding : ++digits;
      bits = bits << 6 | (c == '=' ? 0U : static_cast<std::uint32_t>(value));
    }
    for (int i = 0; i < 3 - padding; ++i) buffer_ += static_cast<char>(bits >> (16 - 8 * i) & 255U);
  }

  std::string_view text_;
  std::string buffer_;
  bool base64_;
  const std::string& origin_;
};

class VtpReader {
 public:
  VtpReader(std::string_view bytes, const std::string& origin)
      : bytes_(bytes), origin_(origin), tags_(bytes, origin) {}

  SurfaceFile read() {
    find_appended();
    SurfaceFile file;
    file.declares = first_comments();
    std::string group;
    for (std::optional<Tag> tag = tags_.next(); tag && tag->name != "AppendedData"; tag = tags_.next()) {
      if (tag->name == "VTKFile") begin_file(tag->attributes);
      if (tag->name == "Piece") begin_piece(tag->attributes);
      if (tag->name == "Points" || tag->name == "Polys" || tag->name == "FieldData") group = tag->name;
      if (tag->name == "/Points" || tag->name == "/Polys" || tag->name == "/FieldData") group.clear();
      if (group == "FieldData") file.declares += field_declaration({tag->attributes, tags_.rest()});
      if (tag->name == "DataArray" && (group == "Points" || group == "Polys"))
        arrays_[group == "Points" ? "points" : text(tag->attributes, "Name")] = {tag->attributes,
                                                                                 tags_.rest()};
      if (tag->name == "/Piece") end_piece();
    }
    file.mesh = std::move(mesh_);
    return file;
  }

 private:
  struct Array {
    Attributes attributes;
    std::string_view content;
  };

  [[noreturn]] void refuse(Reason reason, const std::string& what) const {
    throw BadInput(reason, fmt::format("{}: {}", origin_, what));
  }

  static std::string text(const Attributes& attributes, std::string_view key) {
    const auto found = attributes.find(key);
    return found == attributes.end() ? std::string() : found->second;
  }

  std::size_t count(const Attributes& attributes, const char* key, std::size_t limit) const {
    const std::string word = text(attributes, key);
    if (word.empty()) return 0;
    if (word.size() > 12 || word.find_first_not_of("0123456789") != std::string::npos)
      refuse(Reason::bad_value, fmt::format("{} is \"{}\", a number is expected", key, word.substr(0, 40)));
    const auto value = static_cast<std::size_t>(std::stoull(word));
    if (value > limit) refuse(Reason::bad_size, fmt::format("{} is {}, limit {}", key, value, limit));
    return value;
  }

  /// Appended data may hold any bytes: they begin after the first underscore.
  void find_appended() {
    const std::size_t tag = bytes_.find("<AppendedData");
    const std::size_t end = tag == std::string_view::npos ? tag : bytes_.find('>', tag);
    const std::size_t mark = end == std::string_view::npos ? end : bytes_.find('_', end);
    if (mark == std::string_view::npos) return;
    appended_ = bytes_.substr(mark + 1);
    raw_ = bytes_.substr(tag, end - tag).find("raw") != std::string_view::npos;
  }

  void begin_file(const Attributes& attributes) {
    if (const std::string type = text(attributes, "type"); type != "PolyData")
      refuse(Reason::unsupported, fmt::format("VTK data of type \"{}\"; save the surface as PolyData", type));
    const std::string packing = text(attributes, "compressor"), width = text(attributes, "header_type");
    if (!packing.empty() && packing != "vtkZLibDataCompressor")
      refuse(Reason::unsupported, fmt::format("compressor \"{}\"; save with zlib or without", packing));
    packed_ = !packing.empty();
    big_ = text(attributes, "byte_order") == "BigEndian";
    header_bytes_ = width == "UInt64" ? 8 : 4;
  }

  void begin_piece(const Attributes& attributes) {
    arrays_.clear();
    points_ = count(attributes, "NumberOfPoints", most_values - mesh_.corners.size());
    polygons_ = count(attributes, "NumberOfPolys", max_triangles);
    if (count(attributes, "NumberOfStrips", most_values) > 0)
      refuse(Reason::unsupported, "triangle strips; save the surface as triangles");
  }

  void end_piece() {
    const std::size_t first = mesh_.corners.size();
    const auto places = values("points", 3 * points_);
    const auto ends = values("offsets", polygons_);
    const double last = ends.empty() ? 0 : ends.back();
    if (!(last >= 0 && last <= double(most_values) && last == std::floor(last)))
      refuse(Reason::bad_size, fmt::format("the polygons have {} corners, limit {}", last, most_values));
    const auto corners = values("connectivity", static_cast<std::size_t>(last));
    for (std::size_t i = 0; i < points_; ++i)
      mesh_.corners.emplace_back(places[3 * i], places[3 * i + 1], places[3 * i + 2]);
    double begin = 0;
    for (const double end : ends) {
      if (!(end >= begin && end <= last && end == std::floor(end)))
        refuse(Reason::bad_value, "the polygons' offsets do not increase");
      add_polygon(corners, static_cast<std::size_t>(begin), static_cast<std::size_t>(end), first);
      begin = end;
    }
  }

  void add_polygon(const std::vector<double>& corners, std::size_t begin, std::size_t end,
                   std::size_t first) {
    const auto corner = [&](std::size_t k) {
      if (!(corners[k] >= 0 && corners[k] < double(points_)))
        refuse(Reason::bad_value, fmt::format("a polygon names point {} of {}", corners[k], points_));
      return static_cast<std::uint32_t>(first + static_cast<std::size_t>(corners[k]));
    };
    for (std::size_t k = begin + 2; k < end; ++k)
      mesh_.triangles.push_back({corner(begin), corner(k - 1), corner(k)});
    if (mesh_.triangles.size() > max_triangles)
      refuse(Reason::bad_size, fmt::format("more than {} triangles", max_triangles));
  }

  /// Comments before the first piece.
  std::string first_comments() const {
    std::string comments;
    const std::string_view head = bytes_.substr(0, std::min(bytes_.find("<Piece"), most_head));
    for (std::size_t at = head.find("<!--"); at != std::string_view::npos; at = head.find("<!--", at + 4)) {
      const std::size_t end = std::min(head.find("-->", at), head.size());
      comments += std::string(head.substr(at + 4, std::min(end - at - 4, longest_declaration))) + ";";
    }
    return comments;
  }

  /// "NAME=VALUE;" of an array of texts whose name may be that of a space or unit; else nothing.
  std::string field_declaration(const Array& array) const {
    const std::string name = text(array.attributes, "Name"), small = volume::small_letters(name);
    if (text(array.attributes, "type") != "String" || name.size() > longest_declaration ||
        (small.find("space") == std::string::npos && small.find("coord") == std::string::npos &&
         small.find("unit") == std::string::npos))
      return {};
    std::string value;
    if (text(array.attributes, "format") == "ascii") {
      // VTK writes the numbers of the letters, then 0.
      const std::string_view content = array.content.substr(0, array.content.find('<'));
      SurfaceWords words(content, origin_);
      for (std::string_view word = words.next(); !word.empty() && word != "0"; word = words.next()) {
        const bool number =
            word.find_first_not_of("0123456789") == std::string_view::npos && word.size() <= 3;
        value += number ? std::string(1, static_cast<char>(std::stoi(std::string(word)))) : std::string(word);
      }
    } else {
      Stream stream = stream_of(array, name);
      value = packed_ ? unpacked(stream) : stream.take(header(stream));
      value = value.substr(0, value.find('\0'));
    }
    return name + "=" + value.substr(0, longest_declaration) + ";";
  }

  /// The bytes of an array that is not text.
  Stream stream_of(const Array& array, const std::string& name) const {
    const std::string format = text(array.attributes, "format");
    if (format == "binary") return {array.content, true, origin_};
    if (format != "appended") refuse(Reason::unsupported, fmt::format("DataArray format \"{}\"", format));
    const std::size_t offset = count(array.attributes, "offset", std::size_t{1} << 31);
    if (offset >= appended_.size())
      refuse(Reason::truncated, fmt::format("DataArray \"{}\" lies beyond the file", name));
    return {appended_.substr(offset), !raw_, origin_};
  }

  std::vector<double> values(const char* name, std::size_t wanted) const {
    if (wanted == 0) return {};
    const auto found = arrays_.find(name);
    if (found == arrays_.end()) refuse(Reason::bad_value, fmt::format("DataArray \"{}\" is missing", name));
    const auto& [attributes, content] = found->second;
    const std::string format = text(attributes, "format"), type = text(attributes, "type");
    if (format == "ascii") return volume::read_numbers(content.substr(0, content.find('<')), wanted, origin_);
    return decoded(stream_of(found->second, name), type, wanted);
  }

  std::size_t header(Stream& stream) const {
    const std::string bytes = stream.take(header_bytes_);
    const double size =
        header_bytes_ == 8 ? value<std::uint64_t>(bytes.data()) : value<std::uint32_t>(bytes.data());
    if (size > 8.0 * most_values)
      refuse(Reason::bad_size, fmt::format("a DataArray has {:.0f} bytes, limit {}", size, 8 * most_values));
    return static_cast<std::size_t>(size);
  }

  std::vector<double> decoded(Stream stream, const std::string& type, std::size_t wanted) const {
    const auto [each, value_at] = kind(type);
    const std::string data = packed_ ? unpacked(stream) : stream.take(header(stream));
    if (data.size() != each * wanted)
      refuse(Reason::bad_size, fmt::format("a DataArray has {} bytes, {} values of {} need {}", data.size(),
                                           wanted, type, each * wanted));
    std::vector<double> numbers(wanted);
    for (std::size_t i = 0; i < wanted; ++i) numbers[i] = (this->*value_at)(data.data() + i * each);
    return numbers;
  }

  std::string unpacked(Stream& stream) const {
    const std::size_t blocks = header(stream), block = header(stream), last = header(stream);
    if (blocks > 0 && block > 8 * most_values / blocks)
      refuse(Reason::bad_size, fmt::format("a DataArray has {} blocks of {} bytes, limit {} bytes", blocks,
                                           block, 8 * most_values));
    std::vector<std::size_t> sizes;
    for (std::size_t i = 0; i < blocks; ++i) sizes.push_back(header(stream));
    std::string data;
    for (std::size_t i = 0; i < blocks; ++i)
      data += volume::inflate(stream.take(sizes[i]), i + 1 == blocks && last > 0 ? last : block, origin_);
    return data;
  }

  struct Kind {
    std::size_t bytes;
    double (VtpReader::*value)(const char* at) const;
  };

  template <class T>
  double value(const char* at) const {
    char raw[sizeof(T)];
    for (std::size_t i = 0; i < sizeof(T); ++i) raw[i] = at[big_ ? sizeof(T) - 1 - i : i];
    T whole;
    std::memcpy(&whole, raw, sizeof whole);
    return static_cast<double>(whole);
  }

  template <class T>
  static Kind kind_of() {
    return {sizeof(T), &VtpReader::value<T>};
  }

  Kind kind(const std::string& type) const {
    static const std::map<std::string, Kind> kinds = {
        {"Int8", kind_of<std::int8_t>()},   {"UInt8", kind_of<std::uint8_t>()},
        {"Int16", kind_of<std::int16_t>()}, {"UInt16", kind_of<std::uint16_t>()},
        {"Int32", kind_of<std::int32_t>()}, {"UInt32", kind_of<std::uint32_t>()},
        {"Int64", kind_of<std::int64_t>()}, {"UInt64", kind_of<std::uint64_t>()},
        {"Float32", kind_of<float>()},      {"Float64", kind_of<double>()}};
    const auto found = kinds.find(type);
    if (found == kinds.end()) refuse(Reason::unsupported, fmt::format("DataArray of type \"{}\"", type));
    return found->second;
  }

  std::string_view bytes_, appended_;
  const std::string& origin_;
  Tags tags_;
  bool raw_ = false, packed_ = false, big_ = false;
  std::size_t header_bytes_ = 4, points_ = 0, polygons_ = 0;
  std::map<std::string, Array, std::less<>> arrays_;
  phantom::TriangleMesh mesh_;
};

}  // namespace

bool is_vtk_xml(std::string_view bytes) {
  return bytes.starts_with("<VTKFile") ||
         (bytes.starts_with("<?xml") && bytes.substr(0, 2000).find("<VTKFile") != std::string_view::npos);
}

SurfaceFile vtp_surface(std::string_view bytes, const std::string& origin) {
  return VtpReader(bytes, origin).read();
}

}  // namespace helicarm::registration
