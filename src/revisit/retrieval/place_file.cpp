// SPDX-License-Identifier: Apache-2.0
// A store's file: a header, the checksums of all parts of all chunks, then the chunks as they lie in memory.
#include <array>
#include <cstring>
#include <filesystem>
#include <fstream>

#define XXH_INLINE_ALL  // whoever links this library needs no other
#include <xxhash.h>

#include <revisit/retrieval/internal/place_store.hpp>

namespace revisit::retrieval_internal {
namespace {

constexpr std::size_t kPage = 4096;

struct FileHeader {
  char magic[8] = {'R', 'E', 'V', 'I', 'S', 'I', 'T', 'P'};
  std::uint32_t byte_order = 0x01020304;
  std::uint32_t version = 1;
  std::uint32_t rings = 0, sectors = 0, levels = 0, unused = 0;
  std::uint64_t places = 0;
  std::uint64_t checksum = 0;  ///< of the header with this field 0, and of all bytes up to the first chunk
};
static_assert(sizeof(FileHeader) == 48);

using Checksums = std::array<std::uint64_t, ChunkLayout::kParts>;

std::size_t chunks_of(std::uint64_t places) { return (places + ChunkLayout::kPlaces - 1) / ChunkLayout::kPlaces; }

std::size_t first_chunk(std::size_t chunks) {
  return (sizeof(FileHeader) + chunks * sizeof(Checksums) + kPage - 1) / kPage * kPage;
}

// `rest`: the bytes from the header to the first chunk.
std::uint64_t checksum_of(FileHeader header, const void* rest, std::size_t chunks) {
  header.checksum = XXH3_64bits(rest, first_chunk(chunks) - sizeof header);
  return XXH3_64bits(&header, sizeof header);
}

std::string hint() { return "; make the index again from its scans"; }

}  // namespace

std::uint64_t PlaceStore::checksum(const Chunk& c, ChunkLayout::Part p) const {
  return XXH3_64bits(c.part(p), layout_.begin[p + 1] - layout_.begin[p]);
}

bool PlaceStore::check(const Chunk& c, ChunkLayout::Part p) const {
  // Several threads may do the same work at once; each comes to the same answer.
  if (c.state[p].load(std::memory_order_acquire) == Chunk::kUnchecked)
    c.state[p].store(checksum(c, p) == c.checksums[p] ? Chunk::kIntact : Chunk::kDamaged, std::memory_order_release);
  return c.state[p].load(std::memory_order_acquire) == Chunk::kIntact;
}

Status PlaceStore::check() const {
  for (std::size_t i = 0; i < size(); i += kChunk)
    for (const auto part : {ChunkLayout::kBounds, ChunkLayout::kImages, ChunkLayout::kIntensities})
      if (!is_intact(chunk(i), part)) return damage(i);
  return ok();
}

Error PlaceStore::damage(std::size_t i) const {
  const std::size_t first = i / kChunk * kChunk;
  return Error{path_ + ": places " + std::to_string(first) + " to " + std::to_string(first + kChunk - 1) +
               " do not have the checksum they were saved with: the file was altered" + hint()};
}

std::size_t PlaceStore::saved_bytes() const {
  const std::size_t chunks = chunks_of(size());
  return first_chunk(chunks) + chunks * layout_.begin[ChunkLayout::kParts];
}

Status PlaceStore::save(const Write& write) const {
  const std::size_t places = size(), chunks = chunks_of(places);
  if (const Status intact = check(); !intact) return intact;
  // The checksums, filled up to a whole page.
  std::vector<std::uint64_t> table((first_chunk(chunks) - sizeof(FileHeader)) / sizeof(std::uint64_t));
  for (std::size_t i = 0; i < chunks; ++i)
    for (const auto part : {ChunkLayout::kBounds, ChunkLayout::kImages, ChunkLayout::kIntensities})
      table[i * ChunkLayout::kParts + part] = checksum(chunk(i * kChunk), part);
  FileHeader header;
  header.rings = static_cast<std::uint32_t>(rings_);
  header.sectors = static_cast<std::uint32_t>(sectors_);
  header.levels = static_cast<std::uint32_t>(levels_);
  header.places = places;
  header.checksum = checksum_of(header, table.data(), chunks);
  write(&header, sizeof header);
  write(table.data(), table.size() * sizeof(std::uint64_t));
  for (std::size_t i = 0; i < chunks; ++i) write(chunk(i * kChunk).data, layout_.begin[ChunkLayout::kParts]);
  return ok();
}

Result<std::vector<std::byte>> PlaceStore::to_bytes() const {
  std::vector<std::byte> result;
  result.reserve(saved_bytes());
  const Status saved = save([&](const void* data, std::size_t bytes) {
    const auto* const first = static_cast<const std::byte*>(data);
    result.insert(result.end(), first, first + bytes);
  });
  if (!saved) return saved.error();
  return result;
}

Status PlaceStore::save(const std::string& path) const {
  const std::string partial = path + ".part";
  std::ofstream file(partial, std::ios::binary | std::ios::trunc);
  const Status saved = save([&](const void* data, std::size_t bytes) {
    file.write(static_cast<const char*>(data), static_cast<std::streamsize>(bytes));
  });
  file.close();
  std::error_code failed;
  if (saved && file) std::filesystem::rename(partial, path, failed);
  if (!saved || !file || failed) {
    std::error_code ignored;
    std::filesystem::remove(partial, ignored);
    if (!saved) return saved;
    return Error{path + ": cannot be written (" + std::to_string(saved_bytes()) + " bytes are needed)"};
  }
  return ok();
}

Result<std::unique_ptr<PlaceStore>> PlaceStore::open(const std::string& path) {
  auto mapped = SavedBytes::map(path);
  if (!mapped) return mapped.error();
  return open(path, *std::move(mapped));
}

Result<std::unique_ptr<PlaceStore>> PlaceStore::open(const std::string& path, SavedBytes bytes) {
  const auto refuse = [&](const std::string& why) { return Error{path + ": " + why}; };

  FileHeader header;
  const FileHeader ours;
  const std::size_t size = bytes.size();
  if (size < sizeof header || std::memcmp(bytes.data(), ours.magic, sizeof ours.magic) != 0)
    return refuse("is no place index of revisit (" + std::to_string(size) + " bytes)");
  std::memcpy(&header, bytes.data(), sizeof header);
  if (header.byte_order != ours.byte_order) return refuse("was saved on a machine of other byte order" + hint());
  if (header.version != ours.version)
    return refuse("is of version " + std::to_string(header.version) + ", this program reads version " +
                  std::to_string(ours.version) + hint());
  if (header.rings > 512 || header.sectors > 720 || header.levels > 8 ||
      (header.places > 0 && (header.rings == 0 || header.sectors == 0)) || header.places > kMostChunks * kChunk)
    return refuse("its header names " + std::to_string(header.places) + " places on a grid of " +
                  std::to_string(header.rings) + " x " + std::to_string(header.sectors) + " x " +
                  std::to_string(header.levels) +
                  "; allowed: 1 to 512 rings, 1 to 720 sectors, 0 to 8 levels, up to 268 million places");

  auto store = std::make_unique<PlaceStore>();
  store->path_ = path;
  store->rings_ = static_cast<int>(header.rings);
  store->sectors_ = static_cast<int>(header.sectors);
  store->levels_ = static_cast<int>(header.levels);
  store->layout_ = {store->rings_, store->sectors_, store->levels_};
  const std::size_t chunks = chunks_of(header.places), chunk_bytes = store->layout_.begin[ChunkLayout::kParts];
  const std::size_t expected = first_chunk(chunks) + chunks * chunk_bytes;
  if (size != expected)
    return refuse(std::to_string(size) + " bytes instead of the " + std::to_string(expected) + " that its " +
                  std::to_string(header.places) + " places take: it was cut off or written to" + hint());
  const std::uint8_t* const table = bytes.data() + sizeof header;
  if (checksum_of(header, table, chunks) != header.checksum)
    return refuse("its header does not have the checksum it was saved with: the file was altered" + hint());

  store->file_ = std::move(bytes);
  for (std::size_t i = 0; i < chunks; ++i) {
    const std::uint8_t* const data = store->file_.data() + first_chunk(chunks) + i * chunk_bytes;
    // A last chunk that is not full will be added to: it is copied.
    const bool grows = (i + 1) * kChunk > header.places;
    Chunk& chunk = store->append_chunk(i, grows ? nullptr : data);
    if (grows) std::memcpy(chunk.owned.data(), data, chunk_bytes);
    std::memcpy(chunk.checksums, table + i * sizeof(Checksums), sizeof(Checksums));
    for (auto& state : chunk.state) state = Chunk::kUnchecked;
    if (!store->check(chunk, ChunkLayout::kBounds)) return store->damage(i * kChunk);
    if (grows && !(store->check(chunk, ChunkLayout::kImages) && store->check(chunk, ChunkLayout::kIntensities)))
      return store->damage(i * kChunk);
  }
  store->size_ = header.places;
  return store;
}

}  // namespace revisit::retrieval_internal
