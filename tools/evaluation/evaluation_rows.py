# SPDX-License-Identifier: Apache-2.0
"""Rows of an evaluation's cases, kept as JSON lines as they come, so that an interrupted evaluation goes on; and its table in a document."""
import concurrent.futures
import contextlib
import json
import pathlib
import sys
import tempfile


def add_options(parser, of="cases", keeps=True):
    """--rows, --doc and, where the evaluation has a folder of its own, --keep. `of`: what the rows are of."""
    parser.add_argument("--rows", type=pathlib.Path, help=f"JSON lines of all {of}; what it holds is not run again")
    parser.add_argument("--doc", type=pathlib.Path, help="renews the table of these rows between its marks in that document")
    if keeps:
        parser.add_argument("--keep", type=pathlib.Path, help="folder for cases and results (default: a temporary one)")


@contextlib.contextmanager
def folder_of(keep):
    """`keep`, made where it does not exist; without it a temporary folder."""
    with tempfile.TemporaryDirectory() as temporary:
        folder = keep or pathlib.Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        yield folder


class Rows:
    """All rows, and the file they are kept in, if any. `keys`: those of a row that make its job. `only`: which of the file's rows
    belong to this evaluation."""

    def __init__(self, path, keys, only=lambda row: True):
        self.path, self.keys = path, keys
        lines = path.read_text().splitlines() if path and path.exists() else []
        self.rows = list(filter(only, map(json.loads, lines)))

    def gather(self, work, jobs, count=1):
        """Adds the row or rows of `work(*job)` for every job that has none, `count` jobs at once, and prints them as they come."""
        done = {tuple(row[key] for key in self.keys) for row in self.rows}
        for found in parallel(work, [job for job in jobs if job not in done], count):
            self.add(found if isinstance(found, list) else [found])

    def add(self, rows):
        self.rows += rows
        text = "".join(json.dumps(row) + "\n" for row in rows)
        print(text, end="", flush=True)
        if self.path:
            with self.path.open("a") as out:
                out.write(text)


def parallel(work, jobs, count):
    """Results of `work(*job)` as they come."""
    pool = concurrent.futures.ThreadPoolExecutor(count)
    try:
        for done in concurrent.futures.as_completed([pool.submit(work, *job) for job in jobs]):
            yield done.result()
    finally:
        pool.shutdown(cancel_futures=True)


def renew(document, table, begin, end):
    text = document.read_text()
    if begin not in text or end not in text:
        sys.exit(f"{document}: the marks {begin} and {end} are missing")
    document.write_text(f"{text[:text.index(begin)]}{begin}\n{table.strip()}\n{text[text.index(end):]}")
