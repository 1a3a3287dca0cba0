// SPDX-License-Identifier: Apache-2.0
#include <revisit/io/internal/decompress.hpp>

#include <fstream>
#include <limits>
#include <memory>

#include <bzlib.h>
#include <lz4frame.h>
#include <zstd.h>

namespace revisit::io_internal {
namespace {

std::string wrong_size(std::uint64_t found, std::uint64_t said) {
  return "decompressed to " + std::to_string(found) + " bytes instead of " + std::to_string(said);
}

Error no_memory(std::uint64_t size) { return {"no memory for " + std::to_string(size) + " bytes"}; }

Result<SharedBytes> decompress_lz4(const SharedBytes& data, std::uint64_t size) {
  // A byte of LZ4 stands for 255 at most: a size that lies is noticed before memory is asked for.
  if (size > 256 * data.bytes.size() + 64) return Error{wrong_size(0, size)};
  std::uint8_t* target = nullptr;
  SharedBytes result = allocate(size, target);
  if (target == nullptr) return no_memory(size);
  LZ4F_dctx* raw = nullptr;
  if (LZ4F_isError(LZ4F_createDecompressionContext(&raw, LZ4F_VERSION))) return Error{"lz4: no memory"};
  const std::unique_ptr<LZ4F_dctx, decltype(&LZ4F_freeDecompressionContext)> context(raw,
                                                                                     LZ4F_freeDecompressionContext);
  std::size_t read = 0, written = 0;
  for (std::size_t hint = 1; read < data.bytes.size() && hint != 0;) {
    std::size_t in = data.bytes.size() - read, out = size - written;
    hint = LZ4F_decompress(raw, target + written, &out, data.bytes.data() + read, &in, nullptr);
    if (LZ4F_isError(hint)) return Error{std::string("lz4: ") + LZ4F_getErrorName(hint)};
    read += in;
    written += out;
    if (in == 0 && out == 0) break;
  }
  if (written != size) return Error{"lz4: " + wrong_size(written, size)};
  return result;
}

Result<SharedBytes> decompress_bz2(const SharedBytes& data, std::uint64_t size) {
  if (data.bytes.size() > std::numeric_limits<unsigned>::max()) return Error{"bz2: too large"};
  std::uint8_t* target = nullptr;
  SharedBytes result = allocate(size, target);
  if (target == nullptr) return no_memory(size);
  auto written = static_cast<unsigned>(size);
  // bzip2 declares its input as changeable, and leaves it as it is.
  char* source = reinterpret_cast<char*>(const_cast<std::uint8_t*>(data.bytes.data()));
  const int code = BZ2_bzBuffToBuffDecompress(reinterpret_cast<char*>(target), &written, source,
                                              static_cast<unsigned>(data.bytes.size()), 0, 0);
  if (code != BZ_OK) return Error{"bz2: error " + std::to_string(code)};
  if (written != size) return Error{"bz2: " + wrong_size(written, size)};
  return result;
}

Result<SharedBytes> decompress_zstd(const SharedBytes& data, std::uint64_t size) {
  std::uint8_t* target = nullptr;
  SharedBytes result = allocate(size, target);
  if (target == nullptr) return no_memory(size);
  const std::size_t written = ZSTD_decompress(target, size, data.bytes.data(), data.bytes.size());
  if (ZSTD_isError(written)) return Error{std::string("zstd: ") + ZSTD_getErrorName(written)};
  if (written != size) return Error{"zstd: " + wrong_size(written, size)};
  return result;
}

}  // namespace

Result<SharedBytes> decompress(std::string_view method, const SharedBytes& data, std::uint64_t size) {
  if (size >= kLargestPiece)
    return Error{std::to_string(size) + " bytes in one piece; allowed: below " + std::to_string(kLargestPiece)};
  if (method == "lz4") return decompress_lz4(data, size);
  if (method == "bz2") return decompress_bz2(data, size);
  if (method == "zstd") return decompress_zstd(data, size);
  if (!method.empty() && method != "none")
    return Error{"compression '" + std::string(method.substr(0, 20)) + "'; allowed: none, lz4, zstd, bz2"};
  if (data.bytes.size() != size) return Error{wrong_size(data.bytes.size(), size)};
  return data;
}

Result<SharedBytes> decompress_zstd(const SharedBytes& data) {
  const unsigned long long size = ZSTD_getFrameContentSize(data.bytes.data(), data.bytes.size());
  if (size == ZSTD_CONTENTSIZE_ERROR) return Error{"zstd: no such frame"};
  if (size == ZSTD_CONTENTSIZE_UNKNOWN || size >= kLargestPiece) return Error{"zstd: the frame names no allowed size"};
  return decompress_zstd(data, size);
}

Status decompress_zstd_file(const RandomAccessFile& file, const std::filesystem::path& target) {
  const std::unique_ptr<ZSTD_DStream, decltype(&ZSTD_freeDStream)> stream(ZSTD_createDStream(), ZSTD_freeDStream);
  std::ofstream out(target, std::ios::binary | std::ios::trunc);
  if (!stream || !out) return Error{target.string() + ": cannot be written"};
  std::string room(ZSTD_DStreamOutSize(), '\0');
  std::size_t hint = 0;
  constexpr std::uint64_t kPiece = 1 << 20;
  for (std::uint64_t offset = 0; offset < file.size(); offset += kPiece) {
    const auto piece = file.read(offset, std::min(kPiece, file.size() - offset));
    if (!piece) return piece.error();
    ZSTD_inBuffer in{piece->bytes.data(), piece->bytes.size(), 0};
    ZSTD_outBuffer produced{};
    do {
      produced = {room.data(), room.size(), 0};
      hint = ZSTD_decompressStream(stream.get(), &produced, &in);
      if (ZSTD_isError(hint)) return file.error(offset, std::string("zstd: ") + ZSTD_getErrorName(hint));
      if (!out.write(room.data(), static_cast<std::streamsize>(produced.pos)))
        return Error{target.string() + ": cannot be written: no space left?"};
    } while (in.pos < in.size || (hint != 0 && produced.pos == produced.size));
  }
  if (hint != 0) return file.error(file.size(), "zstd: the data end within a frame");
  return ok();
}

}  // namespace revisit::io_internal
