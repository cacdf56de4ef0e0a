// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "helicarm/core/csv.h"
#include "helicarm/registration/landmarks.h"
#include "target.h"

namespace helicarm::fuzz {

void run(std::string_view bytes) {
  // A landmarks file as `register` reads it, with the places found in the images.
  const auto table =
      read_csv(put_file("input.csv", bytes), {"name", "x_mm", "y_mm", "z_mm"}, {"u_mm", "v_mm", "w_mm"});
  if (!table) return;
  const auto landmarks = guarded([&] {
    std::vector<registration::Landmark> read;
    for (std::size_t row = 0; row < table->rows(); ++row) {
      const auto found = [&](const char* column) {
        return table->optional_number(row, column).value_or(double(row * row));
      };
      read.push_back({table->text(row, "name"),
                      {table->number(row, "x_mm"), table->number(row, "y_mm"), table->number(row, "z_mm")},
                      {found("u_mm"), found("v_mm"), found("w_mm")}});
    }
    return read;
  });
  if (!landmarks) return;
  for (const registration::Landmark& landmark : *landmarks)
    if (!(landmark.in_model.norm() < 1e6 && landmark.in_world.norm() < 1e6)) return;
  const auto registered = registration::register_landmarks(*landmarks);
  if (!registered) return;
  check(registered->world_from_model.rotation.determinant() > 0.99, "a motion is proper");
  check(std::isfinite(registered->fre_mm) && registered->fre_mm >= 0, "the residual is finite");
  check(registered->places.size() == landmarks->size(), "each landmark has a place");
}

std::vector<std::string> seeds() {
  return {"name,x_mm,y_mm,z_mm\na,0,0,0\nb,40,0,0\nc,0,30,0\nd,0,0,20\n",
          "name,x_mm,y_mm,z_mm,u_mm,v_mm,w_mm\na,0,0,0,1,2,3\nb,40,0,0,41,2,3\nc,0,30,0,1,32,3\n"};
}

}  // namespace helicarm::fuzz
