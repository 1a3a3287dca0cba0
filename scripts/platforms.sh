#!/usr/bin/env bash
# Builds the modules that need Eigen and Highway alone for other processors and runs their tests in QEMU's user mode:
# arm64 (NEON), armhf (32 bits), s390x (the other byte order).
# usage: scripts/platforms.sh [ARCHITECTURE...]
set -euo pipefail
cd "$(dirname "$0")/.."
architectures=("${@:-arm64 armhf s390x}")
# shellcheck disable=SC2206
architectures=(${architectures[*]})
declare -A triple=([arm64]=aarch64-linux-gnu [armhf]=arm-linux-gnueabihf [s390x]=s390x-linux-gnu)
declare -A emulator=([arm64]=qemu-aarch64 [armhf]=qemu-arm [s390x]=qemu-s390x)
compile() {
  local object
  object=$work/$(echo "$1" | tr / _).o
  [ "$object" -nt "$1" ] || ccache "$compiler" -std=c++20 -O2 -DHWY_WANT_AVX3_DL "-DREVISIT_SOURCE_DIR=\"$PWD\"" -Isrc -Itests \
    -isystem "$work/root/usr/include" -isystem "$work/headers" -isystem "$work/headers/eigen3" -c "$1" -o "$object"
}
export -f compile

for architecture in "${architectures[@]}"; do
  compiler=${triple[$architecture]}-g++
  scripts/install_packages.sh qemu-user "g++-${triple[$architecture]}"
  work=$PWD/build/platforms/$architecture
  mkdir -p "$work/lists/partial" "$work/packages"
  # Libraries of the other architecture, unpacked beside the build: nothing is installed.
  if [ ! -d "$work/root" ]; then
    apt=(apt-get -qq -o "APT::Architectures=amd64,$architecture" -o "Dir::State::Lists=$work/lists" -o "APT::Sandbox::User=root")
    "${apt[@]}" update > /dev/null 2>&1 || true  # lists that are not needed may be absent
    (cd "$work/packages" && "${apt[@]}" download "libhwy1:$architecture" "libhwy-dev:$architecture" "libgtest-dev:$architecture")
    for package in "$work"/packages/*.deb; do dpkg -x "$package" "$work/root"; done
  fi
  mkdir -p "$work/headers"
  ln -sfn /usr/include/eigen3 /usr/include/toml++ "$work/headers/"
  export work compiler
  libraries=$work/root/usr/lib/${triple[$architecture]}
  for module in core bits config descriptors; do
    mapfile -t sources < <(git ls-files "src/revisit/core/*.cpp" "src/revisit/bits/*.cpp" "src/revisit/config/*.cpp" "src/revisit/descriptors/*.cpp" | grep -v _test.cpp | grep -v baseline)
    [ $module != core ] || sources=()
    [ $module != bits ] || mapfile -t sources < <(printf '%s\n' "${sources[@]}" | grep /bits/)
    mapfile -t tests < <(git ls-files "src/revisit/$module/*_test.cpp" | grep -v baseline)
    objects=()
    for source in "${sources[@]}" "${tests[@]}" tests/source_dir.cpp; do objects+=("$work/$(echo "$source" | tr / _).o"); done
    printf '%s\n' "${sources[@]}" "${tests[@]}" tests/source_dir.cpp | grep . | xargs -P "$(nproc)" -I{} bash -c 'compile {}'
    "$compiler" "${objects[@]}" -o "$work/${module}_test" -L"$libraries" -lgtest_main -lgtest -lhwy -lpthread
    echo "$architecture, $module: $(${emulator[$architecture]} -L "/usr/${triple[$architecture]}" -E "LD_LIBRARY_PATH=$libraries" "$work/${module}_test" 2>&1 | tee "$work/$module.log" | grep -E "^\[  (PASSED|FAILED)" | head -1)"
  done
done
