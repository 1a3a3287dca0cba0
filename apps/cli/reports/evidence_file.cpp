// SPDX-License-Identifier: Apache-2.0
#include "reports/evidence_file.hpp"

#include <charconv>
#include <cmath>
#include <cstdint>
#include <iomanip>
#include <system_error>

#include <revisit/store/map_store.hpp>

namespace revisit::cli {

namespace {

// A run that was killed wrote rows that the next one will write again, and perhaps half a row.
void cut_after(const std::string& file, FrameId last) {
  std::ifstream stream(file, std::ios::binary);
  std::uintmax_t kept = 0;
  for (std::string line; std::getline(stream, line) && !stream.eof(); kept += line.size() + 1) {
    std::int64_t query = 0;
    const bool is_row = std::from_chars(line.data(), line.data() + line.size(), query).ec == std::errc();
    if (is_row && query > last.value) break;
  }
  stream.close();
  std::error_code ignored;
  std::filesystem::resize_file(file, kept, ignored);
}

}  // namespace

std::filesystem::path evidence_of_map(const std::filesystem::path& map_file) {
  const bool is_of_results = map_file.filename() == MapStore::kFileName;
  return map_file.parent_path() / (is_of_results ? "evidence.csv" : map_file.stem().string() + ".evidence.csv");
}

EvidenceFile::EvidenceFile(const std::filesystem::path& csv, std::optional<FrameId> last) : file_(csv.string()) {
  if (last) cut_after(file_, *last);
  stream_.open(file_, last ? std::ios::app : std::ios::trunc);
  stream_ << std::setprecision(10);
  if (stream_.tellp() == 0)
    stream_ << "query,match,inlier_ratio,inlier_share,free_space_agreement,intensity_agreement,rmse_m,overlap,"
               "distance_m,least_fixed,voxel_m,inliers,log_odds,tx,ty,tz,qx,qy,qz,qw,hidden_share,in_the_open,stddev_m,"
               "residual_share\n";
}

EvidenceFile EvidenceFile::of_map(const std::filesystem::path& map_file, FrameId last) {
  EvidenceFile file(evidence_of_map(map_file), last);
  file.is_of_map_ = true;
  return file;
}

Status EvidenceFile::add(const Detection& detection) {
  for (const Detection::Registered& each : detection.registered) {
    if (!is_of_map_ && session_of(each.match) != session_of(detection.frame)) continue;
    const auto numbered = [this](FrameId frame) { return is_of_map_ ? frame.value : in_recording(frame).value; };
    const LoopEvidence& e = each.evidence.evidence;
    const Eigen::Vector3d t = each.evidence.T_match_query.translation();
    const Eigen::Quaterniond q(each.evidence.T_match_query.rotation());
    stream_ << numbered(detection.frame) << ',' << numbered(each.match) << ',' << e.inlier_ratio << ','
            << e.inlier_share << ',' << e.free_space_agreement << ',';
    if (e.intensity_agreement) stream_ << *e.intensity_agreement;
    for (const double value :
         {e.rmse_m, e.overlap, e.distance_m, e.least_fixed, e.voxel_m, static_cast<double>(e.inliers),
          each.evidence.log_odds, t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w(), e.hidden_share})
      stream_ << ',' << value;
    stream_ << ',' << e.in_the_open << ',';
    if (std::isfinite(e.stddev_m)) stream_ << e.stddev_m;
    stream_ << ',' << e.residual_share << '\n';
  }
  stream_.flush();
  return stream_ ? ok() : Status(Error{file_ + ": cannot be written"});
}

Status EvidenceFile::add_rows_of(const std::filesystem::path& map_file, int first_session) {
  std::ifstream stream(evidence_of_map(map_file));
  for (std::string line; std::getline(stream, line) && !stream.eof();) {
    std::int64_t query = 0, match = 0;
    const char* const end = line.data() + line.size();
    const auto first = std::from_chars(line.data(), end, query);
    if (first.ec != std::errc() || first.ptr == end) continue;
    const auto second = std::from_chars(first.ptr + 1, end, match);
    if (second.ec != std::errc()) continue;
    const std::int64_t later = in_map(first_session, FrameId{0}).value;
    stream_ << query + later << ',' << match + later << second.ptr << '\n';
  }
  stream_.flush();
  return stream_ ? ok() : Status(Error{file_ + ": cannot be written"});
}

}  // namespace revisit::cli
