#include "recordings/bag_check.hpp"

#include <rosbag/constants.h>
#include <rosbag/stream.h>

#include <cstdint>
#include <cstring>
#include <fstream>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "frontier_surfels/types.hpp"

namespace frontier_surfels::replay {
namespace {

constexpr std::uint32_t kMaxHeader = 1 << 20;  // [byte]; real ones have some hundred
constexpr std::uint32_t kMaxChunk = 1 << 30;   // [byte]; rosbag's buffers double beyond 32 bits above twice this size

/// What is wrong, as a part of a sentence.
struct Damaged {
  std::string what;
};

template <typename Number>
Number number_at(const std::string& bytes, std::size_t at) {
  Number number;
  std::memcpy(&number, bytes.data() + at, sizeof(number));
  return number;
}

/// The fields of a record's header.
class Fields {
 public:
  explicit Fields(const std::string& header) {
    for (std::size_t at = 0; at < header.size();) {
      if (header.size() - at < 4) throw Damaged{"a field of a header is cut"};
      const auto length = number_at<std::uint32_t>(header, at);
      at += 4;
      if (length > header.size() - at) throw Damaged{"a field of a header is longer than the header"};
      const std::string field = header.substr(at, length);
      const std::size_t equals = field.find('=');
      if (equals == std::string::npos) throw Damaged{"a field of a header has no value"};
      values_[field.substr(0, equals)] = field.substr(equals + 1);
      at += length;
    }
  }

  template <typename Number>
  Number number(const std::string& name) const {
    const std::string value = text(name);
    if (value.size() != sizeof(Number)) throw Damaged{"the field '" + name + "' has a wrong size"};
    return number_at<Number>(value, 0);
  }

  std::string text(const std::string& name) const {
    const auto found = values_.find(name);
    if (found == values_.end()) throw Damaged{"the field '" + name + "' is missing"};
    return found->second;
  }

  int op() const { return number<std::uint8_t>("op"); }

 private:
  std::map<std::string, std::string> values_;
};

std::string decompress(const Fields& header, std::string data) {
  const auto size = header.number<std::uint32_t>("size");
  if (size > kMaxChunk) throw Damaged{"a chunk claims to have " + std::to_string(size) + " bytes"};
  const std::string compression = header.text("compression");
  if (compression == rosbag::COMPRESSION_NONE) {
    if (size != data.size()) throw Damaged{"the size of a chunk is wrong"};
    return data;
  }
  std::string bytes(size, '\0');
  auto* from = reinterpret_cast<std::uint8_t*>(data.data());
  auto* to = reinterpret_cast<std::uint8_t*>(bytes.data());
  const auto length = static_cast<unsigned int>(data.size());
  try {
    if (compression == rosbag::COMPRESSION_LZ4) rosbag::LZ4Stream(nullptr).decompress(to, size, from, length);
    if (compression == rosbag::COMPRESSION_BZ2) rosbag::BZ2Stream(nullptr).decompress(to, size, from, length);
  } catch (const ros::Exception& fault) {
    throw Damaged{fault.what()};
  }
  return bytes;
}

/// The offsets at which rosbag may look for a message in a chunk: those of messages, and of connections that a message follows.
std::set<std::uint32_t> message_offsets(const std::string& chunk) {
  std::vector<std::pair<std::uint32_t, int>> records;  // offset and op
  for (std::size_t at = 0; at < chunk.size();) {
    const auto start = static_cast<std::uint32_t>(at);
    std::string header;
    for (int part = 0; part < 2; ++part) {  // header and data
      if (chunk.size() - at < 4) throw Damaged{"a record of a chunk is cut"};
      const auto length = number_at<std::uint32_t>(chunk, at);
      at += 4;
      if (length > chunk.size() - at) throw Damaged{"a record of a chunk is longer than the chunk"};
      if (part == 0) header = chunk.substr(at, length);
      at += length;
    }
    records.emplace_back(start, Fields(header).op());
  }
  std::set<std::uint32_t> offsets;
  bool message_follows = false;
  for (auto record = records.rbegin(); record != records.rend(); ++record) {
    message_follows = record->second == rosbag::OP_MSG_DATA || (record->second == rosbag::OP_CONNECTION && message_follows);
    if (message_follows) offsets.insert(record->first);
  }
  return offsets;
}

class BagCheck {
 public:
  explicit BagCheck(const std::string& path) : file_(path, std::ios::binary) {
    file_.seekg(0, std::ios::end);
    size_ = static_cast<std::uint64_t>(file_.tellg());
    at_ = kFirstRecord;
    file_.seekg(kFirstRecord);
  }

  void run() {
    const Fields bag = read_header();
    if (bag.op() != rosbag::OP_FILE_HEADER) throw Damaged{"its first record is not a bag's"};
    const auto index_at = bag.number<std::uint64_t>(rosbag::INDEX_POS_FIELD_NAME);
    if (index_at == 0) return;  // was not closed, which rosbag says itself
    read_data();
    while (at_ < size_) read_record();
    check_ends(index_at, bag);
    for (const std::uint64_t chunk : wanted_chunks_)
      if (chunks_.count(chunk) == 0) throw Damaged{"its index names a chunk that is not there"};
  }

 private:
  static constexpr std::uint64_t kFirstRecord = 13;  // after the line "#ROSBAG V2.0"

  std::string read(std::uint64_t length) {
    if (length > size_ - at_) throw Damaged{"a record is longer than the file"};
    std::string bytes(length, '\0');
    file_.read(bytes.data(), static_cast<std::streamsize>(length));
    if (!file_) throw Damaged{"it cannot be read"};
    at_ += length;
    return bytes;
  }

  Fields read_header() {
    const auto length = number_at<std::uint32_t>(read(4), 0);
    if (length > kMaxHeader) throw Damaged{"the header of a record is too long"};
    return Fields(read(length));
  }

  std::string read_data() {
    const auto length = number_at<std::uint32_t>(read(4), 0);
    if (length > kMaxChunk) throw Damaged{"a record is too long"};
    return read(length);
  }

  void read_record() {
    const std::uint64_t start = at_;
    const Fields header = read_header();
    const std::string data = read_data();
    records_[start] = header.op();
    if (header.op() == rosbag::OP_CHUNK) {
      offsets_ = message_offsets(decompress(header, data));
      chunks_.insert(start);
    } else if (header.op() == rosbag::OP_INDEX_DATA) {
      check_index(header, data);
    } else if (header.op() == rosbag::OP_CHUNK_INFO) {
      wanted_chunks_.push_back(header.number<std::uint64_t>(rosbag::CHUNK_POS_FIELD_NAME));
    }
  }

  /// An index belongs to the chunk before it.
  void check_index(const Fields& header, const std::string& data) const {
    constexpr std::size_t kEntry = 12, kOffset = 8;  // [byte]: time and offset
    if (data.size() != kEntry * header.number<std::uint32_t>(rosbag::COUNT_FIELD_NAME)) throw Damaged{"the size of an index is wrong"};
    for (std::size_t at = kOffset; at < data.size(); at += kEntry)
      if (offsets_.count(number_at<std::uint32_t>(data, at)) == 0) throw Damaged{"an index names a message that is not there"};
  }

  /// At the end of a bag, its connections and the places of its chunks are listed.
  void check_ends(std::uint64_t index_at, const Fields& bag) const {
    auto record = records_.find(index_at);
    const auto skip = [&](const std::string& count_field, int op) {
      for (auto left = bag.number<std::uint32_t>(count_field); left > 0; --left, ++record)
        if (record == records_.end() || record->second != op) throw Damaged{"its index is incomplete"};
    };
    skip(rosbag::CONNECTION_COUNT_FIELD_NAME, rosbag::OP_CONNECTION);
    skip(rosbag::CHUNK_COUNT_FIELD_NAME, rosbag::OP_CHUNK_INFO);
  }

  std::ifstream file_;
  std::uint64_t size_ = 0, at_ = 0;           ///< [byte]
  std::map<std::uint64_t, int> records_;      ///< op by position
  std::set<std::uint64_t> chunks_;            ///< their positions
  std::vector<std::uint64_t> wanted_chunks_;  ///< by the bag's index
  std::set<std::uint32_t> offsets_;           ///< of messages in the last chunk
};

}  // namespace

void check_bag(const std::string& path) {
  const auto refuse = [&path](const std::string& what) {
    throw Error(path + " is damaged (" + what + "): repair it with `rosbag reindex`, or copy it again.");
  };
  try {
    BagCheck(path).run();
  } catch (const Damaged& damaged) {
    refuse(damaged.what);
  } catch (const std::bad_alloc&) {
    refuse("its sizes exceed this machine's memory");
  }
}

}  // namespace frontier_surfels::replay
