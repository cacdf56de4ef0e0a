# SPDX-License-Identifier: Apache-2.0
"""Exceptions of helicarm. Codes are those of docs/reasons.md, the same as of the program `helicarm`."""


class HelicarmError(Exception):
    """Base class.

    code: machine-readable reason, such as "too_few_fiducials"; "internal" for a fault of helicarm itself.
    message: a sentence. view: name of the view it concerns, or None. figures: numbers that led to it, such as
    {"value": -1.0, "limit": 0.0}. result: what had been computed until then (run_case), or None.
    """

    def __init__(self, code, message, view=None, figures=None, result=None):
        super().__init__(code, message, view, figures, result)
        self.code = code
        self.message = message
        self.view = view
        self.figures = figures or {}
        self.result = result

    def __str__(self):
        return f"{self.code}: {self.view + ': ' if self.view else ''}{self.message}"


class InputError(HelicarmError):
    """Wrong usage or unreadable input (exit code 2 of the program)."""


class RefusedError(HelicarmError):
    """The data do not support a reliable result (exit code 3 of the program)."""
