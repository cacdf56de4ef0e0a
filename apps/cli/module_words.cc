// SPDX-License-Identifier: Apache-2.0
#include "module_words.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>

#include "module_description.h"

namespace helicarm::cli {
namespace {

constexpr std::array of_slicer_alone = {"returnparameterfile", "processinformationaddress"};

std::string without_blanks(const std::string& text) {
  const std::size_t first = text.find_first_not_of(" \t"), last = text.find_last_not_of(" \t");
  return first == std::string::npos ? std::string{} : text.substr(first, last - first + 1);
}

/// Also as a slider gives it back.
bool is_default(const ModuleParameter& parameter, const std::string& value) {
  const std::string& own = parameter.option->get_default_str();
  double number = 0, of_default = 0;
  return value == own ||
         (parameter.kind != ModuleParameter::Kind::text && CLI::detail::lexical_cast(value, number) &&
          CLI::detail::lexical_cast(own, of_default) &&
          std::abs(number - of_default) <= 1e-9 * std::abs(of_default));
}

/// Values of one field of a form.
std::vector<std::string> values_in(const ModuleParameter& parameter, const std::string& text) {
  std::vector<std::string> values;
  const bool is_list = parameter.option->get_items_expected_max() > 1;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = is_list ? std::min(text.find('|', begin), text.size()) : text.size();
    const std::string value = without_blanks(text.substr(begin, end - begin));
    if (!value.empty()) values.push_back(value);
    begin = end + 1;
  }
  return values;
}

void append(std::vector<std::string>& words, const ModuleParameter& parameter, const std::string& text) {
  if (!parameter.by_place && is_default(parameter, without_blanks(text))) return;
  for (const std::string& value : values_in(parameter, text))
    words.push_back(parameter.flag.empty() ? value : parameter.flag + "=" + value);
}

}  // namespace

const CLI::App* command_named(const CLI::App& program, std::span<const std::string>& words) {
  const CLI::App* command = &program;
  const auto of_name = [](const std::string& name) {
    return [&name](const CLI::App* app) { return app->get_name() == name; };
  };
  while (!words.empty()) {
    const auto inner = command->get_subcommands(of_name(words.front()));
    if (inner.empty()) break;
    command = inner.front();
    words = words.subspan(1);
  }
  const bool is_group = !command->get_subcommands([](const CLI::App*) { return true; }).empty();
  return is_group ? nullptr : command;
}

std::vector<std::string> words_of_module(const CLI::App& command, std::span<const std::string> words) {
  std::vector<ModuleParameter> parameters = parameters_of(command), places;
  std::ranges::copy_if(parameters, std::back_inserter(places), &ModuleParameter::by_place);
  const CLI::App* root = &command;
  while (root->get_parent()) root = root->get_parent();
  std::ranges::move(parameters_of(*root), std::back_inserter(parameters));  // after the command's own
  std::vector<std::string> own, by_place, optional;                         // optional arguments come last
  std::size_t index = 0;
  for (std::size_t i = 0; i < words.size(); ++i) {
    const std::string& word = words[i];
    const bool is_flag = word.starts_with("--");
    const auto name = is_flag ? word.substr(2) : std::string{};
    const bool has_value = i + 1 < words.size();
    const auto known = std::ranges::find(parameters, name, &ModuleParameter::name);
    if (std::ranges::find(of_slicer_alone, name) != of_slicer_alone.end())
      ++i;
    else if (is_flag && known == parameters.end())
      own.push_back(word);  // refused by the program, or --help
    else if (is_flag && (known->kind == ModuleParameter::Kind::boolean || !has_value))
      own.push_back(known->flag.empty() ? word : known->flag);
    else if (is_flag)
      append(known->flag.empty() ? optional : own, *known, words[++i]);
    else if (index < places.size())
      append(by_place, places[index++], word);
    else
      by_place.push_back(word);
  }
  own.insert(own.end(), by_place.begin(), by_place.end());
  own.insert(own.end(), optional.begin(), optional.end());
  return own;
}

std::string module_name(const CLI::App& command) {
  std::string name = "Helicarm";
  bool begins_word = true;
  for (const char c : command_words(command)) {
    if (std::isalnum(static_cast<unsigned char>(c)))
      name += begins_word ? static_cast<char>(std::toupper(static_cast<unsigned char>(c))) : c;
    begins_word = !std::isalnum(static_cast<unsigned char>(c));
  }
  return name;
}

}  // namespace helicarm::cli
