// SPDX-License-Identifier: Apache-2.0
#include <revisit/descriptors/baseline_plugin.hpp>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <string_view>
#include <system_error>

#include <dlfcn.h>

#include <revisit/descriptors/baseline_plugin.h>

namespace revisit {
namespace {

constexpr std::size_t kFirstRoom = 4096, kMostWords = std::size_t{1} << 24;  // 128 MB a place: more is a mistake
constexpr std::uint32_t kMostScans = 1000;

class PluginBaseline final : public Baseline {
 public:
  explicit PluginBaseline(const revisit_method_v1& method) : method_(method) {}

  std::string name() const override { return method_.name; }
  std::string source() const override { return method_.source == nullptr ? "" : method_.source; }
  Gives gives() const override { return static_cast<Gives>(method_.gives); }
  std::size_t scans() const override { return method_.scans; }
  std::size_t place_every() const override { return method_.place_every; }

  Signature describe(std::span<const Point> points, double ground_z_m) const override {
    std::vector<float> flat;
    flat.reserve(4 * points.size());
    for (const Point& p : points) flat.insert(flat.end(), {p.x, p.y, p.z, p.intensity});
    Signature signature;
    signature.bits.resize(kFirstRoom);
    const auto describe_into = [&] {
      return method_.describe(flat.data(), points.size(), ground_z_m, signature.bits.data(), signature.bits.size());
    };
    std::size_t words = describe_into();
    if (words > signature.bits.size() && words <= kMostWords) {
      signature.bits.resize(words);
      words = describe_into();
    }
    signature.bits.resize(words <= signature.bits.size() ? words : 0);  // none where it does not keep its word
    signature.bits.shrink_to_fit();
    return signature;
  }

  double similarity(const Signature& query, const Signature& place) const override {
    const double alike = method_.similarity(of(query), of(place), nullptr);
    return std::isnan(alike) ? least_similarity() : alike;
  }

  Pose T_place_query(const Signature& query, const Signature& place) const override {
    Eigen::Matrix<double, 4, 4, Eigen::RowMajor> T = Eigen::Matrix4d::Identity();
    method_.similarity(of(query), of(place), T.data());
    Pose pose(Eigen::Matrix4d{T});
    return T.allFinite() ? normalised(pose) : Pose::Identity();
  }

 private:
  static revisit_signature of(const Signature& signature) { return {signature.bits.data(), signature.bits.size()}; }

  const revisit_method_v1& method_;
};

Status check(const std::string& file, const revisit_method_v1* method) {
  if (method == nullptr) return Error{file + ": revisit_method() returns null"};
  if (method->version != REVISIT_METHOD_VERSION)
    return Error{file + ": version " + std::to_string(method->version) + " of the interface; this program knows " +
                 std::to_string(REVISIT_METHOD_VERSION)};
  const std::string_view name = method->name == nullptr ? "" : method->name;
  const auto is_alphanumeric = [](unsigned char c) { return std::isalnum(c) != 0; };
  // A folder is called so: neither . nor .. may be one.
  if (name.empty() || !is_alphanumeric(static_cast<unsigned char>(name.front())) ||
      !std::all_of(name.begin(), name.end(),
                   [&](unsigned char c) { return is_alphanumeric(c) || c == '-' || c == '+' || c == '.'; }))
    return Error{file + ": its name is '" + std::string(name) +
                 "'; allowed: letters, digits, - + ., a letter or digit first"};
  if (method->describe == nullptr || method->similarity == nullptr)
    return Error{file + ": describe or similarity is null"};
  const auto within = [&](const char* what, std::uint32_t value, std::uint32_t least, std::uint32_t most) -> Status {
    if (value >= least && value <= most) return ok();
    return Error{file + ": " + what + " is " + std::to_string(value) + "; allowed: " + std::to_string(least) + " to " +
                 std::to_string(most)};
  };
  if (const Status status = within("gives", method->gives, 0, REVISIT_GIVES_POSE); !status) return status;
  if (const Status status = within("scans", method->scans, 1, kMostScans); !status) return status;
  return within("place_every", method->place_every, 1, kMostScans);
}

}  // namespace

Result<std::unique_ptr<Baseline>> load_baseline(const std::filesystem::path& library) {
  const std::string file = library.string();
  std::error_code unreadable;
  const auto absolute = std::filesystem::absolute(library, unreadable);  // a bare name would be searched elsewhere
  void* const handle = unreadable ? nullptr : dlopen(absolute.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (handle == nullptr) {
    const char* const why = unreadable ? nullptr : dlerror();
    return Error{file + ": is no shared library that can be loaded: " + (why == nullptr ? "no such path" : why)};
  }
  using Entry = const revisit_method_v1* (*)();
  const auto entry = reinterpret_cast<Entry>(dlsym(handle, "revisit_method"));
  const revisit_method_v1* const method = entry == nullptr ? nullptr : entry();
  const Status status = entry == nullptr ? Status(Error{file + ": exports no revisit_method() (baseline_plugin.h)"})
                                         : check(file, method);
  if (status) return std::unique_ptr<Baseline>(std::make_unique<PluginBaseline>(*method));
  dlclose(handle);
  return status.error();
}

}  // namespace revisit
