#!/usr/bin/env python3
"""Checks the style of proto/adhesim: every message, field, enum value, service and rpc has a comment; packages, names and
zero values follow the house style. Reads what protoc itself understood, comments included.

With --self-test it checks itself on a planted bad file.
"""

import os
import re
import subprocess
import sys
import tempfile

INCLUDE_DIR = "/usr/include"   # Debian's copy of google/protobuf/*.proto
LOWER_SNAKE = re.compile(r"^[a-z][a-z0-9]*(_[a-z0-9]+)*$")
PASCAL = re.compile(r"^[A-Z][A-Za-z0-9]*$")
UPPER_SNAKE = re.compile(r"^[A-Z][A-Z0-9]*(_[A-Z0-9]+)*$")


def parse_text_format(text):
    """protoc's text output as nested dicts of lists: {"file": [{"name": ["a.proto"], ...}]}."""
    root = {}
    stack = [root]
    for line in text.splitlines():
        line = line.strip()
        if line == "}":
            stack.pop()
        elif line.endswith("{") and ": " not in line:
            child = {}
            stack[-1].setdefault(line[:-1].strip(), []).append(child)
            stack.append(child)
        elif ": " in line:
            key, value = line.split(": ", 1)
            stack[-1].setdefault(key, []).append(value.strip('"'))
    return root


def describe(directory, files):
    """The descriptors of `files`, with their comments."""
    with tempfile.NamedTemporaryFile(suffix=".pb") as out:
        subprocess.run(["protoc", f"-I{directory}", f"-I{INCLUDE_DIR}", "--include_source_info",
                        f"--descriptor_set_out={out.name}", *files], check=True)
        out.seek(0)
        text = subprocess.run(
            ["protoc", f"-I{INCLUDE_DIR}", "--decode=google.protobuf.FileDescriptorSet",
             "google/protobuf/descriptor.proto"],
            check=True, stdin=out, capture_output=True, text=True).stdout
    return parse_text_format(text).get("file", [])


class FileCheck:
    """Collects the problems of one file."""

    def __init__(self, file):
        self.file = file
        self.problems = []
        # Where each part stands and whether it has a comment, by its path in FileDescriptorProto.
        self.places = {}
        for info in file.get("source_code_info", [{}])[0].get("location", []):
            path = tuple(int(i) for i in info.get("path", []))
            line = int(info["span"][0]) + 1
            commented = "leading_comments" in info or "trailing_comments" in info
            self.places[path] = (line, commented)

    def error(self, path, text):
        line, _ = self.places.get(path, (1, False))
        self.problems.append(f"{self.file['name'][0]}:{line}: error: {text}")

    def name(self, path, what, name, pattern):
        if not pattern.match(name):
            self.error(path, f"{what} {name}: the name does not match {pattern.pattern}")
        if not self.places.get(path, (1, False))[1]:
            self.error(path, f"{what} {name} has no comment")

    def message(self, path, message):
        if message.get("options", [{}])[0].get("map_entry") == ["true"]:
            return
        self.name(path, "message", message["name"][0], PASCAL)
        for i, field in enumerate(message.get("field", [])):
            self.name(path + (2, i), "field", field["name"][0], LOWER_SNAKE)
        for i, nested in enumerate(message.get("nested_type", [])):
            self.message(path + (3, i), nested)
        for i, enum in enumerate(message.get("enum_type", [])):
            self.enum(path + (4, i), enum)

    def enum(self, path, enum):
        name = enum["name"][0]
        self.name(path, "enum", name, PASCAL)
        prefix = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).upper() + "_"
        for i, value in enumerate(enum.get("value", [])):
            value_name = value["name"][0]
            self.name(path + (2, i), "enum value", value_name, UPPER_SNAKE)
            if value["number"] == ["0"] and value_name != prefix + "UNSPECIFIED":
                self.error(path + (2, i), f"the zero of {name} must be {prefix}UNSPECIFIED, not {value_name}")
            elif not value_name.startswith(prefix):
                self.error(path + (2, i), f"{value_name} must begin with {prefix}")

    def check(self):
        package = self.file.get("package", ["none"])[0]
        if package != "adhesim.v1":
            self.error((2,), f"the package must be adhesim.v1, not {package}")
        # Numbers are those of FileDescriptorProto: message_type 4, enum_type 5, service 6, extension 7.
        for i, message in enumerate(self.file.get("message_type", [])):
            self.message((4, i), message)
        for i, enum in enumerate(self.file.get("enum_type", [])):
            self.enum((5, i), enum)
        for i, service in enumerate(self.file.get("service", [])):
            self.name((6, i), "service", service["name"][0], PASCAL)
            for j, method in enumerate(service.get("method", [])):
                self.name((6, i, 2, j), "rpc", method["name"][0], PASCAL)
        for i, extension in enumerate(self.file.get("extension", [])):
            self.name((7, i), "extension", extension["name"][0], LOWER_SNAKE)
        return self.problems


def check(directory, files):
    return [problem for file in describe(directory, files) for problem in FileCheck(file).check()]


PLANTED = """syntax = "proto3";
package adhesim.v2;
message bad_name { int32 CamelField = 1; }
// Commented.
message Good {
  // Commented.
  int32 good_field = 1;
  map<string, int32> no_comment = 2;
}
// Commented.
enum Colour {
  // Zero.
  COLOUR_RED = 0;
  // Wrong prefix.
  BLUE = 1;
}
// Commented.
service Maker { rpc Make(Good) returns (Good); }
"""
EXPECTED = [
    ":2: error: the package must be adhesim.v1",
    ":3: error: message bad_name: the name", ":3: error: message bad_name has no comment",
    ":3: error: field CamelField: the name", ":3: error: field CamelField has no comment",
    ":8: error: field no_comment has no comment",
    ":13: error: the zero of Colour must be COLOUR_UNSPECIFIED",
    ":15: error: BLUE must begin with COLOUR_",
    ":18: error: rpc Make has no comment",
]


def self_test():
    with tempfile.TemporaryDirectory() as directory:
        with open(os.path.join(directory, "planted.proto"), "w", encoding="utf-8") as file:
            file.write(PLANTED)
        found = check(directory, ["planted.proto"])
    wrong = [f"not found: {e}" for e in EXPECTED if not any(e in f for f in found)]
    return wrong + [f"not expected: {f}" for f in found if not any(e in f for e in EXPECTED)]


def main():
    if sys.argv[1:] == ["--self-test"]:
        found = self_test()
    else:
        files = sorted(os.path.relpath(os.path.join(folder, name), "proto")
                       for folder, _, names in os.walk("proto/adhesim") for name in names
                       if name.endswith(".proto"))
        found = ["proto/" + problem for problem in check("proto", files)]
    print("\n".join(found), end="\n" if found else "", file=sys.stderr)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
