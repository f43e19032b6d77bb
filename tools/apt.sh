#!/bin/sh
# Installs the Debian packages that the checks need and that are missing; says what to install when it may not.
set -eu
needed="make python3-venv chromium gcc libc6-dev g++ gcc-avr avr-libc binutils-avr libsimavr-dev avrdude arduino-core-avr"
missing=""
for package in $needed; do
    dpkg-query --show --showformat='${Status}' "$package" 2>/dev/null | grep -q 'ok installed' || missing="$missing $package"
done
[ -z "$missing" ] && exit 0
if [ "$(id -u)" = 0 ]; then
    apt-get update --quiet=2
    # shellcheck disable=SC2086
    DEBIAN_FRONTEND=noninteractive apt-get install --quiet=2 --yes --no-install-recommends $missing
elif command -v sudo >/dev/null; then
    # shellcheck disable=SC2086
    sudo apt-get update --quiet=2 && sudo apt-get install --quiet=2 --yes --no-install-recommends $missing
else
    echo "These Debian packages are missing; install them as root: apt-get install$missing" >&2
    exit 1
fi
