#!/bin/sh
# Create a virtual environment with pip, by whatever this machine has for it.
#
#     scripts/create_environment.sh FOLDER [PYTHON]
#
# PYTHON is a command; by default the first of python3, python3.14, ..., python3.11 and python that is new enough.
# A folder that is such an environment stays; one without pip gets it. What is incomplete is removed.
set -u
folder=$1
python=${2:-}

is_new_enough() {
    "$1" -c 'import sys; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1
}

fail() {
    printf 'maniport: %s\n' "$1" >&2
    exit 1
}

has_pip() {
    [ -x "$folder/bin/pip" ] && "$folder/bin/python" -m pip --version >/dev/null 2>&1
}

add_pip() {
    is_new_enough "$folder/bin/python" || return 1
    "$folder/bin/python" -m ensurepip --default-pip >/dev/null 2>&1 && has_pip && return
    command -v uv >/dev/null && uv pip install --quiet --python "$folder/bin/python" pip && has_pip
}

if [ -n "$python" ]; then
    is_new_enough "$python" ||
        fail "PYTHON=$python is not Python 3.11 or newer: $("$python" --version 2>&1)"
else
    for candidate in python3 python3.14 python3.13 python3.12 python3.11 python; do
        if is_new_enough "$candidate"; then
            python=$candidate
            break
        fi
    done
    [ -n "$python" ] || fail "Python 3.11 or newer is needed, found $(python3 --version 2>&1). \
If it is installed elsewhere, name it: make demo PYTHON=/path/to/python3.11"
fi

if has_pip || add_pip; then
    exit
fi

said=$("$python" -m venv --clear "$folder" 2>&1)
has_pip && exit
rm -rf "$folder"
if command -v uv >/dev/null; then
    uv venv --quiet --seed --python "$(command -v "$python")" "$folder"
    has_pip && exit
    rm -rf "$folder"
fi
if "$python" -m virtualenv --version >/dev/null 2>&1; then
    "$python" -m virtualenv --quiet "$folder"
    has_pip && exit
    rm -rf "$folder"
elif command -v virtualenv >/dev/null; then
    virtualenv --quiet --python "$(command -v "$python")" "$folder"
    has_pip && exit
    rm -rf "$folder"
fi
printf '%s\n' "$said" >&2
version=$("$python" -c 'import sys; print("%d.%d" % sys.version_info[:2])')
fail "$python cannot create a virtual environment. Debian and Ubuntu: apt install python$version-venv. \
Elsewhere install uv or virtualenv. Then repeat the command."
