#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Writes the tables of keys in docs/formats.md from the program's own description: tools/format_tables.py PROGRAM [--check]

A table stands between <!-- keys of case[.list] --> and <!-- end -->. --check: changes nothing, exit code 1 if one differs.
"""
import json
import pathlib
import re
import subprocess
import sys

PAGE = pathlib.Path(__file__).resolve().parent.parent / "docs" / "formats.md"
MARK = re.compile(r"(<!-- keys of ([a-z_.]+) -->\n).*?(<!-- end -->)", re.S)


def limits(schema):
    kinds = schema.get("type", [])
    kinds = [kinds] if isinstance(kinds, str) else kinds
    if "enum" in schema:
        return ""
    if "minimum" in schema:
        return f"{schema['minimum']:.10g} to {schema['maximum']:.10g}"
    if "string" in kinds and "minLength" in schema:
        return f"{schema['minLength']} to {schema['maxLength']} characters"
    if "string" in kinds and schema.get("maxLength", 0) > 1000:
        return f"text of at most {schema['maxLength']} characters"
    if "array" in kinds and "items" in schema:
        items = schema["items"]
        least, most = schema.get("minItems", 0), schema.get("maxItems")
        if most is None:
            return "list"
        count = f"{most}" if least == most else f"{least} to {most}" if least else f"at most {most}"
        of = f" numbers, each {limits(items)}" if "minimum" in items else ""
        if items.get("type") == "array" and "maxItems" in items:
            return f"{count} rows of {items['maxItems']} numbers"
        return f"list of {count}{of}"
    return ""


def row(key, schema, required):
    words = [json.dumps(word) for word in schema.get("enum", []) if word is not None]
    value = limits(schema) or (" or ".join(f"`{word}`" for word in words) if key != "format" else "")
    text = schema["description"]
    value = f"{value}: {text}" if value else text
    if schema.get("default") is not None:
        value += f". Default `{json.dumps(schema['default'])}`"
    return f"| `{key}` | {value} | {'required' if required else ''} |"


def table(schema, path):
    for key in path:
        schema = schema["properties"][key]
        schema = schema.get("items", schema)
    required = schema.get("required", []) + schema.get("anyOf", [{}])[0].get("required", [])
    rows = [row(key, value, key in required) for key, value in schema["properties"].items()]
    return "\n".join(["", "| key | value | |", "| --- | --- | --- |", *rows, "", ""])


def main():
    program, check = sys.argv[1], "--check" in sys.argv[2:]
    page = PAGE.read_text()

    def filled(mark):
        file, *path = mark[2].split(".")
        schema = json.loads(subprocess.run([program, "schema", file], check=True, capture_output=True).stdout)
        return mark[1] + table(schema, path) + mark[3]

    new = MARK.sub(filled, page)
    if check:
        if new != page:
            sys.exit("docs/formats.md: a table of keys is not that of the program: run tools/format_tables.py PROGRAM")
        return
    PAGE.write_text(new)


if __name__ == "__main__":
    main()
