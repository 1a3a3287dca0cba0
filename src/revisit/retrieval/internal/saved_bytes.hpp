// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>

#include <revisit/core/result.hpp>
#include <revisit/retrieval/internal/aligned_vector.hpp>

namespace revisit::retrieval_internal {

/// A saved index's bytes: a file, mapped for reading, or memory of its own. The file must not be shortened while it is
/// mapped; replacing it is fine.
class SavedBytes {
 public:
  SavedBytes() = default;
  explicit SavedBytes(AlignedVector<std::uint8_t> bytes)
      : owned_(std::move(bytes)), data_(owned_.data()), size_(owned_.size()) {}
  ~SavedBytes();
  SavedBytes(SavedBytes&& other) noexcept
      : owned_(std::move(other.owned_)),
        data_(std::exchange(other.data_, nullptr)),
        size_(std::exchange(other.size_, 0)) {}
  SavedBytes& operator=(SavedBytes&& other) noexcept {
    std::swap(owned_, other.owned_);
    std::swap(data_, other.data_);
    std::swap(size_, other.size_);
    return *this;
  }

  static Result<SavedBytes> map(const std::string& path);

  const std::uint8_t* data() const { return data_; }
  std::size_t size() const { return size_; }

 private:
  AlignedVector<std::uint8_t> owned_;  ///< empty where a file is mapped
  const std::uint8_t* data_ = nullptr;
  std::size_t size_ = 0;
};

}  // namespace revisit::retrieval_internal
