// SPDX-License-Identifier: Apache-2.0
#include "helicarm/report/markup.h"

#include <cmath>
#include <cstdint>

#include <fmt/format.h>

#include "helicarm/report/style.h"

namespace helicarm::report {

std::string escaped(std::string_view text) {
  std::string safe;
  safe.reserve(text.size());
  for (char c : text) {
    switch (c) {
      case '&':
        safe += "&amp;";
        break;
      case '<':
        safe += "&lt;";
        break;
      case '>':
        safe += "&gt;";
        break;
      case '"':
        safe += "&quot;";
        break;
      case '\'':
        safe += "&#39;";
        break;
      default:
        if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f)
          safe += "\xef\xbf\xbd";  // U+FFFD
        else
          safe += c;
    }
  }
  return safe;
}

std::string page_html(std::string_view title, std::string_view heading, std::string_view body,
                      std::string_view footer) {
  return fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n<meta name=\"viewport\" "
      "content=\"width=device-width, initial-scale=1\"/>\n<title>{}</title>\n<style>{}</style>\n</head>\n"
      "<body>\n<header>\n<h1>{}</h1>\n<p class=\"notice\">Research instrument, not a medical device.</p>\n"
      "</header>\n<main>\n{}</main>\n<footer><p class=\"soft\">helicarm "
      "{}{}</p></footer>\n</body>\n</html>\n",
      escaped(title), report_style, escaped(heading), body, HELICARM_VERSION, footer);
}

std::string base64(std::string_view bytes) {
  constexpr std::string_view digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const auto byte = [&](std::size_t k) {
      return i + k < bytes.size() ? std::uint32_t{static_cast<unsigned char>(bytes[i + k])} : 0u;
    };
    const std::uint32_t word = byte(0) << 16 | byte(1) << 8 | byte(2);
    for (unsigned k = 0; k < 4; ++k) text += i + k <= bytes.size() ? digits[word >> (18 - 6 * k) & 63] : '=';
  }
  return text;
}

std::string fixed(std::optional<double> value, int digits) {
  if (!value || !std::isfinite(*value)) return "–";
  return fmt::format("{:.{}f}", *value, digits);
}

std::string coordinates(const std::optional<Eigen::Vector3d>& values, int digits) {
  if (!values) return "–";
  return fmt::format("{}, {}, {}", fixed(values->x(), digits), fixed(values->y(), digits),
                     fixed(values->z(), digits));
}

}  // namespace helicarm::report
