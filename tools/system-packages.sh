#!/bin/sh
# One test draws the scene with MuJoCo's own offscreen renderer, which needs EGL; some speak to a RealSense made of
# software, whose library needs libusb. Installs both where that can be done without asking (root on Debian or Ubuntu);
# elsewhere says so and lets those tests be skipped.
set -eu

PACKAGES="libegl1 libgl1 libgl1-mesa-dri libusb-1.0-0"

has() { { ldconfig -p || /sbin/ldconfig -p; } 2>/dev/null | grep -q "$1"; }
has_all() { has 'libEGL\.so\.1' && has 'libusb-1\.0\.so\.0'; }

if has_all; then
    exit 0
fi
if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null 2>&1; then
    echo "Installing $PACKAGES for tests of rendering and camera ..."
    export DEBIAN_FRONTEND=noninteractive
    if { apt-get update -qq && apt-get install -y -qq --no-install-recommends $PACKAGES; } >/dev/null 2>&1 && has_all; then
        exit 0
    fi
fi
echo "EGL or libusb is missing: tests that need them will be skipped. To run them, install (Debian, Ubuntu): $PACKAGES"
