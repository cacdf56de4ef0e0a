// SPDX-License-Identifier: Apache-2.0
// Prints what all studies write, for ranks_test.py. Usage: small_studies FOLDER
#include "studies/small_studies.h"

#include <cstdio>

int main(int, char** arguments) {
  const helicarm::study::Ranks ranks;
  helicarm::study::EngineOptions engine;
  engine.threads = 1 + unsigned(ranks.own());  // as on different machines
  for (const auto& study : helicarm::study::small_studies()) {
    const std::string bytes = study.bytes(engine, ranks, arguments[1]);
    if (ranks.leads())
      std::printf("=== %s, %d ranks\n%s\n", study.name.c_str(), ranks.count(), bytes.c_str());
  }
}
