// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "helicarm/core/csv.h"
#include "helicarm/core/text.h"
#include "target.h"

namespace helicarm::fuzz {

void run(std::string_view bytes) {
  // The columns that `solve` reads as points and `locate` as picks.
  const bool points = Choices(bytes).byte() % 2 == 0;
  const auto path = put_file("input.csv", bytes);
  const auto table = points ? read_csv(path, {"label", "x_mm", "y_mm", "z_mm", "u_px", "v_px"}, {"sigma_px"})
                            : read_csv(path, {"name", "view", "u_px", "v_px"}, {"sigma_px"});
  if (!table) return;
  for (std::size_t row = 0; row < table->rows(); ++row) {
    check(!holds_control_character(table->text(row, points ? "label" : "name")),
          "a text has no control characters");
    const auto read = guarded([&] {
      check(std::isfinite(table->number(row, "u_px")) && std::isfinite(table->number(row, "v_px")),
            "numbers are finite");
      const auto sigma = table->optional_number(row, "sigma_px");
      check(!sigma || std::isfinite(*sigma), "an optional number is finite");
      return 0;
    });
    if (!read) return;
  }
}

std::vector<std::string> seeds() {
  const std::string points = "label,x_mm,y_mm,z_mm,u_px,v_px";
  return {'\0' + points + "\nP1,1,2,3,512.5,100\n# comment\nP2,-1e-3,2.5,3,0,7\n",
          std::string("\0\xEF\xBB\xBF", 4) + points + ",sigma_px\r\n\"P1\",1,2,3,512.5,100,\r\n",
          "\1name,view,u_px,v_px,sigma_px\nFS,AP,10,20,0.5\nFS,LAT,30,40,\n"};
}

}  // namespace helicarm::fuzz
