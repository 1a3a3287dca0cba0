// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdlib>
#include <filesystem>

#include <gtest/gtest.h>

#include "source_dir.hpp"

namespace revisit::testing_support {

/// Where the real recordings lie: beside the project, or where REVISIT_TEST_DATA says.
inline std::filesystem::path shared_data() {
  if (const char* folder = std::getenv("REVISIT_TEST_DATA")) return folder;
  return source_dir() / ".." / "shared" / "data";
}

/// An empty folder of this test's own.
inline std::filesystem::path fresh_folder() {
  const auto* test = testing::UnitTest::GetInstance()->current_test_info();
  const auto folder = std::filesystem::path(testing::TempDir()) / "revisit" /
                      (std::string(test->test_suite_name()) + "." + test->name());
  std::filesystem::remove_all(folder);
  std::filesystem::create_directories(folder);
  return folder;
}

}  // namespace revisit::testing_support

/// Skips the test where the real recordings are not there: they are under other licences and not part of the project.
#define REVISIT_NEEDS_SHARED_DATA()                                      \
  if (!std::filesystem::exists(revisit::testing_support::shared_data())) \
  GTEST_SKIP() << "needs the recordings of " << revisit::testing_support::shared_data()
