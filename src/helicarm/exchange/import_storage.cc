// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <charconv>

#include <fmt/format.h>
#include <opencv2/core.hpp>

#include "helicarm/core/text.h"
#include "helicarm/exchange/import_formats.h"

namespace helicarm::exchange {
namespace {

constexpr std::size_t most_storage_bytes = 8u << 20;
constexpr int deepest_storage = 64;  // cv::FileStorage recurses without a limit

struct YamlLine {
  std::size_t column = 0;  ///< of the first letter
  std::string content;     ///< without line end, blanks around and comment
};

/// Whether the value may stand as it is: OpenCV reads a date or a word with a colon as broken numbers.
bool is_plain(std::string_view value) {
  if (value.empty() || std::string_view("[{!\"'|>&*").find(value[0]) != value.npos) return true;
  if (value[0] == '+' || value[0] == '-') value.remove_prefix(1);
  if (value == ".inf" || value == ".Inf" || value == ".nan" || value == ".NaN") return true;
  double number = 0;
  const auto [end, error] = std::from_chars(value.data(), value.data() + value.size(), number);
  return error != std::errc::invalid_argument && end == value.data() + value.size();
}

std::string with_quotes(std::string_view value) {
  std::string text = "\"";
  for (const char c : value) text.append(c == '"' || c == '\\' ? "\\" : "").append(1, c);
  return text + '"';
}

/// Open brackets less closed ones, but for those in quotes.
int open_brackets(std::string_view text) {
  int open = 0;
  bool in_quotes = false;
  for (const char c : text) {
    in_quotes = in_quotes != (c == '"');
    if (!in_quotes) open += c == '[' || c == '{' ? 1 : c == ']' || c == '}' ? -1 : 0;
  }
  return open;
}

/// Lines with content; a flow list over several lines becomes one.
std::vector<YamlLine> yaml_lines(std::string_view text) {
  std::vector<YamlLine> lines;
  int open = 0;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    std::string_view line = text.substr(at, end - at);
    at = end + 1;
    if (const auto comment = line.find(" #"); comment != line.npos && line.find_first_of("\"'") == line.npos)
      line = line.substr(0, comment);
    std::string content(trimmed(line));
    if (content.empty() || content[0] == '#' || content[0] == '%' || content == "---") continue;
    if (content == "...") break;
    const int change = open_brackets(content);
    if (open > 0)
      lines.back().content += " " + content;
    else
      lines.push_back({line.find_first_not_of(" \t"), std::move(content)});
    open = std::max(0, open + change);
  }
  return lines;
}

/// Where a key's name ends in "name: value" or "name:"; npos if the text is none.
std::size_t colon_of(std::string_view text) {
  const std::size_t quote = text.starts_with('"') || text.starts_with('\'') ? text.find(text[0], 1) : 0;
  if (quote == text.npos || text.starts_with('[') || text.starts_with('{')) return text.npos;
  const std::size_t colon = text.find(':', quote);
  return colon == text.npos || colon + 1 == text.size() || text[colon + 1] == ' ' ? colon : text.npos;
}

std::string written(std::string_view content) {
  std::string dashes;
  while (content.starts_with("- ")) {
    dashes += "- ";
    content.remove_prefix(2);
    content.remove_prefix(std::min(content.find_first_not_of(' '), content.size()));
  }
  const std::size_t colon = colon_of(content);
  if (colon == content.npos)
    return dashes + (is_plain(content) ? std::string(content) : with_quotes(content));
  std::string name(trimmed(std::string_view(content).substr(0, colon)));
  if (name.size() > 1 && (name[0] == '"' || name[0] == '\'')) name = name.substr(1, name.size() - 2);
  const std::string value(trimmed(std::string_view(content).substr(colon + 1)));
  return dashes + name + ": " + (is_plain(value) ? value : with_quotes(value));
}

/// YAML of other programs (PyYAML, ROS) in the form that cv::FileStorage reads: its first line, lists deeper
/// than their key, keys without value as "~", texts in quotes.
std::string opencv_yaml(std::string_view text) {
  const std::vector<YamlLine> lines = yaml_lines(text);
  std::string yaml = "%YAML:1.0\n---\n";
  std::vector<std::size_t> shifted;  // columns of lists that begin where their key does
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const auto& [column, content] = lines[i];
    const bool item = content.starts_with("- ") || content == "-";
    while (!shifted.empty() && (column < shifted.back() || (column == shifted.back() && !item)))
      shifted.pop_back();
    std::string line = written(content);
    const bool has_value = !line.ends_with(": ") && content.find(": !") == content.npos;
    const bool list_follows = !has_value && i + 1 < lines.size() && lines[i + 1].column == column &&
                              lines[i + 1].content.starts_with('-') && !item;
    const bool nothing_follows =
        line.ends_with(": ") && !list_follows && (i + 1 == lines.size() || lines[i + 1].column <= column);
    yaml += std::string(column + 2 * shifted.size(), ' ') + line + (nothing_follows ? "~\n" : "\n");
    if (list_follows) shifted.push_back(column);
  }
  return yaml;
}

void check_nesting(std::string_view text, bool xml, const std::string& origin) {
  int depth = 0, greatest = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    const char next = i + 1 < text.size() ? text[i + 1] : '\0';
    if (xml)
      depth += c == '<' && next != '?' && next != '!' ? (next == '/' ? -1 : 1)
               : c == '/' && next == '>'              ? -1
                                                      : 0;
    else if (c == '\n')
      depth = 0;  // a flow list is in one line
    else
      depth += c == '[' || c == '{' || (c == '-' && next == ' ') ? 1 : c == ']' || c == '}' ? -1 : 0;
    greatest = std::max(greatest, depth);
  }
  std::size_t deepest_column = 0;
  if (!xml)
    for (const YamlLine& line : yaml_lines(text)) deepest_column = std::max(deepest_column, line.column);
  if (greatest > deepest_storage || deepest_column > 4 * deepest_storage)
    throw BadInput(Reason::bad_value, fmt::format("{}: nested deeper than {}", origin, deepest_storage));
}

Json json_of(const cv::FileNode& node, const std::string& where) {
  if (node.isInt()) return int(node);
  if (node.isReal()) return double(node);
  if (node.isString()) {
    std::string text = std::string(node);
    return text == "~" || text == "null" ? Json() : Json(std::move(text));
  }
  if (node.isNone()) return {};
  Json json = node.isMap() ? Json::object() : Json::array();
  for (const cv::FileNode& child : node) {
    const std::string name = node.isMap() ? child.name() : "";
    if (!node.isMap())
      json.push_back(json_of(child, where));
    else if (json.contains(name))
      throw BadInput(Reason::bad_value, fmt::format("{}: {} is given twice", where,
                                                    without_control_characters(name.substr(0, 40))));
    else
      json[name] = json_of(child, where);
  }
  return json;
}

/// The end of OpenCV's message: "(13): Incorrect indentation" of a line.
std::string cause_of(const cv::Exception& error) {
  const std::string_view words = error.what();
  const std::size_t open = words.find("in function '(");
  if (open == words.npos) return without_control_characters(error.err.substr(0, 100));
  std::string cause(trimmed(std::string_view(words).substr(open + std::string_view("in function '").size())));
  std::erase(cause, '\'');
  return without_control_characters(cause.substr(0, 100));
}

}  // namespace

Json file_storage_json(std::string_view text, const std::string& origin) {
  const bool xml = text.find("<opencv_storage") != text.npos;
  if (text.size() > most_storage_bytes)
    throw BadInput(Reason::bad_size,
                   fmt::format("{}: {} bytes, limit {}", origin, text.size(), most_storage_bytes));
  const std::string heading = xml && !text.starts_with("<?xml") ? "<?xml version=\"1.0\"?>\n" : "";
  const std::string storage = xml ? heading + std::string(text) : opencv_yaml(text);
  check_nesting(storage, xml, origin);
  if (xml && storage.find("</opencv_storage>") == storage.npos)
    throw BadInput(Reason::truncated, fmt::format("{}: <opencv_storage> is not closed", origin));
  if (!xml && open_brackets(storage) > 0)
    throw BadInput(Reason::truncated, fmt::format("{}: a list does not end", origin));
  try {
    const cv::FileStorage file(storage, cv::FileStorage::READ | cv::FileStorage::MEMORY);
    const cv::FileNode root = file.root();
    return root.isMap() ? json_of(root, origin) : Json::object();
  } catch (const cv::Exception& error) {
    throw BadInput(Reason::bad_value,
                   fmt::format("{}: OpenCV's FileStorage does not read it: {}", origin, cause_of(error)));
  }
}

}  // namespace helicarm::exchange
