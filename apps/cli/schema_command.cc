// SPDX-License-Identifier: Apache-2.0
#include <functional>
#include <map>
#include <string>

#include "command_line.h"
#include "helicarm/calibration/c_arm_history_file.h"
#include "helicarm/operation/session_records.h"
#include "helicarm/phantom/schemas.h"
#include "helicarm/pipeline/case.h"

namespace helicarm::cli {
namespace {

const std::map<std::string, std::function<Json()>>& schemas() {
  static const std::map<std::string, std::function<Json()>> by_file{
      {"calibrator", phantom::calibrator_schema}, {"case", pipeline::case_schema},
      {"machine", calibration::history_schema},   {"plan", operation::plan_schema},
      {"plate", phantom::plate_schema},           {"session", operation::session_schema}};
  return by_file;
}

struct SchemaArguments {
  std::string file;
};

CommandResult schema_command(const SchemaArguments& arguments, Console& console) {
  console.out << to_text(schemas().at(arguments.file)()) << '\n';
  return {};
}

}  // namespace

void add_schema(CLI::App& app, Action& action) {
  auto* command =
      add_command(app, group::measure, "schema", "Print the JSON Schema of a file that helicarm reads",
                  "helicarm schema case > case.schema.json\n\n"
                  "An editor that is given the schema completes the keys, explains them and marks values out "
                  "of range\n(https://json-schema.org, draft 2020-12).");
  auto& arguments = arguments_of(command, action, schema_command);
  command->add_option("FILE", arguments.file, "The file, without .json")
      ->required()
      ->check(CLI::IsMember(schemas()));
}

}  // namespace helicarm::cli
