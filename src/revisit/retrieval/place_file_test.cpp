// SPDX-License-Identifier: Apache-2.0
#include <revisit/retrieval/place_index.hpp>

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "random_points.hpp"

namespace revisit {
namespace {

namespace fs = std::filesystem;

IntensityScanContext small_context(unsigned seed) {
  DescriptorOptions grid;
  grid.rings = 12;
  grid.sectors = 8;
  return describe(testing_support::random_points(60, seed), grid);
}

class PlaceFile : public testing::Test {
 protected:
  PlaceFile() { fs::create_directories(folder); }
  ~PlaceFile() override { fs::remove_all(folder); }

  static PlaceIndex filled(int places) {
    PlaceIndex index{options()};
    for (int i = 0; i < places; ++i) index.add(FrameId{3 * i}, 0.1 * i, small_context(static_cast<unsigned>(i % 700)));
    return index;
  }
  // By their offset, and the size of all.
  using Pieces = std::map<std::size_t, std::vector<std::byte>>;
  static std::pair<Pieces, std::size_t> pieces_of(const PlaceIndex& index) {
    Pieces pieces;
    std::size_t size = 0;
    EXPECT_TRUE(index.save([&](std::size_t offset, std::span<const std::byte> bytes) {
      pieces[offset] = {bytes.begin(), bytes.end()};
      size = std::max(size, offset + bytes.size());
      return ok();
    }));
    return {std::move(pieces), size};
  }
  static RetrievalOptions options() {
    RetrievalOptions result;
    result.top_k = 5;
    result.shortlist = 5;
    result.exclude_s = 0.0;
    return result;
  }
  // The error of opening a file, or of using all that is in it.
  std::string error_of(const fs::path& file) const {
    const auto index = PlaceIndex::open(file, options());
    if (!index) return index.error().message;
    const Status status = index->check();
    return status ? "" : status.error().message;
  }
  std::string bytes(const fs::path& of) const {
    std::ifstream file(of, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  fs::path written(const std::string& content) const {
    std::ofstream(folder / "other.places", std::ios::binary) << content;
    return folder / "other.places";
  }

  const fs::path folder = fs::temp_directory_path() / ("revisit_" + std::to_string(::getpid()) + "_" +
                                                       ::testing::UnitTest::GetInstance()->current_test_info()->name());
  const fs::path path = folder / "map.places";
};

TEST_F(PlaceFile, AnswersAsTheIndexThatWasSavedAndGrowsOn) {
  for (const int places : {0, 1, 700, 4096, 9000}) {
    PlaceIndex saved = filled(places);
    ASSERT_TRUE(saved.save(path));
    auto opened = PlaceIndex::open(path, options());
    ASSERT_TRUE(opened) << opened.error().message;
    for (int more = 0; more < 2; ++more) {  // as it was, then with another place in each
      ASSERT_EQ(opened->size(), saved.size());
      for (const unsigned seed : {3u, 699u, 5000u}) {
        const auto expected = *saved.search(small_context(seed), saved.size());
        const auto found = opened->search(small_context(seed), opened->size());
        ASSERT_TRUE(found);
        ASSERT_EQ(found->size(), expected.size());
        for (std::size_t i = 0; i < expected.size(); ++i) {
          EXPECT_EQ((*found)[i].match, expected[i].match);
          EXPECT_EQ((*found)[i].score(), expected[i].score());
        }
      }
      for (PlaceIndex* index : {&saved, &*opened}) index->add(FrameId{50000 + more}, 1e5, small_context(5000));
    }
    // Saved again over the file it is mapped from.
    ASSERT_TRUE(opened->save(path));
    EXPECT_EQ(PlaceIndex::open(path, options())->size(), opened->size());
  }
}

// The pieces lie anywhere, as in the rows of a map.
TEST_F(PlaceFile, InPiecesItAnswersTheSameAndNoticesWhatWasAltered) {
  const PlaceIndex saved = filled(5000);
  auto [pieces, size] = pieces_of(saved);
  const auto read = [&pieces = pieces](std::size_t offset, std::span<std::byte> to) -> Status {
    const auto found = pieces.find(offset);
    if (found == pieces.end() || found->second.size() != to.size()) return Error{"no such piece"};
    std::copy(found->second.begin(), found->second.end(), to.begin());
    return ok();
  };
  {
    const auto opened = PlaceIndex::open("pieces", size, read, options());
    ASSERT_TRUE(opened) << opened.error().message;
    const auto expected = *saved.search(small_context(699), saved.size());
    const auto found = opened->search(small_context(699), opened->size());
    ASSERT_TRUE(found);
    ASSERT_EQ(found->size(), expected.size());
    for (std::size_t i = 0; i < expected.size(); ++i) EXPECT_EQ((*found)[i].match, expected[i].match);
    EXPECT_TRUE(opened->check());
  }
  // Destroyed while the rest is read in the background.
  for (const int wait_ms : {0, 300, 302}) {
    const auto opened = PlaceIndex::open("pieces", size, read, options());
    ASSERT_TRUE(opened);
    std::this_thread::sleep_for(std::chrono::milliseconds(wait_ms));
  }
  for (auto& [offset, bytes] : pieces) {
    bytes.back() ^= std::byte{1};
    const auto opened = PlaceIndex::open("pieces", size, read, options());
    const Status status = opened ? opened->check() : Status(opened.error());
    EXPECT_FALSE(status) << "the piece at " << offset;
    bytes.back() ^= std::byte{1};
  }
  EXPECT_FALSE(PlaceIndex::open("pieces", size - 1, read, options()));
}

TEST_F(PlaceFile, IsRefusedWhereverItWasAltered) {
  ASSERT_TRUE(filled(4500).save(path));
  const std::string good = bytes(path);
  ASSERT_EQ(error_of(path), "");
  // One bit at many positions: in the header, the checksums, and all parts of both chunks.
  for (std::size_t i = 0; i < 400; ++i) {
    const std::size_t at = i < 40 ? 4 * i : (i - 40) * (good.size() - 1) / 359;
    std::string altered = good;
    altered[at] = static_cast<char>(altered[at] ^ 4);
    EXPECT_NE(error_of(written(altered)), "") << "byte " << at;
  }
}

TEST_F(PlaceFile, IsRefusedWhenCutOff) {
  ASSERT_TRUE(filled(200).save(path));
  const std::string good = bytes(path);
  for (const std::size_t size : {0u, 1u, 7u, 47u})
    EXPECT_NE(error_of(written(good.substr(0, size))).find("is no place index of revisit (" + std::to_string(size)),
              std::string::npos)
        << size;
  for (const std::size_t size : {std::size_t{48}, std::size_t{4096}, good.size() - 1})
    EXPECT_NE(error_of(written(good.substr(0, size)))
                  .find(std::to_string(size) + " bytes instead of the " + std::to_string(good.size()) + " that"),
              std::string::npos)
        << size;
  EXPECT_NE(error_of(written(good + '\0')), "") << "longer";
}

TEST_F(PlaceFile, AnAlteredImageIsNoticedByTheSearchThatMeetsIt) {
  ASSERT_TRUE(filled(5000).save(path));
  std::string altered = bytes(path);
  altered[4096 + 40 * 4096 + 500] ^= 1;  // after the header and the bounds of the first chunk
  const auto index = PlaceIndex::open(written(altered), options());
  ASSERT_TRUE(index) << "images are checked on first use";
  const auto found = index->search(small_context(5), index->size());
  ASSERT_FALSE(found);
  EXPECT_NE(found.error().message.find("other.places: places 0 to 4095"), std::string::npos) << found.error().message;
  EXPECT_FALSE(index->find(FrameId{0}));
  EXPECT_FALSE(index->save(path)) << "what is damaged is not saved as sound";
  EXPECT_NE(index->save(path).error().message.find("do not have the checksum"), std::string::npos);

  altered = bytes(path);
  altered[altered.size() - 1] ^= 1;  // in the second chunk
  const std::string error = error_of(written(altered));
  EXPECT_NE(error.find("places 4096 to 8191 do not have"), std::string::npos) << error;
}

TEST_F(PlaceFile, AlteredIntensitiesAreNoticedWhereTheyAreUsed) {
  ASSERT_TRUE(filled(4096).save(path));
  std::string altered = bytes(path);
  altered[altered.size() - 96 * (4096 - 300)] ^= 1;  // of the cells of place 300
  const auto index = PlaceIndex::open(written(altered), options());
  ASSERT_TRUE(index);
  EXPECT_TRUE(index->find(FrameId{0}));
  EXPECT_FALSE(index->find(FrameId{3 * 300}));
  EXPECT_FALSE(index->search(small_context(300), index->size()));
}

TEST_F(PlaceFile, LeavesNothingMappedAndNothingUnset) {
  ASSERT_TRUE(filled(5).save(path));
  const auto is_mapped = [&] { return bytes("/proc/self/maps").find(path.string()) != std::string::npos; };
  {
    const auto index = PlaceIndex::open(path, options());
    EXPECT_TRUE(is_mapped());
  }
  EXPECT_FALSE(is_mapped());
  const std::string content = bytes(path);
  EXPECT_EQ(content.substr(28, 4), std::string(4, '\0')) << "unused";
  EXPECT_EQ(content.back(), '\0') << "room for more places";
}

// The rest is read in the background, once, and not before a first search had time.
TEST_F(PlaceFile, InPiecesAllOfItIsReadAndThenLetGo) {
  const PlaceIndex saved = filled(9000);
  const auto [pieces, size] = pieces_of(saved);
  struct Reads {
    std::mutex mutex;
    std::map<std::size_t, int> times;
    std::optional<std::chrono::steady_clock::time_point> first_behind;
  };
  const auto reads = std::make_shared<Reads>();
  const auto opener = std::this_thread::get_id();
  const auto began = std::chrono::steady_clock::now();
  const auto opened = PlaceIndex::open(
      "pieces", size,
      [&pieces = pieces, opener, reads](std::size_t offset, std::span<std::byte> to) {
        const std::lock_guard lock(reads->mutex);
        ++reads->times[offset];
        if (std::this_thread::get_id() != opener && !reads->first_behind)
          reads->first_behind = std::chrono::steady_clock::now();
        std::copy(pieces.at(offset).begin(), pieces.at(offset).end(), to.begin());
        return ok();
      },
      options());
  ASSERT_TRUE(opened) << opened.error().message;
  while (reads.use_count() > 1 && std::chrono::steady_clock::now() - began < std::chrono::seconds(20))
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  ASSERT_EQ(reads.use_count(), 1) << "the reader is destroyed";
  ASSERT_TRUE(reads->first_behind);
  EXPECT_GE(*reads->first_behind - began, std::chrono::milliseconds(300));
  EXPECT_EQ(reads->times.size(), pieces.size());
  for (const auto& [offset, times] : reads->times) EXPECT_EQ(times, 1) << offset;
}

// Numbers of the header as they lie in the file (docs/formats.md).
TEST_F(PlaceFile, AHeaderThatCannotBeIsRefused) {
  for (const int places : {1, 300}) {
    ASSERT_TRUE(filled(places).save(path));
    const std::string good = bytes(path);
    const auto error_with = [&](std::size_t at, std::uint64_t value, std::size_t size) {
      std::string other = good;
      std::memcpy(other.data() + at, &value, size);
      return error_of(written(other));
    };
    constexpr std::size_t kRings = 16, kSectors = 20, kLevels = 24, kPlaces = 32;
    for (const auto& [at, value] :
         {std::pair{kRings, 0u}, {kSectors, 0u}, {kRings, 513u}, {kSectors, 721u}, {kLevels, 9u}})
      EXPECT_NE(error_with(at, value, 4).find("; allowed: 1 to 512 rings"), std::string::npos) << at << " " << value;
    for (const auto& [at, value] : {std::pair{kRings, 512u}, {kSectors, 720u}, {kLevels, 8u}})
      EXPECT_NE(error_with(at, value, 4).find(" bytes instead of the "), std::string::npos) << at << " " << value;
    EXPECT_NE(error_with(kPlaces, std::uint64_t{1} << 40, 8).find("names 1099511627776 places"), std::string::npos);
    EXPECT_NE(error_with(kPlaces, std::uint64_t{1} << 28, 8).find(" bytes instead of the "), std::string::npos);
    EXPECT_NE(error_with(kPlaces, (std::uint64_t{1} << 28) + 1, 8).find("; allowed: "), std::string::npos);
    EXPECT_NE(error_with(kPlaces, static_cast<std::uint64_t>(places) + 1, 8).find("checksum"), std::string::npos)
        << "as many chunks";
    EXPECT_NE(error_with(8, 0x04030201, 4).find("other byte order"), std::string::npos);
  }
  ASSERT_TRUE(filled(0).save(path));
  EXPECT_EQ(error_of(path), "") << "an empty one has no grid";
}

TEST_F(PlaceFile, ErrorsSayWhatWasAllowed) {
  ASSERT_TRUE(filled(5).save(path));
  std::string other = bytes(path);
  other[12] = 9;
  EXPECT_NE(error_of(written(other)).find("version 9, this program reads version 2"), std::string::npos);
  EXPECT_NE(error_of(written("a text file that is long enough to hold a header")).find("no place index"),
            std::string::npos);
  EXPECT_NE(error_of(folder).find("no regular file"), std::string::npos);
  EXPECT_NE(error_of(folder / "absent").find("absent: No such file"), std::string::npos);
  const Status failed = filled(5).save(folder / "no such folder" / "file");
  ASSERT_FALSE(failed);
  EXPECT_NE(failed.error().message.find("(" + std::to_string(fs::file_size(path)) + " bytes are needed)"),
            std::string::npos);
}

}  // namespace
}  // namespace revisit
