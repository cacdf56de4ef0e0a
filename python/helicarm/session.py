# SPDX-License-Identifier: Apache-2.0
"""The record of an operation."""
import json
import pathlib
from typing import NamedTuple

from . import _helicarm as _c
from .errors import InputError, RefusedError


class Record(NamedTuple):
    """One event of an operation. content: its keys as docs/formats.md has them for its kind."""
    number: int
    time_s: float  # UTC, seconds since 1970
    kind: str
    content: dict


class Session:
    """The record of an operation, in the folder that `helicarm navigate` or `operate` wrote.

    records: list of Record, each read by the type of its kind, the chain of digests checked. torn: the last record is
    incomplete (the program was killed while writing) and left out.
    Raises InputError: missing_file, unsupported, bad_value (a changed, missing or exchanged record).
    """

    def __init__(self, folder):
        self.folder = pathlib.Path(folder)
        records, self.torn = _c._session_records(self.folder)
        self.records = [Record(*each) for each in records]

    def __len__(self):
        return len(self.records)

    def __repr__(self):
        return f"<Session {self.folder.name}: {len(self)} records{', the last torn' if self.torn else ''}>"

    @property
    def kinds(self):
        """{kind: number of records}, in the order of their first."""
        counts = {}
        for record in self.records:
            counts[record.kind] = counts.get(record.kind, 0) + 1
        return counts

    def of_kind(self, kind):
        """The records of one kind, such as "exposure", "result", "order", "outcome"."""
        return [record for record in self.records if record.kind == kind]

    @property
    def results(self):
        """The content of result.json of each measurement and verification."""
        return [json.loads((self.folder / record.content["folder"] / "result.json").read_text())
                for record in self.of_kind("result")]

    def to_frame(self):
        """A pandas DataFrame: number, time, kind."""
        from .results import frame_of
        import pandas
        frame = frame_of([record._asdict() for record in self.records], ["number", "time_s", "kind"])
        frame.insert(1, "time", pandas.to_datetime(frame.pop("time_s"), unit="s", utc=True))
        return frame

    def replay(self, progress=None):
        """Recomputes the operation from its record, as `helicarm replay` does; all must agree to the last bit.

        progress: called with the share of the records that are done; an exception from it ends the replay, and Ctrl-C does.
        Releases the GIL. Returns {"complete": True, "records", "results", "orders", "files", "notes", ...}; notes: sentences
        on what equals the record in the form of an earlier version alone. Raises RefusedError
        (replay_differs), with the same in .result, where a value or file differs or the record has no end; InputError.
        """
        report = _c._replay(self.folder, progress)
        if report["complete"]:
            return report
        message = (f"{len(report['differences'])} recorded values or files differ from what the record implies, the first: "
                   f"{report['differences'][0]}" if report["differences"] else
                   f"{self.folder}: the record has no end: the program was killed or is still running, or records were removed")
        raise RefusedError("replay_differs", message, result=report)


__all__ = ["InputError", "Record", "Session"]
