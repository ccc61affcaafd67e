#!/bin/sh
# Runs the quick tests on each Python that is named and here, in an environment of its own in build/; names
# those that are not here. It fails if a test fails, or if none of them is here.
set -eu
cd "$(dirname "$0")/.."
tested="" failed="" missing=""
for version in "$@"; do
    # A name on the path may stand for nothing.
    if ! "python$version" -c 'import ensurepip, venv' 2>/dev/null; then
        missing="$missing $version"
        continue
    fi
    echo "test-pythons: Python $version"
    folder="build/python$version"
    [ -x "$folder/bin/python" ] || "python$version" -m venv "$folder"
    install() { "$folder/bin/python" -m pip install -qq --disable-pip-version-check "$@"; }
    if install --require-hashes -r requirements.txt && install --no-deps --no-build-isolation -e . &&
        "$folder/bin/python" -m pytest -q -n "${WORKERS:-2}" -m "not slow"; then
        tested="$tested $version"
    else
        failed="$failed $version"
    fi
done
[ -z "$tested" ] || echo "test-pythons: passed on$tested"
[ -z "$missing" ] || echo "test-pythons: not here:$missing"
[ -z "$failed" ] || { echo "test-pythons: failed on$failed" >&2; exit 1; }
[ -n "$tested" ] || exit 1
