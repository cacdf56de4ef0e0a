#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The documentation as a site with search, from docs/ and from what program, Python package and headers say of
# themselves: build/site/index.html
set -euo pipefail
cd "$(dirname "$0")/.."

tools/install_packages.sh build python docs
tools/build.sh -DHELICARM_PYTHON=ON helicarm helicarm_python
rm -rf build/docs build/site
cp -r docs build/docs
cp CONTRIBUTING.md CHANGELOG.md SECURITY.md build/docs
cp README.md build/docs/overview.md
# Beside each other here, one above the other in the repository.
sed -i 's#(\(\.\./\)\?README\.md#(overview.md#g; s#(\.\./#(#g; s#(docs/#(#g' build/docs/*.md
tools/cli_reference.py build/bin/helicarm markdown build/docs/options.md
PYTHONPATH=build/python /usr/bin/python3 tools/api_reference.py python build/docs/python_api.md
/usr/bin/python3 tools/api_reference.py cpp build/docs/cpp_api.md
/usr/bin/mkdocs build --quiet --strict
echo "build/site/index.html" >&2
