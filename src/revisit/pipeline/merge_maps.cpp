// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/merge_maps.hpp>

#include <algorithm>
#include <map>
#include <memory>
#include <utility>

#include <revisit/core/put_in_place.hpp>
#include <revisit/core/text.hpp>
#include <revisit/localisation/saved_map.hpp>
#include <revisit/pipeline/slam_back_end.hpp>
#include <revisit/pose_graph/edge_information.hpp>
#include <revisit/store/keyframe_bytes.hpp>

namespace revisit {
namespace {

namespace fs = std::filesystem;

struct Source {
  fs::path file;
  MapStore store;
  StoredMap map;
};

Result<Source> open_source(const fs::path& path) {
  auto store = open_map(path);
  if (!store) return store.error();
  const fs::path file = store->file();
  // As it is now, until its scans have been read, too.
  if (const Status held = store->hold(); !held) return held.error();
  auto map = read_map(*store);
  if (!map) return Error{file.string() + ": " + map.error().message};
  if (map->keyframes.empty()) return Error{file.string() + ": the map holds no key frame yet"};
  return Source{file, *std::move(store), *std::move(map)};
}

// One map after the other goes into the new one.
class Merger {
 public:
  Merger(std::shared_ptr<MapStore> store, const Parameters& parameters, const LogSink& log,
         std::function<bool()> advance, std::function<Status(const Detection&)> take)
      : store_(store),
        parameters_(parameters),
        advance_(std::move(advance)),
        take_(std::move(take)),
        back_end_(parameters, Odometry::Source::kLidar, std::move(store), log) {}

  Status add(const Source& source);
  Result<MergeReport> finish();

 private:
  FrameId renumbered(FrameId frame) const { return in_map(session_of(frame) + first_session_, in_recording(frame)); }
  Result<SlamBackEnd::Entry> entry(const Source& source, const StoredMap::Keyframe& keyframe) const;
  Status add_scans(const Source& source);

  std::shared_ptr<MapStore> store_;
  Parameters parameters_;
  std::function<bool()> advance_;
  std::function<Status(const Detection&)> take_;
  std::size_t maps_ = 0;  ///< added so far
  SlamBackEnd back_end_;
  MergeReport report_;
  // Of the map at work.
  int first_session_ = 0, first_segment_ = 0;
  struct Anchor {
    FrameId frame;  ///< in the new map
    Pose T_map_lidar = Pose::Identity();
  };
  std::map<int, Anchor> anchors_;  ///< the last key frame of each of its parts
};

Result<SlamBackEnd::Entry> Merger::entry(const Source& source, const StoredMap::Keyframe& keyframe) const {
  const FrameId frame = keyframe.frame.frame;
  SlamBackEnd::Entry entry;
  entry.row.frame = renumbered(frame);
  entry.row.stamp_s = keyframe.frame.stamp_s;
  entry.row.T_odom_lidar = keyframe.point.T_segment_lidar;
  entry.point = keyframe.point;
  entry.point.segment += first_segment_;
  entry.point.origin += first_segment_;
  entry.edge = keyframe.edge;
  const auto& before = back_end_.graph().keyframes();
  if (!before.empty()) {
    entry.row.starts_segment = back_end_.graph().last_point().segment != entry.point.segment;
    if (!entry.edge) entry.edge = KeyframeGraph::OdometryEdge{Pose::Identity(), no_information()};
  }
  if (keyframe.settled) {
    // As its map has it to the last one of the same part, wherever that one has been moved to by now.
    const auto anchor = anchors_.find(keyframe.settled->part);
    entry.T_world_lidar = keyframe.settled->T_map_lidar;
    if (anchor != anchors_.end())
      entry.T_world_lidar = normalised(back_end_.graph().T_world_lidar(anchor->second.frame) *
                                       anchor->second.T_map_lidar.inverse() * keyframe.settled->T_map_lidar);
  }
  for (const auto& [part, bytes] :
       {std::pair{MapStore::Part::kDescriptor, &entry.row.descriptor}, {MapStore::Part::kPlace, &entry.row.place}}) {
    auto read = source.store.part(frame, part);
    if (!read) return read.error();
    *bytes = *std::move(read);
  }
  // As its map is now: what was gone stays so.
  const auto points = read_map_points(source.store, frame);
  if (!points) return points.error();
  entry.row.cloud = to_map_bytes(*points);
  if (entry.row.descriptor.empty()) return entry;
  auto descriptor = to_descriptor(entry.row.descriptor);
  auto cloud = to_thin_cloud(entry.row.place);
  if (!descriptor) return source.store.damaged("descriptor", frame);
  if (!cloud) return source.store.damaged("place", frame);
  if (const Status same = check_grid(*descriptor, parameters_.descriptor); !same)
    return Error{source.file.string() + ": " + same.error().message};
  entry.place.emplace();
  entry.place->descriptor = *std::move(descriptor);
  entry.place->cloud = *std::move(cloud);
  return entry;
}

Status Merger::add(const Source& source) {
  const auto& before = back_end_.graph().keyframes();
  first_segment_ = before.empty() ? 0 : back_end_.graph().last_point().segment + 1;
  first_session_ = static_cast<int>(report_.sessions.size());
  anchors_.clear();
  const std::size_t places = back_end_.places();  // those of the same map have been searched already
  std::multimap<FrameId, const LoopConstraint*> loops;
  for (const LoopConstraint& loop : source.map.loops) loops.emplace(std::max(loop.query, loop.match), &loop);
  auto keyframe = source.map.keyframes.begin();
  for (const StoredSession& session : source.map.sessions) {
    const int id = session.id + first_session_;
    if (id != static_cast<int>(report_.sessions.size()))
      return Error{source.file.string() + ": its sessions are not numbered one after the other"};
    report_.sessions.push_back({id, maps_, session.recording, 0, {}, 0});
    if (Status begun = back_end_.begin_session({id, session.recording, session.parameters, session.sensor}); !begun)
      return begun;
    for (; keyframe != source.map.keyframes.end() && session_of(keyframe->frame.frame) == session.id; ++keyframe) {
      auto entered = entry(source, *keyframe);
      if (!entered) return entered.error();
      const auto added = back_end_.add_entry(*std::move(entered), places);
      if (!added) return added.error();
      if (take_ && added->detection)
        if (Status taken = take_(*added->detection); !taken) return taken;
      ++report_.sessions.back().keyframes;
      if (const auto& settled = keyframe->settled)
        anchors_[settled->part] = {renumbered(settled->keyframe), settled->T_map_lidar};
      const auto [first, last] = loops.equal_range(keyframe->frame.frame);
      for (auto it = first; it != last; ++it) {
        LoopConstraint loop = *it->second;
        loop.query = renumbered(loop.query);
        loop.match = renumbered(loop.match);
        if (Status known = back_end_.add_known_loop(loop); !known) return known;
      }
      if (!advance_()) return Error{"interrupted; nothing was written"};
    }
  }
  ++maps_;
  return add_scans(source);
}

Status Merger::add_scans(const Source& source) {
  const auto fixes = source.store.fixes();
  if (!fixes) return fixes.error();
  for (StoredFix fix : *fixes) {
    fix.keyframe = renumbered(fix.keyframe);
    if (Status added = store_->add(fix); !added) return added;
  }
  const auto ups = source.store.ups();
  if (!ups) return ups.error();
  for (StoredUp up : *ups) {
    up.keyframe = renumbered(up.keyframe);
    if (Status added = store_->add(up); !added) return added;
  }
  const auto scans = source.store.scans();
  if (!scans) return scans.error();
  for (StoredScan scan : *scans) {
    if (!back_end_.graph().has(renumbered(scan.keyframe))) continue;
    scan.frame = renumbered(scan.frame);
    scan.keyframe = renumbered(scan.keyframe);
    if (Status added = store_->add(scan); !added) return added;
  }
  return store_->commit();
}

Result<MergeReport> Merger::finish() {
  Status finished = back_end_.decide_all();
  if (finished) finished = back_end_.settle();
  if (finished) finished = store_->commit();
  if (!finished) return finished.error();
  const KeyframeGraph& graph = back_end_.graph();
  for (const FrameId frame : graph.keyframes())
    report_.sessions.at(static_cast<std::size_t>(session_of(frame))).parts.insert(graph.part(frame));
  const auto edges = store_->edges();
  if (!edges) return edges.error();
  for (const StoredEdge& edge : *edges) {
    if (!edge.loop || session_of(edge.from) == session_of(edge.to)) continue;
    for (const FrameId end : {edge.from, edge.to})
      ++report_.sessions.at(static_cast<std::size_t>(session_of(end))).loops;
  }
  return report_;
}

}  // namespace

Result<MergeReport> merge_maps(std::span<const fs::path> maps, const fs::path& out, const Parameters& parameters,
                               const LogSink& log, const std::function<bool(std::size_t, std::size_t)>& progress,
                               const std::function<Status(const Detection&)>& take) {
  if (const Status status = validate(parameters); !status) return status.error();
  std::error_code failure;
  if (fs::exists(out, failure)) return Error{out.string() + ": exists already; name another file"};
  std::vector<Source> sources;
  std::size_t keyframes = 0, done = 0;
  for (const fs::path& path : maps) {
    auto source = open_source(path);
    if (!source) return source.error();
    keyframes += source->map.keyframes.size();
    sources.push_back(*std::move(source));
  }
  // Complete, it gets its name; whatever ends the work before leaves no map behind.
  const fs::path partial = out.string() + ".part";
  const auto remove_partial = [](const fs::path* file) {
    std::error_code ignored;
    for (const char* ending : {"", "-wal", "-shm", "-journal"}) fs::remove(file->string() + ending, ignored);
  };
  const std::unique_ptr<const fs::path, decltype(remove_partial)> at_the_end(&partial, remove_partial);
  if (const Status removed = MapStore::remove_file(partial); !removed) return removed.error();
  auto store = MapStore::create(partial);
  if (!store) return store.error();
  Result<MergeReport> report = Error{};
  const auto written = std::make_shared<MapStore>(*std::move(store));
  {
    Merger merger(
        written, parameters, log, [&] { return !progress || progress(++done, keyframes); }, take);
    Status status = ok();
    for (const Source& source : sources)
      if (status) status = merger.add(source);
    report = status ? merger.finish() : Result<MergeReport>(status.error());
  }
  if (report)
    if (const Status closed = written->close(); !closed) report = closed.error();
  if (report)
    if (const Status named = put_in_place(partial, out); !named) report = named.error();
  return report;
}

}  // namespace revisit
