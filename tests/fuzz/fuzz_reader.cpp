// SPDX-License-Identifier: Apache-2.0
// libFuzzer's door to one reader: READER=pcd fuzz_reader CORPUS... (scripts/fuzz.sh). What a reader allocates stays
// within a small multiple of the file's size, whatever the file says of itself.
#include <atomic>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <fstream>

#include <fcntl.h>
#include <sanitizer/allocator_interface.h>
#include <unistd.h>

#include "fuzz/readers.hpp"

namespace {

namespace fs = std::filesystem;
using namespace revisit::fuzz;

constexpr std::size_t kAlways = 64 << 20, kPerByte = 200;  // buffers of fixed size; points of compressed clouds

std::atomic<std::size_t> in_use{0}, most{0};

void on_malloc(const volatile void* memory, std::size_t) {
  const std::size_t now = in_use += __sanitizer_get_allocated_size(const_cast<const void*>(memory));
  std::size_t before = most;
  while (before < now && !most.compare_exchange_weak(before, now)) {
  }
}
void on_free(const volatile void* memory) {
  if (memory != nullptr) in_use -= __sanitizer_get_allocated_size(const_cast<const void*>(memory));
}

const Reader* reader = nullptr;
fs::path folder;

}  // namespace

extern "C" int LLVMFuzzerInitialize(int*, char***) {
  const char* name = std::getenv("READER");
  reader = find_reader(name == nullptr ? "" : name);
  if (reader == nullptr) {
    std::fprintf(stderr, "set READER to one of:");
    for (const Reader& each : readers()) std::fprintf(stderr, " %s", each.name);
    std::fprintf(stderr, "\n");
    std::exit(2);
  }
  char work[] = "/dev/shm/revisit_fuzz_XXXXXX";
  if (mkdtemp(work) == nullptr) std::exit(2);
  folder = work;
  std::atexit([] {
    std::error_code ignored;
    fs::remove_all(folder, ignored);
  });
  __sanitizer_install_malloc_and_free_hooks(on_malloc, on_free);
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const fs::path file = folder / reader->file;
  const int descriptor = open(file.c_str(), O_CREAT | O_TRUNC | O_WRONLY, 0600);
  if (descriptor < 0 || write(descriptor, data, size) != static_cast<ssize_t>(size)) std::abort();
  close(descriptor);
  const std::size_t before = in_use;
  most = before;
  reader->read(file);
  if (most > before && most - before > kAlways + kPerByte * size) {
    std::fprintf(stderr, "%zu bytes were allocated for a file of %zu\n", most - before, size);
    std::abort();
  }
  return 0;
}
