// SPDX-License-Identifier: Apache-2.0
#include "helicarm/study/ranks.h"

namespace helicarm {

Ranks::Ranks() = default;
Ranks::~Ranks() = default;
std::vector<double> Ranks::gather(const std::vector<double>& values) const { return values; }
std::vector<double> Ranks::from_leader(std::vector<double> values) const { return values; }

}  // namespace helicarm
