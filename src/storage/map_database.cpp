#include "storage/map_database.hpp"

#include <SQLiteCpp/SQLiteCpp.h>
#include <SQLiteCpp/VariadicBind.h>
#include <fcntl.h>
#include <sqlite3.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <mutex>

#include "config/config_text.hpp"
#include "frontier_surfels/types.hpp"
#include "storage/stored_block.hpp"

namespace frontier_surfels {
namespace {

constexpr std::int64_t kApplication = 0x46537266;  ///< tells our databases from other programs'
constexpr std::int64_t kVersion = 2;               ///< of the tables below, and of the bytes of a block

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

constexpr int kFlags = SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE | SQLITE_OPEN_NOMUTEX;
constexpr int kBusyTimeout = 5000;  // [ms]: somebody may look into the file with SQLite's own shell

std::string named(const std::string& folder) { return "The map folder " + folder; }

/// What is wrong, and what to do about it.
FileError explained(const std::string& folder, const SQLite::Exception& error) {
  const std::string said = std::string(" (") + error.what() + "): ";
  switch (error.getErrorCode()) {
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
std::int64_t number(const SQLite::Database& database, const char* sql) {
  SQLite::Statement statement(database, sql);
  if (!statement.executeStep()) throw SQLite::Exception("an empty table", SQLITE_CORRUPT);
  return statement.getColumn(0);
}

void create_tables(SQLite::Database& database, double block_size) {
  SQLite::Transaction transaction(database, SQLite::TransactionBehavior::IMMEDIATE);
  database.exec("PRAGMA application_id = " + std::to_string(kApplication));
  database.exec(kTables);
  SQLite::Statement insert(database, "INSERT INTO meta (version, block_size) VALUES (?, ?)");
  SQLite::bind(insert, kVersion, block_size);
  insert.exec();
  transaction.commit();
}

std::string in_metres(double length) { return to_text(length) + " m"; }

void check_tables(const SQLite::Database& database, const std::string& folder, double block_size) {
  if (number(database, "PRAGMA application_id") != kApplication) {
    throw FileError(named(folder) + " has a map.sqlite of another program: give another folder.");
  }
  const std::int64_t version = number(database, "SELECT version FROM meta");
  if (version < kVersion) {
    throw FileError(named(folder) + " was written by an older version, which did not store what has been seen (format " +
                    std::to_string(version) + "): save its map as a file with that version, and load the file with this one.");
  }
  if (version != kVersion) {
    throw FileError(named(folder) + " was written by a newer version (format " + std::to_string(version) + ", not " +
                    std::to_string(kVersion) + "): update this one, or give another folder.");
  }
  SQLite::Statement made_with(database, "SELECT block_size FROM meta");
  if (made_with.executeStep() && made_with.getColumn(0).getDouble() != block_size) {
    throw FileError(named(folder) + " has blocks of " + in_metres(made_with.getColumn(0)) + ", not of " + in_metres(block_size) +
                    ": set that block size again, or give another folder.");
  }
}

/// Nothing is changed in a file that is not ours.
SQLite::Database open_map(const std::string& folder, const std::string& file, double block_size) {
  SQLite::Database database(file, kFlags, kBusyTimeout);
  // SQLite makes do with reading where writing is forbidden.
  if (sqlite3_db_readonly(database.getHandle(), "main") != 0) throw SQLite::Exception(sqlite3_errstr(SQLITE_READONLY), SQLITE_READONLY);
  if (number(database, "SELECT count(*) FROM sqlite_master") == 0 && number(database, "PRAGMA application_id") == 0) {
    create_tables(database, block_size);
  } else {
    check_tables(database, folder, block_size);
  }
  database.exec(kPragmas);
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

/// Makes a statement about one block ready for another one.
SQLite::Statement& restart(SQLite::Statement& statement, BlockKey key) {
  statement.tryReset();  // whatever became of it the last time
  SQLite::bind(statement, key.x, key.y, key.z);
  return statement;
}

/// Numbers of the disk and of the file on it; zeros if there is no file.
std::pair<std::uint64_t, std::uint64_t> place_of(const std::string& file) {
  struct stat found = {};
  if (stat(file.c_str(), &found) != 0) return {0, 0};
  return {found.st_dev, found.st_ino};
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
        reader(file, kFlags, kBusyTimeout),
        put(writer, kPut),
        erase(writer, "DELETE FROM blocks WHERE x = ? AND y = ? AND z = ?"),
        get(reader, "SELECT crc, bytes FROM blocks WHERE x = ? AND y = ? AND z = ?") {}

  SQLite::Database writer, reader;  // two: reading does not wait for the disk that a transaction is written to
  SQLite::Statement put, erase, get;
  std::mutex reading;  // guards reader and get
};

MapDatabase::MapDatabase(const std::string& folder, double block_size) : folder_(folder), lock_(std::make_unique<Lock>(folder)) {
  file_ = (std::filesystem::absolute(folder) / "map.sqlite").string();
  try {
    connections_ = std::make_unique<Connections>(folder, file_, block_size);
    place_ = place_of(file_);
  } catch (const SQLite::Exception& error) {
    throw explained(folder, error);
  }
}

MapDatabase::~MapDatabase() = default;

/// SQLite would not notice, and would write into files that nobody finds any more.
void MapDatabase::check_place() const {
  if (place_of(file_) == place_) return;
  throw FileError(named(folder_) +
                  " has been deleted, moved or replaced while it was in use: put it back, or save the map as a file and start again with "
                  "another folder.");
}

void MapDatabase::for_each_block(const std::function<void(BlockKey, std::size_t, std::size_t)>& visit) const {
  const std::lock_guard<std::mutex> lock(connections_->reading);
  try {
    SQLite::Statement all(connections_->reader, "SELECT x, y, z, length(bytes), substr(bytes, 1, 8) FROM blocks");
    static_assert(kStoredHead == 8);
    while (all.executeStep()) {
      const BlockKey key = {all.getColumn(0).getInt(), all.getColumn(1).getInt(), all.getColumn(2).getInt()};
      const SQLite::Column head = all.getColumn(4);
      const std::size_t surfels = surfels_of(static_cast<const std::uint8_t*>(head.getBlob()), static_cast<std::size_t>(head.getBytes()));
      visit(key, static_cast<std::size_t>(all.getColumn(3).getInt64()), surfels);
    }
  } catch (const SQLite::Exception& error) {
    throw explained(folder_, error);
  }
}

void MapDatabase::write(const std::vector<StoredBlock>& blocks, bool clear) {
  check_place();
  try {
    SQLite::Transaction transaction(connections_->writer, SQLite::TransactionBehavior::IMMEDIATE);
    if (clear) connections_->writer.exec("DELETE FROM blocks");
    for (const auto& [key, bytes] : blocks) {
      SQLite::Statement& statement = restart(bytes.empty() ? connections_->erase : connections_->put, key);
      if (!bytes.empty()) {
        statement.bind(4, checksum(key, bytes));
        statement.bindNoCopy(5, bytes.data(), static_cast<int>(bytes.size()));
      }
      statement.exec();
    }
    transaction.commit();
  } catch (const SQLite::Exception& error) {
    throw explained(folder_, error);
  }
}

std::vector<std::uint8_t> MapDatabase::read(BlockKey key) const {
  const std::lock_guard<std::mutex> lock(connections_->reading);
  std::string reason = "it is missing";
  try {
    SQLite::Statement& get = restart(connections_->get, key);
    if (get.executeStep()) {
      const SQLite::Column column = get.getColumn(1);
      const auto* data = static_cast<const std::uint8_t*>(column.getBlob());
      const std::vector<std::uint8_t> bytes(data, data + column.getBytes());
      const bool sound = get.getColumn(0).getInt64() == checksum(key, bytes);
      get.tryReset();  // lets its lock go
      if (sound) return bytes;
      reason = "its checksum does not fit";
    }
  } catch (const SQLite::Exception& error) {
    reason = error.what();
  }
  throw FileError("Block (" + std::to_string(key.x) + ", " + std::to_string(key.y) + ", " + std::to_string(key.z) + ") of the map folder " +
                  folder_ + " cannot be read (" + reason + "): use a copy of the folder, or reset the map.");
}

}  // namespace frontier_surfels
