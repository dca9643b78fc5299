#!/bin/sh
# Make a virtual environment for the make targets: that of the package, with it and lock.txt, or one
# with another list only. Usage: venv.sh PYTHON VENV [LIST]
set -eu
python=$1
venv=$2
list=${3:-}
here=$(dirname "$0")
root=$(dirname "$here")

new_enough() {
    command -v "$1" >/dev/null 2>&1 &&
        "$1" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null
}

if ! new_enough "$python"; then
    for candidate in python3.11 python3.12 python3.13 python3.14; do
        if new_enough "$candidate"; then
            python=$candidate
            break
        fi
    done
fi
if ! new_enough "$python"; then
    echo "make: $python is missing or older than Python 3.11; name another: make PYTHON=/path/to/python3" >&2
    exit 1
fi

# Debian and Ubuntu keep ensurepip, without which a venv has no pip, in a package of its own.
if ! "$python" -c 'import ensurepip, venv' 2>/dev/null; then
    package=$("$python" -c 'import sys; print("python%d.%d-venv" % sys.version_info[:2])')
    if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null 2>&1; then
        echo "make: installing $package"
        apt-get update -qq
        DEBIAN_FRONTEND=noninteractive apt-get install -y -qq "$package" >/dev/null
    else
        echo "make: $python cannot make virtual environments; install them with: sudo apt-get install $package" >&2
        exit 1
    fi
fi

# One that was made by another Python, or moved from another folder, is made anew.
wanted=$("$python" -c 'import sys; print("%d.%d" % sys.version_info[:2])')
if [ -d "$venv" ]; then
    found=$("$venv/bin/python" -c 'import sys; print("%d.%d" % sys.version_info[:2])' 2>/dev/null || true)
    [ "$found" = "$wanted" ] || rm -rf "$venv"
fi
[ -x "$venv/bin/python" ] || "$python" -m venv "$venv"

quiet=-q
if [ -t 1 ]; then quiet=; fi
if [ -n "$list" ]; then
    echo "make: installing $list into $venv"
    exec "$venv/bin/python" -m pip install $quiet --disable-pip-version-check -r "$list"
fi
echo "make: installing the pinned dependencies into $venv (a minute or two, 1 GB)"
"$venv/bin/python" -m pip install $quiet --disable-pip-version-check -r "$here/lock.txt"
"$venv/bin/python" -m pip install -q --disable-pip-version-check \
    --no-deps --no-build-isolation --editable "$root"
