// SPDX-License-Identifier: Apache-2.0
#include "detect_command.h"

#include <algorithm>

#include <fmt/format.h>

#include "helicarm/core/json.h"
#include "helicarm/detection/find_crosses.h"
#include "helicarm/detection/find_dots.h"
#include "helicarm/xray/read_xray_image.h"

namespace helicarm::cli {
namespace {

std::vector<Dot> found_in(const XrayImage& xray_image, bool crosses, Polarity polarity) {
  if (crosses) {
    CrossOptions options;
    options.polarity = polarity;
    return find_crosses(xray_image, options);
  }
  DotOptions options;
  options.polarity = polarity;
  return find_clear_dots(xray_image, options);
}

/// Metal may be dark or bright in an image; the polarity with more detections is used.
std::vector<Dot> metal_in(const XrayImage& xray_image, bool crosses) {
  auto dark = found_in(xray_image, crosses, Polarity::dark);
  auto bright = found_in(xray_image, crosses, Polarity::bright);
  return dark.size() >= bright.size() ? dark : bright;
}

}  // namespace

CommandResult detect_command(const DetectArguments& arguments, Console& console) {
  return guarded([&] {
    const bool crosses = arguments.kind == "crosses";
    if (!crosses && arguments.kind != "balls" && arguments.kind != "holes")
      throw BadInput(Reason::usage,
                     fmt::format("--kind: \"{}\" is none of: balls, holes, crosses", arguments.kind));
    const XrayImage xray_image = value_or_throw(
        read_xray_image(arguments.image, arguments.image.filename().string(), arguments.frame));
    const std::vector<Dot> dots = arguments.kind == "holes" ? found_in(xray_image, false, Polarity::bright)
                                                            : metal_in(xray_image, crosses);
    if (console.json) {
      Json list = Json::array();
      for (const Dot& dot : dots)
        list.push_back({{"u", dot.centre_px.x()},
                        {"v", dot.centre_px.y()},
                        {"sigma_px", dot.sigma_px},
                        {"radius_px", dot.radius_px}});
      console.out << to_text(Json{{"dots", std::move(list)}}) << '\n';
      return;
    }
    console.out << fmt::format("{:>10} {:>10} {:>9} {:>9}\n", "u px", "v px", "sigma px", "radius px");
    for (const Dot& dot : dots)
      console.out << fmt::format("{:>10.3f} {:>10.3f} {:>9.3f} {:>9.2f}\n", dot.centre_px.x(),
                                 dot.centre_px.y(), dot.sigma_px, dot.radius_px);
  });
}

}  // namespace helicarm::cli
