// SPDX-License-Identifier: Apache-2.0
#include "module_description.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <limits>
#include <regex>
#include <sstream>

#include <fmt/format.h>

namespace helicarm::cli {
namespace {

using Kind = ModuleParameter::Kind;

// Slicer reads integers as int, and its slider wants less than the largest.
constexpr double largest_integer = std::numeric_limits<int>::max() - 1;

/// Digits without an exponent: Slicer counts the decimals behind the point.
std::string plain(double value) {
  std::string digits = fmt::format("{:.12f}", value);
  digits.erase(digits.find_last_not_of('0') + 1);
  if (digits.back() == '.') digits.pop_back();
  return digits;
}

std::optional<double> number_of(const std::string& word) {
  double value = 0;
  if (!word.empty() && CLI::detail::lexical_cast(word, value) && std::isfinite(value)) return value;
  return std::nullopt;
}

std::vector<std::string> split_at(const std::string& text, const std::regex& separator) {
  return {std::sregex_token_iterator(text.begin(), text.end(), separator, -1), std::sregex_token_iterator()};
}

/// Words of the limits "{a, b}" or "a or b", or of a help whose every line is "word: what it means".
std::vector<std::string> words_of_choice(const CLI::Option& option, const std::string& limits) {
  static const std::regex braces(R"(\{(.*)\})"), comma(", *"), either(" or "),
      line(R"(([A-Za-z][A-Za-z0-9_-]*): .*)"), newline("\n");
  std::smatch found;
  if (std::regex_match(limits, found, braces)) return split_at(found[1], comma);
  if (option.get_type_name().rfind("WORD", 0) != 0) return {};
  if (!limits.empty()) return split_at(limits, either);
  std::vector<std::string> words;
  for (const std::string& text : split_at(option.get_description(), newline)) {
    if (!std::regex_match(text, found, line)) return {};
    words.push_back(found[1]);
  }
  return words.size() > 1 ? words : std::vector<std::string>{};
}

/// Limits "0 to 100 mm", "512 to 1024 px in steps of 512" or "FLOAT in [0.01 - 2]".
void set_limits(ModuleParameter& parameter, const std::string& limits) {
  static const std::regex range(
      R"((?:.*\[)?(-?[0-9.e+-]+?) (?:to|-) (-?[0-9.e+-]+)(?:\D.*?)?(?: in steps of (\d+))?)");
  std::smatch found;
  if (!std::regex_match(limits, found, range)) return;
  parameter.low = number_of(found[1]);
  parameter.high = number_of(found[2]);
  if (found[3].matched) parameter.step = number_of(found[3]);
}

bool begins_with(const std::string& text, const char* regex) {
  return std::regex_search(text, std::regex(regex), std::regex_constants::match_continuous);
}

Kind kind_of_path(const CLI::Option& option) {
  if (begins_with(option.get_description(), "(?:[a-z, ]+: )?[Ff]olders? ")) return Kind::folder;
  if (begins_with(option.get_description(), ".*MetaImage, NRRD")) return Kind::volume;
  return Kind::file;
}

Kind kind_of(const CLI::Option& option, const ModuleParameter& parameter) {
  const std::string type = option.get_type_name().substr(0, option.get_type_name().find(':'));
  const bool counts = type == "INT" || type == "UINT", measures = type == "FLOAT" || type == "NUMBER";
  if (option.get_items_expected_max() == 0) return Kind::boolean;
  if (type == "PATH") return kind_of_path(option);
  if (option.get_items_expected_max() > 1) return counts || measures ? Kind::numbers : Kind::texts;
  if (!parameter.words.empty()) return Kind::choice;
  // A number is always passed on, so one without a default could not be left out.
  if ((counts || measures) && number_of(option.get_default_str()))
    return counts ? Kind::integer : Kind::number;
  return Kind::text;
}

std::string default_of(const CLI::Option& option, Kind kind) {
  if (kind == Kind::boolean) return "false";
  // A relative path would become one below the other program's folder as soon as a form shows it.
  if (kind == Kind::file || kind == Kind::folder || kind == Kind::volume) return {};
  const auto number = number_of(option.get_default_str());
  return number && (kind == Kind::integer || kind == Kind::number) ? plain(*number)
                                                                   : option.get_default_str();
}

std::string underscored(std::string name) {
  std::ranges::replace(name, '-', '_');
  return name;
}

ModuleParameter parameter_of(const CLI::Option& option) {
  ModuleParameter parameter;
  parameter.option = &option;
  // Of "--ask,--no-ask" the one that changes something.
  const auto& names = option.get_fnames().empty() ? option.get_lnames() : option.get_fnames();
  const std::string name = names.empty() ? option.get_single_name() : names.front();
  parameter.name = underscored(name);
  if (!names.empty()) parameter.flag = "--" + name;
  parameter.by_place = names.empty() && option.get_required();
  const std::string type = option.get_type_name();
  const std::string limits = type.find(':') == std::string::npos ? "" : type.substr(type.find(':') + 1);
  parameter.words = words_of_choice(option, limits);
  parameter.kind = kind_of(option, parameter);
  parameter.value = default_of(option, parameter.kind);
  if (parameter.kind == Kind::integer || parameter.kind == Kind::number) set_limits(parameter, limits);
  if (parameter.kind == Kind::integer && parameter.high)
    parameter.high = std::min(*parameter.high, largest_integer);
  return parameter;
}

/// A slider's step: a power of ten, a thousand of which span the range.
double step_of(const ModuleParameter& parameter) {
  if (parameter.step) return *parameter.step;
  if (parameter.kind == Kind::integer) return 1;
  return std::pow(10, std::floor(std::log10((*parameter.high - *parameter.low) / 1000)));
}

const char* tag_of(Kind kind) {
  switch (kind) {
    case Kind::boolean:
      return "boolean";
    case Kind::integer:
      return "integer";
    case Kind::number:
      return "double";
    case Kind::numbers:
      return "double-vector";
    case Kind::choice:
      return "string-enumeration";
    case Kind::file:
      return "file";
    case Kind::folder:
      return "directory";
    case Kind::volume:
      return "image";
    case Kind::text:
      return "string";
    case Kind::texts:
      return "string-vector";
  }
  return "string";
}

std::string element(const char* name, const std::string& text, int depth = 2) {
  return fmt::format("{:{}}<{}>{}</{}>\n", "", 2 * depth, name, xml_text(text), name);
}

/// The help, with what the form does not show: limits of a number without a default, a path's default.
std::string described(const ModuleParameter& parameter) {
  std::string text = parameter.option->get_description();
  const std::string type = parameter.option->get_type_name();
  const bool is_path = type == "PATH";
  if (!parameter.low && type.find(" to ") != std::string::npos)
    text += fmt::format(" ({})", type.substr(type.find(':') + 1));
  if (is_path && !parameter.option->get_default_str().empty())
    text += fmt::format(" (default: {} in the home folder)", parameter.option->get_default_str());
  if (parameter.kind == Kind::texts ||
      (parameter.kind == Kind::numbers && !parameter.option->get_delimiter()))
    text += " (several: separated by |)";
  if (parameter.option->get_required() && !parameter.by_place) text += " (required)";
  return text;
}

std::string label_of(const ModuleParameter& parameter) {
  std::string label = parameter.name;
  std::ranges::replace(label, '_', ' ');
  if (parameter.flag.empty())
    std::ranges::transform(label, label.begin(), [](unsigned char c) { return std::tolower(c); });
  label[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(label[0])));
  return label;
}

std::string xml_of(const ModuleParameter& parameter, int& index) {
  const bool is_file = parameter.kind == Kind::file || parameter.kind == Kind::folder;
  const char* tag = tag_of(parameter.kind);
  std::string xml = fmt::format("    <{}>\n", tag) + element("name", parameter.name, 3);
  if (!parameter.by_place) xml += element("longflag", "--" + parameter.name, 3);
  xml += element("label", label_of(parameter), 3) + element("description", described(parameter), 3);
  if (is_file || parameter.kind == Kind::volume)
    xml += element("channel", parameter.name == "out" ? "output" : "input", 3);
  if (!parameter.value.empty()) xml += element("default", parameter.value, 3);
  for (const std::string& word : parameter.words)
    if (parameter.kind == Kind::choice) xml += element("element", word, 3);
  if (parameter.low && parameter.high)
    xml += fmt::format(
        "      <constraints>\n        <minimum>{}</minimum>\n        <maximum>{}</maximum>\n"
        "        <step>{}</step>\n      </constraints>\n",
        plain(*parameter.low), plain(*parameter.high), plain(step_of(parameter)));
  if (parameter.by_place) xml += element("index", std::to_string(index++), 3);
  return xml + fmt::format("    </{}>\n", tag);
}

std::string group_of(const char* label, const char* what, const std::vector<ModuleParameter>& parameters,
                     int& index, bool is_advanced = false) {
  if (parameters.empty()) return {};
  std::string xml = is_advanced ? "  <parameters advanced=\"true\">\n" : "  <parameters>\n";
  xml += element("label", label) + element("description", what);
  for (const ModuleParameter& parameter : parameters) xml += xml_of(parameter, index);
  return xml + "  </parameters>\n";
}

const CLI::App& root_of(const CLI::App& command) {
  const CLI::App* root = &command;
  while (root->get_parent()) root = root->get_parent();
  return *root;
}

/// The command's group in `helicarm --help`.
std::string category_of(const CLI::App& command) {
  const CLI::App* top = &command;
  while (top->get_parent() && top->get_parent()->get_parent()) top = top->get_parent();
  return "Helicarm." + top->get_group();
}

}  // namespace

std::string xml_text(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    if (c == '&')
      escaped += "&amp;";
    else if (c == '<')
      escaped += "&lt;";
    else if (c == '>')
      escaped += "&gt;";
    else
      escaped += c != '\n' && (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) ? ' ' : c;
  }
  return escaped;
}

std::vector<ModuleParameter> parameters_of(const CLI::App& command) {
  std::vector<ModuleParameter> parameters;
  for (const CLI::Option* option : command.get_options())
    if (option != command.get_help_ptr() && option != command.get_version_ptr() &&
        !option->get_group().empty())
      parameters.push_back(parameter_of(*option));
  return parameters;
}

std::string command_words(const CLI::App& command) {
  const CLI::App* parent = command.get_parent();
  if (!parent) return {};
  const std::string before = command_words(*parent);
  return before.empty() ? command.get_name() : before + " " + command.get_name();
}

std::string module_description(const CLI::App& command) {
  std::vector<ModuleParameter> arguments, options, general = parameters_of(root_of(command));
  for (ModuleParameter& parameter : parameters_of(command))
    (parameter.flag.empty() ? arguments : options).push_back(std::move(parameter));
  std::erase_if(general, [&](const ModuleParameter& of_all) {  // `segment --seed` is not the seed of numbers
    return std::ranges::any_of(options, [&](const ModuleParameter& own) { return own.name == of_all.name; });
  });
  std::string xml = "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n<executable>\n";
  xml +=
      element("category", category_of(command), 1) +
      element("title", "helicarm " + command_words(command), 1) +
      element("description", command.get_description() + ".\nResearch instrument, not a medical device.", 1) +
      element("version", HELICARM_VERSION, 1) + element("documentation-url", "", 1) +
      element("license", "Apache-2.0", 1) + element("contributor", "The helicarm maintainers", 1);
  int index = 0;
  xml += group_of("Data", "What the command works on", arguments, index);
  xml += group_of("Options", "Options of the command", options, index);
  xml += group_of("Program", "Options of every command", general, index, true);
  return xml + "</executable>\n";
}

}  // namespace helicarm::cli
