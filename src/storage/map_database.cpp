#include "storage/map_database.hpp"

#include <fcntl.h>
#include <sqlite3.h>
#include <sys/file.h>
#include <unistd.h>
#include <zlib.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <mutex>

#include "frontier_surfels/types.hpp"
#include "storage/sqlite.hpp"

namespace frontier_surfels {
namespace {

constexpr std::int64_t kApplication = 0x46537266;  ///< tells our databases from other programs'
constexpr std::int64_t kVersion = 1;               ///< of the tables below

constexpr char kTables[] =
    "CREATE TABLE meta (version INTEGER NOT NULL, block_size REAL NOT NULL);"
    "CREATE TABLE blocks (x INTEGER NOT NULL, y INTEGER NOT NULL, z INTEGER NOT NULL,"
    " crc INTEGER NOT NULL, bytes BLOB NOT NULL, PRIMARY KEY (x, y, z))";
constexpr char kPut[] =
    "INSERT INTO blocks (x, y, z, crc, bytes) VALUES (?, ?, ?, ?, ?)"
    " ON CONFLICT (x, y, z) DO UPDATE SET crc = excluded.crc, bytes = excluded.bytes";

/// WAL: readers do not wait for a transaction, and the disk is waited for once in some megabytes. A killed process loses nothing then;
/// after a power cut the last transactions may be missing.
constexpr char kPragmas[] = "PRAGMA journal_mode = WAL; PRAGMA synchronous = NORMAL";

std::string named(const std::string& folder) { return "The map folder " + folder; }

/// What is wrong, and what to do about it.
FileError explained(const std::string& folder, const SqliteError& error) {
  const std::string said = std::string(" (") + error.what() + "): ";
  switch (error.code) {
    case SQLITE_FULL:
      return FileError(named(folder) + " cannot be written" + said + "free some space on its disk.");
    case SQLITE_NOTADB:
    case SQLITE_CORRUPT:
      return FileError(named(folder) + " is damaged, or its map.sqlite is no map" + said + "use a copy of it, or give another folder.");
    case SQLITE_CANTOPEN:
    case SQLITE_PERM:
    case SQLITE_READONLY:
      return FileError(named(folder) + " cannot be opened for writing" + said + "check who may write there, or give another folder.");
    case SQLITE_BUSY:
      return FileError(named(folder) + " is in use by another program" + said + "close that one.");
    default:
      return FileError(named(folder) + " cannot be used" + said + "check its disk, or give another folder.");
  }
}

/// The first number of the first row.
std::int64_t number(const Database& database, const char* sql) {
  Statement statement(database, sql);
  if (!statement.step()) throw SqliteError(SQLITE_CORRUPT, "an empty table");
  return statement.number(0);
}

void create_tables(Database& database, double block_size) {
  Transaction transaction(database);
  database.run(("PRAGMA application_id = " + std::to_string(kApplication)).c_str());
  database.run(kTables);
  Statement(database, "INSERT INTO meta (version, block_size) VALUES (?, ?)").bind(kVersion, block_size).step();
  transaction.commit();
}

std::string in_metres(double length) {
  char text[40];
  std::snprintf(text, sizeof text, "%.9g m", length);
  return text;
}

void check_tables(const Database& database, const std::string& folder, double block_size) {
  if (number(database, "PRAGMA application_id") != kApplication) {
    throw FileError(named(folder) + " has a map.sqlite of another program: give another folder.");
  }
  const std::int64_t version = number(database, "SELECT version FROM meta");
  if (version != kVersion) {
    throw FileError(named(folder) + " was written by a newer version (format " + std::to_string(version) + ", not " +
                    std::to_string(kVersion) + "): update this one, or give another folder.");
  }
  Statement made_with(database, "SELECT block_size FROM meta");
  if (made_with.step() && made_with.real(0) != block_size) {
    throw FileError(named(folder) + " has blocks of " + in_metres(made_with.real(0)) + ", not of " + in_metres(block_size) +
                    ": set that block size again, or give another folder.");
  }
}

/// Nothing is changed in a file that is not ours.
Database open_map(const std::string& folder, const std::string& file, double block_size) {
  Database database(file);
  if (number(database, "SELECT count(*) FROM sqlite_master") == 0 && number(database, "PRAGMA application_id") == 0) {
    create_tables(database, block_size);
  } else {
    check_tables(database, folder, block_size);
  }
  database.run(kPragmas);
  return database;
}

/// Of the bytes and of where they belong.
std::int64_t checksum(BlockKey key, const std::vector<std::uint8_t>& bytes) {
  const std::uint32_t place[] = {static_cast<std::uint32_t>(key.x), static_cast<std::uint32_t>(key.y), static_cast<std::uint32_t>(key.z)};
  uLong crc = crc32(0, nullptr, 0);
  for (const std::uint32_t number : place) {
    const Bytef little_endian[] = {static_cast<Bytef>(number), static_cast<Bytef>(number >> 8), static_cast<Bytef>(number >> 16),
                                   static_cast<Bytef>(number >> 24)};
    crc = crc32_z(crc, little_endian, sizeof little_endian);
  }
  return static_cast<std::int64_t>(crc32_z(crc, bytes.data(), bytes.size()));
}

}  // namespace

/// Held until the process ends, however it ends: the kernel lets it go. A file of its own, as SQLite locks and unlocks parts of its.
class MapDatabase::Lock {
 public:
  /// Makes the folder if it is missing.
  explicit Lock(const std::string& folder) {
    std::error_code error;
    std::filesystem::create_directories(folder, error);
    if (error) throw FileError(named(folder) + " cannot be made: " + error.message() + "; give another folder.");
    const std::string file = (std::filesystem::path(folder) / "map.lock").string();
    descriptor_ = open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
    if (descriptor_ < 0) {
      throw FileError(named(folder) + " cannot be written: " + std::strerror(errno) +
                      "; check who may write there, or give another folder.");
    }
    if (flock(descriptor_, LOCK_EX | LOCK_NB) == 0) return;
    const int reason = errno;
    close(descriptor_);
    if (reason == EWOULDBLOCK) {
      throw FileError(named(folder) + " is in use by another running mapper: stop that one, or give another folder.");
    }
    throw FileError(named(folder) + " cannot be locked: " + std::strerror(reason) + "; give a folder on a disk of this machine.");
  }
  ~Lock() { close(descriptor_); }
  Lock(const Lock&) = delete;
  Lock& operator=(const Lock&) = delete;

 private:
  int descriptor_;
};

struct MapDatabase::Connections {
  Connections(const std::string& folder, const std::string& file, double block_size)
      : writer(open_map(folder, file, block_size)),
        reader(file),
        put(writer, kPut),
        erase(writer, "DELETE FROM blocks WHERE x = ? AND y = ? AND z = ?"),
        get(reader, "SELECT crc, bytes FROM blocks WHERE x = ? AND y = ? AND z = ?") {}

  Database writer, reader;  // two: reading does not wait for the disk that a transaction is written to
  Statement put, erase, get;
  std::mutex reading;  // guards reader and get
};

MapDatabase::MapDatabase(const std::string& folder, double block_size) : folder_(folder), lock_(std::make_unique<Lock>(folder)) {
  try {
    const auto file = std::filesystem::absolute(folder) / "map.sqlite";
    connections_ = std::make_unique<Connections>(folder, file.string(), block_size);
  } catch (const SqliteError& error) {
    throw explained(folder, error);
  }
}

MapDatabase::~MapDatabase() = default;

void MapDatabase::for_each_block(const std::function<void(BlockKey, std::size_t)>& visit) const {
  const std::lock_guard<std::mutex> lock(connections_->reading);
  try {
    Statement all(connections_->reader, "SELECT x, y, z, length(bytes) FROM blocks");
    while (all.step()) {
      const auto coordinate = [&](int column) { return static_cast<std::int32_t>(all.number(column)); };
      visit({coordinate(0), coordinate(1), coordinate(2)}, static_cast<std::size_t>(all.number(3)));
    }
  } catch (const SqliteError& error) {
    throw explained(folder_, error);
  }
}

void MapDatabase::write(const std::vector<StoredBlock>& blocks, bool clear) {
  try {
    Transaction transaction(connections_->writer);
    if (clear) connections_->writer.run("DELETE FROM blocks");
    for (const auto& [key, bytes] : blocks) {
      if (bytes.empty()) {
        connections_->erase.bind(key.x, key.y, key.z).step();
      } else {
        connections_->put.bind(key.x, key.y, key.z, checksum(key, bytes), bytes).step();
      }
    }
    transaction.commit();
  } catch (const SqliteError& error) {
    throw explained(folder_, error);
  }
}

std::vector<std::uint8_t> MapDatabase::read(BlockKey key) const {
  const std::lock_guard<std::mutex> lock(connections_->reading);
  std::string reason = "it is missing";
  try {
    Statement& get = connections_->get;
    if (get.bind(key.x, key.y, key.z).step()) {
      std::vector<std::uint8_t> bytes = get.bytes(1);
      const bool sound = get.number(0) == checksum(key, bytes);
      get.reset();
      if (sound) return bytes;
      reason = "its checksum does not fit";
    }
  } catch (const SqliteError& error) {
    reason = error.what();
  }
  throw FileError("Block (" + std::to_string(key.x) + ", " + std::to_string(key.y) + ", " + std::to_string(key.z) + ") of the map folder " +
                  folder_ + " cannot be read (" + reason + "): use a copy of the folder, or reset the map.");
}

}  // namespace frontier_surfels
