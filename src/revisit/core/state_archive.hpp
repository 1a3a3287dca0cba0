// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <deque>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include <revisit/core/ids.hpp>

namespace revisit {

/// The state of a run as bytes, from which the next run goes on as if there had been no end (Slam). A class whose
/// state belongs to it names its fields once, for both directions: `void archive(auto& fields) { fields(a_, b_); }`.
/// What follows from parameters, and caches that only save time, are left out. For one version of the program, on one
/// kind of machine.
class StateWriter {
 public:
  static constexpr bool kReads = false;
  void operator()(auto&... fields) { (put(fields), ...); }
  /// What a reader demands of values that it cannot trust.
  void require(bool) {}
  std::vector<std::byte> take() { return std::move(bytes_); }

 private:
  template <typename T>
  static constexpr bool kIsPlain = std::is_arithmetic_v<T> || std::is_enum_v<T>;

  void put_bytes(const void* data, std::size_t size) {
    const auto* const first = static_cast<const std::byte*>(data);
    bytes_.insert(bytes_.end(), first, first + size);
  }
  void put_count(std::size_t count) {
    const std::uint64_t number = count;
    put_bytes(&number, sizeof number);
  }
  template <typename T>
  requires kIsPlain<T>
  void put(const T& value) { put_bytes(&value, sizeof value); }
  template <typename T>
  requires requires(T& value, StateWriter& writer) { value.archive(writer); }
  void put(T& value) { value.archive(*this); }
  void put(FrameId& frame) { put(frame.value); }
  template <typename Scalar, int Rows, int Columns>
  void put(Eigen::Matrix<Scalar, Rows, Columns>& matrix) {
    static_assert(Rows > 0 && Columns > 0);
    put_bytes(matrix.data(), sizeof(Scalar) * static_cast<std::size_t>(matrix.size()));
  }
  void put(Eigen::Isometry3d& T) { put(T.matrix()); }
  void put(std::string& text) {
    put_count(text.size());
    put_bytes(text.data(), text.size());
  }
  template <typename A, typename B>
  void put(std::pair<A, B>& both) {
    (*this)(both.first, both.second);
  }
  template <typename T>
  void put(std::optional<T>& value) {
    put(value.has_value());
    if (value) put(*value);
  }
  template <typename T, std::size_t N>
  void put(std::array<T, N>& values) {
    for (T& each : values) put(each);
  }
  template <typename T>
  void put(std::vector<T>& values) {
    put_count(values.size());
    if constexpr (kIsPlain<T>)
      put_bytes(values.data(), values.size() * sizeof(T));
    else
      for (T& each : values) put(each);
  }
  template <typename T>
  void put(std::deque<T>& values) {
    put_count(values.size());
    for (T& each : values) put(each);
  }
  template <typename K, typename V>
  void put(std::map<K, V>& values) {
    put_count(values.size());
    for (auto& [key, value] : values) {
      K copy = key;
      (*this)(copy, value);
    }
  }

  std::vector<std::byte> bytes_;
};

/// Reads what StateWriter wrote. The bytes may be anything: what is read takes a small multiple of their number, and
/// is_complete() says whether they were such a state.
class StateReader {
 public:
  static constexpr bool kReads = true;
  explicit StateReader(std::span<const std::byte> bytes) : bytes_(bytes) {}
  void operator()(auto&... fields) { (get(fields), ...); }
  void require(bool holds) { is_fine_ = is_fine_ && holds; }
  bool is_complete() const { return is_fine_ && bytes_.empty(); }
  bool is_fine() const { return is_fine_; }

 private:
  void get_bytes(void* data, std::size_t size) {
    require(size <= bytes_.size());
    if (!is_fine_ || size == 0) return;
    std::memcpy(data, bytes_.data(), size);
    bytes_ = bytes_.subspan(size);
  }
  /// Of things that take at least `least` bytes each; 0 where the rest cannot hold them.
  std::size_t get_count(std::size_t least = 1) {
    std::uint64_t count = 0;
    get_bytes(&count, sizeof count);
    require(count <= bytes_.size() / least);
    return is_fine_ ? static_cast<std::size_t>(count) : 0;
  }
  template <typename T>
  requires std::is_arithmetic_v<T>
  void get(T& value) { get_bytes(&value, sizeof value); }
  void get(bool& value) {
    std::uint8_t byte = 0;
    get_bytes(&byte, 1);
    require(byte <= 1);
    value = byte == 1;
  }
  /// An enumeration's class checks its value.
  template <typename T>
  requires std::is_enum_v<T>
  void get(T& value) { get_bytes(&value, sizeof value); }
  template <typename T>
  requires requires(T& value, StateReader& reader) { value.archive(reader); }
  void get(T& value) { value.archive(*this); }
  void get(FrameId& frame) { get(frame.value); }
  template <typename Scalar, int Rows, int Columns>
  void get(Eigen::Matrix<Scalar, Rows, Columns>& matrix) {
    get_bytes(matrix.data(), sizeof(Scalar) * static_cast<std::size_t>(matrix.size()));
  }
  void get(Eigen::Isometry3d& T) { get(T.matrix()); }
  void get(std::string& text) {
    text.resize(get_count());
    get_bytes(text.data(), text.size());
  }
  template <typename A, typename B>
  void get(std::pair<A, B>& both) {
    (*this)(both.first, both.second);
  }
  template <typename T>
  void get(std::optional<T>& value) {
    bool has_value = false;
    get(has_value);
    value.reset();
    if (has_value && is_fine_) get(value.emplace());
  }
  template <typename T, std::size_t N>
  void get(std::array<T, N>& values) {
    for (T& each : values) get(each);
  }
  template <typename T>
  void get(std::vector<T>& values) {
    if constexpr (std::is_arithmetic_v<T> && !std::same_as<T, bool>) {
      values.resize(get_count(sizeof(T)));
      get_bytes(values.data(), values.size() * sizeof(T));
    } else {
      get_each(values);
    }
  }
  template <typename T>
  void get(std::deque<T>& values) {
    get_each(values);
  }
  void get_each(auto& values) {
    values.clear();
    for (std::size_t count = get_count(); count > 0 && is_fine_; --count) get(values.emplace_back());
  }
  template <typename K, typename V>
  void get(std::map<K, V>& values) {
    values.clear();
    for (std::size_t count = get_count(); count > 0 && is_fine_; --count) {
      std::pair<K, V> entry;
      get(entry);
      values.insert_or_assign(values.end(), std::move(entry.first), std::move(entry.second));
    }
  }

  std::span<const std::byte> bytes_;
  bool is_fine_ = true;
};

}  // namespace revisit
