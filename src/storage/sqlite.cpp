#include "storage/sqlite.hpp"

#include <sqlite3.h>

namespace frontier_surfels {
namespace {

constexpr int kBusyTimeout = 5000;  // [ms]: somebody may look into the file with SQLite's own shell

void check(int code, sqlite3* handle) {
  if (code != SQLITE_OK) throw SqliteError(code & 0xff, handle != nullptr ? sqlite3_errmsg(handle) : sqlite3_errstr(code));
}

}  // namespace

Database::Database(const std::string& file) {
  sqlite3* handle = nullptr;
  const int code = sqlite3_open_v2(file.c_str(), &handle, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE | SQLITE_OPEN_NOMUTEX, nullptr);
  handle_.reset(handle);  // also after an error
  check(code, handle);
  // SQLite makes do with reading where writing is forbidden.
  if (sqlite3_db_readonly(handle, "main") != 0) throw SqliteError(SQLITE_READONLY, sqlite3_errstr(SQLITE_READONLY));
  check(sqlite3_busy_timeout(handle, kBusyTimeout), handle);
}

void Database::Close::operator()(sqlite3* handle) const { sqlite3_close(handle); }

void Database::run(const char* sql) { check(sqlite3_exec(get(), sql, nullptr, nullptr, nullptr), get()); }

Statement::Statement(const Database& database, const char* sql) {
  sqlite3_stmt* handle = nullptr;
  check(sqlite3_prepare_v2(database.get(), sql, -1, &handle, nullptr), database.get());
  handle_.reset(handle);
}

void Statement::Finalize::operator()(sqlite3_stmt* handle) const { sqlite3_finalize(handle); }

bool Statement::step() {
  const int code = sqlite3_step(handle_.get());
  if (code == SQLITE_ROW) return true;
  check(sqlite3_reset(handle_.get()), sqlite3_db_handle(handle_.get()));  // gives step's error once more
  return false;
}

void Statement::reset() { sqlite3_reset(handle_.get()); }

std::int64_t Statement::number(int column) const { return sqlite3_column_int64(handle_.get(), column); }

double Statement::real(int column) const { return sqlite3_column_double(handle_.get(), column); }

std::vector<std::uint8_t> Statement::bytes(int column) const {
  const auto* data = static_cast<const std::uint8_t*>(sqlite3_column_blob(handle_.get(), column));
  return data == nullptr ? std::vector<std::uint8_t>()
                         : std::vector<std::uint8_t>(data, data + sqlite3_column_bytes(handle_.get(), column));
}

void Statement::bind_one(int n, std::int64_t value) {
  check(sqlite3_bind_int64(handle_.get(), n, value), sqlite3_db_handle(handle_.get()));
}

void Statement::bind_one(int n, double value) { check(sqlite3_bind_double(handle_.get(), n, value), sqlite3_db_handle(handle_.get())); }

void Statement::bind_one(int n, const std::vector<std::uint8_t>& value) {
  check(sqlite3_bind_blob64(handle_.get(), n, value.data(), value.size(), SQLITE_STATIC), sqlite3_db_handle(handle_.get()));
}

Transaction::Transaction(Database& database) : database_(database) { database_.run("BEGIN IMMEDIATE"); }

Transaction::~Transaction() {
  // A failed statement may have rolled back already.
  if (sqlite3_get_autocommit(database_.get()) == 0) sqlite3_exec(database_.get(), "ROLLBACK", nullptr, nullptr, nullptr);
}

}  // namespace frontier_surfels
