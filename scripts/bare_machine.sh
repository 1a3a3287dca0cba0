#!/usr/bin/env bash
# On a bare Debian 12, made by debootstrap (as root): installs the packages of `make deb`, runs them; with `demo`, runs
# `make demo` of a clone there instead, with nothing installed before but make and git.
# usage: scripts/bare_machine.sh [packages|demo|TARGET OF MAKE]
set -euo pipefail
cd "$(dirname "$0")/.."
what=${1:-packages}
root=${BARE_ROOT:-$PWD/build/bare}
scripts/install_packages.sh debootstrap
[ ! -e "$root" ] || { echo "$root: is there already; remove it, or set BARE_ROOT" >&2; exit 1; }
debootstrap --variant=minbase bookworm "$root" > /dev/null
clean_up() {
  for mounted in root/.cache/ccache proc; do
    ! mountpoint -q "$root/$mounted" || umount "$root/$mounted" || return 1  # never delete what is mounted
  done
  rm -rf --one-file-system "$root"
}
trap clean_up EXIT
echo '127.0.0.1 localhost' > "$root/etc/hosts"  # which an installed system has
inside() { chroot "$root" env DEBIAN_FRONTEND=noninteractive HOME=/root ${registry:+npm_config_registry="$registry"} bash -euc "$1"; }
registry=$(npm config get registry 2> /dev/null || true)  # a mirror, where there is one
inside 'apt-get update -qq > /dev/null; mount -t proc proc /proc 2> /dev/null || true'
if [ "$what" = packages ]; then
  cp out/deb/*.deb "$root/tmp"
  inside '
    apt-get install -y -qq --no-install-recommends /tmp/*.deb cmake g++ make > /dev/null 2>&1
    cd /tmp
    revisit --version
    revisit simulate --sensor vlp16 --length_m 100 --out drive.mcap 2> /dev/null
    revisit slam drive.mcap --out map 2> /dev/null
    revisit view map --report map.html
    python3 -c "import revisit; print(revisit.__version__, revisit.LoopDetector())"'
  cp -r tests/consumer "$root/tmp/consumer"
  inside 'cmake -S /tmp/consumer -B /tmp/consumer/build > /dev/null && cmake --build /tmp/consumer/build > /dev/null && /tmp/consumer/build/consumer && /tmp/consumer/build/consumer_of_shared'
else
  git clone -q . "$root/root/revisit"
  mkdir -p "$root/root/.cache/ccache"
  [ ! -d ~/.cache/ccache ] || mount --bind ~/.cache/ccache "$root/root/.cache/ccache"
  inside "apt-get install -y -qq --no-install-recommends make git ca-certificates > /dev/null 2>&1; cd /root/revisit && make $what"
fi
echo "bare machine, $what: done"
