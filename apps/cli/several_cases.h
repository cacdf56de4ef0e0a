// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <initializer_list>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "command_line.h"
#include "helicarm/core/failure.h"

namespace helicarm::cli {

/// Cases of one command, done one after the other or shared by processes.
struct SeveralCases {
  std::vector<std::filesystem::path> cases = {};  ///< folders that hold case.json, or case files
  std::string share = {};                         ///< common word of the processes that do the cases together
  const CLI::App* command = nullptr;              ///< whose options the answers depend on
};

/// CASE, of which there may be several, and --share.
void add_cases(CLI::App* command, SeveralCases& several);

/// A line of summary.csv.
struct CaseRow {
  std::string name = {};
  std::optional<Failure> failure = {};
  std::vector<std::optional<double>> figures = {};  ///< by the columns; missing ones are empty
};

/// What a command does with each case.
struct CaseWork {
  std::filesystem::path out;  ///< a folder of each case, and summary.csv
  /// Of summary.csv behind "case": status, code, message, then those of the figures, which are whole numbers
  /// where the name does not end with _mm.
  std::initializer_list<const char*> columns;
  /// Does one case and writes into the folder; what it throws or returns as failure is that of the case.
  std::function<CaseRow(const std::filesystem::path& the_case, const std::filesystem::path& out,
                        Console& silent)>
      one_case;
  std::function<std::string(const CaseRow&)> line_of;  ///< for the terminal, of a case without failure
  std::function<void(const std::filesystem::path& folder)> forget;  ///< one case's files of an earlier run
};

/// Each case writes to a folder of its own under `out`, and summary.csv there has a line for each. A refused
/// or unusable case does not stop the others; the command then fails with the gravest reason. Processes of
/// one launch (`launch_of_environment`), or with one `share`, do them together: the one that ends them
/// reports, the others succeed.
CommandResult do_cases(const SeveralCases& several, const CaseWork& work, Console& console);

/// What the rows of cases that are shared depend on, besides the cases' names: the command, where each case
/// lies from `out`, and each option, as given or by default; files by their whole path.
std::map<std::string, std::string> terms_of(const SeveralCases& several, const std::filesystem::path& out);

/// A different name for each case: that of its folder, numbered where it repeats.
std::vector<std::string> names_of(const std::vector<std::filesystem::path>& cases);

}  // namespace helicarm::cli
