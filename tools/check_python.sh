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
cp -r python/tests examples/*.ipynb "$folder"
cd "$folder"
export MPLBACKEND=Agg
venv/bin/python -c 'import helicarm; assert "venv" in helicarm.__file__, helicarm.__file__'
venv/bin/python -m pytest -q -rs -p no:cacheprovider tests
venv/bin/python -m ipykernel install --prefix "$folder/venv" --name python3 >/dev/null
for notebook in first_steps arrays; do
  JUPYTER_PATH=$folder/venv/share/jupyter venv/bin/python -m nbconvert --to notebook --execute --output ran.ipynb "$notebook.ipynb"
  venv/bin/python - "$notebook" <<END
import json, sys
cells = json.load(open("ran.ipynb"))["cells"]
pictures = sum("image/png" in o.get("data", {}) for c in cells for o in c.get("outputs", []))
least = {"first_steps": 3, "arrays": 1}[sys.argv[1]]
assert pictures >= least, f"{pictures} pictures"
print(f"{sys.argv[1]}: {pictures} pictures")
END
done
