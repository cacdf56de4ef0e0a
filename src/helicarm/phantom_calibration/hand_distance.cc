// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom_calibration/hand_distance.h"

#include <cmath>
#include <locale>
#include <sstream>

#include <fmt/format.h>

namespace helicarm::phantom_calibration {

Expected<HandDistance> hand_distance_from(const std::string& text) {
  const auto wrong = [&] {
    return fail(Reason::usage,
                fmt::format("--distance: \"{}\" is neither A,B=MM (labels) nor u1,v1;u2,v2=MM (pixels of the "
                            "first view), with MM over 0 and up to 2000",
                            text));
  };
  const std::size_t equals = text.rfind('=');
  if (equals == std::string::npos) return wrong();
  const auto number = [](const std::string& word, double& value) {
    std::istringstream in(word);
    in.imbue(std::locale::classic());
    return bool(in >> value) && in.peek() == std::istringstream::traits_type::eof() && std::isfinite(value);
  };
  HandDistance distance{};
  if (!number(text.substr(equals + 1), distance.mm) || !(distance.mm > 0) || distance.mm > 2000)
    return wrong();
  const std::string pair = text.substr(0, equals);
  const std::size_t semicolon = pair.find(';');
  if (semicolon == std::string::npos) {
    const std::size_t comma = pair.find(',');
    if (comma == std::string::npos || pair.find(',', comma + 1) != std::string::npos) return wrong();
    distance.a = pair.substr(0, comma);
    distance.b = pair.substr(comma + 1);
    return distance;
  }
  const auto place = [&](const std::string& words, FiducialName& name) {
    const std::size_t comma = words.find(',');
    Eigen::Vector2d uv;
    if (comma == std::string::npos || !number(words.substr(0, comma), uv[0]) ||
        !number(words.substr(comma + 1), uv[1]))
      return false;
    name = uv;
    return true;
  };
  if (!place(pair.substr(0, semicolon), distance.a) || !place(pair.substr(semicolon + 1), distance.b))
    return wrong();
  return distance;
}

Expected<bool> is_outer(const std::string& word) {
  if (word == "outer" || word == "centres") return word == "outer";
  return fail(Reason::usage, fmt::format("distance-is: \"{}\" is none of: centres, outer", word));
}

}  // namespace helicarm::phantom_calibration
