// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/replay.h"
#include "helicarm/operation/session_log.h"
#include "helicarm/operation/session_records.h"
#include "module.h"
#include "signals.h"

namespace helicarm::python {
namespace {

/// Each record is read by its type first, so that what is listed is what replay reads.
py::tuple records_of(const std::filesystem::path& session) {
  const auto read = value_or_raise(without_gil([&] {
    return operation::read_session(session / "session.log").and_then([&](operation::SessionHistory history) {
      return guarded([&] {
        for (const operation::SessionRecord& record : history.records)
          value_or_throw(operation::record_from(record, session));
        return std::move(history);
      });
    });
  }));
  py::list records;
  for (const operation::SessionRecord& record : read.records)
    records.append(py::make_tuple(record.number, record.time_s, record.kind, python_from(record.content)));
  return py::make_tuple(records, read.torn);
}

py::object replay(const std::filesystem::path& session, const py::object& progress) {
  const RunHooks hooks = run_hooks(py::none());
  const operation::ReplayReport report = value_or_raise(without_gil([&] {
    return operation::replay(session, [&](std::size_t done, std::size_t all) {
      hooks.on_view();
      if (progress.is_none()) return true;
      const py::gil_scoped_acquire acquire;
      progress(double(done) / double(std::max<std::size_t>(all, 1)));
      return true;
    });
  }));
  return python_from(operation::to_json(report));
}

}  // namespace

void add_session(py::module_& module) {
  module.def("_session_records", &records_of);
  module.def("_replay", &replay);
}

}  // namespace helicarm::python
