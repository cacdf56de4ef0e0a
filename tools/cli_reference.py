#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Man pages, bash completion and the command reference, all from the program's own --help.

tools/cli_reference.py PROGRAM man|completion|markdown OUT
"""
import pathlib
import re
import subprocess
import sys

HEADINGS = ("Positionals:", "Options:", "Subcommands:", "Example:", "Begin with:")


def help_of(program, words):
    done = subprocess.run([program, *words, "--help"], capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"cli_reference: {program} {' '.join(words)} --help ends with {done.returncode}")
    return done.stdout


def parsed(text):
    """{"about": [lines], "usage": line, heading: [(term, description)] or lines}"""
    page, heading = {"about": [], "usage": ""}, None
    for line in text.splitlines():
        if line in HEADINGS:
            heading = line[:-1]
            page[heading] = []
        elif re.fullmatch(r"[A-Z][a-z ]+:", line) and heading not in ("Example", "Begin with"):  # a group of commands
            heading = "Subcommands"
            page.setdefault(heading, [])
        elif line.startswith("Usage: "):
            page["usage"] = line[len("Usage: "):]
        elif heading is None and line.strip():
            page["about"].append(line)
        elif heading in ("Example", "Begin with") and line.strip():
            page[heading].append(line.strip())
        elif heading and (found := re.match(r"  (\S.*?)(?:\s{2,}(.*))?$", line)) and not line.startswith("   "):
            page[heading].append([found.group(1), found.group(2) or ""])
        elif heading and line.strip() and page[heading]:
            page[heading][-1][1] = (page[heading][-1][1] + " " + line.strip()).strip()
    return page


def tree(program, words=()):
    """Every command with its page, depth first: [(words, page)]."""
    page = parsed(help_of(program, words))
    pages = [(list(words), page)]
    for name, _ in page.get("Subcommands", []):
        pages += tree(program, [*words, name])
    return pages


def options(page):
    """The words that begin with a dash, as they are typed."""
    return [word for term, _ in page.get("Options", []) for word in re.findall(r"--?[a-z][a-z0-9-]*", term.split(" ")[0])]


def roff(text):
    text = text.replace("\\", "\\e").replace("-", "\\-")
    return "\\&" + text if text.startswith((".", "'")) else text


def man_page(words, page, version):
    name = "-".join(["helicarm", *words])
    lines = [f'.TH {name.upper()} 1 "" "helicarm {version}" "User Commands"', ".SH NAME",
             f"{roff(name)} \\- {roff(page['about'][0].removeprefix('helicarm: '))}", ".SH SYNOPSIS",
             f".B {roff(page['usage'])}"]
    if len(page["about"]) > 1:
        lines += [".SH DESCRIPTION", *map(roff, page["about"][1:])]
    for heading, title in (("Positionals", "ARGUMENTS"), ("Options", "OPTIONS"), ("Subcommands", "COMMANDS")):
        if page.get(heading):
            lines.append(f".SH {title}")
            for term, text in page[heading]:
                lines += [".TP", f".B {roff(term)}", roff(text)]
    if page.get("Example"):
        lines += [".SH EXAMPLES", ".nf", *map(roff, page["Example"]), ".fi"]
    lines += [".SH EXIT STATUS", "0 done, 1 internal error, 2 wrong usage or unreadable input, 3 refused: the data do not",
              "support a reliable answer.", ".SH SEE ALSO",
              ".BR helicarm (1)" if words else ".BR " + " (1),\n.BR ".join(
                  f"helicarm\\-{term}" for term, _ in page.get("Subcommands", [])) + " (1)"]
    return "\n".join(lines) + "\n"


def completion(pages):
    cases = []
    for words, page in pages:
        subcommands = [term for term, _ in page.get("Subcommands", [])]
        cases.append(f"    '{' '.join(words)}') echo '{' '.join(subcommands + options(page))}' ;;")
    common = [o for o in options(pages[0][1]) if o.startswith("--")]
    known = "|".join(f"'{' '.join(words)}'" for words, _ in pages if words)
    return "\n".join([
        "# bash completion for helicarm, made from its --help", "_helicarm_words() {", '  case "$1" in', *cases, "  esac",
        "}", "_helicarm() {", '  local here="${COMP_WORDS[COMP_CWORD]}" path="" word next',
        '  for word in "${COMP_WORDS[@]:1:COMP_CWORD-1}"; do', '    next="${path:+$path }$word"',
        f'    case "$next" in {known}) path="$next" ;; esac', "  done",
        f'  COMPREPLY=($(compgen -W "$(_helicarm_words "$path") {" ".join(common)}" -- "$here"))',
        '  [[ "$here" == -* ]] || COMPREPLY+=($(compgen -f -- "$here"))', "}",
        "complete -o filenames -F _helicarm helicarm", ""])


def markdown(pages):
    lines = ["# Options of each command", "", "Made from the program's own `--help` by `tools/cli_reference.py`.", ""]
    for words, page in pages:
        lines += [f"## `{' '.join(['helicarm', *words])}`", "", *page["about"], "", "```", page["usage"], "```", ""]
        for heading in ("Positionals", "Options", "Subcommands"):
            if page.get(heading):
                lines += [f"| {heading.lower()} | |", "| --- | --- |"]
                lines += [f"| `{term}` | {text} |".replace("\\", "\\\\") for term, text in page[heading]] + [""]
        if page.get("Example"):
            lines += ["```", *page["Example"], "```", ""]
    return "\n".join(lines)


def main():
    if len(sys.argv) != 4 or sys.argv[2] not in ("man", "completion", "markdown"):
        sys.exit(__doc__)
    program, kind, out = sys.argv[1], sys.argv[2], pathlib.Path(sys.argv[3])
    pages = tree(program)
    version = subprocess.run([program, "--version"], capture_output=True, text=True).stdout.split()[1]
    if kind == "man":
        out.mkdir(parents=True, exist_ok=True)
        for words, page in pages:
            (out / ("-".join(["helicarm", *words]) + ".1")).write_text(man_page(words, page, version))
        return
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(completion(pages) if kind == "completion" else markdown(pages))


if __name__ == "__main__":
    main()
