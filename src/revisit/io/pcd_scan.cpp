// SPDX-License-Identifier: Apache-2.0
#include <sstream>

#include <pcl/console/print.h>
#include <pcl/io/pcd_io.h>

#include <revisit/io/internal/bytes.hpp>
#include <revisit/io/internal/pcd_header.hpp>
#include <revisit/io/internal/scan_formats.hpp>

namespace revisit::io_internal {

void silence_pcl() {
  static const bool done = (pcl::console::setVerbosityLevel(pcl::console::L_ALWAYS), true);
  (void)done;
}

Result<Scan> read_pcd(const std::filesystem::path& file, const LogSink& log) {
  silence_pcl();
  const auto bytes = read_bytes(file);
  if (!bytes) return bytes.error();
  if (bytes->empty()) return Error{file.string() + ": empty file"};
  const auto header = parse_pcd_header(file, *bytes);
  if (!header) return header.error();
  if (header->padding_was_repaired)
    log_to(log, LogLevel::kInfo,
           file.string() + ": the header counts a padding as 0; the fields after it were taken at natural alignment");

  // PCL reads from the header as checked and the data as they stand.
  pcl::PCLPointCloud2 cloud;
  Eigen::Vector4f origin;
  Eigen::Quaternionf orientation;
  int version = 0, encoding = 0;
  unsigned int data_offset = 0;
  pcl::PCDReader reader;
  std::istringstream header_text(header->text());
  if (reader.readHeader(header_text, cloud, origin, orientation, version, encoding, data_offset) < 0)
    return Error{file.string() + ": PCD header: not understood"};
  int status = 0;
  if (encoding == 0) {
    std::istringstream body(bytes->substr(header->data_offset));
    status = reader.readBodyASCII(body, cloud, version);
  } else {
    status = reader.readBodyBinary(reinterpret_cast<const unsigned char*>(bytes->data()), cloud, version, encoding == 2,
                                   static_cast<unsigned int>(header->data_offset));
  }
  if (status < 0) return Error{file.string() + ": the data do not match the PCD header"};
  return to_scan(file, cloud, log);
}

}  // namespace revisit::io_internal
