// SPDX-License-Identifier: Apache-2.0
#include "several_cases.h"

#include <algorithm>
#include <array>
#include <span>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "distinct_names.h"
#include "helicarm/core/csv.h"
#include "helicarm/core/earlier_files.h"
#include "helicarm/core/files.h"
#include "helicarm/core/json.h"
#include "shared_work.h"

namespace helicarm::cli {
namespace {

namespace fs = std::filesystem;

/// Options on which no answer depends: where it is written, what is kept for later, how it is divided.
constexpr std::array<std::string_view, 6> without_effect{"--help",  "--out",      "--share",
                                                         "--cache", "--no-cache", "--resume"};

/// One spelling of a path, which need not exist.
fs::path whole_path(const fs::path& path) {
  std::error_code ignored;
  const fs::path whole = fs::weakly_canonical(fs::absolute(path, ignored), ignored);
  return whole.has_filename() ? whole : whole.parent_path();
}

std::string_view status_of(const CaseRow& row) {
  if (!row.failure) return "ok";
  return exit_code(row.failure->reason) == 2 ? "failed" : "refused";
}

std::string csv_of(const CaseWork& work, const std::vector<CaseRow>& rows) {
  const std::span<const char* const> columns = std::span(work.columns).subspan(3);
  std::string csv = fmt::format("case,{}\n", fmt::join(work.columns, ","));
  for (const CaseRow& row : rows) {
    csv += fmt::format("{},{},{},{}", csv_field(row.name), status_of(row),
                       row.failure ? code(row.failure->reason) : "",
                       row.failure ? csv_field(row.failure->message) : "");
    for (std::size_t i = 0; i < columns.size(); ++i) {
      const auto figure = i < row.figures.size() ? row.figures[i] : std::nullopt;
      const bool is_whole = figure && !std::string_view(columns[i]).ends_with("_mm");
      csv += !figure ? "," : is_whole ? fmt::format(",{:.0f}", *figure) : fmt::format(",{:.4f}", *figure);
    }
    csv += '\n';
  }
  return csv;
}

/// What went wrong with the cases, by the gravest of them.
Failure gravest(const std::vector<CaseRow>& rows, const fs::path& csv) {
  std::size_t failed = 0;
  const CaseRow* worst = nullptr;
  for (const CaseRow& row : rows) {
    if (!row.failure) continue;
    ++failed;
    if (!worst || exit_code(row.failure->reason) < exit_code(worst->failure->reason)) worst = &row;
  }
  Failure failure = *worst->failure;
  failure.view.clear();
  failure.message = fmt::format("{} of {} cases give no result, {} for example: {} ({} lists all)", failed,
                                rows.size(), worst->name, failure.message, csv.string());
  failure.figures = {{"cases", double(rows.size())}, {"without_result", double(failed)}};
  return failure;
}

/// Results of an earlier run of several cases in this folder, by its summary.
void forget_earlier(const CaseWork& work) {
  std::error_code ignored;
  if (const auto summary = read_csv(work.out / "summary.csv", {"case"}, work.columns))
    for (std::size_t i = 0; i < summary->rows(); ++i) {
      const fs::path name = summary->text(i, "case");
      if (name.empty() || name != name.filename() || name == "." || name == "..") continue;
      work.forget(work.out / name);
      if (fs::is_directory(work.out / name, ignored) && fs::is_empty(work.out / name, ignored))
        fs::remove(work.out / name, ignored);
    }
  forget_files(work.out, {"summary.csv"});
}

Json json_of(const CaseRow& row) {
  Json figures = Json::array();
  for (const auto& figure : row.figures) figures.push_back(figure ? Json(*figure) : Json());
  Json json{{"name", row.name}, {"figures", std::move(figures)}};
  if (row.failure) json["failure"] = {{"code", code(row.failure->reason)}, {"message", row.failure->message}};
  return json;
}

CaseRow row_from(const Json& json) {
  CaseRow row;
  row.name = json.at("name").get<std::string>();
  for (const Json& figure : json.at("figures"))
    row.figures.push_back(figure.is_null() ? std::nullopt : std::optional(figure.get<double>()));
  if (json.contains("failure"))
    for (const Reason reason : all_reasons())
      if (code(reason) == json["failure"].at("code").get<std::string>())
        row.failure = Failure{reason, json["failure"].at("message").get<std::string>(), {}, {}};
  return row;
}

CaseRow row_of(const SeveralCases& several, const CaseWork& work, std::size_t index, const std::string& name,
               const Console& console) {
  Console silent = console;
  silent.quiet = true;
  silent.json = false;
  auto done = guarded([&] { return work.one_case(several.cases[index], work.out / name, silent); });
  CaseRow row = done ? *std::move(done) : CaseRow{{}, done.error(), {}};
  row.name = name;
  if (row.failure && !row.failure->view.empty())
    row.failure->message = row.failure->view + ": " + row.failure->message;
  return row;
}

std::string line_of(const CaseRow& row, const CaseWork& work) {
  if (row.failure)
    return fmt::format("{}: {}: {}", row.name, code(row.failure->reason), row.failure->message);
  return fmt::format("{}: {}", row.name, work.line_of(row));
}

CommandResult all_done(const std::vector<CaseRow>& rows, const fs::path& csv, Console& console) {
  if (std::ranges::any_of(rows, [](const CaseRow& row) { return row.failure.has_value(); }))
    return tl::unexpected<Failure>(gravest(rows, csv));
  if (console.json)
    console.out << to_text(Json{{"cases", rows.size()}, {"summary", csv.string()}}) << '\n';
  else if (!console.quiet)
    console.out << fmt::format("\n  {} cases, written to {}\n", rows.size(), csv.string());
  return {};
}

CommandResult do_alone(const SeveralCases& several, const CaseWork& work, Console& console) {
  const std::vector<std::string> names = names_of(several.cases);
  const fs::path csv = work.out / "summary.csv";
  std::vector<CaseRow> rows;
  forget_earlier(work);
  for (std::size_t i = 0; i < names.size(); ++i) {
    rows.push_back(row_of(several, work, i, names[i], console));
    if (auto written = write_file(csv, csv_of(work, rows)); !written) return written;
    if (!console.quiet)
      console.progress << fmt::format("[{}/{}] {}\n", i + 1, names.size(), line_of(rows.back(), work));
  }
  return all_done(rows, csv, console);
}

CommandResult do_shared(const SeveralCases& several, const CaseWork& work, const Launch& launch,
                        Console& console) {
  const std::vector<std::string> names = names_of(several.cases);
  const fs::path csv = work.out / "summary.csv";
  return guarded([&] {
    SharedWork shared(
        work.out, launch, names, [&] { forget_earlier(work); }, terms_of(several, work.out));
    const auto given_up = [&](std::size_t index) {
      return json_of(
          CaseRow{names[index],
                  Failure{Reason::interrupted, "each process that did it ended before it was done", {}, {}},
                  {}});
    };
    while (const auto item = shared.next(given_up)) {
      const CaseRow row = row_of(several, work, item->index, names[item->index], console);
      shared.done(*item, json_of(row));
      if (!console.quiet)
        console.progress << fmt::format("[{} of {}{}] {}\n", item->index + 1, names.size(),
                                        item->taken_over ? ", whose first process ended" : "",
                                        line_of(row, work))
                         << std::flush;
    }
    std::vector<CaseRow> all;
    const bool reports = shared.finish([&](const std::vector<Json>& rows) {
      for (const Json& row : rows) all.push_back(row_from(row));
      value_or_throw(write_file(csv, csv_of(work, all)));
    });
    if (reports) value_or_throw(all_done(all, csv, console));
  });
}

}  // namespace

std::vector<std::string> names_of(const std::vector<fs::path>& cases) {
  std::vector<std::string> names;
  for (const fs::path& case_folder : cases) {
    const fs::path whole = fs::absolute(case_folder).lexically_normal();
    const bool is_folder = whole.has_filename() && whole.extension() != ".json";
    const std::string name = (is_folder ? whole : whole.parent_path()).filename().string();
    names.push_back(name.empty() ? "case" : name);
  }
  return distinct(names);
}

std::map<std::string, std::string> terms_of(const SeveralCases& several, const fs::path& out) {
  std::map<std::string, std::string> terms;
  const std::vector<std::string> names = names_of(several.cases);
  // Relative: another machine may see the folder that they share under another name.
  for (std::size_t i = 0; i < names.size(); ++i)
    terms["case " + names[i]] =
        whole_path(several.cases[i]).lexically_relative(whole_path(out)).generic_string();
  if (!several.command) return terms;
  terms["command"] = several.command->get_name();
  for (const CLI::Option* option : several.command->get_options()) {
    const std::string name = option->get_name();
    if (!name.starts_with("--") || std::ranges::find(without_effect, name) != without_effect.end()) continue;
    std::vector<std::string> words = option->results();
    for (std::string& word : words)
      if (std::error_code ignored; fs::exists(word, ignored)) word = whole_path(word).string();
    const std::string value =
        words.empty() ? option->get_default_str() : fmt::format("{}", fmt::join(words, " "));
    if (!value.empty()) terms[name] = value;
  }
  return terms;
}

void add_cases(CLI::App* command, SeveralCases& several) {
  several.command = command;
  command
      ->add_option(
          "CASE", several.cases,
          "Folder that holds case.json; several are done one after the other, each in --out/NAME, with "
          "--out/summary.csv")
      ->required();
  command->add_option(
      "--share", several.share,
      "A word that several processes have in common, which do the cases together, each the "
      "next that no other "
      "has; mpirun and srun need none. The same word goes on after an interruption, with the same "
      "cases and options only");
}

CommandResult do_cases(const SeveralCases& several, const CaseWork& work, Console& console) {
  auto launch = launch_of_environment();
  if (!several.share.empty()) launch = Launch{several.share, launch ? launch->processes : 0};
  return launch ? do_shared(several, work, *launch, console) : do_alone(several, work, console);
}

}  // namespace helicarm::cli
