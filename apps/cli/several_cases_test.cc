// SPDX-License-Identifier: Apache-2.0
#include "several_cases.h"

#include <gtest/gtest.h>

namespace helicarm::cli {
namespace {

using Names = std::vector<std::string>;

TEST(NamesOfCases, AreThoseOfTheirFolders) {
  EXPECT_EQ(names_of({"/data/monday", "/data/tuesday/", "/data/friday/case.json"}),
            (Names{"monday", "tuesday", "friday"}));
}

TEST(NamesOfCases, ThatRepeatAreNumbered) {
  EXPECT_EQ(names_of({"/a/knee", "/b/knee", "/b/knee_2", "/c/knee"}),
            (Names{"knee", "knee_2", "knee_2_2", "knee_3"}));
}

/// Terms of a command line of a command with one option.
std::map<std::string, std::string> terms(const std::string& line, const std::filesystem::path& out) {
  CLI::App app;
  CLI::App* command = app.add_subcommand("run");
  SeveralCases several;
  add_cases(command, several);
  std::string method = "best";
  std::filesystem::path folder;
  command->add_option("--method", method)->capture_default_str();
  command->add_option("--out", folder);
  app.parse(line);
  return terms_of(several, out);
}

TEST(TermsOfCases, AreTheCommandItsOptionsAndWhereTheCasesLie) {
  EXPECT_EQ(terms("run /s/a /s/b --out /s/o --share w", "/s/o"),
            (std::map<std::string, std::string>{
                {"command", "run"}, {"case a", "../a"}, {"case b", "../b"}, {"--method", "best"}}));
}

TEST(TermsOfCases, DifferWithStudyAndOptionAndNotWithTheWordsThatSayTheSame) {
  const auto one = terms("run /s/a /s/b", "/s/o");
  EXPECT_EQ(terms("run --method best /s/a/ /s/../s/b --share w", "/s/o"), one);
  EXPECT_NE(terms("run /t/a /t/b", "/s/o"), one);
  EXPECT_NE(terms("run /s/a /s/b --method paper", "/s/o"), one);
}

}  // namespace
}  // namespace helicarm::cli
