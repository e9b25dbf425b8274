"""What is inside a release and under which licence: a CycloneDX 1.6 document on standard output.

    python3 packaging/sbom.py > sbom.cdx.json

From `cargo metadata`, `cargo tree` and Cargo.lock alone: every crate that is compiled into the program or the wheel on Linux, with its licence and the
checksum of its archive; the data inside it (atlases, sample scans); the CGAL mesher beside it. No time, no random number: the same
sources give the same bytes. Ends with 1 when a crate states no licence.
"""

import json
import os
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PLATFORM = "x86_64-unknown-linux-gnu"


def cargo(*words):
    words = [os.environ.get("CARGO", "cargo"), *words]
    return subprocess.run(words, cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout


def compiled_in():
    """The packages that hgm is linked from, with what each needs of the others. `cargo metadata` knows licences but lists optional
    dependencies that nobody asked for; `cargo tree` knows which are compiled."""
    metadata = ["metadata", "--format-version", "1", "--locked", "--filter-platform", PLATFORM]
    everything = json.loads(cargo(*metadata))
    tree = ["tree", "--locked", "--target", PLATFORM, "--edges", "normal", "--prefix", "none", "--format", "{p}"]
    wheel = ROOT / "python" / "Cargo.toml"
    ours = ["hgm", *([tomllib.loads(wheel.read_text(encoding="utf-8"))["package"]["name"]] if wheel.exists() else [])]
    lines = [line for name in ours for line in cargo(*tree, "--package", name).splitlines()]
    named = {tuple(line.split()[:2]) for line in lines if line}
    packages = {package["id"]: package for package in everything["packages"]}
    inside = {id for id, package in packages.items() if (package["name"], f"v{package['version']}") in named}
    root = next(id for id in inside if packages[id]["name"] == "hgm" and packages[id]["source"] is None)
    found = {
        node["id"]: sorted(
            dependency["pkg"]
            for dependency in node["deps"]
            if dependency["pkg"] in inside and any(kind["kind"] is None for kind in dependency["dep_kinds"])
        )
        for node in everything["resolve"]["nodes"]
        if node["id"] in inside
    }
    return packages, root, found


def reference(package):
    return f"pkg:cargo/{package['name']}@{package['version']}"


def component(package, checksums):
    licence = package["license"]
    if not licence:
        sys.exit(f"{package['name']} {package['version']} states no licence: look at its files and leave it out or say so here")
    entry = {
        "type": "library",
        "bom-ref": reference(package),
        "name": package["name"],
        "version": package["version"],
        "purl": reference(package),
        # An older way of writing OR.
        "licenses": [{"expression": licence.replace("/", " OR ")}],
    }
    if checksum := checksums.get((package["name"], package["version"])):
        entry["hashes"] = [{"alg": "SHA-256", "content": checksum}]
    return entry


def beside():
    """What is in a release and no crate."""
    for atlas in sorted(path.parent for path in ROOT.glob("atlases/*/LICENSE")):
        name = f"atlases/{atlas.name}"
        text = (atlas / "LICENSE").read_text(encoding="utf-8")
        licence = {"license": {"name": f"{name}/LICENSE", "text": {"content": text}}}
        yield {"type": "data", "bom-ref": name, "name": name, "licenses": [licence]}
    yield {
        "type": "application",
        "bom-ref": "engines/cgal",
        "name": "hgm-cgal-mesher",
        "description": "A program of its own, run by hgm where it is installed; nothing of it is linked into hgm",
        "licenses": [{"expression": "GPL-3.0-or-later"}],
    }


def main():
    lock = tomllib.loads((ROOT / "Cargo.lock").read_text(encoding="utf-8"))
    checksums = {(one["name"], one["version"]): one.get("checksum") for one in lock["package"]}
    packages, root, found = compiled_in()
    libraries = sorted((packages[id] for id in found if packages[id]["source"]), key=lambda one: (one["name"], one["version"]))
    own = component(packages[root], {}) | {"type": "application"}
    others = list(beside())
    depends = [
        {"ref": reference(packages[id]), "dependsOn": sorted(reference(packages[one]) for one in needed)}
        for id, needed in found.items()
        if id == root or packages[id]["source"]
    ]
    document = {
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "version": 1,
        "metadata": {"component": own},
        "components": [component(package, checksums) for package in libraries] + others,
        "dependencies": sorted(depends, key=lambda one: one["ref"]),
    }
    json.dump(document, sys.stdout, indent=1)
    print()


if __name__ == "__main__":
    main()
