// SPDX-License-Identifier: Apache-2.0
#include "module_description.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "command_line.h"
#include "module_words.h"

namespace helicarm::cli {
namespace module_description_test {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

/// A program with one command of every kind of argument.
struct Program {
  CLI::App app{"all of it", "program"};
  bool quick = false, asks = true;
  int size = 8;
  double depth = -1e-6;
  std::optional<double> sigma;
  std::string kind = "one";
  std::filesystem::path folder, out = "result", more;
  std::vector<std::string> names;
  CLI::App* command = app.add_subcommand("group", "several")->add_subcommand("do", "Does <this> & \"that\"");

  Program() {
    command->add_option("FOLDER", folder, "Folder of it")->required();
    command->add_option("MORE", more, "Another file");
    command->add_flag("--quick-now", quick, "no\x01thing");
    command->add_flag("--ask,!--no-ask", asks, "Ask");
    command->add_option("--size", size, "px")->check(within(1, 1e19))->capture_default_str();
    command->add_option("--depth", depth, "mm")->check(within(-1, 2))->capture_default_str();
    command->add_option("--sigma", sigma, "px")->check(within(0, 5));
    command->add_option("--kind", kind, "one: first\ntwo: second")->type_name("WORD")->capture_default_str();
    command->add_option("--out", out, "Folder for it")->capture_default_str();
    command->add_option("--name", names, "NAME=x,y,z")->allow_extra_args(false);
  }

  std::vector<std::string> words(std::vector<std::string> of_form) const {
    return words_of_module(*command, of_form);
  }
};

TEST(ModuleDescription, EscapesTexts) {
  const std::string xml = module_description(*Program().command);
  EXPECT_THAT(xml, HasSubstr("Does &lt;this&gt; &amp; \"that\""));
  EXPECT_THAT(xml, HasSubstr("no thing"));
  EXPECT_THAT(xml, Not(HasSubstr("\x01")));
}

TEST(ModuleDescription, NumbersHaveNoExponentAndFitAnInt) {
  const std::string xml = module_description(*Program().command);
  EXPECT_THAT(xml, HasSubstr("<default>-0.000001</default>"));
  EXPECT_THAT(xml, HasSubstr("<maximum>2147483646</maximum>"));
}

TEST(ModuleDescription, NumberWithoutDefaultIsATextThatMayStayEmpty) {
  EXPECT_THAT(module_description(*Program().command), HasSubstr("<string>\n      <name>sigma</name>"));
}

TEST(ModuleDescription, FlagIsTheOneThatChangesSomething) {
  EXPECT_THAT(module_description(*Program().command), HasSubstr("<longflag>--no_ask</longflag>"));
}

TEST(ModuleDescription, ChoiceOfAHelpThatExplainsEachWord) {
  EXPECT_THAT(
      module_description(*Program().command),
      HasSubstr("<default>one</default>\n      <element>one</element>\n      <element>two</element>"));
}

TEST(ModuleWords, ValuesOfAnUntouchedFormAreLeftOut) {
  EXPECT_THAT(Program().words({"--size", "8", "--depth", "-0.0000010000000000000001", "--sigma", "", "--kind",
                               "one", "in"}),
              ElementsAre("in"));
}

TEST(ModuleWords, UnderscoresStandForHyphensAndValuesMayBeNegative) {
  EXPECT_THAT(Program().words({"--quick_now", "--depth", "-0.5", "in"}),
              ElementsAre("--quick-now", "--depth=-0.5", "in"));
}

TEST(ModuleWords, ListsAreSplit) {
  EXPECT_THAT(Program().words({"--name", "a=1,2,3 | b=4,5,6", "in"}),
              ElementsAre("--name=a=1,2,3", "--name=b=4,5,6", "in"));
}

TEST(ModuleWords, OptionalArgumentComesAfterTheRequiredOne) {
  EXPECT_THAT(Program().words({"--MORE", "x y", "in"}), ElementsAre("in", "x y"));
}

TEST(ModuleWords, SlicersOwnArgumentsAreLeftOut) {
  EXPECT_THAT(
      Program().words({"--processinformationaddress", "0x1", "--returnparameterfile", "a.params", "in"}),
      ElementsAre("in"));
}

TEST(ModuleWords, UnknownOptionsAreLeftToTheProgram) {
  EXPECT_THAT(Program().words({"--size-of", "in"}), ElementsAre("--size-of", "in"));
}

TEST(ModuleWords, CommandOfAGroup) {
  const Program program;
  const std::vector<std::string> words = {"group", "do", "--xml"};
  std::span<const std::string> rest(words);
  EXPECT_EQ(command_named(program.app, rest), program.command);
  EXPECT_EQ(rest.size(), 1U);
  EXPECT_EQ(module_name(*program.command), "HelicarmGroupDo");
  rest = std::span(words).first(1);
  EXPECT_EQ(command_named(program.app, rest), nullptr);
}

}  // namespace module_description_test
}  // namespace helicarm::cli
