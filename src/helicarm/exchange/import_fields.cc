// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "helicarm/exchange/import_formats.h"

namespace helicarm::exchange {
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
    std::string name(trimmed(tag.substr(closing, tag.find_first_of(" \t\r\n/", closing) - closing)));
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

}  // namespace helicarm::exchange
