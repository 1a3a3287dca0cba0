// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <optional>

#include <revisit/localisation/saved_map.hpp>
#include <revisit/pipeline/detection.hpp>
#include <revisit/pipeline/place_recognition.hpp>

namespace revisit {

/// Where a scan is in a saved map.
struct Localisation {
  std::optional<Pose> T_map_lidar;        ///< absent where the scan was not found; `detection` says why
  double probability = 0.0;               ///< that the pose is right (docs/accuracy.md)
  Matrix6 information = Matrix6::Zero();  ///< of the pose relative to the key frame, as in LoopConstraint
  Detection detection;                    ///< match: the frame of the key frame in the map's own recording
};

/// A saved map answers: where am I? One scan, without a prior. Takes scans as a driver delivers them. Belongs to one
/// thread at a time.
class Localiser {
 public:
  /// `map`: what `revisit slam --out` or Slam::open() wrote. Its scans are not read again. The parameters must be those
  /// of its descriptors.
  static Result<Localiser> open(const std::filesystem::path& map, const Parameters& parameters = {}, LogSink log = {});

  /// An error where the scan describes no place, or a place of the map cannot be read.
  Result<Localisation> locate(Scan scan);

  std::size_t places() const { return recognition_.index().size(); }

 private:
  Localiser(SavedMap map, const Parameters& parameters, LogSink log);

  SavedMap map_;
  ScanPreparation preparation_;
  PlaceRecognition recognition_;
  TypicalAgreement typical_;
};

}  // namespace revisit
