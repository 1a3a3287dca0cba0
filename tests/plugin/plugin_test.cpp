// SPDX-License-Identifier: Apache-2.0
// Methods from shared libraries: the example, one with faults, and both in `revisit compare`.
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include <gtest/gtest.h>

#include <revisit/descriptors/baseline_plugin.hpp>
#include <revisit/io/result_files.hpp>

#include "made_place.hpp"
#include "run_program.hpp"

namespace revisit {
namespace {

namespace fs = std::filesystem;
using testing_support::made_place;

fs::path example_plugin() { return fs::path(REVISIT_EXAMPLES) / "example_method_plugin.so"; }

Result<std::unique_ptr<Baseline>> broken(const char* fault) {
  setenv("REVISIT_FAULT", fault, 1);
  auto loaded = load_baseline(REVISIT_BROKEN_PLUGIN);
  unsetenv("REVISIT_FAULT");
  return loaded;
}

TEST(Plugin, ExampleKnowsThePlaceWhicheverWayTheSensorLooks) {
  const auto method = load_baseline(example_plugin());
  ASSERT_TRUE(method) << method.error().message;
  EXPECT_EQ((*method)->name(), "ranges-and-heights");
  EXPECT_EQ((*method)->gives(), Baseline::Gives::kPlace);
  const auto place = (*method)->describe(made_place(1), -1.7),
             query = (*method)->describe(testing_support::turned(made_place(1), 1.0), -1.7),
             other = (*method)->describe(made_place(2), -1.7);
  EXPECT_EQ(place.bytes(), std::size_t{40 * 8 * sizeof(float)});
  EXPECT_GT((*method)->similarity(query, place), 0.95);
  EXPECT_LT((*method)->similarity(query, other), 0.9);
}

TEST(Plugin, FaultIsNamedWithTheFile) {
  for (const auto& [fault, what] :
       std::vector<std::pair<const char*, const char*>>{{"null", "returns null"},
                                                        {"version", "version 99"},
                                                        {"name", "'a/../b'; allowed: letters"},
                                                        {"dots", "its name is '..'; allowed: letters"},
                                                        {"nameless", "its name is ''"},
                                                        {"describe", "describe or similarity is null"},
                                                        {"gives", "gives is 7; allowed: 0 to 3"},
                                                        {"scans", "scans is 0; allowed: 1 to 1000"},
                                                        {"place_every", "place_every is 0; allowed: 1 to 1000"}}) {
    const auto loaded = broken(fault);
    ASSERT_FALSE(loaded) << fault;
    EXPECT_NE(loaded.error().message.find(what), std::string::npos) << loaded.error().message;
    EXPECT_NE(loaded.error().message.find("broken_plugin"), std::string::npos) << loaded.error().message;
  }
  const fs::path folder = testing_support::fresh_folder(), text = folder / "method.so";
  std::ofstream(text) << "not a library";
  for (const fs::path& file : {text, folder / "none.so", folder}) {
    const auto loaded = load_baseline(file);
    ASSERT_FALSE(loaded) << file;
    EXPECT_EQ(loaded.error().message.find(file.string() + ": is no shared library"), 0u) << loaded.error().message;
  }
}

TEST(Plugin, WhatItSaysWronglyIsNoAnswer) {
  for (const char* fault : {"insatiable", "huge"}) {
    const auto method = broken(fault);
    ASSERT_TRUE(method) << method.error().message;
    EXPECT_EQ((*method)->describe(made_place(1), -1.7).bytes(), 0u) << fault;
  }
  const auto method = broken("long");
  ASSERT_TRUE(method);
  const auto signature = (*method)->describe({}, -1.7);
  ASSERT_EQ(signature.bits.size(), 10000u);
  EXPECT_EQ(signature.bits.back(), 9999u);
  EXPECT_LE((*method)->similarity(signature, signature), (*method)->least_similarity());
  EXPECT_TRUE((*method)->T_place_query(signature, signature).isApprox(Pose::Identity()));
}

TEST(Plugin, CompareScoresItBesideTheOthers) {
  const fs::path folder = testing_support::fresh_folder(), spec = folder / "drive.toml", out = folder / "compared";
  std::ofstream(spec) << "[simulation]\nworld = \"warehouse\"\nsensor = \"vlp16\"\nlength_m = 25\nframes = 60\n";
  const auto compare = [&](const std::string& more) {
    return testing_support::run_program(
        std::string(REVISIT_PROGRAM) + " compare " + spec.string() +
        " --retrieval.exclude_frames 10 --retrieval.exclude_s 1 --methods scan-context" + " --overwrite --out " +
        out.string() + more);
  };
  const auto compared = compare(" --verify --plugin " + example_plugin().string());
  ASSERT_EQ(compared.code, 0) << compared.output;
  EXPECT_NE(compared.output.find("ranges-and-heights: an example"), std::string::npos) << compared.output;
  const auto rows = read_candidates(out / "ranges-and-heights" / "candidates.csv");
  ASSERT_TRUE(rows);
  EXPECT_EQ(rows->size(), 50u);
  for (const CandidateRow& row : *rows) EXPECT_TRUE(row.match && row.match->value <= row.query.value - 10);

  const auto twice = compare(" --plugin " + example_plugin().string() + " --plugin " + example_plugin().string());
  EXPECT_EQ(twice.code, 1);
  EXPECT_NE(twice.output.find("its name, ranges-and-heights, is taken"), std::string::npos) << twice.output;
  const auto absent = compare(" --plugin none.so");
  EXPECT_EQ(absent.code, 1);
  EXPECT_NE(absent.output.find("none.so: is no shared library"), std::string::npos) << absent.output;
}

}  // namespace
}  // namespace revisit
