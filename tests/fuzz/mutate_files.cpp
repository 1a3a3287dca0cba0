// SPDX-License-Identifier: Apache-2.0
// Reads broken copies of recordings and scans: bits turned, bytes lost or doubled, lengths that lie. Nothing may crash
// or hang, and no error may come without a message; to be built with sanitizers (scripts/mutate.sh). Each copy follows
// from the seed and its number, so that one that failed can be made again.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <random>
#include <string>
#include <vector>

#include <revisit/io/bag_topics.hpp>
#include <revisit/io/recording.hpp>
#include <revisit/io/scan_file.hpp>

namespace {

namespace fs = std::filesystem;
using namespace revisit;

constexpr std::uintmax_t kLargest = 4 << 20;

std::vector<fs::path> files_in(const fs::path& folder) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    const std::string extension = entry.path().extension().string();
    const bool is_read = has_topics(entry.path()) || has_scan_extension(entry.path());
    if (entry.is_regular_file() && is_read && entry.file_size() <= kLargest && extension != ".json")
      files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

std::string read_file(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

void mutate(std::string& bytes, std::mt19937_64& random) {
  const auto up_to = [&](std::size_t most) { return most == 0 ? 0 : static_cast<std::size_t>(random() % most); };
  // Heads and ends hold what matters: half of the changes hit them.
  const auto anywhere = [&] {
    const std::size_t edge = std::min<std::size_t>(bytes.size(), 4096);
    switch (random() % 4) {
      case 0:
        return up_to(edge);
      case 1:
        return bytes.size() - edge + up_to(edge);
      default:
        return up_to(bytes.size());
    }
  };
  const int changes = 1 + static_cast<int>(random() % 8);
  for (int i = 0; i < changes && !bytes.empty(); ++i) {
    const std::size_t at = anywhere(), length = std::min(bytes.size() - at, up_to(64) + 1);
    switch (random() % 7) {
      case 0:
        bytes[at] = static_cast<char>(bytes[at] ^ (1 << (random() % 8)));
        break;
      case 1:
        bytes[at] = static_cast<char>(random());
        break;
      case 2:
        bytes.erase(at, length);
        break;
      case 3:
        bytes.insert(at, bytes.substr(at, length));
        break;
      case 4:
        std::fill_n(bytes.begin() + static_cast<std::ptrdiff_t>(at), length, random() % 2 == 0 ? '\0' : '\xff');
        break;
      case 5:
        if (random() % 4 == 0) bytes.resize(at);
        break;
      default: {  // a length, or an offset, that lies
        const std::uint64_t values[] = {0, 1, 0x7fffffff, 0xffffffff, 0xffffffffffffffff, 0x7fffffffffffffff, random()};
        const std::uint64_t value = values[random() % 7];
        std::memcpy(bytes.data() + at, &value, std::min<std::size_t>(bytes.size() - at, random() % 2 == 0 ? 4 : 8));
      }
    }
  }
}

struct Counts {
  std::size_t refused = 0, read = 0, scans = 0, failed_scans = 0;
};

void require_message(const Error& error) {
  if (!error.message.empty()) return;
  std::printf("an error without a message\n");
  std::abort();
}

void check(const Scan& scan) {
  require_consistent(scan);
  for (const Point& p : scan.points)
    if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z) || !std::isfinite(p.intensity)) std::abort();
}

void read_recording(const fs::path& file, Counts& counts) {
  if (const auto topics = list_topics(file); !topics) require_message(topics.error());
  const auto recording = open_recording(file);
  if (!recording) {
    require_message(recording.error());
    ++counts.refused;
    return;
  }
  ++counts.read;
  (*recording)->findings();
  const std::size_t size = (*recording)->size();
  for (const std::size_t i : {std::size_t{0}, size / 2, size - 1}) {
    const auto scan = (*recording)->read(i);
    (*recording)->wheel_pose(i);
    if (scan) check(*scan);
    if (!scan) require_message(scan.error());
    ++(scan ? counts.scans : counts.failed_scans);
  }
}

void read_one(const fs::path& file, Counts& counts) {
  const auto scan = read_scan(file);
  if (scan) check(*scan);
  if (!scan) require_message(scan.error());
  ++(scan ? counts.read : counts.refused);
}

}  // namespace

int main(int count, char** arguments) {
  if (count < 4) return std::printf("mutate_files FOLDER FIRST LAST [WORK]: copies FIRST to LAST of its files\n"), 2;
  const std::vector<fs::path> files = files_in(arguments[1]);
  const long first = std::stol(arguments[2]), last = std::stol(arguments[3]);
  const fs::path work = count > 4 ? fs::path(arguments[4]) : fs::temp_directory_path() / "revisit_mutate";
  Counts counts;
  double slowest_s = 0.0;
  long slowest = 0;
  for (long number = first; number <= last; ++number) {
    std::mt19937_64 random(static_cast<std::uint64_t>(number));
    const fs::path& source = files[random() % files.size()];
    std::string bytes = read_file(source);
    mutate(bytes, random);
    fs::remove_all(work);
    fs::create_directories(work);
    const fs::path copy = work / source.filename();
    std::ofstream(copy, std::ios::binary) << bytes;
    for (const auto& beside : fs::directory_iterator(source.parent_path()))  // of Ouster sensors
      if (beside.path().extension() == ".json") fs::copy(beside.path(), work / beside.path().filename());
    std::fprintf(stderr, "\rcopy %ld of %ld  ", number, last);
    const auto begin = std::chrono::steady_clock::now();
    if (has_topics(copy))
      read_recording(copy, counts);
    else
      read_one(copy, counts);
    const double took_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    if (took_s > slowest_s) slowest = number;
    slowest_s = std::max(slowest_s, took_s);
  }
  std::printf(
      "\n%ld copies of %zu files: %zu refused, %zu opened; of the scans in bags and captures %zu read, %zu refused; "
      "the slowest copy, %ld, took %.2f s\n",
      last - first + 1, files.size(), counts.refused, counts.read, counts.scans, counts.failed_scans, slowest,
      slowest_s);
  return 0;
}
