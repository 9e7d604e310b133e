// SQLite as the map files use it: a connection, statements, and rows that carry their own checksum. What SQLite reports
// becomes an exception that names the file.
//
// Not thread-safe: a connection and its statements belong to one thread at a time.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

struct sqlite3;
struct sqlite3_stmt;

namespace parallax {

enum class SqliteMode { read, write };  // write: made when it is not there

class SqliteDatabase {
 public:
  // Throws InputError (read: "PATH: cannot be opened: ...") or RunError (write: "PATH: cannot be written: ..."), as
  // every call does from then on. `vfs`: a file system registered with SQLite, empty for the operating system's
  // (tests).
  SqliteDatabase(const std::string& path, SqliteMode mode, const std::string& vfs = {});
  // A database in memory, read only: the bytes of a file. `name` stands for the path.
  SqliteDatabase(const std::string& name, std::span<const std::byte> file);
  ~SqliteDatabase();
  SqliteDatabase(const SqliteDatabase&) = delete;
  SqliteDatabase& operator=(const SqliteDatabase&) = delete;

  void run(const std::string& statements);
  std::int64_t number(const std::string& query);  // first column of the first row; 0: no row
  std::vector<std::string> texts(const std::string& query, std::size_t at_most);

  const std::string& path() const { return path_; }
  [[noreturn]] void fail() const;  // with SQLite's last message
  sqlite3* handle() const { return handle_; }

 private:
  void prepare();

  std::string path_;
  SqliteMode mode_;
  sqlite3* handle_ = nullptr;
};

// All or nothing: rolled back unless committed.
class SqliteTransaction {
 public:
  explicit SqliteTransaction(SqliteDatabase* database);
  ~SqliteTransaction();
  SqliteTransaction(const SqliteTransaction&) = delete;
  SqliteTransaction& operator=(const SqliteTransaction&) = delete;
  void commit();  // returns when it is durable

 private:
  SqliteDatabase* database_;
  bool open_ = true;
};

// A prepared statement. Values are bound, and columns taken, in order.
class SqliteStatement {
 public:
  SqliteStatement(SqliteDatabase* database, const std::string& text);
  ~SqliteStatement();
  SqliteStatement(const SqliteStatement&) = delete;
  SqliteStatement& operator=(const SqliteStatement&) = delete;

  // Binding: the bytes of a text or blob must live until execute().
  template <class T>
  requires(std::is_integral_v<T> || std::is_enum_v<T>) SqliteStatement& put(T value) {
    return put_integer(static_cast<std::int64_t>(value));
  }
  SqliteStatement& put(double value);
  SqliteStatement& put(std::string_view text);
  SqliteStatement& put(std::span<const std::byte> bytes);
  // The checksum of what was bound, as the last value.
  SqliteStatement& put_checksum();
  void execute();  // a statement without rows; ready to be bound anew

  // Rows. Columns of another type than expected are noted (row_is_sound()) and read as nothing.
  bool next();
  std::int64_t take_integer();
  double take_number();
  std::string_view take_text();             // valid until next()
  std::span<const std::byte> take_bytes();  // valid until next()
  // Takes the last column: the checksum of those before; notes it when it is another.
  void take_checksum();
  // Types and checksum of the row were as they should be.
  bool row_is_sound() const { return sound_; }

 private:
  SqliteStatement& put_integer(std::int64_t value);
  void expect_type(int type);

  SqliteDatabase* database_;
  sqlite3_stmt* statement_ = nullptr;
  int column_ = 0;
  std::uint64_t sum_ = 0;
  bool sound_ = true;
};

}  // namespace parallax
