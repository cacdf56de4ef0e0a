// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include <Eigen/Core>

namespace helicarm::report {

/// Escapes markup for HTML and SVG content and attributes, and replaces control characters.
std::string escaped(std::string_view text);

std::string base64(std::string_view bytes);

/// A page with the reports' style. `title` and `heading` are plain text; `body` and `footer` are HTML,
/// `footer` follows the program's version.
std::string page_html(std::string_view title, std::string_view heading, std::string_view body,
                      std::string_view footer);

/// `digits` decimals, or an en dash without a value.
std::string fixed(std::optional<double> value, int digits);

/// "x, y, z", each as `fixed`; an en dash without a value.
std::string coordinates(const std::optional<Eigen::Vector3d>& values, int digits);

}  // namespace helicarm::report
