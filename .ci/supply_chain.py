#!/usr/bin/env python3
"""What the program is made of: an SBOM (CycloneDX 1.6, JSON), and whether its licences and sources are
those that deny.toml allows.

    .ci/supply_chain.py FILE [VULNERABILITIES]

writes the SBOM to FILE, with what is known of vulnerabilities ("not checked" where nothing is said); what deny.toml does not allow is named, and the status is then 1. Crates are those
that `cargo metadata` resolves for Linux with every feature, tests left out of the SBOM but not of the
check. The same sources make the same bytes: there is neither a time nor a random number in it.
"""

import hashlib
import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
TARGETS = ["x86_64-unknown-linux-gnu", "aarch64-unknown-linux-gnu"]
VENDOR = ROOT / "src/dashboard/assets/vendor"
CRATES_IO = "registry+https://github.com/rust-lang/crates.io-index"


def metadata():
    command = ["cargo", "metadata", "--format-version", "1", "--locked", "--all-features"]
    for target in TARGETS:
        command += ["--filter-platform", target]
    return json.loads(subprocess.run(command, cwd=ROOT, check=True, capture_output=True).stdout)


def spdx(licence):
    """What a package says, as an SPDX expression: some write `/` or `or` for OR."""
    upper = re.sub(r"\b(or|and|with)\b", lambda word: word[0].upper(), licence or "")
    return " ".join(upper.replace("/", " OR ").split())


def allows(expression, allowed):
    """Whether an SPDX expression (appendix D of SPDX 2.3) can be met with these licences."""
    tokens = re.findall(r"[()]|[^\s()]+", expression)

    def either():
        met = both()
        while tokens and tokens[0] == "OR":
            tokens.pop(0)
            met = both() or met
        return met

    def both():
        met = one()
        while tokens and tokens[0] == "AND":
            tokens.pop(0)
            met = one() and met
        return met

    def one():
        if not tokens:
            raise ValueError(f"`{expression}` is no SPDX expression")
        name = tokens.pop(0)
        if name == "(":
            met = either()
            if not tokens or tokens.pop(0) != ")":
                raise ValueError(f"`{expression}` is no SPDX expression")
            return met
        if tokens and tokens[0] == "WITH":
            name = f"{name} WITH {tokens[1]}"
            del tokens[:2]
        return name in allowed

    met = either()
    if tokens:
        raise ValueError(f"`{expression}` is no SPDX expression")
    return met


def faults(packages, policy):
    allowed = set(policy["licenses"]["allow"])
    for package in packages:
        name = f"{package['name']} {package['version']}"
        try:
            if not allows(spdx(package["license"]), allowed):
                yield f"{name}: the licence `{package['license']}` is not allowed"
        except ValueError as why:
            yield f"{name}: {why}"
        if package["source"] not in (None, CRATES_IO):
            yield f"{name}: the source {package['source']} is not allowed"


def reached(data, kinds):
    """The packages that the program needs by edges of these kinds."""
    nodes = {node["id"]: node for node in data["resolve"]["nodes"]}
    seen, open_ = set(), [data["resolve"]["root"]]
    while open_:
        package = open_.pop()
        if package in seen:
            continue
        seen.add(package)
        for dependency in nodes[package]["deps"]:
            if any(kind["kind"] in kinds for kind in dependency["dep_kinds"]):
                open_.append(dependency["pkg"])
    return seen


def purl(package):
    return f"pkg:cargo/{package['name']}@{package['version']}"


def component(package, checksums, runs):
    made = {
        "type": "library",
        "bom-ref": purl(package),
        "name": package["name"],
        "version": package["version"],
        # What runs while the program is built, and is no part of it.
        "scope": "required" if runs else "excluded",
        "licenses": [{"expression": spdx(package["license"])}],
        "purl": purl(package),
    }
    if package["description"]:
        made["description"] = " ".join(package["description"].split())
    checksum = checksums.get((package["name"], package["version"]))
    if checksum:
        made["hashes"] = [{"alg": "SHA-256", "content": checksum}]
    if package["repository"]:
        made["externalReferences"] = [{"type": "vcs", "url": package["repository"]}]
    return made


def scripts():
    """The scripts of others that the page has within itself."""
    for script in sorted(VENDOR.glob("*.js")):
        name, version = re.fullmatch(r"([a-z]+)-([0-9.]+)[.-]min\.js", script.name).groups()
        licence = (VENDOR / f"{name}-{version}.LICENSE").read_text()
        if "MIT License" not in licence:
            sys.exit(f"{script.name}: its licence is not the MIT licence")
        yield {
            "type": "library",
            "bom-ref": f"pkg:npm/{name}@{version}",
            "name": name,
            "version": version,
            "scope": "required",
            "hashes": [{"alg": "SHA-256", "content": hashlib.sha256(script.read_bytes()).hexdigest()}],
            "licenses": [{"license": {"id": "MIT"}}],
            "purl": f"pkg:npm/{name}@{version}",
        }


def sbom(data, vulnerabilities):
    packages = {package["id"]: package for package in data["packages"]}
    lock = tomllib.loads((ROOT / "Cargo.lock").read_text())["package"]
    checksums = {(own["name"], own["version"]): own.get("checksum") for own in lock}
    root = data["resolve"]["root"]
    runs, built = reached(data, {None}), reached(data, {None, "build"})
    crates = sorted((packages[own] for own in built if own != root), key=purl)
    page = list(scripts())
    nodes = [node for node in data["resolve"]["nodes"] if node["id"] in built]
    depends = []
    for node in sorted(nodes, key=lambda node: purl(packages[node["id"]])):
        needs = {
            purl(packages[dependency["pkg"]])
            for dependency in node["deps"]
            if any(kind["kind"] in (None, "build") for kind in dependency["dep_kinds"])
        }
        needs |= {script["bom-ref"] for script in page} if node["id"] == root else set()
        depends.append({"ref": purl(packages[node["id"]]), "dependsOn": sorted(needs)})
    program = packages[root]
    return {
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "version": 1,
        "metadata": {
            "component": {
                "type": "application",
                "bom-ref": purl(program),
                "name": program["default_run"],
                "version": program["version"],
                "licenses": [{"expression": program["license"]}],
                "purl": purl(program),
            },
            "properties": [{"name": "greybox:known-vulnerabilities", "value": vulnerabilities}],
        },
        "components": [component(own, checksums, own["id"] in runs) for own in crates] + page,
        "dependencies": depends,
    }


def main():
    if len(sys.argv) not in (2, 3):
        sys.exit(__doc__)
    data = metadata()
    policy = tomllib.loads((ROOT / "deny.toml").read_text())
    found = list(faults(data["packages"], policy))
    for fault in found:
        print(fault, file=sys.stderr)
    if found:
        sys.exit(1)
    made = sbom(data, sys.argv[2] if len(sys.argv) == 3 else "not checked")
    Path(sys.argv[1]).write_text(json.dumps(made, indent=1, ensure_ascii=False) + "\n")
    print(f"{len(made['components'])} components; {len(data['packages'])} crates with allowed licences and sources")


main()
