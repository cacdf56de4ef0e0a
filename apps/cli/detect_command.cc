// SPDX-License-Identifier: Apache-2.0
#include "detect_command.h"

#include <fmt/format.h>

#include "helicarm/core/json.h"
#include "helicarm/detection/find_marks.h"
#include "helicarm/xray/read_xray_image.h"

namespace helicarm::cli {

CommandResult detect_command(const DetectArguments& arguments, Console& console) {
  return guarded([&] {
    const detection::MarkKind kind = value_or_throw(detection::mark_kind(arguments.kind));
    const xray::XrayImage xray_image = value_or_throw(
        xray::read_xray_image(arguments.image, arguments.image.filename().string(), arguments.frame));
    const std::vector<detection::Dot> dots = detection::find_marks(xray_image, kind);
    if (console.json) {
      Json list = Json::array();
      for (const detection::Dot& dot : dots)
        list.push_back({{"u", dot.centre_px.x()},
                        {"v", dot.centre_px.y()},
                        {"sigma_px", dot.sigma_px},
                        {"radius_px", dot.radius_px}});
      console.out << to_text(Json{{"dots", std::move(list)}}) << '\n';
      return;
    }
    console.out << fmt::format("{:>10} {:>10} {:>9} {:>9}\n", "u px", "v px", "sigma px", "radius px");
    for (const detection::Dot& dot : dots)
      console.out << fmt::format("{:>10.3f} {:>10.3f} {:>9.3f} {:>9.2f}\n", dot.centre_px.x(),
                                 dot.centre_px.y(), dot.sigma_px, dot.radius_px);
  });
}

}  // namespace helicarm::cli
