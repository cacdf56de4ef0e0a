// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cctype>
#include <span>

#include <fmt/format.h>

#include "helicarm/core/text.h"
#include "helicarm/exchange/import_formats.h"

namespace helicarm::exchange {
namespace {

using LensWord = std::string_view;

/// Keys of coefficients: Bouguet's kc, ROS' D, RealSense's coeffs, Mei's xi, tilted sensors' tau.
constexpr std::array lens_keys{LensWord("d"),          LensWord("kc"),   LensWord("camdist"),
                               LensWord("cameradist"), LensWord("xi"),   LensWord("tau"),
                               LensWord("taux"),       LensWord("tauy"), LensWord("ocam"),
                               LensWord("poly"),       LensWord("pol"),  LensWord("invpol")};
constexpr std::array lens_parts{LensWord("distort"), LensWord("kappa"),  LensWord("lens"),
                                LensWord("fisheye"), LensWord("radial"), LensWord("tangential")};
/// Models that are a pinhole where all coefficients are 0.
constexpr std::array pinhole_models{LensWord("plumbbob"),
                                    LensWord("radtan"),
                                    LensWord("radialtangential"),
                                    LensWord("brown"),
                                    LensWord("brownconrady"),
                                    LensWord("modifiedbrownconrady"),
                                    LensWord("opencv"),
                                    LensWord("inversebrownconrady"),
                                    LensWord("rationalpolynomial"),
                                    LensWord("pinhole"),
                                    LensWord("perspective"),
                                    LensWord("none"),
                                    LensWord("nodistortion"),
                                    LensWord("undistorted"),
                                    LensWord("standard"),
                                    LensWord("")};
/// Models that are no pinhole whatever their coefficients.
constexpr std::array other_models{LensWord("fisheye"), LensWord("equi"),         LensWord("kannala"),
                                  LensWord("omni"),    LensWord("mei"),          LensWord("unified"),
                                  LensWord("fov"),     LensWord("doublesphere"), LensWord("eucm"),
                                  LensWord("ftheta"),  LensWord("scaramuzza"),   LensWord("ocam")};

bool holds_any(std::string_view word, std::span<const LensWord> parts) {
  return std::ranges::any_of(parts, [&](LensWord part) { return word.find(part) != word.npos; });
}

/// k1, p2, s3, D1.
bool is_numbered(std::string_view word) {
  return word.size() >= 2 && word.size() <= 3 && std::string_view("kpsd").find(word[0]) != word.npos &&
         std::ranges::all_of(word.substr(1), [](unsigned char c) { return std::isdigit(c) != 0; });
}

[[noreturn]] void not_understood(const std::string& where, const Json& value) {
  const std::string shown =
      without_control_characters(value.dump(-1, ' ', true, Json::error_handler_t::replace));
  throw BadInput(
      Reason::unsupported,
      fmt::format("{}: {} may be a lens distortion and is not understood; export undistorted images, "
                  "and state that they are (--undistorted)",
                  where, shown.substr(0, 60)));
}

/// Numbers of lists in lists and of named numbers, without an OpenCV matrix's shape.
void add_coefficients(const Json& value, const std::string& where, std::vector<double>& numbers) {
  if (value.is_object() && value.contains("data")) return add_coefficients(value["data"], where, numbers);
  if (value.is_boolean()) return numbers.push_back(value.get<bool>() ? 1 : 0);
  if (value.is_number()) return numbers.push_back(value.get<double>());
  if (!value.is_structured() && !value.is_null()) not_understood(where, value);
  for (const Json& each : value) add_coefficients(each, where, numbers);
}

void check_model(const std::string& text, const std::string& where, bool is_lens) {
  const std::string word = key_word(text);
  if (holds_any(word, other_models) || word == "ds")
    throw BadInput(Reason::unsupported,
                   fmt::format("{}: \"{}\" is no pinhole camera; export undistorted images, and state that "
                               "they are (--undistorted)",
                               where, without_control_characters(text.substr(0, 40))));
  if (is_lens && std::ranges::find(pinhole_models, word) == pinhole_models.end()) not_understood(where, text);
}

void check_lens(const Json& object, const std::string& where, const ImportOptions& options) {
  if (object.is_array())
    for (const Json& each : object) check_lens(each, where, options);
  if (!object.is_object()) return;
  for (const auto& [key, value] : object.items()) {
    const std::string here = fmt::format("{}: {}", where, without_control_characters(key.substr(0, 40)));
    const bool matrix = is_numbered(key_word(key)) && key_word(key)[0] == 'p' && !value.is_primitive();
    const bool lens = names_lens(key) && !matrix;  // P1 is a projection of a stereo pair
    if (value.is_string() && (lens || key_word(key).find("model") != std::string::npos)) {
      check_model(value.get<std::string>(), here, lens);
    } else if (lens) {
      std::vector<double> numbers;
      add_coefficients(value, here, numbers);
      refuse_lens_distortion(numbers, here, options);
    } else {
      check_lens(value, here, options);
    }
  }
}

}  // namespace

std::string key_word(std::string_view key) {
  std::string word;
  for (const char c : key)
    if (c != '_' && c != '-' && c != ' ' && c != '.')
      word += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return word;
}

bool names_lens(std::string_view key) {
  const std::string word = key_word(key);
  if (word == "undistorted" || word.starts_with("distance")) return false;
  return word.starts_with("dist") || word.starts_with("coef") ||
         std::ranges::find(lens_keys, word) != lens_keys.end() || is_numbered(word) ||
         holds_any(word, lens_parts);
}

void refuse_lens_distortion(const std::vector<double>& coefficients, const std::string& where,
                            const ImportOptions& options) {
  if (options.undistorted || std::ranges::all_of(coefficients, [](double c) { return c == 0; })) return;
  const std::string shown = coefficients.size() == 1
                                ? fmt::format("{:g}", coefficients[0])
                                : fmt::format("k1 {:g}, k2 {:g}", coefficients[0], coefficients[1]);
  throw BadInput(
      Reason::unsupported,
      fmt::format("{}: the camera has a lens distortion ({}); export undistorted images, and state "
                  "that they are (--undistorted)",
                  where, shown));
}

void refuse_lens(const Json& camera, const std::string& origin, const ImportOptions& options) {
  if (!options.undistorted) check_lens(camera, origin, options);
}

}  // namespace helicarm::exchange
