"""The list of what programs are made of is whole, and of one piece.

sbom_test.py SBOM_SCRIPT PROGRAM...
"""

import json
import subprocess
import sys

script, *programs = sys.argv[1:]
sbom = json.loads(subprocess.run([sys.executable, script, *programs], capture_output=True, check=True).stdout)

packages = {package["SPDXID"]: package for package in sbom["packages"]}
assert len(packages) == len(sbom["packages"]), "identifiers are not unique"
assert sbom["spdxVersion"] == "SPDX-2.3" and sbom["dataLicense"] == "CC0-1.0"
assert sbom["creationInfo"]["created"].endswith("Z")
for package in packages.values():
    assert package["versionInfo"], package
    assert package["SPDXID"] == "SPDXRef-tumbler" or package["externalRefs"][0]["referenceType"] == "purl"
known = set(packages) | {"SPDXRef-DOCUMENT"}
links = {}
for relation in sbom["relationships"]:
    assert {relation["spdxElementId"], relation["relatedSpdxElement"]} <= known, relation
    links.setdefault(relation["relationshipType"], set()).update(
        {relation["spdxElementId"], relation["relatedSpdxElement"]} - {"SPDXRef-tumbler", "SPDXRef-DOCUMENT"})
# Of the solver, the telemetry and the C library one does not get rid of; headers alone are needed to build.
for name in ("libnlopt0", "liblcm1", "libc6", "libfmt9"):
    assert any(name in package for package in links["DYNAMIC_LINK"]), name
for name in ("libcli11-dev", "libeigen3-dev", "cmake"):
    assert "SPDXRef-" + name in links["BUILD_DEPENDENCY_OF"], name

nothing = subprocess.run([sys.executable, script], capture_output=True, check=False)
assert nothing.returncode == 1 and nothing.stdout == b""
print(f"{len(packages)} packages")
