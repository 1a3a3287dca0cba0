// SPDX-License-Identifier: Apache-2.0
#include <fstream>
#include <sstream>

#include <gtest/gtest.h>
#include <unistd.h>

#include <revisit/config/parameter_file.hpp>

#include "source_dir.hpp"

namespace revisit {
namespace {

std::filesystem::path write_file(const std::string& text) {
  // A file of this process: tests run side by side.
  const auto file =
      std::filesystem::path(testing::TempDir()) / ("revisit_parameters_" + std::to_string(::getpid()) + ".toml");
  std::ofstream(file) << text;
  return file;
}

TEST(Parameters, DefaultsAndPresetsAreValid) {
  for (const auto& name : preset_names()) {
    const auto parameters = preset(name);
    ASSERT_TRUE(parameters) << name;
    EXPECT_TRUE(validate(*parameters)) << name;
  }
  EXPECT_FALSE(preset("papre"));
}

TEST(Parameters, PaperPresetIsTheTableOfThePaper) {
  const Parameters p = *preset("paper");
  EXPECT_EQ(p.descriptor.rings, 60);
  EXPECT_EQ(p.descriptor.sectors, 20);
  EXPECT_EQ(p.descriptor.max_range_m, 50.0);
  EXPECT_EQ(p.retrieval.min_geometry_score, 0.9);
  EXPECT_EQ(p.retrieval.min_intensity_score, 0.92);
  EXPECT_EQ(p.retrieval.shortlist, 0) << "every place enters the intensity stage";
  EXPECT_EQ(p.geometric.features, "first");
  EXPECT_EQ(p.temporal.min_score, 1.8);
}

TEST(Parameters, EveryParameterIsReadBackFromItsText) {
  for (const auto& info : parameter_infos()) {
    Parameters p;
    EXPECT_TRUE(set_parameter(p, info.name, info.default_value)) << info.name;
    EXPECT_EQ(get_parameter(p, info.name), info.default_value);
  }
}

TEST(Parameters, WrongValueNamesTheAllowedRange) {
  Parameters p;
  EXPECT_EQ(set_parameter(p, "descriptor.rings", "0").error().message,
            "descriptor.rings = 0 is not allowed; allowed: a whole number, 1 to 512");
  EXPECT_FALSE(set_parameter(p, "descriptor.rings", "2.5"));
  EXPECT_FALSE(set_parameter(p, "retrieval.exclude_s", "nan"));
  EXPECT_FALSE(set_parameter(p, "retrieval.exclude_s", "30s"));
  EXPECT_FALSE(set_parameter(p, "preprocess.remove_ground", "yes"));
  EXPECT_TRUE(validate(p)) << "a refused value changes nothing";
}

TEST(Parameters, UnknownNameSuggestsTheNearest) {
  Parameters p;
  EXPECT_EQ(set_parameter(p, "retrieval.topk", "3").error().message,
            "unknown parameter 'retrieval.topk'; did you mean 'retrieval.top_k'?");
}

TEST(Parameters, ContradictionIsNamed) {
  Parameters p;
  p.preprocess.min_range_m = 20.0;
  p.preprocess.max_range_m = 10.0;
  EXPECT_NE(validate(p).error().message.find("preprocess.max_range_m"), std::string::npos);
  p = {};
  p.descriptor.max_range_m = 100.0;
  EXPECT_NE(validate(p).error().message.find("up to preprocess.max_range_m = 80"), std::string::npos);
}

TEST(Parameters, AreFewBesidesTheSimulators) {
  std::size_t count = 0;
  for (const auto& info : parameter_infos()) count += !info.name.starts_with("simulation.");
  EXPECT_LE(count, 26u);
}

TEST(Parameters, AChoiceIsOneOfThoseNamed) {
  Parameters p;
  EXPECT_TRUE(set_parameter(p, "geometric.features", "fallback"));
  for (const char* wrong : {"always", "", "never, first", "fall"})
    EXPECT_EQ(set_parameter(p, "geometric.features", wrong).error().message,
              "geometric.features = " + std::string(wrong) + " is not allowed; allowed: never, fallback, first");
}

TEST(ParameterFile, ReadsBackWhatItWrites) {
  Parameters p;
  p.descriptor.rings = 33;
  p.preprocess.remove_ground = !p.preprocess.remove_ground;
  p.retrieval.exclude_s = 1.25;
  const auto again = read_parameters(write_file(to_toml(p)));
  ASSERT_TRUE(again) << again.error().message;
  EXPECT_EQ(to_toml(*again), to_toml(p));
}

TEST(ParameterFile, ErrorsNameFileAndLine) {
  const auto file = write_file("[descriptor]\nrings = 20\nsectros = 60\n");
  EXPECT_EQ(read_parameters(file).error().message,
            file.string() + ":3: unknown parameter 'descriptor.sectros'; did you mean 'descriptor.sectors'?");
  EXPECT_FALSE(read_parameters(write_file("[descriptor\n")));
  EXPECT_FALSE(read_parameters(write_file("rings = 20\n")));
  EXPECT_FALSE(read_parameters("/no/such/file.toml"));
}

TEST(ParameterReference, PageInDocsIsUpToDate) {
  std::ifstream file(testing_support::source_dir() / "docs" / "parameters.md");
  std::stringstream page;
  page << file.rdbuf();
  EXPECT_EQ(page.str(), parameter_reference_markdown())
      << "run: build/revisit parameters --markdown > docs/parameters.md";
}

}  // namespace
}  // namespace revisit
