"""Whether JSON files are what the schema says of the commands that printed them: check.py SCHEMA COMMAND=FILE ..."""

import json
import sys

import jsonschema

with open(sys.argv[1]) as file:
    schema = json.load(file)
wrong = []
for command, path in (pair.split("=", 1) for pair in sys.argv[2:]):
    part = schema["$defs"]["error"] if command == "error" else schema["properties"][command]
    checked = jsonschema.Draft202012Validator({"$schema": schema["$schema"], "$defs": schema["$defs"], **part})
    with open(path) as file:
        wrong += [f"{command}: {e.json_path}: {e.message[:300]}" for e in checked.iter_errors(json.load(file))]
print("\n".join(wrong))
sys.exit(bool(wrong))
