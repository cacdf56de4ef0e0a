#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The Python package as a user installs it, in a virtual environment that sees Debian's packages, and each notebook run
# there: tools/check_python.sh. operation.ipynb needs the program in build/bin.
set -euo pipefail
cd "$(dirname "$0")/.."

tools/install_packages.sh build python test full
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
/usr/bin/python3 -m venv --system-site-packages "$folder/venv"
HELICARM_BUILD_FOLDER=$PWD/build "$folder/venv/bin/pip" install -q --no-build-isolation --no-deps .
rm -rf build/lib build/bdist.*
cp -r python/tests examples/*.ipynb "$folder"
program=$PWD/build/bin
cd "$folder"
export MPLBACKEND=Agg
venv/bin/python -c 'import helicarm; assert "venv" in helicarm.__file__, helicarm.__file__'
venv/bin/python -m pytest -q -rs -p no:cacheprovider tests
venv/bin/python -m ipykernel install --prefix "$folder/venv" --name python3 >/dev/null
export JUPYTER_PATH=$folder/venv/share/jupyter PATH=$program:$PATH
for notebook in *.ipynb; do
  venv/bin/python -m nbconvert --to notebook --execute --output-dir ran "$notebook"
done
venv/bin/python - <<END
import json, pathlib
figures = {"arrays": 1, "bone": 3, "camera": 1, "first_steps": 3, "migration": 1, "motion": 2, "operation": 1, "phantom": 1, "run": 1}
assert sorted(figures) == sorted(path.stem for path in pathlib.Path().glob("*.ipynb")), "figures: state the least number of each notebook"
for name, least in figures.items():
    cells = json.loads(pathlib.Path(f"ran/{name}.ipynb").read_text())["cells"]
    drawn = sum("image/png" in output.get("data", {}) for cell in cells for output in cell.get("outputs", []))
    assert drawn >= least, f"{name}: {drawn} figures, at least {least} expected"
    print(f"{name}: {drawn} figures")
END
