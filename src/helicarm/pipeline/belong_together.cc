// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/belong_together.h"

#include <fmt/format.h>

#include "helicarm/rectification/usable.h"

namespace helicarm::pipeline {

Expected<void> check_images_belong_together(const std::vector<const xray::XrayImage*>& images) {
  for (std::size_t i = 0; i < images.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) {
      const xray::Acquisition& a = images[j]->acquisition;
      const xray::Acquisition& b = images[i]->acquisition;
      if (!a.patient_key.empty() && !b.patient_key.empty() && a.patient_key != b.patient_key)
        return fail(Reason::patient_mismatch, fmt::format("{} and {} are of different patients or studies",
                                                          images[j]->name, images[i]->name));
      if (!a.instance_key.empty() && a.instance_key == b.instance_key)
        return rectification::check_usable(*images[i]).and_then([&]() -> Expected<void> {
          return fail(Reason::views_too_close,
                      fmt::format("{} and {} are the same image", images[j]->name, images[i]->name));
        });
    }
  return {};
}

}  // namespace helicarm::pipeline
