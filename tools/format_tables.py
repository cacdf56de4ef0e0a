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


def kind_of(schema):
    """A value that is written: words for its type, where they say more than the description."""
    words = [f"`{json.dumps(word)}`" for word in schema.get("enum", []) if word is not None]
    if words:
        return " or ".join(words)
    items = schema.get("items", {})
    if "array" not in schema.get("type", []) or "number" not in items.get("type", []) and "array" not in items.get("type", []):
        return ""
    count = schema.get("minItems")
    if "array" in items["type"]:
        columns = items.get("minItems")
        return f"{count} rows of {columns} numbers" if count and columns else "rows of numbers"
    return f"{count} numbers" if count else "list of numbers"


def written_rows(schema, file, told, prefix=""):
    """Of a file that is only written: its objects' and lists' keys too, but of those that have a table of their own, or
    have been told (keys to the place where)."""
    for key, value in schema["properties"].items():
        text = ": ".join(filter(None, [kind_of(value), value["description"]]))
        named = value.get("additionalProperties", {})
        inside = []
        for inner, mark in ((value, "."), (value.get("items", {}), "[]."), (named, ".NAME.")):
            if "properties" not in inner or "see below" in text:
                continue
            keys, place = json.dumps(inner["properties"]), f"{prefix}{key}"
            of_file, at = told.setdefault(keys, (file, place))
            if at == place and of_file == file:
                inside += written_rows(inner, file, told, place + mark)
            else:
                other = "" if of_file == file else f" of [{of_file}.json](#{of_file}json)"
                text = "; ".join(filter(None, [text, f"keys as of `{at}`{other}"]))
        yield f"| `{prefix}{key}` | {text} |"
        yield from inside


def table(schema, path, told):
    file = schema.get("title", "").removesuffix(".json")
    is_read = '"additionalProperties": false' in json.dumps(schema)  # of a file that is only written keys may be added
    for key in path:
        schema = schema["properties"][key]
        schema = schema.get("items", schema)
    if not is_read:
        return "\n".join(["", "| key | value |", "| --- | --- |", *written_rows(schema, file, told), "", ""])
    required = schema.get("required", []) + schema.get("anyOf", [{}])[0].get("required", [])
    rows = [row(key, value, key in required) for key, value in schema["properties"].items()]
    return "\n".join(["", "| key | value | |", "| --- | --- | --- |", *rows, "", ""])


def main():
    program, check = sys.argv[1], "--check" in sys.argv[2:]
    page = PAGE.read_text()
    told = {}

    def filled(mark):
        file, *path = mark[2].split(".")
        schema = json.loads(subprocess.run([program, "schema", file], check=True, capture_output=True).stdout)
        return mark[1] + table(schema, path, told) + mark[3]

    new = MARK.sub(filled, page)
    if check:
        if new != page:
            sys.exit("docs/formats.md: a table of keys is not that of the program: run tools/format_tables.py PROGRAM")
        return
    PAGE.write_text(new)


if __name__ == "__main__":
    main()
