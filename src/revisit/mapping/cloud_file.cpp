// SPDX-License-Identifier: Apache-2.0
#include <revisit/mapping/cloud_file.hpp>

#include <cassert>
#include <cerrno>
#include <cstring>

namespace revisit {

CloudFile::CloudFile(const std::filesystem::path& file, CloudFormat format, std::size_t count)
    : file_(file), stream_(file, std::ios::binary | std::ios::trunc), left_(count) {
  if (format == CloudFormat::kPly)
    stream_ << "ply\nformat binary_little_endian 1.0\ncomment metres; intensity in [0, 1]\nelement vertex " << count
            << "\nproperty float x\nproperty float y\nproperty float z\nproperty float intensity\nend_header\n";
  else
    stream_ << "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z intensity\nSIZE 4 4 4 4\n"
               "TYPE F F F F\nCOUNT 1 1 1 1\nWIDTH "
            << count << "\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS " << count << "\nDATA binary\n";
}

void CloudFile::add(std::span<const Point> points) {
  assert(points.size() <= left_);
  left_ -= points.size();
  stream_.write(reinterpret_cast<const char*>(points.data()), static_cast<std::streamsize>(points.size_bytes()));
}

Status CloudFile::finish() {
  assert(left_ == 0);
  stream_.close();
  if (stream_) return ok();
  return Error{file_.string() + ": cannot be written: " + std::strerror(errno)};
}

}  // namespace revisit
