#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The Python package as a user installs it, in a virtual environment that sees Debian's packages, and the notebook run
# there: tools/check_python.sh
set -euo pipefail
cd "$(dirname "$0")/.."

tools/install_packages.sh build python test full
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
/usr/bin/python3 -m venv --system-site-packages "$folder/venv"
HELICARM_BUILD_FOLDER=$PWD/build "$folder/venv/bin/pip" install -q --no-build-isolation --no-deps .
rm -rf build/lib build/bdist.*
cp -r python/tests examples/first_steps.ipynb "$folder"
cd "$folder"
export MPLBACKEND=Agg
venv/bin/python -c 'import helicarm; assert "venv" in helicarm.__file__, helicarm.__file__'
venv/bin/python -m pytest -q -p no:cacheprovider tests
venv/bin/python -m ipykernel install --prefix "$folder/venv" --name python3 >/dev/null
JUPYTER_PATH=$folder/venv/share/jupyter venv/bin/python -m nbconvert --to notebook --execute --output ran.ipynb first_steps.ipynb
venv/bin/python - <<END
import json
cells = json.load(open("ran.ipynb"))["cells"]
pictures = sum("image/png" in o.get("data", {}) for c in cells for o in c.get("outputs", []))
assert pictures >= 3, f"{pictures} pictures"
print(f"notebook: {pictures} pictures")
END
