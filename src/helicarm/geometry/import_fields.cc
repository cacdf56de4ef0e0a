// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "helicarm/geometry/import_formats.h"

namespace helicarm::geometry {
namespace {

constexpr std::size_t deepest = 32, most_fields = 1000000;

[[noreturn]] void malformed(const std::string& origin, std::string_view what) {
  throw BadInput(Reason::bad_value, fmt::format("{}: {}", origin, what));
}

std::string joined(const std::vector<std::string>& names) {
  std::string path;
  for (const std::string& name : names) path.append(1, '/').append(name);
  return path;
}

/// Indentation of a line; npos of an empty one.
std::size_t depth_of(std::string_view line) { return line.find_first_not_of(" \t\r"); }

}  // namespace

std::vector<FileField> xml_fields(std::string_view text, const std::string& origin) {
  std::vector<FileField> fields;
  std::vector<std::string> open;
  std::size_t content = 0;
  for (std::size_t at = text.find('<'); at != text.npos; at = text.find('<', at)) {
    const std::size_t start = at;
    const bool comment = text.substr(at).starts_with("<!--");
    const std::size_t end = comment ? text.find("-->", at) : text.find('>', at);
    if (end == text.npos)
      throw BadInput(Reason::truncated, fmt::format("{}: an XML tag does not end", origin));
    const std::string_view tag = text.substr(at + 1, end - at - 1);
    at = end + 1;
    if (comment || tag.starts_with('!') || tag.starts_with('?')) continue;
    const bool closing = tag.starts_with('/'), empty = tag.ends_with('/');
    std::string name = trimmed(tag.substr(closing, tag.find_first_of(" \t\r\n/", closing) - closing));
    if (!closing) open.push_back(name);
    if (open.size() > deepest || fields.size() > most_fields) malformed(origin, "too many XML elements");
    if (closing && (open.empty() || open.back() != name))
      malformed(origin, fmt::format("</{}> closes no XML element", name.substr(0, 40)));
    if (closing || empty) {
      fields.push_back({joined(open), closing ? std::string(text.substr(content, start - content)) : ""});
      open.pop_back();
    }
    content = at;
  }
  if (!open.empty())
    throw BadInput(Reason::truncated,
                   fmt::format("{}: <{}> is not closed", origin, open.back().substr(0, 40)));
  return fields;
}

std::vector<FileField> yaml_fields(std::string_view text, const std::string& origin) {
  std::vector<FileField> fields;
  std::vector<std::pair<std::size_t, std::string>> keys;  // indentation, name
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    const std::string_view line = text.substr(at, end - at);
    at = end + 1;
    const std::size_t depth = depth_of(line), colon = line.find(": "), last = line.find_last_not_of(" \t\r");
    const bool key_alone = last != line.npos && line[last] == ':';
    if (depth == line.npos || line[depth] == '#' || line[depth] == '%' || line[depth] == '-') continue;
    if (colon == line.npos && !key_alone) continue;
    const std::size_t name_end = colon == line.npos ? last : colon;
    while (!keys.empty() && keys.back().first >= depth) keys.pop_back();
    keys.emplace_back(depth, trimmed(line.substr(depth, name_end - depth)));
    if (keys.size() > deepest || fields.size() > most_fields) malformed(origin, "too many YAML keys");
    std::string path;
    for (const auto& key : keys) path.append(1, '/').append(key.second);
    std::string value = trimmed(line.substr(name_end + 1));
    if (value.starts_with('[') && value.find(']') == value.npos) {  // a list over several lines
      const std::size_t closed = text.find(']', at);
      if (closed == text.npos)
        throw BadInput(Reason::truncated, fmt::format("{}: {}: the list does not end", origin, path));
      value.append(1, ' ').append(text.substr(at, closed + 1 - at));
      at = std::min(text.find('\n', closed), text.size() - 1) + 1;
    }
    fields.push_back({std::move(path), std::move(value)});
  }
  return fields;
}

}  // namespace helicarm::geometry
