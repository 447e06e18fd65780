#!/bin/sh
# One test draws the scene with MuJoCo's own offscreen renderer, which needs EGL. Installs it where that can be done
# without asking (root on Debian or Ubuntu); elsewhere says so and lets that test be skipped.
set -eu

PACKAGES="libegl1 libgl1 libgl1-mesa-dri"

has_egl() { { ldconfig -p || /sbin/ldconfig -p; } 2>/dev/null | grep -q 'libEGL\.so\.1'; }

if has_egl; then
    exit 0
fi
if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null 2>&1; then
    echo "Installing $PACKAGES for the rendering test ..."
    export DEBIAN_FRONTEND=noninteractive
    if { apt-get update -qq && apt-get install -y -qq --no-install-recommends $PACKAGES; } >/dev/null 2>&1 && has_egl; then
        exit 0
    fi
fi
echo "No EGL here: the rendering test will be skipped. To run it, install (Debian, Ubuntu): $PACKAGES"
