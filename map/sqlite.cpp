#include "map/sqlite.h"

#include <sqlite3.h>

#include <algorithm>
#include <cstring>
#include <utility>

#include "core/checksum.h"
#include "core/error.h"

namespace parallax {
namespace {

// No map has a text or blob, or a statement, larger than this.
constexpr int kMostBytes = 1 << 28;
// Another program may be looking at the file: so long it is waited for.
constexpr int kBusy_ms = 2000;

}  // namespace

SqliteDatabase::SqliteDatabase(const std::string& path, SqliteMode mode, const std::string& vfs)
    : path_(path), mode_(mode) {
  // What a killed program left half done is rolled back by whoever opens the file next, reader or not.
  const int flags = SQLITE_OPEN_READWRITE | (mode == SqliteMode::write ? SQLITE_OPEN_CREATE : 0);
  const int result = sqlite3_open_v2(path.c_str(), &handle_, flags | SQLITE_OPEN_NOMUTEX | SQLITE_OPEN_EXRESCODE,
                                     vfs.empty() ? nullptr : vfs.c_str());
  try {
    if (result != SQLITE_OK) fail();
    prepare();
  } catch (...) {
    sqlite3_close(handle_);
    throw;
  }
}

SqliteDatabase::SqliteDatabase(const std::string& name, std::span<const std::byte> file)
    : path_(name), mode_(SqliteMode::read) {
  const int result = sqlite3_open_v2(":memory:", &handle_,
                                     SQLITE_OPEN_READWRITE | SQLITE_OPEN_NOMUTEX | SQLITE_OPEN_EXRESCODE, nullptr);
  try {
    if (result != SQLITE_OK) fail();
    // SQLite reads the bytes in place: it gets a copy of its own.
    auto* bytes = static_cast<unsigned char*>(sqlite3_malloc64(std::max<std::size_t>(file.size(), 1)));
    if (!bytes) fail();
    std::memcpy(bytes, file.data(), file.size());
    const auto size = static_cast<sqlite3_int64>(file.size());
    if (sqlite3_deserialize(handle_, "main", bytes, size, size,
                            SQLITE_DESERIALIZE_FREEONCLOSE | SQLITE_DESERIALIZE_READONLY) != SQLITE_OK)
      fail();
    prepare();
  } catch (...) {
    sqlite3_close(handle_);
    throw;
  }
}

// The file may be anyone's: its schema is not trusted, its cells are checked.
void SqliteDatabase::prepare() {
  sqlite3_busy_timeout(handle_, kBusy_ms);
  sqlite3_limit(handle_, SQLITE_LIMIT_LENGTH, kMostBytes);
  sqlite3_limit(handle_, SQLITE_LIMIT_ATTACHED, 0);
  sqlite3_db_config(handle_, SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
  sqlite3_db_config(handle_, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, nullptr);
  sqlite3_db_config(handle_, SQLITE_DBCONFIG_ENABLE_TRIGGER, 0, nullptr);
  sqlite3_db_config(handle_, SQLITE_DBCONFIG_ENABLE_VIEW, 0, nullptr);
  run("PRAGMA cell_size_check = ON; PRAGMA mmap_size = 0");
  if (mode_ == SqliteMode::read) run("PRAGMA query_only = ON");
}

SqliteDatabase::~SqliteDatabase() { sqlite3_close(handle_); }

void SqliteDatabase::fail() const {
  std::string why = handle_ ? sqlite3_errmsg(handle_) : "out of memory";
  std::replace_if(
      why.begin(), why.end(), [](unsigned char c) { return c < ' '; }, ' ');  // one line, whatever it quotes
  if (mode_ == SqliteMode::write) throw RunError(path_ + ": cannot be written: " + why);
  throw InputError(path_ + ": cannot be read: " + why);
}

void SqliteDatabase::run(const std::string& statements) {
  if (sqlite3_exec(handle_, statements.c_str(), nullptr, nullptr, nullptr) != SQLITE_OK) fail();
}

std::int64_t SqliteDatabase::number(const std::string& query) {
  SqliteStatement statement(this, query);
  return statement.next() ? statement.take_integer() : 0;
}

std::vector<std::string> SqliteDatabase::texts(const std::string& query, std::size_t at_most) {
  std::vector<std::string> out;
  SqliteStatement statement(this, query);
  while (out.size() < at_most && statement.next()) out.emplace_back(statement.take_text());
  return out;
}

SqliteTransaction::SqliteTransaction(SqliteDatabase* database) : database_(database) {
  database_->run("BEGIN IMMEDIATE");
}

SqliteTransaction::~SqliteTransaction() {
  // After some failures SQLite has rolled back by itself.
  if (open_ && !sqlite3_get_autocommit(database_->handle()))
    sqlite3_exec(database_->handle(), "ROLLBACK", nullptr, nullptr, nullptr);
}

void SqliteTransaction::commit() {
  database_->run("COMMIT");
  open_ = false;
}

SqliteStatement::SqliteStatement(SqliteDatabase* database, const std::string& text) : database_(database) {
  if (sqlite3_prepare_v2(database->handle(), text.c_str(), static_cast<int>(text.size()), &statement_, nullptr) !=
      SQLITE_OK)
    database->fail();
}

SqliteStatement::~SqliteStatement() { sqlite3_finalize(statement_); }

SqliteStatement& SqliteStatement::put_integer(std::int64_t value) {
  sum_ = checksum(&value, sizeof value, sum_);
  if (sqlite3_bind_int64(statement_, ++column_, value) != SQLITE_OK) database_->fail();
  return *this;
}

SqliteStatement& SqliteStatement::put(double value) {
  value += 0.0;  // SQLite keeps no negative zero
  sum_ = checksum(&value, sizeof value, sum_);
  if (sqlite3_bind_double(statement_, ++column_, value) != SQLITE_OK) database_->fail();
  return *this;
}

SqliteStatement& SqliteStatement::put(std::string_view text) {
  sum_ = checksum(text.data(), text.size(), sum_);
  // An empty view may have no address, which would be NULL.
  if (sqlite3_bind_text64(statement_, ++column_, text.empty() ? "" : text.data(), text.size(), SQLITE_STATIC,
                          SQLITE_UTF8) != SQLITE_OK)
    database_->fail();
  return *this;
}

SqliteStatement& SqliteStatement::put(std::span<const std::byte> bytes) {
  sum_ = checksum(bytes.data(), bytes.size(), sum_);
  const int result = bytes.empty()
                         ? sqlite3_bind_zeroblob(statement_, ++column_, 0)
                         : sqlite3_bind_blob64(statement_, ++column_, bytes.data(), bytes.size(), SQLITE_STATIC);
  if (result != SQLITE_OK) database_->fail();
  return *this;
}

SqliteStatement& SqliteStatement::put_checksum() {
  if (sqlite3_bind_int64(statement_, ++column_, static_cast<std::int64_t>(sum_)) != SQLITE_OK) database_->fail();
  return *this;
}

void SqliteStatement::execute() {
  if (sqlite3_step(statement_) != SQLITE_DONE) {
    database_->fail();
  }
  sqlite3_reset(statement_);
  sqlite3_clear_bindings(statement_);
  column_ = 0;
  sum_ = 0;
}

bool SqliteStatement::next() {
  const int result = sqlite3_step(statement_);
  if (result != SQLITE_ROW && result != SQLITE_DONE) database_->fail();
  column_ = 0;
  sum_ = 0;
  sound_ = true;
  return result == SQLITE_ROW;
}

void SqliteStatement::expect_type(int type) {
  if (sqlite3_column_type(statement_, column_) != type) sound_ = false;
}

std::int64_t SqliteStatement::take_integer() {
  expect_type(SQLITE_INTEGER);
  const std::int64_t value = sqlite3_column_int64(statement_, column_++);
  sum_ = checksum(&value, sizeof value, sum_);
  return value;
}

double SqliteStatement::take_number() {
  expect_type(SQLITE_FLOAT);
  const double value = sqlite3_column_double(statement_, column_++);
  sum_ = checksum(&value, sizeof value, sum_);
  return value;
}

std::string_view SqliteStatement::take_text() {
  expect_type(SQLITE_TEXT);
  const auto* text = reinterpret_cast<const char*>(sqlite3_column_text(statement_, column_));
  const auto size = static_cast<std::size_t>(sqlite3_column_bytes(statement_, column_++));
  const std::string_view value = text ? std::string_view(text, size) : std::string_view("");
  sum_ = checksum(value.data(), value.size(), sum_);
  return value;
}

std::span<const std::byte> SqliteStatement::take_bytes() {
  expect_type(SQLITE_BLOB);
  const auto* bytes = static_cast<const std::byte*>(sqlite3_column_blob(statement_, column_));
  const auto size = static_cast<std::size_t>(sqlite3_column_bytes(statement_, column_++));
  const std::span<const std::byte> value(bytes, bytes ? size : 0);
  sum_ = checksum(value.data(), value.size(), sum_);
  return value;
}

void SqliteStatement::take_checksum() {
  const std::uint64_t expected = sum_;
  expect_type(SQLITE_INTEGER);
  if (static_cast<std::uint64_t>(sqlite3_column_int64(statement_, column_++)) != expected) sound_ = false;
}

}  // namespace parallax
