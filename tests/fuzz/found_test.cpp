// SPDX-License-Identifier: Apache-2.0
// Inputs that a fuzzer once broke a reader with, each in the folder of its reader: they are read without harm now.
#include <cstdlib>
#include <filesystem>

#include <gtest/gtest.h>

#include "fuzz/readers.hpp"
#include "shared_data.hpp"
#include "source_dir.hpp"

namespace revisit {
namespace {

namespace fs = std::filesystem;

TEST(Fuzz, WhatWasFoundOnceIsReadWithoutHarm) {
  const fs::path work = testing_support::fresh_folder();
  std::size_t inputs = 0;
  for (const auto& entry : fs::recursive_directory_iterator(testing_support::source_dir() / "tests/fuzz/found")) {
    if (!entry.is_regular_file()) continue;
    const fuzz::Reader* reader = fuzz::find_reader(entry.path().parent_path().filename().string());
    ASSERT_NE(reader, nullptr) << entry.path();
    const fs::path copy = work / reader->file;
    fs::copy_file(entry.path(), copy, fs::copy_options::overwrite_existing);
    SCOPED_TRACE(entry.path().string());
    reader->read(copy);  // aborts where it is not well
    fs::remove(copy);
    ++inputs;
  }
  EXPECT_GT(inputs, 0u);
}

}  // namespace
}  // namespace revisit
