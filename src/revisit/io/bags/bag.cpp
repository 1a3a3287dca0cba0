// SPDX-License-Identifier: Apache-2.0
#include <revisit/io/internal/bag.hpp>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cstdlib>
#include <limits>
#include <set>

#include <unistd.h>

#include <revisit/io/internal/byte_cursor.hpp>
#include <revisit/io/internal/bytes.hpp>
#include <revisit/io/internal/decompress.hpp>

namespace revisit::io_internal {
namespace {

namespace fs = std::filesystem;

// "drive.db3.zstd" -> ".db3": what is in it.
std::string format_of(const fs::path& file) {
  std::string name = file.filename().string();
  std::transform(name.begin(), name.end(), name.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  if (name.ends_with(".zstd")) name.resize(name.size() - 5);
  if (name.ends_with(".active")) name.resize(name.size() - 7);  // rosbag was stopped hard
  const std::string extension = fs::path(name).extension().string();
  return extension == ".bag" || extension == ".mcap" || extension == ".db3" ? extension : "";
}

std::vector<fs::path> bags_in(const fs::path& folder) {
  std::vector<fs::path> files;
  std::error_code failure;
  for (fs::directory_iterator it(folder, failure), end; !failure && it != end; it.increment(failure))
    if (!format_of(it->path()).empty()) files.push_back(it->path());
  std::sort(files.begin(), files.end());
  return files;
}

// The files that metadata.yaml names, in its order; empty where it names none.
std::vector<fs::path> files_in_metadata(const fs::path& folder) {
  std::vector<fs::path> files;
  const auto text = read_bytes(folder / "metadata.yaml");
  if (!text) return files;
  bool is_list = false;
  for (const std::string_view line : split_lines(*text)) {
    const std::vector<std::string_view> words = split_words(line);
    if (words.size() == 2 && words[0] == "-" && is_list) {
      std::string name(words[1]);
      std::erase_if(name, [](char c) { return c == '"' || c == '\''; });
      files.push_back(folder / name);
    } else {
      is_list = words.size() == 1 && words[0] == "relative_file_paths:";
    }
  }
  return files;
}

// The number at the end of "drive_12.mcap", and the name with every digit masked.
struct SplitName {
  std::string mask;
  std::int64_t number = -1;
};
SplitName split_name(const fs::path& file) {
  const std::string name = file.filename().string();
  const std::string stem = name.substr(0, name.find('.'));
  SplitName result{stem};
  for (char& c : result.mask)
    if (std::isdigit(static_cast<unsigned char>(c)) != 0) c = '0';
  const auto underscore = stem.rfind('_');
  if (underscore != std::string::npos)
    std::from_chars(stem.data() + underscore + 1, stem.data() + stem.size(), result.number);
  result.mask.resize(std::min(result.mask.size(), underscore));
  return result;
}

// Parts of one recording: alike but for the numbers at their ends, which follow each other.
bool are_one_recording(const std::vector<fs::path>& files) {
  std::set<std::int64_t> numbers;
  for (const fs::path& file : files) {
    const SplitName name = split_name(file);
    if (name.mask != split_name(files.front()).mask || format_of(file) != format_of(files.front())) return false;
    numbers.insert(name.number);
  }
  return *numbers.begin() >= 0 && numbers.size() == files.size() &&
         *numbers.rbegin() - *numbers.begin() + 1 == static_cast<std::int64_t>(files.size());
}

Result<std::vector<fs::path>> files_of(const fs::path& path, const LogSink& log) {
  std::error_code failure;
  if (!fs::is_directory(path, failure)) return std::vector{path};
  std::vector<fs::path> named = files_in_metadata(path);
  const std::size_t declared = named.size();
  std::erase_if(named, [&](const fs::path& file) { return !fs::exists(file, failure) || format_of(file).empty(); });
  if (named.size() < declared)
    log_to(log, LogLevel::kWarning,
           (path / "metadata.yaml").string() + ": " + std::to_string(declared - named.size()) + " of " +
               std::to_string(declared) + " files that it names are not there");
  if (!named.empty()) return named;
  const std::vector<fs::path> found = bags_in(path);
  if (found.size() > 1 && !are_one_recording(found))
    return Error{path.string() + ": holds " + std::to_string(found.size()) +
                 " bags that are not parts of one recording; name one of them, e.g. " + found.front().string()};
  return found;
}

}  // namespace

bool Bag::is_bag(const fs::path& path) {
  std::error_code failure;
  if (fs::is_directory(path, failure)) return !bags_in(path).empty();
  return !format_of(path).empty();
}

Result<std::unique_ptr<Bag>> Bag::open(const fs::path& path, const LogSink& log) {
  const auto files = files_of(path, log);
  if (!files) return files.error();
  auto bag = std::make_unique<Bag>();
  bag->path_ = path;
  for (const fs::path& file : *files)
    if (const Status status = bag->add(file, log); !status) return status.error();
  bag->finish();
  return bag;
}

Bag::~Bag() {
  files_.clear();
  std::error_code failure;
  for (const fs::path& file : temporary_) fs::remove(file, failure);
}

Status Bag::add(const fs::path& file, const LogSink& log) {
  fs::path plain = file;
  if (file.extension() == ".zstd") {
    const auto packed = RandomAccessFile::open(file);
    if (!packed) return packed.error();
    std::error_code failure;
    std::string name = (fs::temp_directory_path(failure) / "revisit-XXXXXX").string() + format_of(file);
    const int descriptor = ::mkstemps(name.data(), static_cast<int>(format_of(file).size()));
    if (descriptor < 0) return Error{name + ": cannot be made: " + system_reason()};
    ::close(descriptor);
    plain = name;
    temporary_.push_back(plain);
    log_to(log, LogLevel::kInfo, file.string() + ": is decompressed to " + plain.string() + " first");
    if (const Status status = decompress_zstd_file(*packed, plain); !status) return status;
  }
  format_ = format_of(file);
  auto opened = format_ == ".bag"    ? open_ros1_bag(plain, log)
                : format_ == ".mcap" ? open_mcap(plain, log)
                                     : open_db3(plain, log);
  if (!opened) return opened.error();
  files_.push_back({*std::move(opened), {}});
  return ok();
}

void Bag::finish() {
  std::stable_sort(files_.begin(), files_.end(),
                   [](const File& a, const File& b) { return a.bag->first_ns() < b.bag->first_ns(); });
  first_ns_ = std::numeric_limits<std::int64_t>::max();
  last_ns_ = std::numeric_limits<std::int64_t>::min();
  for (File& file : files_) {
    std::uint64_t messages = 0;
    for (std::size_t i = 0; i < file.bag->topics().size(); ++i) {
      const BagTopic& topic = file.bag->topics()[i];
      const std::string type = short_type(topic.type);
      // One file may hold two of the same name and type: they stay apart.
      const auto is_taken = [&](std::size_t number) {
        return number < file.topic_here.size() && file.topic_here[number].has_value();
      };
      const auto found = std::find_if(topics_.begin(), topics_.end(), [&](const BagTopic& other) {
        if (is_taken(static_cast<std::size_t>(&other - topics_.data()))) return false;
        return other.name == topic.name && other.type == type && other.encoding == topic.encoding;
      });
      const auto number = static_cast<std::size_t>(found - topics_.begin());
      if (found == topics_.end()) topics_.push_back({topic.name, type, topic.encoding, topic.definition, 0});
      file.topic_here.resize(std::max(file.topic_here.size(), topics_.size()));
      file.topic_here[number] = i;
      topics_[number].messages += topic.messages;
      messages += topic.messages;
    }
    if (messages == 0) continue;
    first_ns_ = std::min(first_ns_, file.bag->first_ns());
    last_ns_ = std::max(last_ns_, file.bag->last_ns());
  }
  if (first_ns_ > last_ns_) first_ns_ = last_ns_ = 0;
  for (File& file : files_) file.topic_here.resize(topics_.size());
  for (const BagTopic& topic : topics_) {
    const std::string known = known_definition(topic.type, topic.encoding == "ros1");
    const bool is_read = (topic.encoding == "ros1" || topic.encoding == "cdr") && !known.empty();
    auto definition = is_read
                          ? MessageDefinition::parse(topic.type, topic.definition.empty() ? known : topic.definition)
                          : Result<MessageDefinition>(Error{});
    definitions_.push_back(definition ? std::optional(*std::move(definition)) : std::nullopt);
  }
}

std::string Bag::kind() const {
  const std::string name = format_ == ".bag" ? "ROS 1 bag" : format_ == ".mcap" ? "bag (.mcap)" : "ROS 2 bag (.db3)";
  return name + (files_.size() > 1 ? " in " + std::to_string(files_.size()) + " files" : "");
}

std::string Bag::name_of(std::size_t topic, std::uint64_t index) const {
  return path_.string() + ": message " + std::to_string(index) + " of " + topics_[topic].name;
}

Result<BagMessage> Bag::read(std::size_t topic, std::uint64_t index) const {
  std::uint64_t left = index;
  for (const File& file : files_) {
    const auto here = file.topic_here[topic];
    if (!here) continue;
    const std::uint64_t messages = file.bag->topics()[*here].messages;
    if (left >= messages) {
      left -= messages;
      continue;
    }
    auto message = file.bag->read(*here, left);
    return message ? unpacked(topic, *std::move(message)) : message;
  }
  throw std::out_of_range(name_of(topic, index));
}

// ROS 2 may compress each message by itself; one of CDR never begins like that.
Result<BagMessage> Bag::unpacked(std::size_t topic, BagMessage message) const {
  constexpr std::uint32_t kZstdMagic = 0xFD2FB528;
  const ByteSpan bytes = message.data.bytes;
  if (topics_[topic].encoding != "cdr" || bytes.size() < sizeof kZstdMagic ||
      load_number<std::uint32_t>(bytes.data()) != kZstdMagic)
    return message;
  auto plain = decompress_zstd(message.data);
  if (!plain) return Error{path_.string() + ": a message of " + topics_[topic].name + ": " + plain.error().message};
  message.data = *std::move(plain);
  return message;
}

Status Bag::visit(std::size_t topic, std::int64_t from_ns, std::int64_t to_ns,
                  const std::function<bool(const BagMessage&)>& use) const {
  Status problem = ok();
  bool goes_on = true;
  for (const File& file : files_) {
    const auto here = file.topic_here.at(topic);
    if (!here || !goes_on) continue;
    const Status status = file.bag->visit(*here, from_ns, to_ns, [&](const BagMessage& packed) {
      const auto message = unpacked(topic, packed);
      if (!message) problem = message.error();
      return goes_on = message && use(*message);
    });
    if (!status) return status;
  }
  return problem;
}

Result<MessageValues> Bag::decode(std::size_t topic, const BagMessage& message) const {
  const BagTopic& facts = topics_.at(topic);
  if (!definitions_[topic]) {
    std::string known;
    for (const std::string& type : known_types()) known += (known.empty() ? "" : ", ") + type;
    return Error{path_.string() + ": " + facts.name + " holds " + facts.type + " (" + facts.encoding +
                 "); types that are read: " + known};
  }
  auto values = MessageValues::decode(
      *definitions_[topic], facts.encoding == "ros1" ? Serialisation::kRos1 : Serialisation::kCdr, message.data.bytes);
  if (!values) return Error{path_.string() + ": " + facts.name + ": " + values.error().message};
  return values;
}

}  // namespace revisit::io_internal
