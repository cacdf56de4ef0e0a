// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include <fmt/format.h>

#include "helicarm/study/centres.h"

namespace helicarm {
namespace {

Json centres_json(const std::vector<CentreRow>& rows, const CentreOptions& options) {
  Json json{{"format", "helicarm-study/1"}, {"study", "centres"},          {"groups", options.balls},
            {"seed", options.seed},         {"version", HELICARM_VERSION}, {"rows", Json::array()}};
  for (const CentreRow& row : rows)
    json["rows"].push_back({{"group", row.group},
                            {"situation", row.situation},
                            {"balls", row.balls},
                            {"refused", row.refused},
                            {"rms_px", row.rms_px},
                            {"bias_px", row.bias_px},
                            {"sigma_px", row.sigma_px},
                            {"z", row.z},
                            {"coverage", row.coverage},
                            {"radius_bias", row.radius_bias},
                            {"bound_px", row.bound_px},
                            {"ratio", row.ratio()}});
  return json;
}

std::string centres_csv(const std::vector<CentreRow>& rows) {
  std::string text =
      "group,situation,balls,refused,rms_px,bias_px,sigma_px,z,coverage,radius_bias,bound_px,ratio\n";
  for (const CentreRow& row : rows) {
    text += fmt::format("{},{},{},{}", row.group, row.situation, row.balls, row.refused);
    for (const double value : {row.rms_px, row.bias_px, row.sigma_px, row.z, row.coverage, row.radius_bias,
                               row.bound_px, row.ratio()})
      text += std::isfinite(value) ? fmt::format(",{}", value) : ",";
    text += '\n';
  }
  return text;
}

std::string centres_table(const std::vector<CentreRow>& rows) {
  const auto number = [](double value, int digits) {
    return std::isfinite(value) ? fmt::format("{:.{}f}", value, digits) : std::string();
  };
  std::string text =
      fmt::format("{:<22} {:<26} {:>7} {:>8} {:>7} {:>7} {:>6} {:>8} {:>12} {:>9}\n", "", "", "rms px",
                  "over bound", "bias px", "sigma", "z", "covered", "radius bias", "refused");
  for (const CentreRow& row : rows)
    text +=
        fmt::format("{:<22} {:<26} {:>7} {:>10} {:>8} {:>7} {:>6} {:>7} % {:>9} % {:>4} of {}\n", row.group,
                    row.situation, number(row.rms_px, 4), number(row.ratio(), 2), number(row.bias_px, 4),
                    number(row.sigma_px, 4), number(row.z, 2), number(100 * row.coverage, 1),
                    number(100 * row.radius_bias, 1), row.refused, row.balls);
  return text;
}

}  // namespace

StudyFiles files_of(const std::vector<CentreRow>& rows, const CentreOptions& options) {
  return {centres_csv(rows), centres_json(rows, options), {}, centres_table(rows)};
}

}  // namespace helicarm
