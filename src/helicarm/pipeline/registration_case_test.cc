// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/registration_case.h"

#include <gtest/gtest.h>

#include "helicarm/core/files.h"
#include "helicarm/core/temporary_folder.h"

namespace helicarm::pipeline {
namespace {

TEST(RegistrationCase, HasModelsIfItNamesAny) {
  const TemporaryFolder folder;
  const auto with = [&](const char* json) {
    EXPECT_TRUE(write_file(folder.path() / "case.json", json));
    return has_models(folder.path());
  };
  EXPECT_FALSE(has_models(folder.path()));
  EXPECT_TRUE(with(R"({"models": [{"name": "femur", "volume": "ct.nrrd"}]})"));
  EXPECT_TRUE(has_models(folder.path() / "case.json"));
  for (const char* none : {R"({"models": []})", R"({"models": null})", R"({})", R"([])", R"("models")", "{"})
    EXPECT_FALSE(with(none)) << none;
}

TEST(RegistrationCase, WrongModelsAreRefusedWhereTheyAreRead) {
  const TemporaryFolder folder;
  for (const char* wrong : {R"({"models": "femur"})", R"({"models": {"name": "femur"}})"}) {
    EXPECT_TRUE(write_file(folder.path() / "case.json", wrong));
    EXPECT_TRUE(has_models(folder.path())) << wrong;
    EXPECT_FALSE(read_registration_case(folder.path())) << wrong;
  }
}

}  // namespace
}  // namespace helicarm::pipeline
