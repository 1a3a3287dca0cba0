// SPDX-License-Identifier: Apache-2.0
#include <revisit/io/result_files.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <iomanip>
#include <map>
#include <sstream>

#include <revisit/core/put_in_place.hpp>
#include <revisit/io/internal/bytes.hpp>
#include <revisit/io/internal/text_writer.hpp>

namespace revisit {
namespace {

namespace fs = std::filesystem;
using io_internal::TextWriter;

constexpr const char* kCandidateHeader = "query,match,score,accepted,reason";
constexpr const char* kLocalisationHeader =
    "frame,status,session,match,tx,ty,tz,qx,qy,qz,qw,match_tx,match_ty,match_tz,match_qx,match_qy,match_qz,match_qw,"
    "probability,deviation_m,deviation_deg,ms,reason";
constexpr const char* kLoopHeader = "query,match,score,tx,ty,tz,qx,qy,qz,qw,inlier_ratio,rmse_m";

std::vector<std::string_view> split_cells(std::string_view line) {
  std::vector<std::string_view> cells;
  for (;;) {
    const auto comma = line.find(',');
    cells.push_back(line.substr(0, comma));
    if (comma == std::string_view::npos) return cells;
    line.remove_prefix(comma + 1);
  }
}

std::optional<double> number(std::string_view cell) {
  const auto values = io_internal::parse_numbers(cell);
  if (!values || values->size() != 1) return std::nullopt;
  return (*values)[0];
}

std::optional<FrameId> frame(std::string_view cell) {
  const auto value = number(cell);
  if (!value || !(*value >= 0.0 && *value < 1e15) || *value != std::floor(*value)) return std::nullopt;
  return FrameId{static_cast<std::int64_t>(*value)};
}

// Calls `read_row` with the cells of each row; a row it refuses is an error that names file and line.
template <typename ReadRow>
Status read_csv(const fs::path& file, std::string_view header, ReadRow read_row) {
  const auto text = io_internal::read_bytes(file);
  if (!text) return text.error();
  const auto lines = io_internal::split_lines(*text);
  if (lines.empty() || lines[0] != header)
    return Error{file.string() + ": the first line must be '" + std::string(header) + "'"};
  for (std::size_t i = 1; i < lines.size(); ++i) {
    if (lines[i].empty()) continue;
    if (!read_row(split_cells(lines[i])))
      return Error{file.string() + ":" + std::to_string(i + 1) + ": '" + std::string(lines[i].substr(0, 80)) +
                   "' does not fit '" + std::string(header) + "'"};
  }
  return ok();
}

void write(std::ostream& out, const CandidateRow& row) {
  std::string reason = row.reason;
  std::replace_if(
      reason.begin(), reason.end(), [](char c) { return c == ',' || c == '\n' || c == '"'; }, ';');
  out << row.query.value << ',';
  if (row.match) out << row.match->value;
  out << ',' << std::setprecision(6) << row.score << ',' << (row.accepted ? 1 : 0) << ',' << reason << '\n';
}

// The rows of a CSV file in the order of their queries, some of them replaced by others. The file is the one of before
// or the new one, whatever happens.
Status sort_rows(const fs::path& file, const std::map<FrameId, std::string>& replaced) {
  const auto text = io_internal::read_bytes(file);
  if (!text) return text.error();
  const auto lines = io_internal::split_lines(*text);
  std::vector<std::pair<FrameId, std::string_view>> rows;
  for (std::size_t i = 1; i < lines.size(); ++i) {
    const auto query = frame(split_cells(lines[i])[0]);
    if (!query) continue;
    const auto other = replaced.find(*query);
    rows.emplace_back(*query, other == replaced.end() ? lines[i] : std::string_view(other->second));
  }
  std::stable_sort(rows.begin(), rows.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  std::string sorted = std::string(lines[0]) + '\n';
  for (const auto& [query, row] : rows) (sorted += row) += '\n';
  const fs::path partial = file.string() + ".part";
  Status done = write_text(partial, sorted);
  if (done) done = put_in_place(partial, file);
  std::error_code ignored;
  if (!done) fs::remove(partial, ignored);
  return done;
}

}  // namespace

struct ResultWriter::Files {
  fs::path folder;
  TextWriter candidates, loops;
  std::map<FrameId, std::string> replaced;  // rows of candidates.csv, without their ends
};

ResultWriter::ResultWriter(std::unique_ptr<Files> files) : files_(std::move(files)) {}
ResultWriter::ResultWriter(ResultWriter&&) noexcept = default;
ResultWriter& ResultWriter::operator=(ResultWriter&&) noexcept = default;
ResultWriter::~ResultWriter() = default;

Result<ResultWriter> ResultWriter::create(const fs::path& folder, Existing existing) {
  std::error_code failure;
  fs::create_directories(folder, failure);
  if (failure) return Error{folder.string() + ": cannot be created: " + failure.message()};
  if (const fs::path earlier = folder / "candidates.csv"; existing == Existing::kRefuse && fs::exists(earlier, failure))
    return Error{folder.string() + ": already holds a result; name another folder or pass --overwrite"};
  // What an earlier run left would otherwise stand beside rows that it does not belong to.
  for (const char* name : {"candidates.csv", "loops.csv", "poses.txt", "poses.tum", "odometry.tum", "graph.g2o",
                           "calib.txt", "run.json", "evaluation.json", "reference.txt", "trajectories.png", "map.png",
                           "report.html", "precision_recall.png", "trajectory.png"})
    if (fs::is_regular_file(fs::symlink_status(folder / name, failure))) fs::remove(folder / name, failure);
  ResultWriter writer(std::make_unique<Files>(
      Files{folder, TextWriter(folder / "candidates.csv"), TextWriter(folder / "loops.csv"), {}}));
  writer.files_->candidates.stream() << kCandidateHeader << '\n';
  writer.files_->loops.stream() << kLoopHeader << '\n' << std::setprecision(10);
  for (TextWriter* each : {&writer.files_->candidates, &writer.files_->loops})
    if (const Status status = each->flush(); !status) return status.error();
  return writer;
}

Status ResultWriter::add(const CandidateRow& row) {
  write(files_->candidates.stream(), row);
  return files_->candidates.flush();
}

void ResultWriter::replace(const CandidateRow& row) {
  std::ostringstream text;
  write(text, row);
  files_->replaced[row.query] = text.str().substr(0, text.str().size() - 1);
}

Status ResultWriter::add(const LoopConstraint& loop) {
  auto& out = files_->loops.stream();
  const Eigen::Vector3d t = loop.T_match_query.translation();
  const Eigen::Quaterniond q = Eigen::Quaterniond(loop.T_match_query.rotation()).normalized();
  out << loop.query.value << ',' << loop.match.value;
  for (const double value :
       {loop.score, t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w(), loop.inlier_ratio, loop.rmse_m})
    out << ',' << value;
  out << '\n';
  return files_->loops.flush();
}

Status ResultWriter::finish() {
  const Status candidates = files_->candidates.finish();
  const Status loops = files_->loops.finish();
  for (const Status* each : {&candidates, &loops})
    if (!*each) return *each;
  if (files_->replaced.empty()) return ok();
  const Status sorted = sort_rows(files_->folder / "candidates.csv", files_->replaced);
  return sorted ? sort_rows(files_->folder / "loops.csv", {}) : sorted;
}

struct LocalisationWriter::File {
  TextWriter text;
};

LocalisationWriter::LocalisationWriter(const fs::path& file) : file_(std::make_unique<File>(File{TextWriter(file)})) {
  file_->text.stream() << kLocalisationHeader << '\n' << std::setprecision(10);
}
LocalisationWriter::LocalisationWriter(LocalisationWriter&&) noexcept = default;
LocalisationWriter::~LocalisationWriter() = default;

Status LocalisationWriter::add(const LocalisationRow& row) {
  auto& out = file_->text.stream();
  out << row.frame.value << ',' << row.status << ',';
  if (row.is_answered())
    out << session_of(row.match) << ',' << in_recording(row.match).value;
  else
    out << ',';
  for (const Pose* T : {&row.T_map_lidar, &row.T_match_lidar}) {
    const Eigen::Vector3d t = T->translation();
    const Eigen::Quaterniond q = Eigen::Quaterniond(T->rotation()).normalized();
    for (const double value : {t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w()}) {
      out << ',';
      if (row.is_answered()) out << value;
    }
  }
  std::string reason = row.reason;
  std::replace_if(
      reason.begin(), reason.end(), [](char c) { return c == ',' || c == '\n' || c == '"'; }, ';');
  out << ',' << row.probability << ',' << row.deviation_m << ',' << row.deviation_deg << ',' << row.ms << ',' << reason
      << '\n';
  return file_->text.flush();
}

Status LocalisationWriter::finish() { return file_->text.finish(); }

Result<std::vector<CandidateRow>> read_candidates(const fs::path& file) {
  std::vector<CandidateRow> rows;
  const Status status = read_csv(file, kCandidateHeader, [&](const std::vector<std::string_view>& cells) {
    if (cells.size() != 5) return false;
    CandidateRow row;
    const auto query = frame(cells[0]);
    const auto score = number(cells[2]);
    if (!query || !score || !std::isfinite(*score) || (cells[3] != "0" && cells[3] != "1")) return false;
    if (!cells[1].empty()) {
      row.match = frame(cells[1]);
      if (!row.match) return false;
    }
    row.query = *query;
    row.score = *score;
    row.accepted = cells[3] == "1";
    row.reason = cells[4];
    rows.push_back(row);
    return true;
  });
  if (!status) return status.error();
  return rows;
}

Result<std::vector<LoopConstraint>> read_loops(const fs::path& file) {
  std::vector<LoopConstraint> rows;
  const Status status = read_csv(file, kLoopHeader, [&](const std::vector<std::string_view>& cells) {
    if (cells.size() != 12) return false;
    const auto query = frame(cells[0]), match = frame(cells[1]);
    std::array<double, 10> v{};
    for (std::size_t i = 0; i < v.size(); ++i) {
      const auto value = number(cells[i + 2]);
      if (!value || !std::isfinite(*value)) return false;
      v[i] = *value;
    }
    const Eigen::Quaterniond q(v[7], v[4], v[5], v[6]);
    if (!query || !match || std::abs(q.norm() - 1.0) > 1e-2) return false;
    LoopConstraint loop;
    loop.score = v[0];
    loop.query = *query;
    loop.match = *match;
    loop.T_match_query.linear() = q.normalized().toRotationMatrix();
    loop.T_match_query.translation() << v[1], v[2], v[3];
    loop.inlier_ratio = v[8];
    loop.rmse_m = v[9];
    rows.push_back(loop);
    return true;
  });
  if (!status) return status.error();
  return rows;
}

Result<std::vector<LocalisationRow>> read_localisation(const fs::path& file) {
  std::vector<LocalisationRow> rows;
  const Status status = read_csv(file, kLocalisationHeader, [&](const std::vector<std::string_view>& cells) {
    if (cells.size() != 23) return false;
    LocalisationRow row;
    const auto query = frame(cells[0]);
    const auto probability = number(cells[18]), deviation_m = number(cells[19]), deviation_deg = number(cells[20]),
               ms = number(cells[21]);
    if (!query || !probability || !deviation_m || !deviation_deg || !ms) return false;
    row.frame = *query;
    row.status = cells[1];
    row.probability = *probability;
    row.deviation_m = *deviation_m;
    row.deviation_deg = *deviation_deg;
    row.ms = *ms;
    row.reason = cells[22];
    if (row.is_answered()) {
      const auto session = frame(cells[2]), match = frame(cells[3]);
      if (!session || !match || session->value < 0 || session->value > INT16_MAX || !fits_into_map(*match))
        return false;
      row.match = in_map(static_cast<int>(session->value), *match);
      for (const auto& [T, first] : {std::pair{&row.T_map_lidar, std::size_t{4}}, {&row.T_match_lidar, 11}}) {
        std::array<double, 7> v{};
        for (std::size_t i = 0; i < v.size(); ++i) {
          const auto value = number(cells[first + i]);
          if (!value || !std::isfinite(*value)) return false;
          v[i] = *value;
        }
        const Eigen::Quaterniond q(v[6], v[3], v[4], v[5]);
        if (std::abs(q.norm() - 1.0) > 1e-2) return false;
        T->linear() = q.normalized().toRotationMatrix();
        T->translation() << v[0], v[1], v[2];
      }
    }
    rows.push_back(row);
    return true;
  });
  if (!status) return status.error();
  return rows;
}

Status write_text(const fs::path& file, const std::string& text) {
  TextWriter writer(file);
  writer.stream() << text;
  return writer.finish();
}

}  // namespace revisit
