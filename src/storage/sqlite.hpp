/// SQLite's handles as objects that close themselves, and its error codes as exceptions.
#pragma once

#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

struct sqlite3;
struct sqlite3_stmt;

namespace frontier_surfels {

/// What SQLite says, in its words: whoever calls knows the file, and makes a sentence of it.
struct SqliteError : std::runtime_error {
  SqliteError(int code, const std::string& text) : std::runtime_error(text), code(code) {}
  int code;  ///< primary result code, SQLITE_FULL for instance
};

/// One connection. Not for two threads at once.
class Database {
 public:
  /// @param file  an absolute path, as "file:..." would be a URI; made if missing
  explicit Database(const std::string& file);

  /// Runs statements whose rows nobody wants.
  void run(const char* sql);

  sqlite3* get() const { return handle_.get(); }

 private:
  struct Close {
    void operator()(sqlite3* handle) const;
  };
  std::unique_ptr<sqlite3, Close> handle_;
};

/// One prepared statement, to be used again and again.
class Statement {
 public:
  Statement(const Database& database, const char* sql);

  /// Starts anew with these in place of the statement's question marks. Bytes are not copied: they must last until the rows are read.
  template <typename... Values>
  Statement& bind(const Values&... values) {
    reset();
    int n = 0;
    (bind_one(++n, values), ...);
    return *this;
  }

  /// Goes to the next row. @return whether there is one; after the last the statement holds no lock
  bool step();

  /// Ends before the last row, and lets its lock go.
  void reset();

  std::int64_t number(int column) const;
  double real(int column) const;
  std::vector<std::uint8_t> bytes(int column) const;

 private:
  void bind_one(int n, std::int32_t value) { bind_one(n, std::int64_t{value}); }
  void bind_one(int n, std::int64_t value);
  void bind_one(int n, double value);
  void bind_one(int n, const std::vector<std::uint8_t>& value);

  struct Finalize {
    void operator()(sqlite3_stmt* handle) const;
  };
  std::unique_ptr<sqlite3_stmt, Finalize> handle_;
};

/// All or nothing: rolled back unless committed.
class Transaction {
 public:
  explicit Transaction(Database& database);
  ~Transaction();
  Transaction(const Transaction&) = delete;
  Transaction& operator=(const Transaction&) = delete;

  void commit() { database_.run("COMMIT"); }

 private:
  Database& database_;
};

}  // namespace frontier_surfels
