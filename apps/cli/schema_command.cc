// SPDX-License-Identifier: Apache-2.0
#include <string>
#include <vector>

#include "command_line.h"
#include "helicarm/operation/schemas.h"
#include "one_of.h"

namespace helicarm::cli {
namespace {

struct SchemaArguments {
  std::string file;
};

CommandResult schema_command(const SchemaArguments& arguments, Console& console) {
  console.out << to_text(operation::schemas().at(arguments.file)()) << '\n';
  return {};
}

}  // namespace

void add_schema(CLI::App& app, Action& action) {
  auto* command = add_command(
      app, group::measure, "schema", "Print the JSON Schema of a file that helicarm reads or writes",
      "helicarm schema case > case.schema.json\n\n"
      "An editor that is given the schema completes the keys, explains them and marks values out of range\n"
      "(https://json-schema.org, draft 2020-12). result, registration and sweep are written by the program:\n"
      "their schema says which keys are always there, and which may be null.");
  auto& arguments = arguments_of(command, action, schema_command);
  std::vector<std::string> files;
  for (const auto& [file, schema] : operation::schemas()) files.push_back(file);
  command->add_option("FILE", arguments.file, "The file, without .json")->required()->check(one_of(files));
}

}  // namespace helicarm::cli
