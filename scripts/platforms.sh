#!/usr/bin/env bash
# Builds the library for other processors and runs its tests in QEMU's user mode: arm64 (NEON), armhf (32 bits), s390x
# (the other byte order). Where there is no embree there is no simulator, and what needs one is left out.
# usage: scripts/platforms.sh [ARCHITECTURE...]
set -euo pipefail
cd "$(dirname "$0")/.."
[ $# -gt 0 ] || set -- arm64 armhf s390x
tests=(core bits config io preprocess descriptors retrieval registration odometry verification pose_graph store)
of_simulator=(simulation vision mapping localisation detection slam evaluation)
declare -A triple=([arm64]=aarch64-linux-gnu [armhf]=arm-linux-gnueabihf [s390x]=s390x-linux-gnu)
declare -A emulator=([arm64]=qemu-aarch64 [armhf]=qemu-arm [s390x]=qemu-s390x)
libraries=(libblas-dev liblapack-dev libbz2-dev libceres-dev libcli11-dev libeigen3-dev libgeographiclib-dev libgtest-dev libhwy-dev liblz4-dev
  libopencv-features2d-dev libpcap-dev libsqlite3-dev libtbb-dev libtomlplusplus-dev libxxhash-dev libzstd-dev
  nlohmann-json3-dev robin-map-dev zlib1g-dev libboost-dev libpcl-io1.13 libpcl-registration1.13 libpcl-features1.13)

# Libraries of the other architecture, unpacked beside the build: nothing is installed.
unpack() {
  local apt=(apt-get -qq -o "APT::Architecture=$1" -o "APT::Architectures=$1" -o "Dir::State=$work/apt" -o "Dir::Cache=$work/apt"
    -o "Dir::State::Status=$work/apt/status" -o "APT::Sandbox::User=root")
  mkdir -p "$work"/apt/{lists,archives}/partial
  : > "$work/apt/status"
  "${apt[@]}" update
  if "${apt[@]}" --print-uris install libembree-dev > /dev/null 2>&1; then libraries+=(libembree-dev); fi
  "${apt[@]}" --download-only --no-install-recommends -y install "${libraries[@]}"
  # Of libpcl-dev the headers and links alone: all it depends on is a desktop.
  (cd "$work/apt/archives" && "${apt[@]}" download libpcl-dev)
  rm -f "$work"/apt/archives/{libc6,linux-libc}-dev*.deb  # the compiler has its own
  for package in "$work"/apt/archives/*.deb; do dpkg -x "$package" "$work/unpacked"; done
  # Alternatives, which nobody has chosen here.
  ln -s blas/libblas.so{,.3} lapack/liblapack.so{,.3} "$work/unpacked/usr/lib/$tools/"
  sed -i "s#/usr/lib/$tools/#$root&#g" "$work/unpacked/usr/lib/$tools/cmake/Ceres/CeresTargets.cmake"
  mv "$work/unpacked" "$root"
}

for architecture; do
  tools=${triple[$architecture]} work=$PWD/build/platforms/$architecture
  root=$work/root build=$work/build
  scripts/install_packages.sh qemu-user "g++-$tools"
  [ -d "$root" ] || unpack "$architecture"
  of_root=$root/usr/lib/$tools
  dependencies="Eigen;TBB;Highway;PCL;Ceres;SQLite;Bags;Geographic;OpenCV" run=("${tests[@]}")
  if [ -e "$of_root/libembree3.so" ]; then dependencies+=";Embree" run+=("${of_simulator[@]}"); fi
  paths=$of_root:$root/lib/$tools:$root/usr/lib
  export PKG_CONFIG_SYSROOT_DIR=$root PKG_CONFIG_LIBDIR=$of_root/pkgconfig:$root/usr/share/pkgconfig
  emulate=("${emulator[$architecture]}" -L "$root" -E "LD_LIBRARY_PATH=$paths")
  cmake -S . -B "$build" -G Ninja --log-level=NOTICE -DCMAKE_BUILD_TYPE=Release -DCMAKE_SYSTEM_NAME=Linux -DCMAKE_SYSTEM_PROCESSOR="${tools%%-*}" \
    -DCMAKE_CXX_COMPILER="$tools-g++" -DCMAKE_FIND_ROOT_PATH="$root" -DCMAKE_FIND_ROOT_PATH_MODE_PROGRAM=NEVER \
    -DCMAKE_FIND_ROOT_PATH_MODE_LIBRARY=ONLY -DCMAKE_FIND_ROOT_PATH_MODE_INCLUDE=ONLY -DCMAKE_FIND_ROOT_PATH_MODE_PACKAGE=ONLY \
    -DCMAKE_SKIP_RPATH=ON -DCMAKE_EXE_LINKER_FLAGS="-Wl,-rpath-link,$paths" \
    -Drevisit_dependencies="$dependencies" -DREVISIT_SHARED=OFF -DREVISIT_BUILD_APPS=OFF -DREVISIT_BUILD_BINDINGS=OFF \
    -DREVISIT_BUILD_BENCHMARKS=OFF -DREVISIT_BUILD_EXAMPLES=OFF > /dev/null
  cmake --build "$build" --target "${run[@]/%/_test}" -- -k 0 | grep -E "error:" || true  # io and store: little-endian alone
  for name in "${run[@]}"; do
    [ -x "$build/bin/${name}_test" ] || { echo "$architecture, $name: does not build" && continue; }
    "${emulate[@]}" "$build/bin/${name}_test" > "$work/$name.log" 2>&1 || true
    echo "$architecture, $name: $(grep -E "^\[  (PASSED|FAILED)" "$work/$name.log" || tail -1 "$work/$name.log")"
  done
done
