// SPDX-License-Identifier: Apache-2.0
// A store's file: a header, the checksums of all parts of all chunks, then the chunks as they lie in memory.
#include <array>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <vector>

#define XXH_INLINE_ALL  // whoever links this library needs no other
#include <xxhash.h>

#include <revisit/core/put_in_place.hpp>
#include <revisit/retrieval/internal/place_store.hpp>

namespace revisit::retrieval_internal {
namespace {

constexpr std::size_t kPage = 4096;
constexpr std::chrono::milliseconds kFirstAnswer{300};  // what the first search needs comes first

struct FileHeader {
  char magic[8] = {'R', 'E', 'V', 'I', 'S', 'I', 'T', 'P'};
  std::uint32_t byte_order = 0x01020304;
  std::uint32_t version = 2;
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

std::string hint() { return "; make it again from its scans"; }

}  // namespace

std::uint64_t PlaceStore::checksum(const Chunk& c, std::size_t p) const { return XXH3_64bits(c.part(p), c.size(p)); }

bool PlaceStore::check(const Chunk& c, std::size_t p) const {
  // Of a mapped file several threads may do the same work at once; each comes to the same answer.
  const auto lock = is_mapped_ ? std::unique_lock<std::mutex>() : std::unique_lock(reading_);
  if (c.state[p].load(std::memory_order_acquire) == Chunk::kUnchecked) {
    // Where there is no mapping, the chunk lies in `owned`.
    auto* const to = const_cast<std::byte*>(reinterpret_cast<const std::byte*>(c.part(p)));
    const bool is_read = is_mapped_ || read_(c.offset + layout_.begin[p], {to, c.size(p)});
    c.state[p].store(is_read && checksum(c, p) == c.checksums[p] ? Chunk::kIntact : Chunk::kDamaged,
                     std::memory_order_release);
  }
  return c.state[p].load(std::memory_order_acquire) == Chunk::kIntact;
}

Status PlaceStore::check() const {
  for (std::size_t i = 0; i < size(); i += kChunk)  // bounds were when it was opened
    for (std::size_t part = ChunkLayout::kImages; part < ChunkLayout::kParts; ++part)
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
    for (std::size_t part = 0; part < ChunkLayout::kParts; ++part)
      table[i * ChunkLayout::kParts + part] = checksum(chunk(i * kChunk), part);
  FileHeader header;
  header.rings = static_cast<std::uint32_t>(rings_);
  header.sectors = static_cast<std::uint32_t>(sectors_);
  header.levels = static_cast<std::uint32_t>(levels_);
  header.places = places;
  header.checksum = checksum_of(header, table.data(), chunks);
  Status status = write(0, std::as_bytes(std::span(&header, 1)));
  if (status) status = write(sizeof header, std::as_bytes(std::span(table)));
  for (std::size_t i = 0; i < chunks; ++i) {
    const Chunk& c = chunk(i * kChunk);
    const std::size_t begin = first_chunk(chunks) + i * layout_.begin[ChunkLayout::kParts];
    for (std::size_t part = 0; status && part < ChunkLayout::kParts; ++part)
      status = write(begin + layout_.begin[part], std::as_bytes(std::span(c.part(part), c.size(part))));
  }
  return status;
}

Status PlaceStore::save(const std::string& path) const {
  const std::string partial = path + ".part";
  std::ofstream file(partial, std::ios::binary | std::ios::trunc);
  const Status saved = save([&](std::size_t, std::span<const std::byte> bytes) {
    file.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    return ok();
  });
  file.close();
  if (saved && file && put_in_place(partial, path)) return ok();
  std::error_code ignored;
  std::filesystem::remove(partial, ignored);
  if (!saved) return saved;
  return Error{path + ": cannot be written (" + std::to_string(saved_bytes()) + " bytes are needed)"};
}

Result<std::unique_ptr<PlaceStore>> PlaceStore::open(const std::string& path) {
  auto mapped = MappedFile::open(path);
  if (!mapped) return mapped.error();
  const std::uint8_t* const data = mapped->data();
  const std::size_t size = mapped->size();
  return open(path, size, *std::move(mapped), [data](std::size_t offset, std::span<std::byte> to) {
    std::memcpy(to.data(), data + offset, to.size());
    return ok();
  });
}

Result<std::unique_ptr<PlaceStore>> PlaceStore::open(const std::string& name, std::size_t size, Read read) {
  return open(name, size, MappedFile(), std::move(read));
}

Result<std::unique_ptr<PlaceStore>> PlaceStore::open(const std::string& path, std::size_t size, MappedFile mapped,
                                                     Read read) {
  const auto refuse = [&](const std::string& why) { return Error{path + ": " + why}; };
  FileHeader header;
  const FileHeader ours;
  if (size >= sizeof header)
    if (const Status status = read(0, std::as_writable_bytes(std::span(&header, 1))); !status) return status.error();
  if (size < sizeof header || std::memcmp(header.magic, ours.magic, sizeof ours.magic) != 0)
    return refuse("is no place index of revisit (" + std::to_string(size) + " bytes)");
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
  std::vector<std::uint64_t> table((first_chunk(chunks) - sizeof header) / sizeof(std::uint64_t));
  if (const Status status = read(sizeof header, std::as_writable_bytes(std::span(table))); !status)
    return status.error();
  if (checksum_of(header, table.data(), chunks) != header.checksum)
    return refuse("its header does not have the checksum it was saved with: the file was altered" + hint());

  store->file_ = std::move(mapped);
  const std::uint8_t* const data = store->file_.data();
  store->is_mapped_ = data != nullptr;
  if (!store->is_mapped_) store->read_ = std::move(read);
  for (std::size_t i = 0; i < chunks; ++i) {
    const std::size_t offset = first_chunk(chunks) + i * chunk_bytes;
    // A last chunk that is not full will be added to: it is read whole.
    const bool grows = (i + 1) * kChunk > header.places;
    Chunk& chunk = store->append_chunk(i, grows || data == nullptr ? nullptr : data + offset);
    if (grows && data != nullptr) std::memcpy(chunk.owned.data(), data + offset, chunk_bytes);
    chunk.offset = offset;
    std::memcpy(chunk.checksums, table.data() + i * ChunkLayout::kParts, sizeof chunk.checksums);
    for (auto& state : chunk.state) state = Chunk::kUnchecked;
    for (std::size_t part = 0; part < (grows ? ChunkLayout::kParts : ChunkLayout::kImages); ++part)
      if (!store->check(chunk, part)) return store->damage(i * kChunk);
  }
  store->size_ = header.places;
  if (!store->is_mapped_)
    store->background_ = std::jthread([all = store.get(), chunks](const std::stop_token& stop) {
      std::unique_lock waiting(all->reading_);
      all->stopped_.wait_for(waiting, stop, kFirstAnswer, [] { return false; });
      waiting.unlock();
      for (std::size_t i = 0; i < chunks; ++i)
        for (std::size_t part = 0; part < ChunkLayout::kParts && !stop.stop_requested(); ++part)
          (void)all->is_intact(all->chunk(i * kChunk), part);
      const std::lock_guard lock(all->reading_);
      all->read_ = {};
    });
  return store;
}

}  // namespace revisit::retrieval_internal
