# SPDX-License-Identifier: Apache-2.0
"""The XML of each command, by the rules of Slicer's ModuleDescriptionParser; and the launchers."""

import json
import math
import os
import pathlib
import re
import unittest
import xml.etree.ElementTree as ET

from program import SimulatedCase, run

TAGS = {"boolean", "integer", "double", "double-vector", "string-enumeration", "file", "directory", "image", "string",
        "string-vector"}
CHILDREN = {"name", "longflag", "label", "description", "channel", "default", "element", "constraints", "index"}
VARIABLE = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
LARGEST = 2**31 - 1


def listed(words):
    """Subcommands, and the names of options and arguments, that --help lists."""
    text = run(*words, "--help").stdout
    body = text.split("\nExample:")[0]
    names = re.findall(r"^  (?:-h,)?(--[a-z][a-z0-9-]*(?:,--[a-z-]+)?|[A-Z][A-Z0-9_]+)[\s{]", body, re.M)
    subcommands = [] if "[OPTIONS] SUBCOMMAND" not in body else re.findall(r"^  ([a-z][a-z-]*) +[A-Z]", body, re.M)
    return subcommands, [name for name in names if name not in ("--help", "--version")]


def commands(words=()):
    subcommands, _ = listed(words)
    return [inner for name in subcommands for inner in commands([*words, name])] if subcommands else [list(words)]


def text_of(parameter, name):
    return parameter.findtext(name, "").strip()


class Descriptions(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.xml = {" ".join(words): run(*words, "--xml") for words in commands()}

    def parameters(self):
        for command, done in self.xml.items():
            for group in ET.fromstring(done.stdout).findall("parameters"):
                for parameter in group:
                    if parameter.tag not in ("label", "description"):
                        yield f"{command}: {text_of(parameter, 'name')}", parameter

    def test_every_command_has_one_and_nothing_else_is_printed(self):
        self.assertIn("c-arm add", self.xml)
        self.assertGreater(len(self.xml), 30)
        for command, done in self.xml.items():
            self.assertEqual((done.returncode, done.stderr), (0, ""), command)
            self.assertTrue(done.stdout.startswith('<?xml version="1.0" encoding="utf-8"?>\n'), command)

    def test_options_of_the_program_may_stand_before_the_command(self):
        for words in (["--threads", "1", "drr"], ["--threads=1", "--quiet", "c-arm", "add"]):
            command = " ".join(word for word in words if not word.startswith("--") and word != "1")
            self.assertEqual(run(*words, "--xml").stdout, self.xml[command].stdout, words)

    def test_executable_has_the_elements_of_the_schema_in_its_order(self):
        expected = ["category", "title", "description", "version", "documentation-url", "license", "contributor"]
        for command, done in self.xml.items():
            executable = ET.fromstring(done.stdout)
            self.assertEqual(executable.tag, "executable")
            self.assertEqual([child.tag for child in executable if child.tag != "parameters"], expected)
            self.assertEqual(executable.findtext("title"), "helicarm " + command)
            for group in executable.findall("parameters"):
                self.assertEqual([child.tag for child in group][:2], ["label", "description"], command)

    def test_parameters_are_of_known_kinds_with_names_that_are_variables(self):
        for command, parameter in self.parameters():
            self.assertIn(parameter.tag, TAGS, command)
            self.assertLessEqual({child.tag for child in parameter}, CHILDREN, command)
            name, flag = text_of(parameter, "name"), text_of(parameter, "longflag")
            self.assertTrue(VARIABLE.fullmatch(name), command)
            self.assertEqual(flag or "--" + name, "--" + name, command)
            self.assertNotEqual(bool(flag), parameter.find("index") is not None, f"{command}: flag or index, not both")
            if parameter.tag in ("file", "directory", "image"):
                self.assertIn(text_of(parameter, "channel"), ("input", "output"), command)

    def test_every_option_of_help_occurs_once(self):
        general = listed([])[1]
        for command, done in self.xml.items():
            own = listed(command.split())[1]
            groups = ET.fromstring(done.stdout).findall("parameters")
            names = [text_of(p, "name") for group in groups for p in group.findall("*[name]")]
            self.assertEqual(len(names), len(set(names)), command)
            expected = {name.lstrip("-").replace("-", "_") for name in own}
            expected |= {name.lstrip("-") for name in general}
            expected = {"no_ask" if name.startswith("ask,") else name for name in expected}
            self.assertEqual(set(names), expected, command)

    def test_places_are_counted_from_zero(self):
        for command, done in self.xml.items():
            places = [int(index.text) for index in ET.fromstring(done.stdout).iter("index")]
            self.assertEqual(places, list(range(len(places))), command)

    def test_defaults_are_inside_their_limits(self):
        seen = 0
        for command, parameter in self.parameters():
            limits, default = parameter.find("constraints"), text_of(parameter, "default")
            if parameter.tag in ("integer", "double"):
                self.assertTrue(default, f"{command}: a number is always passed on, so it needs a default")
                self.assertNotIn("e", default, command)
            if limits is not None:
                low, high, step = (float(limits.findtext(n)) for n in ("minimum", "maximum", "step"))
                self.assertTrue(low <= float(default) <= high, command)
                self.assertTrue(step > 0 and high / step < LARGEST, command)
                seen += 1
            if parameter.tag == "integer":
                self.assertLessEqual(abs(int(default)), LARGEST, command)
            if parameter.tag == "string-enumeration":
                words = [element.text for element in parameter.findall("element")]
                self.assertGreater(len(words), 1, command)
                self.assertEqual(len(words), len(set(words)), command)
                self.assertIn(default, ["", *words], command)
        self.assertGreater(seen, 40)

    def test_limits_are_those_of_help(self):
        help_text = run("drr", "--help").stdout
        drr = ET.fromstring(self.xml["drr"].stdout)
        for name, limits in re.findall(r"--([a-z-]+) (?:FLOAT|INT):(\S+ to [^=\s]+)=", help_text):
            found = next(p for p in drr.iter() if text_of(p, "name") == name.replace("-", "_"))
            values = [float(found.findtext("constraints/" + end)) for end in ("minimum", "maximum")]
            self.assertEqual(values, [float(value) for value in limits.split(" to ")], name)

    def test_words_of_choices_are_accepted_by_the_program(self):
        study = ET.fromstring(self.xml["study"].stdout)
        name = next(p for p in study.iter("string-enumeration") if text_of(p, "name") == "NAME")
        self.assertIn("biplane-images", [element.text for element in name.findall("element")])
        schema = ET.fromstring(self.xml["schema"].stdout)
        files = [element.text for element in schema.iter("element")]
        self.assertIn("case", files)
        for file in files:
            self.assertEqual(run("schema", file).returncode, 0, file)

    def test_a_group_has_none(self):
        done = run("c-arm", "--xml")
        self.assertEqual((done.returncode, done.stdout), (2, ""))
        self.assertIn("usage", done.stderr)


def words_of_slicer(xml, values):
    """The command line that vtkSlicerCLIModuleLogic makes: each simple parameter with its value or default, files and
    texts where they are not empty, then the arguments by their index."""
    words, places = [], {}
    for parameter in (p for group in ET.fromstring(xml).findall("parameters") for p in group.findall("*[name]")):
        value = str(values.get(text_of(parameter, "name"), text_of(parameter, "default")))
        flag = text_of(parameter, "longflag")
        if not flag:
            places[int(text_of(parameter, "index"))] = value
        elif parameter.tag == "boolean":
            words += [flag] if value == "true" else []
        elif value or parameter.tag in ("integer", "double", "string-enumeration"):
            words += [flag, value]
    return words + [places[index] for index in sorted(places)]


class Launchers(SimulatedCase):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.modules = cls.root / "it's modules"
        answer = run("slicer", cls.modules, "--json")
        cls.files = [pathlib.Path(file) for file in json.loads(answer.stdout)["modules"]]

    def call(self, module, *words):
        home = self.root / "home"
        home.mkdir(exist_ok=True)
        return run(*words, program=str(self.modules / module), env={**os.environ, "HOME": str(home)})

    def as_slicer(self, module, **values):
        return self.call(module, *words_of_slicer(self.call(module, "--xml").stdout, values))

    def test_one_of_each_command_that_needs_no_device_and_no_terminal(self):
        names = {file.name for file in self.files}
        self.assertLessEqual({"HelicarmRun", "HelicarmCArmAdd", "HelicarmDrr", "HelicarmPhantom"}, names)
        self.assertFalse({"HelicarmNavigate", "HelicarmTrackerWatch", "HelicarmReceive", "HelicarmSlicer"} & names)
        for file in self.files:
            self.assertTrue(os.access(file, os.X_OK))
            self.assertNotIn(".", file.name)  # Slicer takes a name with a dot for another kind of file

    def test_a_launcher_prints_the_xml_of_its_command(self):
        self.assertEqual(self.call("HelicarmCArmAdd", "--xml").stdout, run("c-arm", "add", "--xml").stdout)

    def test_every_untouched_form_is_understood(self):
        for file in self.files:
            done = self.call(file.name, *words_of_slicer(self.call(file.name, "--xml").stdout, {}), "--help")
            self.assertEqual((done.returncode, done.stderr), (0, ""), file.name)

    def test_run_gives_what_the_command_gives(self):
        by_module = self.as_slicer("HelicarmRun", CASE=self.root / "case", out=self.root / "by-module", max_error="5")
        self.assertEqual((by_module.returncode, by_module.stderr), (0, ""), by_module.stdout)
        self.assertIn("written to", by_module.stdout)
        run("run", self.root / "case", "--out", self.root / "by-command", "--max-error", 5)
        results = [json.loads((self.root / folder / "result.json").read_text()) for folder in ("by-module", "by-command")]
        for result in results:
            del result["timing_ms"]
        self.assertEqual(*results)

    def test_relative_results_lie_in_the_home_folder(self):
        self.assertEqual(self.as_slicer("HelicarmDemo").returncode, 0)
        self.assertTrue((self.root / "home" / "helicarm-demo").is_dir())

    def test_a_refusal_is_on_stderr_with_its_exit_code(self):
        done = self.as_slicer("HelicarmRun", CASE=self.root / "nothing")
        self.assertEqual(done.returncode, run("run", self.root / "nothing").returncode)
        self.assertIn("missing_file", done.stderr)

    def test_progress_is_in_tags_on_stdout(self):
        done = self.as_slicer("HelicarmStudy", NAME="number", groups=20000, out=self.root / "number")
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        shares = [float(share) for share in re.findall("<filter-progress>(.*)</filter-progress>", done.stdout)]
        self.assertEqual(shares, sorted(shares))
        self.assertTrue(shares and all(0 <= share <= 1 and not math.isnan(share) for share in shares))


if __name__ == "__main__":
    unittest.main()
